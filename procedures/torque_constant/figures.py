"""What the torque calibration draws: torque over current, the constant over gamma, residuals, detent, and one step."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from bench.recording import Recording
from procedures.servomotor.conventions import conventions
from procedures.torque_constant.fit import Balance, Detent, Steps
from procedures.torque_constant.plan import Plan
from procedures.torque_constant.steps import OnLever, TorqueData

Array = npt.NDArray[np.float64]
SIDES = ((1, "left"), (-1, "right"))
SHOWN_S = 0.06


def all_figures(recording: Recording[Plan], data: TorqueData, b: Balance, held: Detent, pairs: float) -> list[Figure]:
    """In the order of the report."""
    return [_torque(data, b, pairs), *_over_gamma(data, b, pairs), _residuals(data, b), _detent(data, b, held),
            _one_step(recording)]  # fmt: skip


def _torque(data: TorqueData, b: Balance, pairs: float) -> Figure:
    s, series = data.steps, []
    angles = np.unique(s.gamma)
    for gamma in (angles[len(angles) // 2], angles[-1]):
        slope = b.alpha * math.cos(pairs * (gamma - b.gamma_0))
        name = f"{math.degrees(gamma):+.1f}°"
        for side, label in SIDES:
            mine = (s.gamma == gamma) & (s.side == side)
            series.append(Series(f"{name}, {label}", (b.current - b.base)[mine], b.torque[mine], "points"))
        reach = float(np.abs((b.current - b.base)[s.gamma == gamma]).max())
        series.append(Series(f"{name}, fit", np.array([-reach, reach]), -slope * np.array([-reach, reach])))
    return Figure("torque", "Torque of the loads over the torque current", "Loads on the left turn the rotor forward and take "
                  "negative current. Current without load is taken off.", "torque current (A)", "torque (N m)",
                  tuple(series))  # fmt: skip


def _over_gamma(data: TorqueData, b: Balance, pairs: float) -> Iterator[Figure]:
    points, apart = [], []
    for side, label in SIDES:
        angles, slopes, u = _slopes(b, data.steps, side)
        fitted = b.alpha * np.cos(pairs * (angles - b.gamma_0))
        points.append(Series(label, np.degrees(angles), slopes, "points", 2 * u))
        apart.append(
            Series(label, np.degrees(angles) + 0.04 * side, 100 * (slopes / fitted - 1), "points", 200 * u / fitted)
        )
    grid = np.linspace(data.steps.gamma.min(), data.steps.gamma.max(), 120)
    points.append(Series("fit", np.degrees(grid), b.alpha * np.cos(pairs * (grid - b.gamma_0))))
    yield Figure("constant", "Torque per current over the phase angle", "One slope at each phase angle and side, and the "
                 "fitted cosine, whose peak is the torque constant.", "phase angle (°)", "torque per current (N m/A)",
                 tuple(points))  # fmt: skip
    yield Figure("constant-residuals", "Torque per current, departure from the cosine", "The same slopes against the fit, with "
                 "95 % intervals by the scatter of the steps. One side above the other would be an arm, a bend "
                 "would be no cosine.",
                 "phase angle (°)", "departure (%)", tuple(apart), lines=(("fit", 0.0),))  # fmt: skip


def _slopes(b: Balance, s: Steps, side: int) -> tuple[Array, Array, Array]:
    """Phase angles (k,) rad, torque per current N m/A of one side's loads at each, and its u from the residuals."""
    angles = np.unique(s.gamma)
    slopes, u = [], []
    for gamma in angles:
        mine = (s.gamma == gamma) & (s.side == side)
        torque, current = b.torque[mine] / b.u[mine], (b.current - b.base)[mine] / b.u[mine]
        size = float(torque @ torque)
        slope = -float(torque @ current) / size  # A per N m
        slopes.append(1 / slope)
        u.append(b.scale / math.sqrt(size) / slope**2)
    return angles, np.array(slopes), np.array(u)


def _residuals(data: TorqueData, b: Balance) -> Figure:
    s, series = data.steps, []
    for side, label in (*SIDES, (0, "no load")):
        mine = s.side == side
        series.append(Series(label, np.degrees(s.gamma[mine]), 1e3 * b.fit.residuals[mine], "points"))
    return Figure("residuals", "Residuals of the fit", "Torque current less the fit, every step; a pattern over the phase "
                  "angle would be no cosine, one by side an arm.", "phase angle (°)", "residual (mA)", tuple(series),
                  lines=(("zero", 0.0),))  # fmt: skip


def _detent(data: TorqueData, b: Balance, held: Detent) -> Figure:
    grid = np.linspace(0, 2 * math.pi / held.order, 100)
    curve = held.constant + held.cosine * np.cos(held.order * grid) + held.sine * np.sin(held.order * grid)
    return Figure("detent", "Torque that holds the rotor without load", "Over one period of the detent; the constant part also "
                  "has the offsets of the current sensors.", "rotor angle (°)", "torque (mN m)",
                  (Series("held", np.degrees(data.detent_angle), 1e3 * b.alpha * data.detent_current, "points"),
                   Series("fit", np.degrees(grid), 1e3 * b.alpha * curve)))  # fmt: skip


def _one_step(recording: Recording[Plan]) -> Figure:
    """The end of a step close by: over its whole second, which is what is averaged, the swing would be a solid block."""
    heaviest = recording.plan.masses[-1]
    step = next(s for s in recording.steps(OnLever.kind) if s.labels["load"] == heaviest)
    segments = conventions(recording.rig).turning
    data = recording.read(segments, step.end_ns - round(1e9 * SHOWN_S), step.end_ns)
    t = (data["t_ns"] - step.end_ns).astype(np.float64) * 1e-6
    current = np.mean([data[c] for c in segments], axis=0)
    return Figure("step-current", f"Torque current at the end of a step ({heaviest})", "Between two counts of the "
                  "encoder the rotor is not held: it swings, and the current with it. What counts is the current's mean over "
                  "the step.", "time to the end of the step (ms)", "torque current (A)",
                  (Series("mean of the segments", t, current),))  # fmt: skip
