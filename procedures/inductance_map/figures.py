"""What pulses draw: flux over current, inductance over the angle, what the formula leaves; the controller's map beside it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bench.figures import Figure, Series, Sheet, Shown
from bench.rigfile import RigFile
from bench.uncertainty import round_to_uncertainty
from procedures.inductance_map.estimates import Result
from procedures.inductance_map.model import MAP, angular, flux
from procedures.inductance_map.residuals import left
from procedures.stages.map_model import currents, names


def all_figures(r: Result, rig: RigFile) -> Iterator[Shown]:
    """Inductance with its residuals, flux over current, and the parameters."""
    yield _inductance(r)
    yield _fluxes(r)
    yield _parameters(r, rig)


def _inductance(r: Result) -> Figure:
    of, m = left(r), dict(zip(MAP, r.found.terms, strict=False))
    d = np.linspace(of.d.min(), of.d.max(), 181)
    curve = m["slope"] * angular(d, m["unaligned"], m["c2"], m["c3"], r.rows.poles)[0]
    points, beyond = [], []
    for k, p in enumerate(r.phases):
        at = np.degrees(of.d[:, k])
        points.append(Series(p.name, at, of.fitted[:, k] + of.beyond[:, k], "points"))
        beyond.append(Series(p.name, at, 100 * of.beyond[:, k] / of.aligned, "points"))
    below = Figure(
        "residuals",
        "Residuals",
        "",
        "angle from the aligned one / °",
        "off the formula / %",
        tuple(beyond),
    )
    caption = ("Inductance per metre of overlap without saturation, over the phase's gain: pulses and the formula, and beneath "
               "them what they are off it, share of the aligned one. What turns once with "
               "the angle is in both.")  # fmt: skip
    return Figure("inductance", "Inductance over the angle", caption, "angle from the aligned one / °", "inductance / (H/m)",
                  (*points, Series("formula", np.degrees(d), curve, "line")), below=below)  # fmt: skip


def _fluxes(r: Result) -> Figure:
    """Of the first stator's phases where the deepest aligned and unaligned pulses are."""
    of = left(r)
    near, far = np.abs(of.d), np.pi / r.rows.poles - np.abs(of.d)
    fit, series = flux(r.found.terms, r.rows), []
    for label, off in (("nearest to aligned", near), ("nearest to unaligned", far)):
        weight = off + 1e3 * (of.overlap < 0.5 * of.overlap.max())
        m, k = np.unravel_index(int(np.argmin(weight)), weight.shape)
        some = (r.rows.place == m) & (r.rows.phase == k)
        order = np.argsort(r.rows.current[some])
        name = f"{r.phases[k].name}, {math.degrees(of.d[m, k]):.2g}°, {of.overlap[m, k] * 1e3:.3g} mm in: {label}"
        i = r.rows.current[some][order]
        series += [
            Series(name, i, 1e3 * r.rows.flux[some][order], "points"),
            Series("", i, 1e3 * fit[some][order], "faint"),
        ]
    caption = (
        "Flux of two pulses on their way up and down, by u − R i with R of the pulse's own held end; lines are the fit."
    )
    return Figure("flux", "Flux over current", caption, "current / A", "flux / mWb", tuple(series))


def _parameters(r: Result, rig: RigFile) -> Sheet:
    stators = list(dict.fromkeys(p.motor for p in r.phases))
    each = [p.name for p in r.phases]
    told, rows = {**names(stators, each), **currents(each)}, []
    for meaning, quantity in told.items():
        name = rig.capabilities.model.get(meaning, "")
        estimate = r.estimates.get(tuple(quantity.partition("@")[::2]))  # type: ignore[arg-type]
        if name in rig.parameters and estimate is not None:
            rows.append(
                (
                    name,
                    f"{rig.parameters[name].default:.6g}",
                    *round_to_uncertainty(estimate.value, 2 * estimate.u),
                    estimate.unit,
                )
            )
    caption = "The controller's map by default, and the one that was found, in its own units; U is 2 u."
    return Sheet(
        "parameters",
        "The controller's map",
        caption,
        ("parameter", "by default", "found", "U", "unit"),
        tuple(rows),
        (1, 2, 3),
    )
