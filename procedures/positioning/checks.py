"""What can be wrong with readings of a reference and with the axis that they are of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.uncertainty import interval
from procedures.positioning.estimates import Result
from procedures.positioning.plan import Plan
from procedures.positioning.standard import FIGURES
from procedures.positioning.steps import Array, Taken
from procedures.positioning.targets import fewest, on_counts
from procedures.positioning.way import errors, measured_travel
from procedures.shared import signals

HELD = "HOLDING"
SLOPE = (0.8, 1.25)  # of readings over places: beyond it lies another unit, sign or axis
TREND = 4.5  # standard uncertainties of a trend
LIKE = 0.02  # of a factor between units
FACTORS = {-1.0: "it counts the other way", 1e3: "µm taken for mm, or mm for m", 1e-3: "mm taken for µm, or m for mm",
           180 / math.pi: "degrees taken for rad", math.pi / 180: "rad taken for degrees", 1e6: "µm taken for m",
           25.4: "inches", 1 / 25.4: "millimetres taken for inches", 0.0: "it does not move with it"}  # fmt: skip
SCATTERING = ("A", "A_up", "A_down", "R", "R_up", "R_down")
PLACED = ("A", "A_up", "A_down", "E", "E_up", "E_down", "M")


def concerned(t: Taken, names: Sequence[str] = FIGURES) -> tuple[str, ...]:
    """Figures of an axis, as they are measured."""
    end = "_angle" if t.tested.axis.unit == "rad" else ""
    return tuple(f"{name}{end}@{t.tested.axis.name}" for name in names)


def in_words(value: float, unit: str) -> str:
    """A length or an angle as it is read best."""
    return f"{value * 1e6:.3g} µm" if unit == "m" else f"{math.degrees(value):.3g}°"


def of_signals(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Not read, not held, losses, another unit or sign: what leaves nothing to be told."""
    for t in taken:
        name, missing = t.tested.axis.name, int(np.isnan(t.read).sum() + np.isnan(t.counted).sum())
        if missing:
            text = f"{missing} readings are missing of {2 * t.read.size} (was the run stopped early?)"
            yield Finding("approaches-missing", text, name, Effect.ERROR)
            return
        if other := [s for s in t.states if rig.binding.mode(s) != HELD]:
            yield Finding(
                "axis-not-held", f"the controller was in {', '.join(other)} while it was read.", name, Effect.ERROR
            )
            return
    lost, expected = np.array([(t.lost, t.expected) for t in taken], dtype=float).T
    yield from signals.losses(lost, expected, plan.max_lost, lambda x: taken[int(np.argmax(x))].tested.axis.name)
    for t in taken:
        yield from _disagrees(t)


def _disagrees(t: Taken) -> Iterator[Finding]:
    """What the instrument reads over what the encoder reads has a slope of 1, nearly; by medians, for one may be mistyped."""
    read, counted = (np.median(a, axis=-1) - np.median(a, axis=-1).mean() for a in (t.read, t.counted))
    square = float((counted**2).sum())
    slope = float((counted * read).sum()) / square if square else math.inf
    if SLOPE[0] < slope < SLOPE[1]:
        return
    known = min(FACTORS, key=lambda f: abs(slope - f))
    guess = f": {FACTORS[known]}?" if abs(slope - known) <= max(LIKE * abs(known), 1e-3) else "."
    text = f"{t.tested.by.instrument} goes {slope:.4g} times as far as the axis' encoder{guess}"
    yield Finding("reference-disagrees", text, t.tested.axis.name, Effect.ERROR)


def of_axes(taken: Sequence[Taken], recording: Recording[Plan]) -> Iterator[Finding]:
    """What makes figures doubtful: motion, far readings, trends, warming, targets."""
    plan = recording.plan
    for t in taken:
        yield from _rest(t, plan)
        yield from _far(t, plan)
        yield from _trend(t)
        yield from _coarse(t, plan)
        yield from _targets(t, plan)
        yield from _warming(t, plan, recording)


def _rest(t: Taken, plan: Plan) -> Iterator[Finding]:
    one, unit = t.tested, t.tested.axis.unit
    may = (plan.rest_counts + 0.5) * one.pitch  # half a count beside what was read again for
    if not may:
        return
    if (count := int((t.moved > may).sum())) > 0:
        most = in_words(float(np.nanmax(t.moved)), unit)
        text = (f"before {count} of {t.moved.size} readings it moved by up to {most} within "
                f"{plan.rest_s:g} s, {in_words(may, unit)} allowed. Dwell longer.")  # fmt: skip
        yield Finding("axis-not-at-rest", text, one.axis.name, Effect.INDETERMINATE, concerned(t))
    went = np.abs(t.counted - t.before)
    if (count := int((went > may).sum())) > 0:
        text = (f"in {count} of {went.size} readings it stood up to {in_words(float(np.nanmax(went)), unit)} elsewhere than "
                f"before, {in_words(may, unit)} allowed: touched, pushed, or not yet at rest.")  # fmt: skip
        yield Finding("moved-while-read", text, one.axis.name, Effect.INDETERMINATE, concerned(t))


def scatter(t: Taken) -> tuple[Array, float]:
    """Deviations less the median of their cell, and their standard deviation by the median of their size."""
    deviations = t.read - t.tested.at[None, :, None]
    off = deviations - np.median(deviations, axis=-1, keepdims=True)
    n = t.read.shape[-1]
    return off, 1.4826 * float(np.median(np.abs(off))) * math.sqrt(n / (n - 1))


def _far(t: Taken, plan: Plan) -> Iterator[Finding]:
    """A reading that was mistyped, or taken of another place: beside the others, and beside the encoder."""
    off, s = scatter(t)
    counted = t.counted - t.tested.at[None, :, None]
    beside = off - (counted - np.median(counted, axis=-1, keepdims=True))
    may = plan.far * math.hypot(s, errors(t.tested.by).reading) + 2 * t.tested.pitch
    far = (np.abs(off) > may) & (np.abs(beside) > may)
    if far.any():
        worst = np.unravel_index(int(np.argmax(np.abs(np.where(far, off, 0.0)))), off.shape)
        most, way = in_words(float(abs(off[worst])), t.tested.axis.unit), ("below", "above")[int(worst[0])]
        text = (f"{int(far.sum())} readings stand up to {most} from the others at their target, and the encoder knows nothing "
                "of it: mistyped, or read of something else? The farthest is "
                f"approach {int(worst[2]) + 1} to target {int(worst[1]) + 1} from {way}.")  # fmt: skip
        yield Finding("readings-far", text, t.tested.axis.name, Effect.INDETERMINATE, concerned(t))


def trend(t: Taken) -> tuple[float, float]:
    """Of readings within their cells over time, m/s or rad/s, beside what goes with the encoder's: how the axis itself comes to
    rest is no trend of the instrument. And its standard uncertainty."""
    x, *columns = ((a - a.mean(axis=-1, keepdims=True)).ravel() for a in (t.read, t.times, t.counted))
    matrix = np.stack([c / np.ptp(c) for c in columns if np.ptp(c) > 0], axis=1)
    found, _, rank, _ = np.linalg.lstsq(matrix, x, rcond=None)
    left = x - matrix @ found
    dof = x.size - t.read.shape[0] * t.read.shape[1] - int(rank)
    u = math.sqrt(float(left @ left) / dof * float(np.linalg.pinv(matrix.T @ matrix)[0, 0]))
    whole = float(np.ptp(columns[0]))
    return float(found[0]) / whole, u / whole


def _trend(t: Taken) -> Iterator[Finding]:
    if t.read.shape[-1] < 3:
        return
    slope, u = trend(t)
    drift, unit = t.tested.by.drift, t.tested.axis.unit
    may = 0.0 if drift is None else (drift.half_width or 2 * drift.standard_uncertainty)
    if abs(slope) > may + TREND * u:
        whole = float(np.ptp(t.times))
        text = (f"readings wander by {in_words(slope * whole, unit)} in {whole:.0f} s ({in_words(u * whole, unit)} standard "
                f"uncertainty), {in_words(may * whole, unit)} stated of {t.tested.by.instrument}: it, its mount or the machine "
                "warms. All of it is in R and A.")  # fmt: skip
        yield Finding("readings-trend", text, t.tested.axis.name, Effect.INDETERMINATE, concerned(t))


def _coarse(t: Taken, plan: Plan) -> Iterator[Finding]:
    """s by noise alone is as large as s by the axis where it is hidden; a mean square of 2 m (n - 1) numbers tells it well."""
    s = math.sqrt(float(t.read.var(axis=-1, ddof=1).mean()))
    noise = errors(t.tested.by).reading
    if noise > plan.max_noise * s:
        unit = t.tested.axis.unit
        share = noise / s if s else math.inf
        text = (f"noise and rounding of {t.tested.by.instrument}, {in_words(noise, unit)}, are {share:.0%} of the "
                f"scatter that it reads, {in_words(s, unit)}: R is the instrument's too. Take a finer one.")  # fmt: skip
        yield Finding("reference-coarse", text, t.tested.axis.name, Effect.INDETERMINATE, concerned(t, SCATTERING))


def _targets(t: Taken, plan: Plan) -> Iterator[Finding]:
    one = t.tested
    if (count := on_counts(one.at, one.pitch)) * 2 > len(one.at):
        text = f"{count} of {len(one.at)} targets are whole counts: what its encoder rounds away does not show."
        yield Finding("targets-on-counts", text, one.axis.name, Effect.INDETERMINATE, concerned(t))
    low, high = (
        (float(one.at[0]), float(one.at[-1])) if plan.targets_m or plan.targets_rad else measured_travel(plan, one.axis)
    )
    asked = fewest(one.axis.unit, high - low)
    if len(one.at) < asked or plan.repeats < 5:
        text = (f"{len(one.at)} targets, {plan.repeats} approaches each way; ISO 230-2 asks for {asked} and 5: these are no "
                "figures of an acceptance test.")  # fmt: skip
        yield Finding("targets-fewer", text, one.axis.name)


def _warming(t: Taken, plan: Plan, recording: Recording[Plan]) -> Iterator[Finding]:
    if t.tested.by.temperature:
        low, high = float(np.nanmin(t.warm)), float(np.nanmax(t.warm))
        text = f"{t.tested.by.temperature} goes from {low - 273.15:.2f} to {high - 273.15:.2f} °C"
        if high - low > plan.max_warming_K:
            text = f"{text}, {plan.max_warming_K:g} K allowed. Wait until it is even, or measure faster."
            yield Finding("axis-warms", text, t.tested.axis.name, Effect.INDETERMINATE, concerned(t))
        else:
            yield Finding("axis-warmth", f"{text}. Figures are those at that temperature.", t.tested.axis.name)
        return
    hot = {n: c for n, c in recording.rig.channels.items() if c.unit in ("K", "degC", "°C")}
    text = "the rig file names no temperature of what carries the axis; figures are those of the run, whatever it was."
    if hot:
        text = f"{text} Recorded: {', '.join(hot)}."
    yield Finding("axis-warmth", text, t.tested.axis.name)


def of_results(results: Sequence[Result]) -> Iterator[Finding]:
    """U by our draws, and as the technical report has it."""
    for r in results:
        scale = 1e6 if r.unit == "m" else 180 / math.pi
        name = "µm" if r.unit == "m" else "°"
        each = ", ".join(
            f"{f} {interval(r.estimates[f]).U * scale:.3g} and {r.reported[f] * scale:.3g}"
            for f in ("A", "R", "E", "M", "B")
        )
        text = f"U by draws, and by sums in squares as ISO/TR 230-9 has them: {each} {name}. The former counts."
        yield Finding("uncertainty-both", text, r.name)
