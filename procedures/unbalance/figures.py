"""What the dwells draw: orbits with the clearance circle, Bode pair, polar plot, full spectra, what the coils need."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from bench.analysis import pictures
from bench.analysis.spectra import full
from bench.figures import Figure, Series, Sheet, Shown
from bench.rigfile import RigFile
from bench.uncertainty import coverage_factor, interval
from bench.units import RPM
from procedures.amb_rotor.stations import stations
from procedures.synchronous import facts
from procedures.synchronous.checks import ZONES
from procedures.synchronous.estimates import Result, Results
from procedures.synchronous.orbit_frame import seen

Array = npt.NDArray[np.float64]
SHOWN_TURNS = 4
STANDS = 0.05  # of gravity across the shaft: with less it has no "up"


def all_figures(results: Results, rig: RigFile) -> Iterator[Shown]:
    """In the order of the report."""
    clearance, way = facts.clearance(rig).value, outlook(rig)
    planes = results.machine.planes
    drawn = [orbits(results.of(variant)[-1], plane, clearance, way) for plane in planes for variant in results.variants]
    yield _dwells(results)
    yield drawn[0]
    yield farthest(results)
    yield from drawn[1:]
    for plane in planes:
        yield _bode(results, plane)
        yield _polar(results, plane)
    for plane in planes:
        for variant in results.variants:
            shown = results.of(variant)[-1]
            if shown.dwell.full is not None:
                yield spectrum(shown, plane)
    if any(r.dwell.full is not None for r in results.dwells):
        yield _use(results, "current_peak", "A", "current")
        if results.machine.voltages:
            yield _use(results, "voltage_peak", "V", "voltage")


def outlook(rig: RigFile) -> pictures.Outlook:
    """From outside the end from which z is counter-clockwise of y, with up above; of a shaft that stands, with the place where
    directions have their zero above."""
    s, shaft = stations(rig), rig.shaft
    assert shaft is not None  # `requires` says so
    end = shaft.far_end if s.hand > 0 else shaft.near_end or "near"
    way = "counter-clockwise" if s.hand > 0 else "clockwise"
    seen = f"Seen from outside the {end} end, from where the shaft turns {way}"
    y_deg = 90.0 + s.hand * round(math.degrees(s.first.value), 6)
    if math.hypot(*s.up) > STANDS:
        return pictures.Outlook(y_deg, seen)
    zero = "0°" if shaft.zero_at == "up" else f"0° ({shaft.zero_at})"
    return pictures.Outlook(y_deg, seen, f"towards {270 if s.hand > 0 else 90}°", f"towards {zero}")


def _dwells(results: Results) -> Sheet:
    """What each speed was, and how far the shaft moved there, peak to peak as shops say it."""
    rows, planes = [], results.machine.planes
    for variant in results.variants:
        for r in results.of(variant):
            widest = [f"{2e6 * float(np.abs(r.vectors.values[list(pair)]).max()):.1f}" for pair in planes.values()]
            rows.append((f"{RPM * r.dwell.wanted:.0f}", f"{RPM * r.dwell.speed:.1f}", variant, *widest))
    head = ("asked (r/min)", "driven (r/min)", "variant", *(f"{plane} (µm pk-pk)" for plane in planes))
    return Sheet("dwells", "Speeds", "Driven: by the once-per-turn pulses. Order 1 of the shaft's centre at the probe of a "
                 "plane where it is greatest, runout subtracted.", head, tuple(rows), (0, 1, 3, 4))  # fmt: skip


def _key(r: Result) -> str:
    return f"{r.dwell.variant}-{r.dwell.wanted * RPM:.0f}"


def orbits(r: Result, plane: str, clearance: float, way: pictures.Outlook) -> Figure:
    """The highest speed: some turns as read, and the shaft's own order 1 about its mean place."""
    y, z = r.dwell.machine.planes[plane]
    x1 = x2 = None
    if r.dwell.full is not None:
        count = round(SHOWN_TURNS * 2 * np.pi / r.dwell.speed * r.dwell.full.rate)
        x1, x2 = _centre(r, (y, z))[:, :count]
    shown = pictures.Orbit(
        f"{SHOWN_TURNS} turns as read", x1, x2, r.orbits[plane], r.centres[plane], "order 1 of the shaft"
    )
    return pictures.orbits(f"orbit-{plane}-{_key(r)}", f"Orbit {plane}, {r.dwell.where}", [shown], clearance, way)


def _centre(r: Result, pair: tuple[int, int]) -> Array:
    """(2, n) along y and z, of what two probes read in a capture."""
    assert r.dwell.full is not None
    machine = r.dwell.machine
    return seen(machine.stations, [machine.positions[k] for k in pair], r.dwell.full.positions[list(pair)])


def _bode(results: Results, plane: str) -> Figure:
    curves = [c for variant in results.variants for c in _curves(results, plane, variant)]
    return pictures.bode(f"bode-{plane}", f"Bode plot of order 1, {plane}", curves)


def _curves(results: Results, plane: str, variant: str) -> Iterator[pictures.Curve]:
    some = results.of(variant)
    speed = np.array([r.dwell.speed for r in some])
    for k in results.machine.planes[plane]:
        values = np.array([r.vectors.values[k] for r in some])
        u = np.array([coverage_factor(r.vectors.dof) * r.vectors.u_amplitude[k] for r in some])
        axis = results.machine.axes[k]
        name = axis if len(results.variants) == 1 else f"{axis}, {variant}"
        yield pictures.Curve(name, speed, values, u)


def _polar(results: Results, plane: str) -> Figure:
    curves = list(_curves(results, plane, results.variants[0]))
    return pictures.polar(f"polar-{plane}", f"Polar plot of order 1, {plane}, {results.variants[0]}", curves)


def spectrum(r: Result, plane: str) -> Figure:
    y, z = r.dwell.machine.planes[plane]
    assert r.dwell.full is not None
    forward = r.dwell.machine.stations.spin > 0
    both = _centre(r, (y, z))
    found = full(both[0], both[1], r.dwell.full.rate, x_to_y=forward)
    title = f"Full spectrum {plane}, {r.dwell.where}"
    return pictures.full_spectrum(f"spectrum-{plane}-{_key(r)}", title, found, r.dwell.speed, 1500.0)


def farthest(results: Results) -> Figure:
    """D_max over the speed within the zones of ISO 14839-2."""
    series = []
    for variant in results.variants:
        for plane in results.machine.planes:
            some = [r for r in results.of(variant) if ("d_max_share", plane) in r.estimates]
            found = [r.estimates["d_max_share", plane] for r in some]
            x = np.array([RPM * r.dwell.speed for r in some])
            y = np.array([100 * e.value for e in found])
            u = np.array([50 * (i.high - i.low) for i in map(interval, found)])
            series.append(Series(f"{plane}, {variant}", x, y, "both", u))
    edges = [0.0, *(100 * end for _, end in ZONES)]
    bands = tuple((f"zone {name}", low, high) for (name, _), low, high in zip(ZONES, edges, edges[1:], strict=False))
    return Figure("d-max", "D_max over the speed", "Greatest distance of the shaft's centre from the clearance's centre over a "
                  "turn, mean place included, over the least clearance; zones after ISO 14839-2, whose ends were not checked "
                  "against the standard.", "speed (r/min)", "D_max (% of the clearance)", tuple(series),
                  bands=bands)  # fmt: skip


def _use(results: Results, name: str, unit: str, what: str) -> Figure:
    series = []
    for variant in results.variants:
        for plane in results.machine.planes:
            some = [r for r in results.of(variant) if (name, plane) in r.estimates]
            x = np.array([RPM * r.dwell.speed for r in some])
            series.append(
                Series(f"{plane}, {variant}", x, np.array([r.estimates[name, plane].value for r in some]), "both")
            )
    caption = "What a plane's four coils need at most: exceeded for 1 % of the time within the captures."
    return Figure(f"use-{what}", f"Greatest coil {what}", caption,
                  "speed (r/min)", f"{what} ({unit})", tuple(series))  # fmt: skip
