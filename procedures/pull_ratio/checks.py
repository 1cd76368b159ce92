"""What can be wrong with the levels, and what their data can say about it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.rigfile.places import PlaceError, Places
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import interval
from procedures.position_loops import recorded
from procedures.pull_ratio.estimates import CONSTANT, LEVER, RATIO, TURN, Result
from procedures.pull_ratio.plan import Plan
from procedures.pull_ratio.planes import planes
from procedures.pull_ratio.steps import Taken
from procedures.shared import signals

APART = 3.0  # standard uncertainties: two rectangular gains end at 2.4 of theirs together
SURE = 5.0  # standard uncertainties of noise beside what is allowed
AGAINST = math.pi / 2
DEG = 180 / math.pi
OTHER = 0.2  # of the slope with both planes moved, that the other plane's reading may have


def of_signals(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """No levels, none captured, not levitated, losses, loops at their limit, readings that are not at their set points."""
    if not taken:
        yield Finding("no-levels", "found no level; expected those of the plan (was the run stopped early?)", "",
                      Effect.ERROR)  # fmt: skip
        return
    missing = [t for t in taken if t.readings is None]
    if (told := recorded.not_captured("level-not-captured", "levels", missing, len(taken))) is not None:
        yield told
        return
    if (told := recorded.not_held(((t.where, t.states) for t in taken), rig)) is not None:
        yield told
        return
    yield from signals.losses_of(taken, plan.max_lost)
    if hit := [t for t in taken if t.limited > 0]:
        worst = max(hit, key=lambda t: t.limited)
        text = (f"a loop was at its limit in {len(hit)} of {len(taken)} levels ({worst.limited:.1%} of the time in the worst). "
                "Go less far: levels_m.")  # fmt: skip
        yield Finding("loop-limited", text, worst.where, Effect.INDETERMINATE)
    far = max(taken, key=lambda t: t.off)
    if far.off > plan.max_position_m:
        count = sum(t.off > plan.max_position_m for t in taken)
        text = (f"a mean reading is {far.off * 1e6:.3g} µm off its set point, {plan.max_position_m * 1e6:.3g} µm allowed; "
                f"{count} of {len(taken)} levels. Settle longer, or look at the integrator.")  # fmt: skip
        yield Finding("unsettled", text, far.where, Effect.INDETERMINATE)


def of_result(r: Result, taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Signs, planes that are linked, ways that differ, levels off the line, axes and levers that do not fit, the frame."""
    wrong = [*_signs(r), *_linked(r)]
    yield from wrong
    if wrong:
        return
    yield from _line(r, taken, plan)
    yield from _unlike(r, rig)
    yield from _levers(r, rig)
    yield from _frames(r, rig)
    yield from _constants(r, rig)


def _signs(r: Result) -> Iterator[Finding]:
    for s in r.slopes:
        if abs(s.turn) > AGAINST:
            text = (f"the current goes {s.turn * DEG:.0f}° beside what holds the shaft against a pull: the sign of a probe or "
                    "of a current is exchanged, or the magnets do not pull.")  # fmt: skip
            yield Finding("wrong-sign", text, s.loop, Effect.ERROR)


def _linked(r: Result) -> Iterator[Finding]:
    """Bearing planes and probes' planes lie on the same side of the middle: r > 0, and other beside own is (1 - r)/(1 + r)."""
    for s in r.slopes:
        if abs(s.other) > OTHER * abs(s.own + s.other):
            text = (f"the current goes by {s.other / (s.own + s.other):.0%} with the other plane's place: actuators or probes "
                    "of both planes are exchanged.")  # fmt: skip
            yield Finding("planes-linked", text, s.loop, Effect.ERROR)


def _line(r: Result, taken: Sequence[Taken], plan: Plan) -> Iterator[Finding]:
    """Means over all levels of what is left from below less from above, and of all that is left."""
    ways = np.array([t.level.branch for t in taken])
    few = 1 / max(int((ways > 0).sum()), 1) + 1 / max(int((ways < 0).sum()), 1)
    for s in r.slopes:
        left = r.statics.left[:, 2 * s.plane : 2 * s.plane + 2] @ s.direction
        above, below = left[ways < 0], left[ways > 0]
        apart = float(below.mean() - above.mean())
        noise = math.sqrt((float(above.var(ddof=1)) + float(below.var(ddof=1))) / 2)
        if abs(apart) > plan.max_ways_A + SURE * noise * math.sqrt(few):
            text = (f"the current is {apart * 1e3:.3g} mA greater from below than from above, {plan.max_ways_A * 1e3:.3g} mA "
                    "allowed: friction, hysteresis, or levels that have not settled.")  # fmt: skip
            yield Finding("ways-differ", text, s.loop, Effect.INDETERMINATE)
        if noise > plan.max_misfit_A:
            text = (f"mean currents are {noise * 1e3:.3g} mA off a straight line, {plan.max_misfit_A * 1e3:.3g} mA allowed: "
                    "the pull bends, or something else moves the shaft.")  # fmt: skip
            yield Finding("misfit", text, s.loop, Effect.INDETERMINATE)


def _unlike(r: Result, rig: RigFile) -> Iterator[Finding]:
    """One actuator's magnets pull alike along both of its axes: what differs is gains, known to their tolerance."""
    for p in planes(rig):
        one, other = (r.estimates[RATIO, loop] for loop in p.loops)
        apart = one / other - 1.0
        if abs(apart.value) > APART * apart.u:
            text = (f"along {p.loops[0]} it differs by {apart.value:+.2%} from that along {p.loops[1]}; gains of probes and "
                    f"coils allow {APART * apart.u:.2%}: a gain is off, or the rotor is not alike all around.")  # fmt: skip
            concerns = tuple(f"{RATIO}@{loop}" for loop in p.loops)
            yield Finding("axes-unlike", text, p.name, Effect.INDETERMINATE, concerns)


def _levers(r: Result, rig: RigFile) -> Iterator[Finding]:
    """Whether what both planes' readings tell of each plane is what the rig file states: they stand where they should."""
    stated = lever(rig)
    if stated is None:
        return
    found, (value, most) = r.estimates[LEVER, ""], stated
    if abs(found.value - value) > most + SURE * found.u:
        text = (f"the actuators' planes are {found.value:.4f} times as far apart as the probes', {value:.4f} is stated, off by "
                f"{most:.4f} at most: does each probe read its own plane?")  # fmt: skip
        yield Finding("levers-off", text, "", Effect.INDETERMINATE)


def lever(rig: RigFile) -> tuple[float, float] | None:
    """Distance of the actuators' planes over that of the probes', by the rig file, and how far it may be off."""
    names = {probe.channel: name for name, probe in rig.probes.items()}
    first, second = planes(rig)
    try:
        probes = [f"probes/{names[p.system.axes[0]]}" for p in (first, second)]
        both = [Places(rig).distance(f"motors/{first.name}", f"motors/{second.name}"), Places(rig).distance(*probes)]
    except (PlaceError, KeyError):
        return None
    off = sum(abs(t.factor) * wide(t.number) / abs(x.value) for x in both for t in x.terms)
    value = both[0].value / both[1].value
    return value, abs(value) * off


def wide(stated: Toleranced) -> float:
    """How far a number may be off: its half width, or twice its standard uncertainty."""
    return stated.half_width if stated.half_width is not None else 2 * stated.standard_uncertainty


def _frames(r: Result, rig: RigFile) -> Iterator[Finding]:
    for p in planes(rig):
        one = rig.capabilities.force_currents.get(p.name)
        if one is None:
            continue
        found, stated, most = interval(r.estimates[TURN, p.name]), one.stated.value, wide(one.stated)
        if found.low <= stated + most and found.high >= stated - most:
            continue
        value = r.estimates[TURN, p.name].value
        text = (f"the currents are laid {value * DEG:.2f}° electrical beside the probes' axes, {most * DEG:.3g}° are stated of "
                f"the encoder's zero. Along an axis alone the ratio would read {1 - math.cos(value):.2%} less.")  # fmt: skip
        yield Finding("frame-turned", text, p.name, Effect.NOTE)


def _constants(r: Result, rig: RigFile) -> Iterator[Finding]:
    """Both planes' together, against what the rig file states of each."""
    hold = rig.capabilities.hold
    for (name, axis), estimate in r.estimates.items():
        if name != CONSTANT or hold is None:
            continue
        low, high = hold.force.value - wide(hold.force), hold.force.value + wide(hold.force)
        found = interval(estimate)
        if found.low > high or found.high < low:
            text = (f"{estimate.value:.4g} N/A follows from the pole and the ratios; the rig file states {low:.4g} to "
                    f"{high:.4g}: gains of the probes, the mass or the pole are off.")  # fmt: skip
            yield Finding("constant-off", text, axis, Effect.INDETERMINATE)
