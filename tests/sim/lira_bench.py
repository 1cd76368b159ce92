"""The bench on the simulated linear-rotary actuator, in this process, over the bytes of its command line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from bench.cli import opening
from bench.link import fault_injection
from bench.procedure.rig import Rig
from bench.rigfile import load_rig
from bench.run.supervisor import Supervisor
from drivers.controller import Controller


@dataclass(frozen=True)
class Bench:
    """What is open: the rig as procedures have it, and its controller."""

    rig: Rig
    controller: Controller


@contextmanager
def opened(*faults: str, seed: int = 0, **truth: float) -> Iterator[Bench]:
    """Open it with faults of its line, as `--fault` has them, and overrides of its truth; the reduced machine."""
    injected = [fault_injection.parse(text) for text in faults]
    connect = opening.simulated(load_rig("lira"), seed, {"reduced": 1.0, **truth}, "auto", None, injected)
    with connect(Supervisor()) as found:
        assert isinstance(found.rig.levitation, Controller)
        yield Bench(found.rig, found.rig.levitation)
