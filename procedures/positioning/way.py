"""Which axes of a rig are tested, by which instrument, at which targets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_reference import ReferenceInstrument
from bench.rigfile.stage import StageAxis
from bench.rigfile.toleranced import Toleranced
from procedures.positioning.fit import Errors
from procedures.positioning.plan import Plan
from procedures.positioning.requires import readable
from procedures.positioning.targets import Array, fewest, targets


@dataclass(frozen=True)
class Tested:
    """An axis with its instrument; `at` (m,) m or rad, its targets from below; `beyond`, where it turns round at both ends."""

    axis: StageAxis
    by: ReferenceInstrument
    at: Array
    beyond: tuple[float, float]

    @property
    def pitch(self) -> float:
        """Of a count, 0 where the rig file does not say."""
        return self.axis.pitch.value if self.axis.pitch is not None else 0.0

    @property
    def unit(self) -> str:
        """In which the operator reads it."""
        return self.by.unit or self.axis.unit


def tested(rig: RigFile, plan: Plan) -> Sequence[Tested]:
    """Those that the plan wants, in the rig file's order."""
    return [_tested(rig, plan, axis) for name, axis in readable(rig).items() if not plan.axes or name in plan.axes]


def _tested(rig: RigFile, plan: Plan, axis: StageAxis) -> Tested:
    turns = axis.unit == "rad"
    chosen, count = (plan.targets_rad, plan.count_rad) if turns else (plan.targets_m, plan.count_m)
    low, high = measured_travel(plan, axis)
    count = count or fewest(axis.unit, high - low)
    pitch = axis.pitch.value if axis.pitch is not None else 0.0
    at = np.array(chosen) if chosen else targets(low, high, count, pitch, plan.draw, turns=turns)
    over = plan.beyond_rad if turns else plan.beyond_m
    return Tested(axis, rig.capabilities.reference[axis.name], at, (float(at[0]) - over, float(at[-1]) + over))


def measured_travel(plan: Plan, axis: StageAxis) -> tuple[float, float]:
    """From where to where targets are made: the middle of an axis along, a turn of one around from zero on."""
    if axis.unit == "rad":
        low = max(0.0, axis.low)
        return low, min(low + plan.turn_rad, axis.high)
    middle, half = (axis.low + axis.high) / 2, plan.travel * (axis.high - axis.low) / 2
    return middle - half, middle + half


def errors(by: ReferenceInstrument) -> Errors:
    """Of an instrument, as the rig file states them."""
    gain = by.gain
    return Errors(
        gain.standard_uncertainty / gain.value,
        gain.distribution != "normal",
        scale=_u(by.error) / gain.value,
        noise=_u(by.noise) / gain.value,
        wander=_u(by.drift) / gain.value,
        step=by.resolution / gain.value,
    )


def _u(number: Toleranced | None) -> float:
    return 0.0 if number is None else number.standard_uncertainty


def seconds(one: Tested, plan: Plan) -> float:
    """About how long its test takes, without the readings of a person."""
    rate = plan.rate_rad_s if one.axis.unit == "rad" else plan.rate_m_s
    return 2 * plan.repeats * ((one.beyond[1] - one.beyond[0]) / rate + len(one.at) * (plan.dwell_s + 1.0))


def rates(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Parameters of the way, of the axes that are tested."""
    out: dict[str, float] = {}
    for one in tested(rig, plan):
        turns = one.axis.unit == "rad"
        wanted = ((one.axis.rate, plan.rate_rad_s if turns else plan.rate_m_s),
                  (one.axis.rise, plan.rise_rad_s2 if turns else plan.rise_m_s2))  # fmt: skip
        out |= {parameter: value for parameter, value in wanted if parameter}
    return out


def off_turn(angle: Array | float) -> Array:
    """Angles without whole turns, within half a turn of nothing."""
    return np.asarray((np.asarray(angle) + math.pi) % (2 * math.pi) - math.pi)
