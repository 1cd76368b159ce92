"""What the bearing-model run draws: where the shaft stood, currents over position, both models' residuals, gaps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.figures import Figure, Series
from bench.rigfile import RigFile
from procedures.estimators import bearing
from procedures.estimators.bearing import AXES
from procedures.estimators.bearing_estimates import Analysis
from procedures.estimators.bearing_findings import expanded

SHOWN = ("yi", "yo")


def all_figures(a: Analysis, rig: RigFile) -> list[Figure]:
    """In the order of the report."""
    return [_places(a, rig), _currents(a), *_residuals(a), _forces(a), _gaps(a)]


def _places(a: Analysis, rig: RigFile) -> Figure:
    turn = np.linspace(0, 2 * np.pi, 181)
    radius = 1e6 * rig.geometry["clearance"].value
    read = 1e6 * np.array([a.held.mean[f"pos_{x}"] for x in AXES])
    series = (Series("touchdown ring", radius * np.cos(turn), radius * np.sin(turn)),
              Series("inboard", read[0], read[1], "points"), Series("outboard", read[2], read[3], "points"))  # fmt: skip
    return Figure("positions", "Positions of the shaft", "Where the sensors saw the shaft at each position, within the touchdown ring.",
                  "y (µm)", "z (µm)", series, kind="plane")  # fmt: skip


def _currents(a: Analysis) -> Figure:
    """Control current over position, with the fitted magnet's line at the mean force and bias."""
    series = []
    for k, axis in enumerate(AXES):
        x = 1e6 * a.statics.r[k]
        series.append(Series(axis, x, (a.statics.p[k] - a.statics.n[k]) / 2, "points"))
    return Figure("currents", "Control current over position", "Half the difference of both coils' currents that carries the shaft, over the "
                  "displacement at the AMB. It falls towards the upper coils, which pull by themselves.",
                  "displacement at the AMB (µm)", "control current (A)", tuple(series))  # fmt: skip


def _residuals(a: Analysis) -> Iterator[Figure]:
    """As T Table 2.2 in a picture: the same scale would hide the nonlinear model's."""
    for name, title, linear in (
        ("linear", "linear model without intercept (T 2.9)", True),
        ("nonlinear", "nonlinear model (T 2.8)", False),
    ):
        series = []
        for k, axis in enumerate(AXES):
            f = a.fits[axis].linear if linear else a.fits[axis].fit
            series.append(Series(axis, 1e6 * a.statics.r[k], 1e3 * f.residuals, "points"))
        load = 1e3 * float(np.mean([np.abs(f.force).mean() for f in a.fits.values()]))
        yield Figure(f"residuals-{name}", f"Residuals of the {title}", f"Force that carries less the model's, of each position; the load of an "
                     f"axis is {load:.0f} mN on average.", "displacement at the AMB (µm)", "residual (mN)", tuple(series),
                     lines=(("zero", 0.0),))  # fmt: skip


def _forces(a: Analysis) -> Figure:
    """Force of the magnets at equal currents over position: the fit's, and the linear model's lines."""
    k, axis = 0, "yi"
    f, bias = a.fits[axis], a.bias_A
    r = np.linspace(float(a.statics.r[k].min()), float(a.statics.r[k].max()), 60)
    curves = [Series("nonlinear, no control current", 1e6 * r, bearing.magnet(f.beta, f.offset, a.values["gap"], r, bias + 0 * r, bias + 0 * r)),
              Series("linear, no control current", 1e6 * r, f.linear.terms[1] * r),
              Series("force that carries", 1e6 * a.statics.r[k], a.statics.force[k], "points")]  # fmt: skip
    return Figure("forces", "Force of axis yi at the bias", f"Pull of both coils at {bias:g} A over the displacement at the AMB, by both models; "
                  "the points are what gravity and spring need. The offset pulls where the sensors read zero; the linear model has no such "
                  "pull and makes up for it with slopes that are too steep.",
                  "displacement at the AMB (µm)", "force (N)", tuple(curves))  # fmt: skip


def _gaps(a: Analysis) -> Figure:
    all_of = [*a.gaps.values(), a.drawing, a.gap]
    x = np.arange(1.0, 7.0)
    values = np.array([e.value for e in all_of]) * 1e6
    u = np.array([expanded(e) for e in all_of]) * 1e6
    return Figure("gaps", "Gaps", "1 to 4: the gap that the positions of yi, zi, yo, zo ask for beside force constant and offset; 5: the drawing; 6: both "
                  "together, which is used. 95 % intervals.", "1 to 4 by axis, 5 drawing, 6 used", "gap (µm)",
                  (Series("gap", x, values, "points", u),))  # fmt: skip
