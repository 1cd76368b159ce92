"""What the response of an estimator draws, after T Fig. 4.2: error, gain and phase beside those of the weights."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from bench.uncertainty import coverage_factor
from procedures.derivative.estimates import Result
from procedures.derivative.plan import Plan

Array = npt.NDArray[np.float64]


def all_figures(result: Result, plan: Plan) -> list[Figure]:
    """In the order of the report."""
    hz = np.array([line.taken.hz for line in result.lines])
    if not len(hz):
        return []
    fine = np.geomspace(min(hz[0], 1.0), max(hz[-1], 150.0), 600)
    return [_error(result, plan, hz, fine), _response(result, plan, hz, fine), _sidebands(result, plan, hz, fine)]


def _points(result: Result, name: str, hz: Array, scale: float = 1.0) -> Series:
    found = [result.by_line[line.taken.where][name] for line in result.lines]
    k = coverage_factor(len(result.lines[0].found.h) - 1)
    u = np.array([k * e.u * abs(scale) for e in found])
    return Series("measured", hz, np.array([e.value * scale for e in found]), "points", u)


def _error(result: Result, plan: Plan, hz: Array, fine: Array) -> Figure:
    return Figure(
        "error", "Error over frequency",
        f"RMS of velocity less derivative over the derivative's rms, sidebands included. Degree {plan.degree}, spacing "
        f"{plan.window_s * 1e3:g} ms, rule {plan.rule}; the curve is that of the weights.",
        "frequency (Hz)", "error (%)",
        (_points(result, "error", hz, 100.0), Series("weights", fine, 100 * result.bank.error(fine))),
        lines=((f"limit of the band, {plan.limit:.1%}", 100 * plan.limit),), log_x=True, log_y=True,
    )  # fmt: skip


def _response(result: Result, plan: Plan, hz: Array, fine: Array) -> Figure:
    mean = result.bank.responses(fine).mean(axis=0)
    own = Series("weights", fine, np.degrees(np.angle(mean)))
    measured = _points(result, "phase", hz, 180 / np.pi)
    phase = Figure("phase", "Phase", "", "frequency (Hz)", "phase (°)", (measured, own), log_x=True)
    return Figure(
        "gain", "Gain and phase over frequency",
        f"Mean over the time since the reset; the curves are those of the weights. Rule {plan.rule}.",
        "frequency (Hz)", "gain (1)", (_points(result, "gain", hz), Series("weights", fine, np.abs(mean))), log_x=True,
        below=phase,
    )  # fmt: skip


def _sidebands(result: Result, plan: Plan, hz: Array, fine: Array) -> Figure:
    each = result.bank.responses(fine)
    own = Series("weights", fine, 100 * np.sqrt((np.abs(each - each.mean(axis=0)) ** 2).mean(axis=0)))
    return Figure(
        "sidebands", "Sidebands",
        f"What comes out at f ± n/eps, 1/eps = {1 / plan.window_s:.4g} Hz: a wrong spacing shows here first.",
        "frequency (Hz)", "sidebands (% of the derivative)", (_points(result, "sideband", hz, 100.0), own), log_x=True,
    )  # fmt: skip
