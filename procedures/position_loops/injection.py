"""Sines into a position loop: what a controller can, and the writes that make one; what its gains say of size and time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from bench.errors import BenchError, Lacking
from bench.procedure.rig import Rig
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import InjectedLoop, LoopInjection

USUAL_HZ = 35e3
SENSOR, REFERENCE, FORCE = "sensor", "reference", "force"
BELOW = 0.3  # of the rate of captures, that a line may have
UNKNOWN_S = 0.1  # of an integrator that the rig file does not tell


@dataclass(frozen=True)
class Sine:
    """So many whole `periods` in so many `samples`; `amplitude` 0-pk, m or rad."""

    hz: float
    amplitude: float
    periods: int
    samples: int


def ability(rig: RigFile) -> LoopInjection:
    """What the controller injects.

    Raises:
        Lacking: it does not.
    """
    can = rig.capabilities.loop_injection
    if can is None:
        raise Lacking("capabilities.loop_injection: found none")
    return can


def told(rig: RigFile, parameters: Mapping[str, float], name: str) -> float | None:
    """A parameter of the controller with those that a plan writes; None where the rig file does not tell which."""
    if name not in rig.parameters:
        return None
    return parameters.get(name, rig.parameters[name].default)


def integrator_s(rig: RigFile, parameters: Mapping[str, float], loop: InjectedLoop) -> float:
    """How slow the integrator of a loop is: k_P/k_I, s."""
    kp, ki = told(rig, parameters, loop.kp), told(rig, parameters, loop.ki)
    return kp / ki if kp and ki else 0.0 if kp else UNKNOWN_S


def whole(sampled: float, hz: float, least_s: float, periods: int) -> tuple[float, int, int]:
    """Near `hz` a frequency that has whole periods in whole samples: it, periods and samples."""
    count = max(periods, math.ceil(least_s * hz))
    samples = round(count * sampled / hz)
    return count * sampled / samples, count, samples


def parameters_of(can: LoopInjection, place: str, one: Sine) -> dict[str, float]:
    """The controller's parameters that make it, but the one that begins."""
    return {can.place: can.places[place], can.amplitude: one.amplitude, can.hz: one.hz}  # type: ignore[index]


@contextmanager
def injected(rig: Rig, axis: str, place: str, one: Sine, start_s: float) -> Iterator[None]:
    """With a sine in a loop, settled; off again in the end, whatever happens."""
    can, write = ability(rig.file), rig.levitation.write
    write(parameters_of(can, place, one))
    try:
        write({can.axis: can.loops[axis].value})
        rig.clock.sleep(start_s)
        yield
    except BaseException:
        with suppress(BenchError):
            write({can.axis: can.off})
        raise
    write({can.axis: can.off})
