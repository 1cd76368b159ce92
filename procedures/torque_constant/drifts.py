"""What drifts while a torque calibration runs: the current without load, and the torque per current."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from procedures.servomotor.conventions import Servomotor
from procedures.shared.leastsquares import linear
from procedures.torque_constant.fit import Balance
from procedures.torque_constant.plan import Plan
from procedures.torque_constant.steps import TorqueData

Array = npt.NDArray[np.float64]
SIGNIFICANT = 6.0  # standard deviations, of Student's t with some twenty degrees of freedom


def scale(b: Balance, plan: Plan) -> Iterator[Finding]:
    """Drift of the torque per current. The fit takes off what is even in time; what is not grows with it."""
    found = b.drift
    if abs(found.value) <= max(plan.max_scale_drift, SIGNIFICANT * found.u):
        return
    yield Finding(
        "drifting-scale",
        f"the torque per current drifts by {found.value:+.2%} from the first load to the last (u {found.u:.2%} by scatter; "
        f"{plan.max_scale_drift:.2%} allowed): magnets that warm up, or a scale that all four current sensors share.",
        "segments", Effect.INDETERMINATE,
    )  # fmt: skip


def baseline(data: TorqueData, machine: Servomotor, b: Balance, plan: Plan) -> Iterator[Finding]:
    """Drift of the current without load. The amplifier closes on its own sensor, so that a drifting sensor moves the true
    current of its segment, all references follow to hold the angle, and the outboard AMB answers the pull to the side.

    A constant torque takes a current that goes with 1/cos(M (gamma - gamma_0)): it is fitted along beside the offsets."""
    zero, pairs = data.steps.side == 0, b.pole_pairs
    t = data.steps.time[zero] - data.steps.time[zero].mean()
    constant_torque = 1 / np.cos(pairs * (data.steps.gamma[zero] - b.gamma_0))
    fit = linear(np.column_stack([t, np.ones_like(t), constant_torque]), b.current[zero])
    slope = float(fit.terms[0])
    if abs(slope) <= max(plan.max_baseline_drift_A_s, SIGNIFICANT * float(fit.u[0])):
        return
    segment = _drifting(data, zero, t, len(machine.turning) * slope, pairs)
    channel = "" if segment is None else machine.turning[segment]
    yield Finding(
        "current-drift",
        f"the torque current without load drifts by {slope * 1e3:+.3f} mA/s over the run "
        f"({plan.max_baseline_drift_A_s * 1e3:.3f} mA/s allowed): a segment's current sensor drifts"
        + (f"; the pull to the side points to {channel}." if channel else "."),
        channel or "segments", Effect.INDETERMINATE,
    )  # fmt: skip


def _drifting(data: TorqueData, zero: npt.NDArray[np.bool_], t: Array, drift: float, pairs: float) -> int | None:
    """Which segment's drift explains the pull to the side: one whose sensor drifts by d lowers its true current by d, which
    is a drift of i_x or i_y by d/2; the phase angle turns the pull by M gamma, as nearly as both force constants are alike."""
    turn = pairs * data.steps.gamma[zero]
    c, q = np.cos(turn), np.sin(turn)
    rows = []
    for to_x, to_y in data.wiring:  # control current over the true i_x and i_y at this phase angle
        pull = np.column_stack([to_x * c + to_y * q, to_y * c - to_x * q])
        rows.append(np.column_stack([pull * t[:, None], pull]))
    nothing, one = np.zeros_like(t), np.ones_like(t)
    design = np.vstack([np.column_stack([rows[0], one, nothing]), np.column_stack([rows[1], nothing, one])])
    seen = np.concatenate([data.table.mean[f"side_{axis}"][zero] for axis in "xy"])
    found = np.linalg.lstsq(design, seen, rcond=None)[0][:2]  # A/s of i_x, i_y
    expected = np.array([[0.0, -drift / 2], [drift / 2, 0.0], [0.0, drift / 2], [-drift / 2, 0.0]])
    expected = expected[
        :: len(expected) // data.steps.segments.shape[1]
    ]  # of q1 and q2 alone where segments are vectors
    apart = np.linalg.norm(expected - found, axis=1)
    best = int(np.argmin(apart))
    return best if apart[best] < 0.3 * abs(drift) else None
