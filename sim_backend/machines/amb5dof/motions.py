"""The truths of motion of the AMB stand, as procedures' plans ask for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.amb5dof import truth_balance, truth_step, truth_track, truth_unbalance
from sim_backend.machines.stepping import Shown, Small
from sim_backend.motion import Motions, OrbitAsked, StepsAsked, Whirl, drag

if TYPE_CHECKING:
    from sim_backend.machines.amb5dof.truth_sensitivity import Loop
    from sim_backend.machines.passing import Curves

Numbers = Mapping[str, float]


def steps(_: RigFile, drawn: Truth, asked: StepsAsked) -> tuple[Small, dict[tuple[float, int], Shown]]:
    """Set-point steps along y, z or x."""
    return truth_step.truth(
        drawn.plant, asked.settings, asked.axis, asked.sizes, speed=asked.speed, rest_s=asked.rest_s,
        record_s=asked.record_s, wait_s=asked.wait_s, told=drawn.defects.get(f"factor_ref_{asked.axis}", 1.0),
    )  # fmt: skip


def orbit(_: RigFile, drawn: Truth, asked: OrbitAsked) -> dict[str, float]:
    """A path of the ellipse."""
    return truth_track.truth(
        drawn.plant, asked.settings, hz=asked.hz, y=asked.y, z=asked.z, ratio=asked.ratio, speed=asked.speed,
        settle_s=asked.settle_s,
    )  # fmt: skip


def whirl(_: RigFile, drawn: Truth, settings: Numbers, speed: float, channels: Sequence[str]) -> Whirl:
    """At a speed, with the noise that the controller has; of its four radial probes."""
    del channels
    found = truth_unbalance.motion(drawn.plant, settings, speed)
    return Whirl(found.shaft, found.d_max, (drawn.plant.clearance,) * 2)


def left(
    rig: RigFile, drawn: Truth, events: Sequence[Mapping[str, Any]], names: Sequence[str]
) -> list[truth_balance.Complex]:
    """In its two planes."""
    del names
    return truth_balance.left(rig, drawn, events)


def passage(_: RigFile, drawn: Truth, settings: Numbers, low: float, high: float, channels: Sequence[str]) -> Curves:
    """Between two speeds, rad/s, of its four radial probes."""
    del channels
    from sim_backend.machines.amb5dof import truth_passage  # scipy: what asks for no curves starts without it

    return truth_passage.curves(drawn.plant, settings, low, high)


def loop(_: RigFile, drawn: Truth, settings: Numbers, axes: Sequence[str]) -> Loop:
    """At rest; of its five axes."""
    del axes
    from sim_backend.machines.amb5dof import truth_sensitivity

    return truth_sensitivity.loop(drawn.plant, settings)


def peak(_: RigFile, drawn: Truth, settings: Numbers, axis: int, speed: float) -> tuple[float, float]:
    """Of the shaft that turns."""
    from sim_backend.machines.amb5dof import truth_sensitivity

    return truth_sensitivity.quiet_peak(drawn.plant, settings, axis, speed)


MOTIONS = Motions(steps=steps, orbit=orbit, whirl=whirl, left=left, passage=passage, loop=loop, peak=peak, drag=drag)
