"""What the bearing-model run draws: where the shaft stood, currents over position, both models' residuals, adjustments."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from bench.figures import Figure, Series
from bench.rigfile import RigFile
from procedures.amb_rotor import magnetics
from procedures.amb_rotor.geometry import Edge, at_rings, nominal
from procedures.amb_rotor.keys import gap_key
from procedures.bearing_model.checks import influence
from procedures.bearing_model.estimates import Analysis

DISPLACEMENT = "displacement at the AMB (µm)"


def all_figures(a: Analysis, rig: RigFile) -> list[Figure]:
    """In the order of the report."""
    return [_places(a, rig), _currents(a), *_residuals(a), _forces(a), _adjustments(a)]


def _places(a: Analysis, rig: RigFile) -> Figure:
    turn = np.linspace(0, 2 * np.pi, 181)
    machine = a.held.machine
    radius, turned = 1e6 * machine.clearance, turn if np.isfinite(machine.clearance) else turn[:0]
    f = nominal(rig)
    facts = replace(f, rings=tuple(Edge(k, None, 0.0) for k in (0, 1)))
    at = at_rings(
        np.array([1e6 * a.held.mean[c] for c in machine.stations.channels]) / np.array(f.gains)[:, None], facts
    )
    series = (
        Series("touchdown ring", radius * np.cos(turned), radius * np.sin(turned), "guide"),
        *(Series(name, y, z, "points") for name, (y, z) in zip(machine.planes, at, strict=True)),
    )
    caption = "Where the sensors saw the shaft at each position, within the touchdown ring."
    return Figure("positions", "Positions of the shaft", caption, "y (µm)", "z (µm)", series, kind="plane")


def _currents(a: Analysis) -> Figure:
    control = (a.statics.p - a.statics.n) / 2
    series = (Series(axis, 1e6 * a.statics.r[k], control[k], "points") for k, axis in enumerate(a.held.machine.axes))
    caption = (
        "Half the difference of both coils' currents that carries the shaft, over the displacement at the AMB. "
        "It falls towards the upper coils, which pull by themselves; there is one row of points for each bias."
    )
    title = "Control current over position"
    return Figure("currents", title, caption, DISPLACEMENT, "control current (A)", tuple(series))


def _residuals(a: Analysis) -> Iterator[Figure]:
    """As T Table 2.2 in a picture: the same scale would hide the nonlinear model's."""
    load = 1e3 * float(np.abs(a.statics.force).mean())
    caption = f"Force that carries less the model's, of each position; the load of an axis is {load:.0f} mN on average."
    of_linear = {axis: f.linear.residuals for axis, f in a.fits.items()}
    of_nonlinear = {axis: -f.residuals for axis, f in a.fits.items()}
    for key, name, at, residuals in (
        ("residuals-linear", f"linear model without intercept (T 2.9){_at(a)}", a.compared, of_linear),
        ("residuals-nonlinear", "nonlinear model (T 2.8)", a.statics, of_nonlinear),
    ):
        series = tuple(
            Series(axis, 1e6 * at.r[a.held.machine.axes.index(axis)], 1e3 * left, "points")
            for axis, left in residuals.items()
        )
        title = f"Residuals of the {name}"
        yield Figure(key, title, caption, DISPLACEMENT, "residual (mN)", series, lines=(("zero", 0.0),))


def _at(a: Analysis) -> str:
    """The bias of the comparison, of every bearing where they differ."""
    return f" at {' and '.join(f'{x:g}' for x in dict.fromkeys(a.bias_A.values()))} A" if a.bias_A else ""


def _forces(a: Analysis) -> Figure:
    """Force of the magnets at equal currents over position: the fit's, and the linear model's line."""
    axis = next(iter(a.fits))
    bias = a.bias_A.get(axis, math.nan)
    k = a.held.machine.axes.index(axis)
    f = a.fits[axis]
    r = np.linspace(float(a.compared.r[k].min()), float(a.compared.r[k].max()), 60)
    both = np.full_like(r, bias)
    pull = magnetics.magnet(f.beta, f.offset, a.adjusted.values[gap_key(a.held.machine, axis)], r, both, both)
    series = (
        Series("nonlinear, no control current", 1e6 * r, pull),
        Series("linear, no control current", 1e6 * r, f.linear.terms[1] * r),
        Series("force that carries", 1e6 * a.compared.r[k], a.compared.force[k], "points"),
    )
    caption = (
        f"Pull of both coils at {bias:g} A over the displacement at the AMB, by both models; the points are what "
        "gravity and spring need. The offset pulls where the sensors read zero; the linear model has no such pull, "
        "and its slope is what the rest of its fit makes of that."
    )
    return Figure("forces", f"Force of axis {axis} at the bias", caption, DISPLACEMENT, "force (N)", series)


def _adjustments(a: Analysis) -> Figure:
    moved = a.adjusted.moved
    at = np.arange(1.0, len(moved) + 1)
    most = sorted(moved, key=lambda name: -abs(moved[name]))[:3]
    named = ", ".join(f"{influence(a, n).name} ({list(moved).index(n) + 1}) {moved[n]:+.1f}" for n in most)
    caption = (
        "How far the positions move each certified number, over its standard uncertainty; beyond the lines they contradict "
        f"the certificate, if they tell of it at all. The most: {named}."
    )
    series = (Series("adjustment", at, np.array(list(moved.values())), "points"),)
    lines = (("+2 u", 2.0), ("−2 u", -2.0))
    return Figure("adjustments", "Adjustments", caption, "number of the input", "adjustment (u)", series, lines=lines)
