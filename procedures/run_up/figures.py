"""What a passage through the speeds draws: Bode pairs, polar plots, waterfall, order map, coil use, orbits and full spectra."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from bench.analysis import pictures
from bench.analysis.ordermap import order_map
from bench.analysis.spectra import waterfall
from bench.figures import Figure, Series, Sheet, Shown
from bench.rigfile import RigFile
from bench.uncertainty import interval, stated
from bench.units import RPM
from procedures.run_up.estimates import Run, asked_margin
from procedures.run_up.steps import Passage
from procedures.shared.limits import current_limit
from procedures.unbalance import figures

HIGHEST_HZ = 480.0
HIGHEST_ORDER = 5.0
SHOWN = 600  # samples of the speed over time
SPECTRA = 24  # of the waterfall: so many can be told apart
TURNS_ORDER = 16
EVERY_RPM = 1000.0


def all_figures(run: Run, rig: RigFile, running: float) -> Iterator[Shown]:
    """In the order of the report."""
    p = run.passage
    planes = p.machine.planes
    yield _criticals(run, running)
    for plane in planes:
        yield _bode(run, plane)
    for plane in planes:
        yield _polar(run, plane)
    probe = _loudest(run)
    part = p.moving
    x = p.data[probe, part]
    name = p.machine.positions[probe]
    shown = waterfall(p.t[part], x, p.tacho, p.sampling, segment=_segment(p), count=SPECTRA)
    yield pictures.waterfall("waterfall", f"Waterfall of {name}, {p.name}", shown, HIGHEST_HZ, (1.0, 2.0, 3.0))
    turns = TURNS_ORDER if abs(_rate(p)) < 100 else TURNS_ORDER // 2
    found = order_map(p.t[part], x, p.tacho, p.sampling, turns=turns, highest=HIGHEST_ORDER)
    drawn = pictures.order_map("order-map", f"Order map of {name}, {p.name}", found)
    yield replace(drawn, caption=f"{drawn.caption} Faint curves that slant are higher orders that its means fold back.")
    yield _currents(run, rig)
    if p.machine.plane_voltages:
        yield _volts(run)
    yield _speed(p)
    if run.near is not None:
        yield figures.farthest(run.near)
        for result in run.near.dwells[-1:]:
            for plane in planes:
                yield figures.orbits(result, plane, run.clearance, figures.outlook(rig))
            if result.dwell.full is not None:
                for plane in planes:
                    yield figures.spectrum(result, plane)


def _rate(p: Passage) -> float:
    at, end = p.moving.start, p.moving.stop - 1
    return float((p.speeds[end] - p.speeds[at]) / (p.t[end] - p.t[at]))


def _segment(p: Passage) -> int:
    """Samples over which the speed changes by as much as a spectrum of them resolves."""
    rate = 1 / p.period_s
    return int(2 ** round(math.log2(rate * math.sqrt(2 * math.pi / abs(_rate(p))))))


def _loudest(run: Run) -> int:
    return int(np.argmax(np.abs(run.shaft).max(axis=1)))


def _curves(run: Run, plane: str) -> list[pictures.Curve]:
    machine = run.passage.machine
    return [pictures.Curve(machine.axes[k], run.curve.speed, run.shaft[k]) for k in machine.planes[plane]]


def _bode(run: Run, plane: str) -> Figure:
    """With the criticals."""
    figure = pictures.bode(
        f"bode-{plane}",
        f"Bode plot of order 1, {plane}, {run.passage.name}",
        _curves(run, plane),
        caption="The shaft's centre at the probes: runout subtracted, the ramp's lag taken off; amplitude zero to peak, phase "
        "lag from the once-per-turn mark to the high spot. Criticals, where there are any, are marked; the legend has their "
        "amplification factors (AF).",
    )
    series, machine = list(figure.series), run.passage.machine
    inside = [machine.axes[k] for k in machine.planes[plane]]
    for peak in run.peaks:
        if peak.critical and peak.factor is not None and peak.axis in inside:
            i = interval(peak.amplitude)
            x, y = RPM * peak.speed.value, 1e6 * peak.amplitude.value
            half = np.array([1e6 * (i.high - i.low) / 2])
            ends = np.array([e for e in (peak.low, peak.high) if math.isfinite(e)])
            series.append(Series(f"{peak.axis} half power", RPM * ends, np.full(ends.size, math.sqrt(0.5) * y), "mark"))
            told = f"{peak.axis} critical, {x:.0f} r/min, AF {peak.factor.value:.1f}"  # in the legend: beside it, two overlap
            series.append(Series(told, np.array([x]), np.array([y]), "points", half))
    return replace(figure, series=tuple(series))


def _criticals(run: Run, running: float) -> Sheet:
    """What a rotordynamics reader looks up first (API 617): N_c, AF, half-power speeds, margins."""
    rows = []
    for peak in run.peaks:
        if peak.factor is None:
            continue
        speed, amplitude, factor, margin = map(interval, (peak.speed, peak.amplitude, peak.factor, peak.margin))
        ends = " to ".join(f"{RPM * e:.0f}" if math.isfinite(e) else "beyond" for e in (peak.low, peak.high))
        rows.append((
            peak.where, "yes" if peak.critical else "no, damped",
            stated(RPM * peak.speed.value, RPM * speed.U, "±"), stated(peak.factor.value, factor.U, "±"), ends,
            stated(1e6 * peak.amplitude.value, 1e6 * amplitude.U, "±"), f"{2e6 * peak.amplitude.value:.3g}",
            stated(100 * peak.margin.value, 100 * margin.U, "±"),
            f"{100 * asked_margin(peak, running):.1f}" if peak.critical else "–",
        ))  # fmt: skip
    head = (
        "Peak",
        "critical",
        "N_c (r/min)",
        "AF",
        "half power (r/min)",
        "µm 0-pk",
        "µm pk-pk",
        "margin (%)",
        "asked (%)",
    )
    caption = (
        f"N_c of small orbits, amplification factor AF by half power, separation margin from the running speed of "
        f"{RPM * running:.0f} r/min and the one that API 617 asks for a critical of that factor; below 2.5 it is "
        "none. ± is U at 95 %."
    )
    return Sheet("criticals", "Critical speeds", caption, head, tuple(rows), tuple(range(2, len(head))))


def _polar(run: Run, plane: str) -> Figure:
    top = RPM * float(run.curve.speed[-1])
    every = EVERY_RPM if top < 8000 else 2 * EVERY_RPM
    return pictures.polar(
        f"polar-{plane}", f"Polar plot of order 1, {plane}, {run.passage.name}", _curves(run, plane), every
    )


def _currents(run: Run, rig: RigFile) -> Figure:
    """Mean and order 1 of the coil that needs most."""
    c, series = run.curve, []
    for plane, (y, z) in run.passage.machine.planes.items():
        coils = [4 + 2 * k + side for k in (y, z) for side in (0, 1)]
        most = np.max([c.means[:, k] + np.abs(c.values[k]) for k in coils], axis=0)
        series.append(Series(plane, RPM * c.speed, most))
    limit = current_limit(rig)
    return Figure("use-current", "Greatest coil current over the speed", "Mean and order 1 of the coil of a plane that carries "
                  "most.", "speed (r/min)", "current (A)", tuple(series), lines=(("limit", limit),))  # fmt: skip


def _volts(run: Run) -> Figure:
    c = run.curve
    series = tuple(Series(plane, RPM * c.speed, c.volts[:, k]) for k, plane in enumerate(run.passage.machine.planes))
    return Figure("use-voltage", "Greatest coil voltage over the speed", "Either way, of all coils of a bearing, as the "
                  "controller tells it.", "speed (r/min)", "voltage (V)", series)  # fmt: skip


def _speed(p: Passage) -> Figure:
    step = max(1, p.t.size // SHOWN)
    t0 = float(p.t[0])
    by_pulses = Series("by the pulses", p.t[::step] - t0, RPM * p.speeds[::step])
    drive = Series("by the drive", p.driven[0] - t0, RPM * p.driven[1], "guide")
    return Figure("speed", f"Speed over time, {p.name}", "By the once-per-turn pulses, and as the drive measures it.",
                  "time (s)", "speed (r/min)", (by_pulses, drive))  # fmt: skip
