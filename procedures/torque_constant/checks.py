"""What can be wrong with a torque calibration, and what its data can say about it. Each check names its suspect.

Thresholds are chosen so that a sound rig trips one in fewer than one run in a thousand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.recording import Recording
from procedures.servomotor.conventions import Servomotor, radial_currents
from procedures.shared import signals
from procedures.torque_constant import drifts, hypotheses
from procedures.torque_constant.drifts import SIGNIFICANT
from procedures.torque_constant.fit import Balance, Detent
from procedures.torque_constant.plan import Plan
from procedures.torque_constant.steps import TorqueData

Array = npt.NDArray[np.float64]
SLIP_RATE = 4e-3  # 1/s, relative, of the heaviest load's torque


def of_events(recording: Recording[Any]) -> Iterator[Finding]:
    """A rotor that did not come to stand where it was pointed."""
    for event in recording.events("not-held"):
        yield Finding("not-held", f"{event['text']}. Is the encoder right? Does the detent or the shaft hold it?",
                      f"{event['angle']:.3f} rad", Effect.ERROR)  # fmt: skip


def of_signals(data: TorqueData, machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    """Checks that need no fit."""
    table = data.table
    yield from signals.losses(table.lost, table.expected, plan.max_lost, table.where)
    yield from signals.flagged(table.flags, _limits(machine), table.where)
    yield from _stuck(data, machine)
    yield from segments(data.steps.segments, machine)
    yield from wiring(data.wiring, machine)
    yield from _settled(data, plan)


def _limits(machine: Servomotor) -> tuple[signals.Meaning, ...]:
    return (
        (machine.amb_limit, "current-saturated", "an AMB amplifier was at its limit"),
        (machine.segment_limit, "current-saturated", "a segment's amplifier was at its limit"),
        (machine.contact, "contact", "the rotor touched a touchdown bearing"),
    )


def _stuck(data: TorqueData, machine: Servomotor) -> Iterator[Finding]:
    for channel in machine.segments:
        if (data.table.spread[channel] == 0).any():
            yield Finding("stuck-channel", f"{channel} does not move at all in some step; a live sensor has noise.", channel,
                          Effect.ERROR)  # fmt: skip


def segments(currents: Array, machine: Servomotor) -> Iterator[Finding]:
    """At home without i_x and i_y all segments carry the torque current: `currents` (n, k) A under different loads."""
    drive = np.median(currents, axis=1)
    drive = drive - drive.mean()
    share = drive @ currents / float(drive @ drive)
    for k, channel in enumerate(machine.turning):
        if share[k] < -0.5:
            yield Finding("segment-sign", f"{channel} reads the torque current with the wrong sign ({share[k]:+.2f} times the "
                          "others). Exchange its sensor's wires.", channel, Effect.ERROR)  # fmt: skip
        elif abs(share[k] - 1) > 0.1:
            yield Finding("segment-unequal", f"{channel} reads {share[k]:.2f} times the torque current of the others.", channel,
                          Effect.INDETERMINATE)  # fmt: skip


def wiring(seen: Array, machine: Servomotor) -> Iterator[Finding]:
    """The outboard AMB answers i_x across the first segment and i_y along it, alike; two exchanged segments mix or turn that.
    `seen` (2, 2): its control currents across and along in A per A of i_x, i_y."""
    scale = float(np.abs(seen).sum())
    if scale == 0:
        return
    misfits = {pair: _misfit(seen, _answer(pair)) for pair in _pairs(machine)}
    best = min(misfits, key=lambda pair: misfits[pair])
    if best:
        names = " and ".join(str(k // machine.components + 1) for k in best[:2])
        yield Finding(
            "segments-exchanged",
            f"i_x and i_y pull at the outboard AMB as they would with the wires of segments {names} exchanged (misfit "
            f"{misfits[best]:.2f}; {misfits[()]:.2f} if wired as called).", f"segments {names}", Effect.ERROR,
        )  # fmt: skip
    elif misfits[best] > 0.3:
        yield Finding("wiring-unclear", f"i_x and i_y pull at the outboard AMB as no wiring of four sound segments would "
                      f"(misfit {misfits[best]:.2f} of 1).", "segments", Effect.INDETERMINATE)  # fmt: skip


def _pairs(machine: Servomotor) -> list[tuple[int, ...]]:
    if machine.components == 2:
        return [(), (0, 2, 1, 3)]
    return [(), *((a, b) for a in range(4) for b in range(a + 1, 4))]


def _answer(exchanged: tuple[int, ...]) -> Array:
    """Effective i_x, i_y over those asked for, (2, 2): T (6.9) with two segments' wires exchanged, each with the next."""
    out = np.zeros((2, 2))
    for column, (ix, iy) in enumerate(((1.0, 0.0), (0.0, 1.0))):
        e = np.array([iy, -ix, -iy, ix])
        for a, b in zip(exchanged[::2], exchanged[1::2], strict=True):
            e[[a, b]] = e[[b, a]]
        out[:, column] = radial_currents(*e)
    return out


def _misfit(seen: Array, expected: Array) -> float:
    """Relative distance of the answers, whose common scale is free but negative: the AMB pulls against the motor."""
    scale = min(float((seen * expected).sum()) / float((expected**2).sum()), 0.0)
    return float(np.linalg.norm(seen - scale * expected) / np.linalg.norm(seen))


def _settled(data: TorqueData, plan: Plan) -> Iterator[Finding]:
    angle, drift = np.abs(data.steps.angle), np.abs(data.table.drift["torque"])
    if angle.max() > plan.max_angle_rad:
        yield Finding(
            "not-held",
            f"the rotor stands {angle.max() * 1e3:.1f} mrad off home in the worst step ({plan.max_angle_rad * 1e3:.1f} mrad "
            f"allowed, {int((angle > plan.max_angle_rad).sum())} of {angle.size} steps): a load or a detent that the motor "
            "does not hold, or too short a time to settle.", data.table.where(angle), Effect.INDETERMINATE,
        )  # fmt: skip
    if drift.max() > plan.max_drift_A:
        yield Finding(
            "unsettled",
            f"the torque current drifts by {drift.max() * 1e3:.0f} mA within a step ({plan.max_drift_A * 1e3:.0f} mA allowed, "
            f"{int((drift > plan.max_drift_A).sum())} of {drift.size} steps). Settle longer, or look at the integrator.",
            data.table.where(drift), Effect.INDETERMINATE,
        )  # fmt: skip


def of_fit(
    data: TorqueData,
    machine: Servomotor,
    b: Balance,
    held: Detent,
    p: Mapping[str, float],
    mass_u: Sequence[float],
    arm_u: float,
    plan: Plan,
) -> Iterator[Finding]:
    """Checks of the fit: slip, drifts, detent, arms, masses, the cosine."""
    slips = list(_slip(data, b))
    yield from slips
    yield from drifts.baseline(data, machine, b, plan)
    yield from drifts.scale(b, plan)
    yield from _detent(b, held)
    yield from _arms(data, b, arm_u)
    if not slips:  # a lever that slips makes heavy loads light: that is no mass's fault
        yield from _loads(data, b, p, mass_u)
    yield from _cosine(data, b)


def _slip(data: TorqueData, b: Balance) -> Iterator[Finding]:
    """A slipping lever's torque falls by half the square of an angle that grows with torque and time: so the current falls
    within each step, the more the heavier the load, and comes back when the load is hung again."""
    s = data.steps
    carried = hypotheses.loaded(b)
    heavy = np.abs(b.torque) / np.abs(b.torque).max()
    on = s.side != 0
    length_s = (data.table.end_ns - data.table.start_ns) * 1e-9
    rate = (
        data.table.drift["torque"][on] * 2 / length_s[on] * np.sign(carried[on])
    )  # A/s, negative where the load gets lighter
    shape = np.abs(carried[on]) * heavy[on] ** 2
    value = float(rate @ shape) / float(shape @ shape)  # relative, 1/s, of the heaviest load
    u = float(np.std(rate - value * shape)) / math.sqrt(float(shape @ shape))
    if -value > max(SLIP_RATE, SIGNIFICANT * u):
        yield Finding(
            "lever-slips",
            f"under the heaviest load the torque falls by {-value:.2%} a second within a step, and is back when the load is "
            f"hung again ({SLIP_RATE:.1%} allowed): the lever slips on the shaft.", "lever", Effect.INDETERMINATE,
        )  # fmt: skip


def _detent(b: Balance, held: Detent) -> Iterator[Finding]:
    torque = b.alpha * held.amplitude
    least = float(np.abs(b.torque[b.torque != 0]).min())
    if torque > 0.25 * least:
        yield Finding(
            "large-detent",
            f"the detent is {torque:.2f} N m 0-pk, the smallest load {least:.2f} N m: a count of the encoder off home is "
            f"{torque * held.order * 1.5e-3:.3f} N m, and what the loads show is the detent.", "detent", Effect.INDETERMINATE,
        )  # fmt: skip
    elif torque > 0.02:
        yield Finding(
            "detent", f"the detent is {torque * 1e3:.0f} mN m 0-pk; it is in the current without load.", "detent"
        )


def _arms(data: TorqueData, b: Balance, arm_u: float) -> Iterator[Finding]:
    found = hypotheses.ratio_of_sides(b, data.steps)
    if abs(found.value) > SIGNIFICANT * math.hypot(found.u, arm_u):
        yield Finding(
            "arms-disagree",
            f"the left end gives {found.value:+.2%} more torque per load than the right one "
            f"(u {math.hypot(found.u, arm_u):.2%} by scatter and certificates): an arm is not what its certificate "
            "says, or the lever slips.", "lever", Effect.INDETERMINATE,
        )  # fmt: skip


def _loads(data: TorqueData, b: Balance, p: Mapping[str, float], mass_u: Sequence[float]) -> Iterator[Finding]:
    found = [hypotheses.of_load(b, data.steps, k) for k in range(len(data.masses))]
    t = [abs(e.value) / math.hypot(e.u, u) if math.isfinite(e.u) else 0.0 for e, u in zip(found, mass_u, strict=True)]
    worst = max(t)
    if worst < SIGNIFICANT:
        return
    suspects = [k for k in range(len(t)) if t[k] ** 2 > 0.8 * worst**2]
    said = [
        f"{data.masses[k]} is {p[f'mass_{k}'] * (1 + found[k].value):.4f} kg instead of {p[f'mass_{k}']:.4f} kg"
        for k in suspects
    ]
    yield Finding("load-inconsistent", f"the loads contradict each other; they agree if {' or '.join(said)}.",
                  ", ".join(data.masses[k] for k in suspects), Effect.INDETERMINATE)  # fmt: skip


def _cosine(data: TorqueData, b: Balance) -> Iterator[Finding]:
    chance, largest = hypotheses.shape_over_gamma(b, data.steps)
    if chance < 1e-6 and largest > 5e-3:
        yield Finding(
            "not-a-cosine",
            f"the torque per current departs from alpha_tau cos(M (gamma - gamma_0)) by up to {largest:.2%} (by chance with a "
            f"probability of {chance:.0e}).", "gamma", Effect.INDETERMINATE,
        )  # fmt: skip
