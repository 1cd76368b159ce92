"""What the force-constant run draws: forces over current, residuals, constants over the angle, and what sharing does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from bench.uncertainty import Estimate
from procedures.force_constant.estimates import AxisResult
from procedures.force_constant.fit import DIRECT, FORCE, MOMENT
from procedures.force_constant.steps import RampData

Array = npt.NDArray[np.float64]
ROWS = ((FORCE, "force row"), (MOMENT, "moment row"))
NAMES = {"y": "vertical", "x": "horizontal"}
COVERAGE = 1.96


def all_figures(data: RampData, y: AxisResult, x: AxisResult, alone: AxisResult) -> list[Figure]:
    """In the order of the report."""
    angles = data.vertical.angles
    return [_forces("y", y), _residuals("y", y), _over_angle("y", y, angles), _sharing(y, alone),
            _forces("x", x), _over_angle("x", x, angles)]  # fmt: skip


def _forces(axis: str, r: AxisResult) -> Figure:
    """Every angle's steps without what its fit has besides the axis' own current."""
    f = r.fit
    i = f.current.reshape(-1)
    own = f.terms[:, :, [DIRECT]] * f.current + f.residuals
    series = [Series(name, i, own[row].reshape(-1), "points") for row, name in ROWS]
    ends = np.array([i.min(), i.max()])
    series.append(Series("mean over a turn", ends, r.mean.value * ends))
    return Figure(f"force-{axis}", f"{NAMES[axis].capitalize()} force of the motor over its current",
                  f"Force from the AMBs by the force row and by the moment row against i_{axis}, all angles, freed of each "
                  "angle's constant, of the other axis' current, of branch and drift. What scatters at one current is the "
                  "ripple over the angle; residuals are drawn apart.",
                  f"motor current i_{axis} (A)", "force (N)", tuple(series))  # fmt: skip


def _residuals(axis: str, r: AxisResult) -> Figure:
    f = r.fit
    series = tuple(
        Series(name, f.current.reshape(-1), 1e3 * f.residuals[row].reshape(-1), "points") for row, name in ROWS
    )
    return Figure(f"residuals-{axis}", f"Residuals of the {NAMES[axis]} fits",
                  "Force less fitted force at each step, all angles. A parabola common to all angles would be a wrong "
                  "curvature of an AMB, one that changes with the angle a calibration of other angles.",
                  f"motor current i_{axis} (A)", "residual (mN)", series, lines=(("zero", 0.0),))  # fmt: skip


def _over_angle(axis: str, r: AxisResult, angles: Array) -> Figure:
    """Constants at each angle; the bars hold what differs between the angles only."""
    degrees = np.degrees(angles)
    values = np.array([e.value for e in r.angles])
    bars = COVERAGE * np.array([(e - r.mean).u for e in r.angles])
    series = [Series("both rows", degrees, values, "points", bars)]
    series += [Series(name, degrees, np.array([e.value for e in r.rows[row]]), "points") for row, name in ROWS]
    if axis == "y":
        grid = np.linspace(0.0, 360.0, 721)
        series.append(Series("order 16 through the points", grid, _ripple(angles, values, np.radians(grid))))
    return Figure(f"angle-{axis}", f"Force constant over the rotor angle, {NAMES[axis]}",
                  "The constant at each angle; bars (95 %) hold what differs between the angles, not what they share. The "
                  "reported value is the mean.", "rotor angle (°)", "force constant (N/A)", tuple(series),
                  lines=(("mean over a turn", r.mean.value),))  # fmt: skip


def _ripple(angles: Array, values: Array, grid: Array) -> Array:
    """The force ripple has order 16 (two per pole pair of a turn): mean and that order, fitted to the points."""

    def design(a: Array) -> Array:
        return np.stack([np.ones_like(a), np.cos(16 * a), np.sin(16 * a)], axis=-1)

    terms, *_ = np.linalg.lstsq(design(angles), values, rcond=None)
    out: Array = design(grid) @ terms
    return out


def _sharing(y: AxisResult, alone: AxisResult) -> Figure:
    """Intervals of the rows and of their mean, by the full budget and as if the calibration shared nothing."""

    def intervals(r: AxisResult, shift: float, label: str) -> Series:
        shown: Sequence[Estimate] = (*r.row_means, r.mean)
        values = np.array([e.value for e in shown])
        return Series(label, np.arange(1.0, 4.0) + shift, values, "points", np.array([COVERAGE * e.u for e in shown]))

    return Figure("sharing", "What the calibration shares with this run",
                  "95 % intervals of alpha_d by each row and by both. Shared: current sensors, spans, "
                  "masses and gravity are one influence in calibration and run. Alone: only the calibration's values and "
                  f"uncertainties were passed on. The force row has the weight {y.weight:.2f} and would have "
                  f"{alone.weight:.2f}.",
                  "", "force constant (N/A)", (intervals(y, -0.08, "shared"), intervals(alone, 0.08, "alone")),
                  ticks=(("force row", 1.0), ("moment row", 2.0), ("both rows", 3.0)))  # fmt: skip
