"""Pushes by hand before the lift: which way probes count where gravity does not say it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import pytest

from bench.cli.virtual import simulated_run
from bench.clock import WallClock
from bench.findings import Effect, Finding
from bench.procedure.roles import Push
from bench.rigfile import load_rig
from bench.rigfile.envelope import Envelope
from drivers.person import ConsoleOperator
from procedures.amb_rotor import leaning, pushes
from procedures.amb_rotor.pushes import Pushed
from procedures.amb_rotor.stations import stations

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SPINDLE, STAND = (str(EXAMPLES / name) for name in ("vertical-spindle/spindle.toml", "plain-stand/stand.toml"))
DISC = str(Path(__file__).resolve().parents[1] / "strangers/skivrotor.toml")


def read(rig: str, angle: float, changed: Mapping[str, float] | None = None) -> dict[str, float]:
    """What sound probes read of a shaft 150 um from the middle, some of them times something."""
    s = stations(load_rig(rig))
    cosines = {c: p.sign * math.cos(angle - p.angle.value) for c, p in s.probes.items()}
    return {c: 150e-6 * x * (changed or {}).get(c, 1.0) for c, x in cosines.items()}


def made(rig: str, changed: Mapping[str, float] | None = None) -> list[Pushed]:
    file = load_rig(rig)
    s = stations(file)
    angles = [s.hand * (p.angle_rad - s.first.value) for p in pushes.wanted(file)]
    return [Pushed(p.axis, a, read(rig, a, changed)) for p, a in zip(pushes.wanted(file), angles, strict=True)]


def codes(rig: str, found: list[Pushed]) -> list[tuple[str, str]]:
    return [(f.code, f.where) for f in pushes.judge(found, load_rig(rig))]


def test_a_push_is_asked_for_each_way_of_which_gravity_says_nothing() -> None:
    along = [(p.axis, round(math.degrees(p.angle_rad))) for p in pushes.wanted(load_rig(SPINDLE))]
    assert along == [("towards the + side of axis LowU", 30), ("towards the + side of axis LowV", 120)]
    across = [(p.axis, round(math.degrees(p.angle_rad))) for p in pushes.wanted(load_rig(STAND))]
    assert across == [("towards the + side of axis x_hinten", -90)]
    assert pushes.wanted(load_rig("amb5dof")) == ()
    assert pushes.count(load_rig(str(EXAMPLES / "one-axis/oneaxis.toml"))) == 0


@pytest.mark.parametrize(("rig", "channel"), [(SPINDLE, "DispLowerV"), (STAND, "LageXVorn")])
def test_a_probe_that_counts_backwards_is_named(rig: str, channel: str) -> None:
    assert codes(rig, made(rig)) == []
    assert codes(rig, made(rig, {channel: -1.0})) == [("sensor-polarity", channel)]


def test_a_push_that_no_probe_shows_and_one_that_those_across_show() -> None:
    still = made(SPINDLE, {"DispUpperU": 0.1})
    assert codes(SPINDLE, still) == [("push-not-seen", "DispUpperU")]
    first, second = made(SPINDLE)
    swapped = [Pushed(p.name, p.angle, p.read | {"DispLowerU": p.read["DispLowerV"], "DispLowerV": p.read["DispLowerU"]})
               for p in (first, second)]  # fmt: skip
    assert [code for code, _ in codes(SPINDLE, swapped)] == ["axes-exchanged", "axes-exchanged"]
    every = made(SPINDLE, dict.fromkeys(read(SPINDLE, 0.0), -1.0))
    assert [code for code, _ in codes(SPINDLE, every)] == ["sensor-polarity", "sensor-polarity"]


def test_a_person_is_told_where_to_push_and_may_leave_it_out() -> None:
    rig, said, answers = load_rig(SPINDLE), list[str](), ["what", "skip", "", ""]
    person = ConsoleOperator(lambda text: said.append(text) or answers.pop(0), WallClock(), Envelope(rig), None)  # type: ignore[func-returns-value]
    (first, _) = pushes.wanted(rig)
    assert not person.push(first)
    assert "towards the + side of axis LowU (30° from the terminal box, counter-clockwise seen from outside" in said[0]
    assert "'what' is no answer here. To leave it out, as it was shown before: type skip." in said[1]
    assert person.push(first)
    assert person.push(None)
    assert "Let go of the shaft" in said[-1]
    person.attended = False
    assert not person.push(Push("aside", 0.0, "up", "far"))
    assert not answers


@pytest.mark.long
@pytest.mark.parametrize(
    ("rig", "defect", "code", "where"),
    [
        (SPINDLE, "", "", ""),
        (SPINDLE, "probe_sign.LowV", "sensor-polarity", "DispLowerV"),
        (SPINDLE, "exchange_probes.LowU.LowV", "axes-exchanged", "DispLowerU"),
        (SPINDLE, "exchange_coils.LowU", "lift-lost", "planes"),
        (STAND, "probe_sign.x_vorn", "sensor-polarity", "LageXVorn"),
    ],
)
def test_a_twin_is_pushed_before_it_is_lifted(rig: str, defect: str, code: str, where: str, tmp_path: Path) -> None:
    truth = {defect: -1.0 if "sign" in defect else 1.0} if defect else {}
    run = simulated_run("tracking", rig, 1, {}, tmp_path / "pushed.mcap", truth)
    found = [f for f in run.results if isinstance(f, Finding)]
    wrong = [(f.code, f.where) for f in found if f.effect is Effect.ERROR and f.code != "controller-fault"]
    assert wrong[:1] == ([(code, where)] if defect else [])
    assert ("polarity-shown" in [f.code for f in found]) == (not defect)
    assert len(run.recording.steps("lift")) == (code in ("", "lift-lost"))


def leaned(changed: Mapping[str, float] | None = None) -> list[Pushed]:
    """What sound probes read of a shaft of 23 kg that overhangs by a third, pushed with its weight; some times something."""
    rig = load_rig(DISC)
    s, out = stations(rig), list[Pushed]()
    for p in pushes.wanted(rig):
        angle = s.hand * (p.angle_rad - s.first.value)
        read = {c: 200e-6 * x * (changed or {}).get(c, 1.0) for c, x in leaning.reads(rig, angle).items()}
        out.append(Pushed(p.axis, angle, read))
    return out


def test_a_shaft_that_overhangs_is_pushed_the_way_it_moves() -> None:
    """Its far ring carries 1.34 of its weight: upwards nobody moves it there; downwards its near end comes off the top."""
    made = leaned()
    assert [p.name for p in made] == ["towards the - side of axis dH", "towards the - side of axis dV"]
    assert all(abs(p.read[c]) > 100e-6 for p, c in zip(made, ("lage_B_1", "lage_B_2"), strict=True))
    assert codes(DISC, made) == []
    assert codes(DISC, leaned({"lage_B_1": -1.0})) == [("sensor-polarity", "lage_B_1")]
    assert codes(DISC, leaned({"lage_B_2": 0.1})) == [("push-not-seen", "lage_B_2")]
    between = leaning.reads(load_rig(SPINDLE), 0.3)  # one that stands goes where it is pushed
    s = stations(load_rig(SPINDLE))
    assert between == pytest.approx({c: p.sign * math.cos(0.3 - p.angle.value) for c, p in s.probes.items()})


def test_a_twin_that_overhangs_is_pushed_and_lifted(tmp_path: Path) -> None:
    run = simulated_run("bearing-model", DISC, 0, {"settle_s": 0.4, "average_s": 0.2}, tmp_path / "pushed.mcap")
    found = [f for f in run.results if isinstance(f, Finding)]
    assert [f.code for f in found if f.effect is Effect.ERROR] == []
    (shown,) = (f.text for f in found if f.code == "polarity-shown")
    assert "lage_B_1, lage_B_2" in shown
