"""The sign of a served simulation, as a bench sees it whose DBC knows nothing of it."""

from __future__ import annotations

import pytest
from bound_rigs import OWN, plain_text

from bench.cli.opening import SIMULATED
from bench.errors import StateContradicts
from bench.link.census import Census
from bench.link.frames import FrameBatch, frame, joined
from bench.rigfile import RigFile
from bench.wire import sign
from drivers.controller import Controller
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

PLAIN = RigFile.parse(plain_text(), (OWN / "plainamb.dbc").read_text(encoding="utf-8"), "plainamb.toml")


class Bench:
    """A bench at a controller behind its own DBC, to whose frames what a test wants is added."""

    def __init__(self) -> None:
        self.machine = SimulatedRig(PLAIN, draw(PLAIN, 5), SIMULATED.number)
        self.added: list[FrameBatch] = []
        self.controller = Controller(PLAIN, self.machine.link, self.machine, SIMULATED)
        real = self.machine.link.receive
        self.machine.link.receive = lambda: joined([real(), *self.added])  # type: ignore[method-assign]


def signed(identifier: int = sign.IDENTIFIER, payload: bytes = sign.PAYLOAD) -> FrameBatch:
    return frame(identifier, payload)


def test_who_shows_the_sign_is_known_as_simulated_and_nothing_is_unknown() -> None:
    bench = Bench()
    bench.added = [signed()]
    bench.controller.connect()
    assert "serial" not in bench.controller.identity
    assert bench.controller.watch.simulated
    bench.controller.clock.sleep(0.5)
    assert bench.controller.telemetry.counters.unknown == 0


@pytest.mark.parametrize(
    "other", [signed(payload=b"\0" * 8), signed(identifier=0x7FE), signed(payload=sign.PAYLOAD[:6])]
)
def test_another_frame_is_no_sign(other: FrameBatch) -> None:
    bench = Bench()
    bench.added = [other]
    bench.controller.connect()
    assert not bench.controller.watch.simulated


def test_who_shows_it_in_the_middle_of_a_run_ends_it() -> None:
    bench = Bench()
    bench.controller.connect()
    bench.controller.clock.sleep(0.2)
    bench.added = [signed()]
    with pytest.raises(StateContradicts, match="simulated one, and did not when the run began"):
        bench.controller.clock.sleep(0.2)


def test_a_listener_says_so_and_counts_it_as_nothing_strange() -> None:
    census = Census(PLAIN)
    census.take(signed(identifier=0x7FE))
    assert (census.simulated, census.strange) == (False, 1)
    census.take(signed())
    assert (census.simulated, census.strange) == (True, 1)
