"""The bench's own drivers against the misbehaving controller: what is wrong is called by its name."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bench.cli.opening import beat_of
from bench.clock import WallClock
from bench.errors import BenchError
from bench.link.session import Session
from bench.rigfile import load_rig
from bench.run.job import WatchedClock
from bench.run.machine_phase import cause_of
from drivers.controller import Controller
from drivers.live_link import LiveLink
from drivers.wires import open_wire

RIG = load_rig("tsbs12")
SESSION = Session(0xA1B2C3D4, 1_767_225_600, "lab@bench7")


@contextmanager
def controller_that(program: Path, *switches: str, wire: str = "packets") -> Iterator[Controller]:
    """The driver of a controller that misbehaves so, not yet connected."""
    child = subprocess.Popen(
        [program, wire, "1", "73.2", "74.4", *switches], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with child:
        assert child.stdin
        assert child.stdout
        scheme = "serial" if wire == "packets" else "slcan"
        url = f"{scheme}:socket://127.0.0.1:{int(child.stdout.readline())}"
        rig = RIG.model_copy(update={"links": {**RIG.links, "controller": RIG.link.model_copy(update={"url": url})}})
        known = [m.identifier for m in rig.messages.messages.values()]
        link = LiveLink("controller", lambda: open_wire(rig.link, "controller", known), beat_of(rig, SESSION))
        try:
            yield Controller(rig, link, WatchedClock(WallClock(), link.renew_lease, lambda _: None), SESSION, 0.02)
        finally:
            link.close()
            child.stdin.close()


def levitated(c: Controller) -> None:
    c.connect()
    c.set("watchdog_s", 1.0)  # so that a busy machine is no dead host
    c.enable()
    c.levitate()


def held(c: Controller) -> None:
    levitated(c)
    c.clock.sleep(5.0)


def called(error: BenchError) -> tuple[str, str]:
    """The finding that a record would have, and its text."""
    _, finding = cause_of(error)
    return finding.code, finding.text


def test_a_command_that_is_not_obeyed_is_told_with_the_state_that_was_seen(mischief: Path) -> None:
    with controller_that(mischief, "disobey=1") as c:
        c.connect()
        with pytest.raises(BenchError) as caught:
            c.enable()
    code, text = called(caught.value)
    assert code == "state-not-reached"
    assert text.startswith("the controller took ENABLE and is not READY after 1 s: its state is OFF since ")


@pytest.mark.parametrize("firmware", [[], ["forgetful"]])
def test_a_levitate_of_which_the_reply_is_lost_is_executed_once(mischief: Path, firmware: list[str]) -> None:
    """Or refused the second time, by a firmware that does not know that it is the first one again."""
    with controller_that(mischief, "lostlevitate", *firmware) as c:
        levitated(c)
        assert c.mode == "LEVITATED"
        assert c.requests.repeats == 1


def test_a_rotor_that_does_not_turn_has_not_arrived(mischief: Path) -> None:
    with controller_that(mischief, "stuckangle") as c:
        levitated(c)
        with pytest.raises(BenchError) as caught:
            c.rotation.point(0.785)
    assert called(caught.value) == ("rotor-not-arrived", "the rotor did not reach 0.785 rad: it stands -0.7850 rad off")


@pytest.mark.parametrize("wire", ["packets", "slcan"])
def test_noise_in_place_of_telemetry_is_told_as_noise(mischief: Path, wire: str) -> None:
    with controller_that(mischief, "garbage=200@0", wire=wire) as c:
        with pytest.raises(BenchError) as caught:
            held(c)
    code, text = called(caught.value)
    assert code == "bytes-unreadable"
    assert "kB/s), but no message can be made of them: " in text


def test_noise_before_the_first_telemetry(mischief: Path) -> None:
    with controller_that(mischief, "garbage=200") as c, pytest.raises(BenchError) as caught:
        c.connect()
    assert called(caught.value)[0] == "bytes-unreadable"


def test_an_adapter_that_answers_while_its_bus_is_silent_is_no_noise(mischief: Path) -> None:
    with controller_that(mischief, "notelemetry", wire="slcan") as c, pytest.raises(BenchError) as caught:
        c.connect()
    code, text = called(caught.value)
    assert code == "link-lost"
    assert text.startswith("link controller: no telemetry within 1.5 s.")


def test_a_controller_that_answers_nothing(mischief: Path) -> None:
    with controller_that(mischief, "mute@0") as c:
        levitated(c)
        c.clock.sleep(0.2)
        with pytest.raises(BenchError) as caught:
            c.set("kd_i", 42.0)
    code, text = called(caught.value)
    assert code == "no-reply"
    assert "the reply to kd_i; it did not come, though it was asked for 3 times" in text


def test_a_controller_that_refuses(mischief: Path) -> None:
    with controller_that(mischief, "cmdstatus=3") as c:
        c.connect()
        with pytest.raises(BenchError) as caught:
            c.enable()
    code, text = called(caught.value)
    assert code == "controller-refused"
    assert text.startswith("the controller refuses ENABLE: WRONG_STATE in state ")
