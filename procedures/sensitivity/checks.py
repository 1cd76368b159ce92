"""What can be wrong with a measured sensitivity, and what its data can say about it. Each check names its suspect."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from bench.analysis.responses import guaranteed_margins
from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.uncertainty import coverage_factor
from bench.units import RPM
from procedures.sensitivity.estimates import Peak, Result, mode_top
from procedures.sensitivity.plan import Plan
from procedures.sensitivity.steps import INJECT, MODE, Taken, folds, grid_of, name_speed
from procedures.shared import signals

ZONES = (3.0, 4.0, 5.0)
"""Ends of the zones A, B and C, |S| (ISO 14839-3; 9.5, 12 and 14 dB; not checked against the standard)."""
SCOPE = ("ISO 14839-3 is for machines above 15 kW and leaves small rotors out; its zones are used here outside of that "
         "scope. A/B and B/C are from secondary sources, C/D from general knowledge; none was "
         "checked against the standard.")  # fmt: skip
HELD = 8  # samples in a row at an extreme: a probe that clips
OFF = 0.05  # share of the amplitude asked for by which that found may differ
NOTHING = 0.1  # of a line's amplitude: less, and there is no line to divide by
SAME = 1e-5  # A: what single precision makes of after - before - inject
FOLLOWS = (0.4, 1.6)  # shares of `after` that the injected axis' coils may follow below 200 Hz, lag and delay included
UNEXPLAINED = 1e-3  # chance that a sound run has a peak so badly explained by its model, all its peaks together
SURE = 4.0  # standard deviations of a line above the refined maximum


def before(recording: Recording[Any]) -> Iterator[Finding]:
    """Nothing to evaluate, captures too slow for their lines, or none of the injection in them."""
    steps = list(recording.steps(INJECT))
    if not steps:
        yield Finding("no-injection", "no injection was recorded", "", Effect.ERROR)
    for step in steps:
        captured = recording.captures(number=step.labels["number"])
        where = f"{step.labels['axis']}, {name_speed(float(step.labels['speed_rad_s']))}"
        if not captured:
            yield Finding("no-capture", "an injection was not captured.", where, Effect.ERROR)
            return
        grid, rate = grid_of(step.labels), captured[0].rate_hz
        if folds(grid, rate):
            if grid.hz.max() <= 0.45 * rate:
                text = (f"captured at {rate:g} Hz; lines that repeat after {grid.period:g} s are {grid.period * rate:g} "
                        "samples; expected a whole number: another rate.")  # fmt: skip
                yield Finding("aliasing", text, where, Effect.ERROR)
                return
            text = (f"captured at {rate:g} Hz; lines up to {grid.hz.max():g} Hz that repeat after {grid.period:g} s need "
                    f"{grid.hz.max() / 0.45:.0f} Hz or more: what is above half of it appears elsewhere.")  # fmt: skip
            yield Finding("aliasing", text, where, Effect.ERROR)
            return
        most = float(np.abs(captured[0].arrays("inject")["inject"]).max())
        if most < NOTHING * grid.amplitude:
            text = (f"nothing was injected: at most {most * 1e3:.2g} mA; asked for were {grid.amplitude * 1e3:.3g} mA in each "
                    f"of {grid.hz.size} lines.")  # fmt: skip
            yield Finding("injection-wrong", text, where, Effect.ERROR)
            return


def of_signals(taken: Sequence[Taken], plan: Plan) -> Iterator[Finding]:
    """Lost samples, probes, contact, limits, the injection itself and where it went."""
    lost, expected = np.array([(t.lost, t.expected) for t in taken], dtype=float).T
    yield from signals.losses(lost, expected, plan.max_lost, lambda share: taken[int(np.argmax(share))].where)
    told: set[tuple[str, str]] = set()
    for t in taken:
        for finding in (*_limits(t), *_injected(t), *_followed(t), *_turning(t, plan)):
            if (finding.code, finding.where) not in told:
                told.add((finding.code, finding.where))
                yield finding


def _limits(t: Taken) -> Iterator[Finding]:
    if t.flags & t.machine.sensor_range or t.clips >= HELD:
        yield Finding(
            "sensor-clipped",
            "a position sensor stood at the end of its range: the loop was cut.",
            t.where,
            Effect.ERROR,
        )
    m = t.machine
    for bits, code, text in (
        (m.contact, "contact", "the shaft touched a ring or the axial stop: this is not the levitated loop."),
        (m.current_limit, "current-saturated", "a coil current was at its limit: the loop was not linear. Inject less."),
        (m.voltage_limit, "voltage-saturated", "an amplifier's voltage was at its limit: this is not S of small motions."),
    ):  # fmt: skip
        if t.flags & bits:
            yield Finding(code, text, t.where, Effect.INDETERMINATE, (f"@{t.where}",))
    if t.clipped > SAME:
        text = f"`after` is not `before` plus `inject` ({t.clipped * 1e3:.2g} mA at worst): the reference was cut at a limit."
        yield Finding("injection-clipped", text, t.where, Effect.INDETERMINATE, (f"@{t.where}",))


def _injected(t: Taken) -> Iterator[Finding]:
    if not t.injected.size:
        yield Finding(
            "all-excluded",
            "every line is beside an order of the shaft's speed.",
            t.where,
            Effect.INDETERMINATE,
            (f"@{t.where}",),
        )
        return
    off = float(np.abs(t.injected / t.grid.amplitude - 1).max())
    if off > OFF:
        found = np.median(t.injected) * 1e3
        text = f"injected were {found:.3g} mA in each line; asked for were {t.grid.amplitude * 1e3:.3g} mA ({off:.0%} off)."
        yield Finding("injection-wrong", text, t.where, Effect.ERROR)


def _followed(t: Taken) -> Iterator[Finding]:
    """The coils of the axis that was asked for must follow the reference with the injection, and with its sign."""
    if t.follows is None:
        return
    axes = t.machine.all_axes
    own = t.follows[axes.index(t.axis)]
    if FOLLOWS[0] < own.real < FOLLOWS[1] and abs(own) < FOLLOWS[1]:
        return
    k = int(np.abs(t.follows).argmax())
    if -FOLLOWS[1] < own.real < -FOLLOWS[0]:
        text = (
            f"the coils of {t.axis} go against the reference: suspect the two coils or their current sensors exchanged."
        )
        yield Finding("coils-exchanged", text, t.where, Effect.ERROR)
        return
    text = f"the coils of {t.axis} do not follow the reference with the injection ({abs(own):.2f} of it)"
    if k != axes.index(t.axis) and FOLLOWS[0] < abs(t.follows[k]) < FOLLOWS[1]:
        text += f"; those of {axes[k]} do: it went into that axis, or the channels are exchanged."
    yield Finding("wrong-axis", f"{text.rstrip('.')}.", t.where, Effect.ERROR)


def _turning(t: Taken, plan: Plan) -> Iterator[Finding]:
    off = abs(t.turning / t.speed - 1) if t.speed else 0.0
    if off > plan.max_speed_error:
        yield Finding(
            "speed-off",
            f"the pulses say {t.turning * RPM:.0f} r/min, {off:.1%} off.",
            t.where,
            Effect.INDETERMINATE,
            (f"@{t.where}",),
        )


def of_results(results: Sequence[Result], plan: Plan) -> Iterator[Finding]:
    """Is the greatest value where the grid is fine, explained, coherent and independent of the amplitude? Then notes."""
    count = sum(len(r.peaks) for r in results)
    for r in results:
        if not r.peaks:
            text = "no maximum was refined: the survey found none."
            yield Finding("peak-not-refined", text, r.where, Effect.INDETERMINATE, (f"@{r.where}",))
            continue
        yield from _covered(r)
        yield from _of_modes(r)
        for p in r.peaks:
            yield from _of_peak(p, plan, UNEXPLAINED / count)
    yield from _notes(results, plan)


def _covered(r: Result) -> Iterator[Finding]:
    """No line elsewhere may be greater than the refined maximum."""
    best = r.peaks[0].top
    size, u = np.abs(r.curve.values), r.curve.u_abs
    near = np.zeros(size.size, bool)
    for p in r.peaks:
        near |= (r.curve.hz >= p.taken.response.hz[0]) & (r.curve.hz <= p.taken.response.hz[-1])
    over = np.where(near, -np.inf, size - SURE * np.maximum(u, np.median(u)) - best.value - 2 * best.u)
    k = int(over.argmax())
    if over[k] > 0 or not best.inside:
        place = (
            f"|S| is {size[k]:.2f} at {r.curve.hz[k]:.4g} Hz, outside"
            if over[k] > 0
            else f"|S| still rises at {best.at:.4g} Hz, the end"
        )
        text = f"{place} of where the grid was refined: the greatest value was not found. Survey with a finer grid."
        yield Finding("peak-not-refined", text, r.where, Effect.INDETERMINATE, (f"@{r.where}",))


def _of_modes(r: Result) -> Iterator[Finding]:
    """No bending mode may have a greater maximum between its lines, nor a circle that they do not tell."""
    best = r.peaks[0].top
    for t in (t for t in r.taken if t.kind == MODE):
        crest = mode_top(t.response, t.noise)
        if crest is None or any(abs(crest.at - p.top.at) <= p.top.width for p in r.peaks):
            continue
        if crest.value - 2 * crest.u > best.value + 2 * best.u:
            text = (f"a bending mode near {crest.at:.5g} Hz has a greater |S|, {crest.value:.2f} ± {2 * crest.u:.2f} between "
                    "its lines, and was not refined. Name it in modes_hz, with the damping it has.")  # fmt: skip
            yield Finding("peak-not-refined", text, r.where, Effect.INDETERMINATE, (f"@{r.where}",))
    for t in r.hidden:
        text = (f"lines {t.grid.step:g} Hz apart do not tell the circle of the bending mode near {t.about:.5g} Hz, by which "
                "the gain may rise less than by the other lines: how far is not told. Give the mode in modes_hz, and in "
                "mode_damping the damping that it has.")  # fmt: skip
        yield Finding("mode-not-resolved", text, r.where, Effect.INDETERMINATE, (f"gain_increase@{r.where}",))


def _of_peak(p: Peak, plan: Plan, chance: float) -> Iterator[Finding]:
    where, half = p.taken.where, p.top.width / 2
    if p.taken.grid.step > half:
        text = (f"lines stand {p.taken.grid.step:g} Hz apart at {p.top.at:.4g} Hz; half of the half-power width there is "
                f"{half:.2g} Hz: the maximum may lie between them.")  # fmt: skip
        yield Finding("grid-too-coarse", text, where, Effect.INDETERMINATE, (f"@{where}",))
    if p.model.probability < chance:
        text = (f"no model of up to four resonances explains the lines about {p.top.at:.4g} Hz (misfit "
                f"{p.model.misfit:.1f}): the loop changed while it was measured, or something else shakes it.")  # fmt: skip
        yield Finding("not-explained", text, where, Effect.INDETERMINATE, (f"@{where}",))
    if p.coherence < plan.min_coherence:
        text = (f"coherence falls to {p.coherence:.2f} at the peak ({plan.min_coherence:g} is wanted): the injection is too "
                "small for what else moves the loop. Inject more, or longer.")  # fmt: skip
        yield Finding("coherence-low", text, where, Effect.INDETERMINATE, (f"@{where}",))
    if abs(p.change) > plan.max_change and abs(p.change) > 3 * p.u_change:
        text = (f"|S| at the peak changes by {p.change:+.1%} at half the amplitude ({plan.max_change:.0%} is "
                "allowed): the loop is not linear at this injection. Inject less.")  # fmt: skip
        yield Finding("not-linear", text, where, Effect.INDETERMINATE, (f"@{where}",))


def _notes(results: Sequence[Result], plan: Plan) -> Iterator[Finding]:
    for r in results:
        if not r.peaks or "s_max" not in r.estimates:
            continue
        p, e = r.peaks[0], r.estimates["s_max"]
        half = coverage_factor(p.taken.dof) * e.u
        names = sorted({zone(e.value - half), zone(e.value + half)})
        said = (
            f"zone {names[0]}"
            if len(names) == 1
            else f"between zones {names[0]} and {names[-1]}: the interval reaches both"
        )
        up, down, angle = guaranteed_margins(e.value) if e.value > 1 else (math.inf, 0.0, 180.0)
        text = (f"|S| is greatest at {p.top.at:.4g} Hz: {e.value:.3f} ± {half:.3f} ({20 * math.log10(e.value):.1f} dB), "
                f"{said}. It guarantees gain factors of {down:.2f} and {up:.2f} and {angle:.0f}° of phase. Half-power width "
                f"{p.top.width:.3g} Hz, lines {p.taken.grid.step:g} Hz apart, least coherence {p.coherence:.3f}; "
                f"{p.change:+.2%} ± {2 * p.u_change:.2%} at half the amplitude.")  # fmt: skip
        if (top := _alone(r)) is not None:
            text += (f" One sine at a time: this is the greatest value up to {top:.4g} Hz, the highest line; a bending mode "
                     "narrower than its lines stand apart is not seen.")  # fmt: skip
        yield Finding("zone", text, r.where)
        yield from _margins(r)
        if found := [t.about for t in r.taken if t.kind == MODE and t.about not in plan.modes_hz]:
            text = (f"Lines were laid near {', '.join(f'{hz:.4g}' for hz in found)} Hz, where the scan shows a bending mode "
                    "that modes_hz does not name.")  # fmt: skip
            yield Finding("mode-not-named", text, r.where)
        if r.excluded:
            left = ", ".join(f"{hz:g}" for hz in r.excluded[:12]) + (" and more" if len(r.excluded) > 12 else "")
            yield Finding(
                "orders-excluded", f"lines beside the orders of the shaft's speed were left out: {left} Hz.", r.where
            )
    peak = max((t.peak for r in results for t in r.taken), default=0.0)
    each = max((t.grid.amplitude for r in results for t in r.taken), default=plan.amplitude_A)
    text = (f"{each * 1e3:g} mA 0-pk in each line, at most {peak * 1e3:.0f} mA together, into the differential "
            "current reference.")  # fmt: skip
    yield Finding("injection", text)
    yield Finding("scope", SCOPE)


def _alone(r: Result) -> float | None:
    """The highest line where each was injected by itself, Hz; None for combs."""
    return float(r.curve.hz[-1]) if all(t.step_hz == 0 for t in r.taken) else None


def _margins(r: Result) -> Iterator[Finding]:
    """In the field's units: degrees and decibels."""
    told = []
    if e := r.estimates.get("phase_margin"):
        told.append(f"phase margin {math.degrees(e.value):.1f}°")
    for name, words in (("gain_reduction", "the gain may fall to"), ("gain_increase", "the gain may rise to")):
        if e := r.estimates.get(name):
            told.append(f"{words} {e.value:.3g} of what it is ({20 * math.log10(e.value):+.1f} dB)")
        elif told:
            told.append(f"how far {words.removesuffix(' to')} is not resolved")
    if told:
        text = "; ".join(told)
        yield Finding("margins", f"{text[0].upper()}{text[1:]}.", r.where)


def zone(value: float) -> str:
    """A to D."""
    return "ABCD"[sum(value >= end for end in ZONES)]
