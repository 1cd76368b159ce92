"""What the tracking test draws, after T Figs. 2.10 to 2.12 and 3.6: orbits, errors over the revolution, coils."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from bench.figures import Figure, Series
from procedures.amb_rotor.geometry import Facts, at_rings, centre
from procedures.amb_rotor.stations import Ring
from procedures.tracking.ellipse import errors, revolutions, turns
from procedures.tracking.points import contour
from procedures.tracking.steps import Orbit

AS_SET = "as set"  # a controller without a choice of law


def all_figures(orbits: Sequence[Orbit], facts: Mapping[str, Facts]) -> list[Figure]:
    """In the order of the report."""
    return [
        _orbit(orbits, facts),
        *(_plane(orbits, facts, k, ring) for k, ring in enumerate(orbits[0].machine.stations.rings)),
        *(
            _contours(orbits, facts)
            if orbits[0].path.points
            else [_errors(orbits, facts, k, axis) for k, axis in enumerate("yz")]
        ),
        *(_tilts(orbits, facts, k, name) for k, name in ((2, "ψ, about y"), (3, "θ, about z"))),
        *(_coils(o) for o in orbits),
    ]


def _ring(clearance: float) -> Series:
    turn = np.linspace(0, 2 * np.pi, 181)
    return Series("touchdown ring", 1e6 * clearance * np.cos(turn), 1e6 * clearance * np.sin(turn), "guide")


def _two(o: Orbit) -> np.ndarray:
    """The first two revolutions: more would hide the others."""
    out: np.ndarray = np.logical_or.reduce(revolutions(o.path)[:2])
    return out


def _orbit(orbits: Sequence[Orbit], facts: Mapping[str, Facts]) -> Figure:
    w, series = orbits[0].path.wave, []
    turn = np.linspace(0, 2 * np.pi, 181)
    series.append(Series("reference", 1e6 * w.y * np.sin(turn), 1e6 * w.z * np.cos(w.ratio * turn), "guide"))
    for o in orbits:
        q = 1e6 * centre(o.path.readings, facts[o.law])[:2, _two(o)]
        series.append(Series(o.law or AS_SET, q[0], q[1]))
    return Figure(
        "orbit",
        f"Centre of mass, {w.hz:g} Hz",
        "Two revolutions of the reference, from where the sensors read zero.",
        "y (µm)",
        "z (µm)",
        tuple(series),
        "plane",
    )


def _plane(orbits: Sequence[Orbit], facts: Mapping[str, Facts], k: int, ring: Ring) -> Figure:
    series = [_ring(facts[orbits[0].law].rings[k].clearance)]
    for o in orbits:
        f = facts[o.law]
        y, z = at_rings(o.path.readings[:, _two(o)] / np.array(f.gains)[:, None], f)[k]
        series.append(Series(o.law or AS_SET, 1e6 * y, 1e6 * z))
    return Figure(
        f"ring-{ring.name}",
        f"Orbit at the {ring.name} {'sensors' if ring.arm is None else 'ring'}",
        "Single samples, with the touchdown ring as the rig file states it; its middle is within the sensors' zero.",
        "y (µm)",
        "z (µm)",
        tuple(series),
        "plane",
    )


def _binned(o: Orbit, f: Facts, values: np.ndarray, count: int = 72) -> tuple[np.ndarray, np.ndarray]:
    """Means over all revolutions in equal parts of the reference's phase, deg."""
    phase = (360 * o.path.wave.hz * (o.path.t - o.path.wave.late - f.t_0)) % 360
    k = (phase / 360 * count).astype(int) % count
    use = np.isfinite(values)
    n = np.maximum(np.bincount(k[use], minlength=count), 1)
    return (np.arange(count) + 0.5) * 360 / count, np.bincount(k[use], values[use], count) / n


def _contours(orbits: Sequence[Orbit], facts: Mapping[str, Facts]) -> list[Figure]:
    """Off the ellipse along its normal, over the time of a revolution."""
    series = []
    for o in orbits:
        mean = turns(o.path, facts[o.law]).errors.mean(axis=0)
        off = contour(mean[0], mean[1], o.path.wave.y, o.path.wave.z)
        series.append(Series(o.law or AS_SET, np.linspace(0, 360, len(off), endpoint=False), 1e6 * off))
    caption = "Of the mean revolution, outwards positive; each step of the reference is a set point."
    title = "Distance from the ellipse"
    return [Figure("contour", title, caption, "part of a revolution (°)", "off the ellipse (µm)", tuple(series))]


def _errors(orbits: Sequence[Orbit], facts: Mapping[str, Facts], k: int, axis: str) -> Figure:
    series = []
    for o in orbits:
        x, y = _binned(o, facts[o.law], errors(o.path, facts[o.law])[k])
        series.append(Series(o.law or AS_SET, x, 1e6 * y))
    return Figure(
        f"error-{axis}",
        f"Error of {axis} over a revolution of the reference",
        "Means over all revolutions; of a turning shaft, averaged over its turn.",
        "phase of the reference (°)",
        f"error of {axis} (µm)",
        tuple(series),
    )


def _tilts(orbits: Sequence[Orbit], facts: Mapping[str, Facts], k: int, name: str) -> Figure:
    series = []
    for o in orbits:
        x, y = _binned(o, facts[o.law], errors(o.path, facts[o.law])[k])
        series.append(Series(o.law or AS_SET, x, 1e6 * y))
    key = "tilt-psi" if k == 2 else "tilt-theta"
    return Figure(
        key,
        f"Tilt {name}, over a revolution of the reference",
        "As the errors.",
        "phase of the reference (°)",
        "tilt (µrad)",
        tuple(series),
    )


def _coils(o: Orbit) -> Figure:
    """Eight curves in one panel could not be told apart."""
    use, t = _two(o), o.path.t - o.path.t[0]
    upper, lower = (
        tuple(Series(axis, t[use], currents[k, use]) for k, axis in enumerate(o.machine.axes))
        for currents in (o.upper, o.lower)
    )
    key = f"coils-{o.law.lower() or 'set'}"
    below = Figure(f"{key}-lower", "", "", "time (s)", "lower coils (A)", lower)
    return Figure(
        key,
        f"Coil currents, {o.law or AS_SET}",
        "Two revolutions of the reference; the upper coils above, the lower ones below.",
        "time (s)",
        "upper coils (A)",
        upper,
        below=below,
    )
