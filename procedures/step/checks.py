"""What can be wrong with set-point steps, and what their data can say about it. Each check names its suspect."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.uncertainty import Estimate, interval
from procedures.shared import signals
from procedures.step.estimates import Result
from procedures.step.plan import Plan
from procedures.step.steps import STEP, Case, Done
from procedures.step.untold import GYROSCOPIC, OBLIQUE, OF_CASE, OF_GROUP, OF_SIZES, Why

FATAL = (
    "current-sign",
    "stuck-channel",
    "no-step",
    "wrong-axis",
    "wrong-way",
    "wrong-size",
    "sensor-clipped",
    "speed-off",
    "telemetry-too-slow",
)
# Of the rise. Two set points that far apart smear the step: the rise, 2.56 standard deviations of its slope, grows by 0.2 %
# (sqrt(1 + 2.56^2 (0.05/2)^2)), a swing of that rise shrinks by 0.04 % (cos(w d/2) at w = 1.1/rise): less than they scatter.
APART = 0.05
FEWEST_IN_RISE = 2.0  # samples; the AMB stand under its PID, whose intervals hold, has 2.5 to 2.6
CAME = 0.2  # of the step: less is no step
SIZE_OFF = 0.4  # of the step: what a stiff integrator-less loop may be off, and no more
DRIFT_S = 0.2  # in which a position before a step must not leave the band
FADING = 1.1  # from one quarter of the record to the next; less does not tell a time constant
AFTER_S = 0.1  # that a record goes on after the position has settled
ASIDE = 0.5  # of the step, that the other axis may move for good


def before(recording: Recording[Any]) -> Iterator[Finding]:
    """A speed that was not reached; steps that were not recorded."""
    for event in recording.events("not-reached"):
        yield Finding(
            "speed-not-reached",
            f"the drive was to turn the shaft at {event['wanted'] * 30 / math.pi:.0f} r/min and it turns at "
            f"{event['reached'] * 30 / math.pi:.0f} r/min: its torque does not suffice, or something holds the shaft.",
            "speed", Effect.ERROR,
        )  # fmt: skip
    if not len(recording.steps(STEP)):
        yield Finding("no-steps", "no set-point step was recorded", "", Effect.ERROR)


def of_steps(steps: Sequence[Done], plan: Plan) -> Iterator[Finding]:
    """Signals, speed, and whether the step that was asked for is the step that came."""
    coarse = list(_resolved(steps))
    yield from _signals(steps, plan)
    if not coarse:  # in one sample a rise the currents have turned round before they are seen
        yield from _kicks(steps)
    yield from _speed(steps, plan)
    yield from _came(steps)
    yield from coarse
    yield from _apart(steps)


def _apart(steps: Sequence[Done]) -> Iterator[Finding]:
    """Set points of one step that were written apart, beside the rise of its group: the shaft followed one, then the other."""
    groups: dict[str, list[Done]] = {}
    for d in steps:
        groups.setdefault(d.case.group, []).append(d)
    hit: list[tuple[Done, float]] = []
    for of in groups.values():
        rises = [n * float(np.median(np.diff(d.t))) for d in of if (n := _samples_in_rise(d)) is not None]
        worst = max(of, key=lambda d: d.apart)
        if rises and worst.apart > APART * float(np.median(rises)):
            hit.append((worst, float(np.median(rises))))
    if not hit:
        return
    worst, rise = max(hit, key=lambda h: h[0].apart)
    text = (f"the set points of a step were written up to {worst.apart * 1e3:.2g} ms apart, and it rises in {rise * 1e3:.2g} "
            "ms: the shaft followed one, then the other. Bind them to signals of one message, which the bench writes at "
            "once, or give the set points in shaft coordinates (capabilities.set_points.shaft).")  # fmt: skip
    yield Finding("set-points-apart", text, worst.case.where, Effect.INDETERMINATE, touched([d for d, _ in hit], steps))


def _resolved(steps: Sequence[Done]) -> Iterator[Finding]:
    """Samples from a tenth to nine tenths of the way, by straight lines between them: too few say nothing of the swing."""
    counts = [n for n in map(_samples_in_rise, steps) if n is not None]
    if not counts or np.median(counts) >= FEWEST_IN_RISE:
        return
    period = float(np.median(np.diff(steps[0].t)))
    text = (f"from a tenth to nine tenths of a step the telemetry has {np.median(counts):.1f} samples, {period * 1e3:.3g} ms "
            f"apart; {FEWEST_IN_RISE:g} or more are needed to tell a swing: faster telemetry, or a softer loop.")  # fmt: skip
    yield Finding("telemetry-too-slow", text, steps[0].case.where, Effect.ERROR)


def _samples_in_rise(d: Done) -> float | None:
    """None where the shaft does not go the step's way."""
    way = float(d.y[-len(d.y) // 4 :].mean())
    after = [int(np.argmax(d.y > share * way)) for share in (0.1, 0.9)]
    if way <= 0 or min(after) < 1:
        return None
    low, high = (
        k - 1 + (share * way - d.y[k - 1]) / (d.y[k] - d.y[k - 1]) for k, share in zip(after, (0.1, 0.9), strict=True)
    )
    return float(high - low)


def _signals(steps: Sequence[Done], plan: Plan) -> Iterator[Finding]:
    lost, expected = np.array([(d.lost, d.expected) for d in steps], dtype=float).T
    yield from signals.losses(lost, expected, plan.max_lost, lambda share: steps[int(np.argmax(share))].case.where)
    for channel in sorted({c for d in steps for c in d.stuck}):
        text = f"{channel} does not move at all; a live sensor has noise."
        yield Finding("stuck-channel", text, channel, Effect.ERROR)
    m = steps[0].machine
    for bits, code, effect, text in (
        (m.sensor_range, "sensor-clipped", Effect.ERROR,
         "a position sensor read beyond its range: what it shows of the swing is cut off"),
        (m.contact, "contact", Effect.INDETERMINATE,
         "the shaft touched a ring or the axial stop: the response is not that of the loop"),
        (m.current_limit, "current-saturated", Effect.INDETERMINATE,
         "a coil current was at its limit: the response is not linear"),
        (m.voltage_limit, "voltage-saturated", Effect.INDETERMINATE,
         "an amplifier's voltage was at its limit: the currents slewed, "
         "and the response is not linear; steps are too large, the supply too low or the coils' inductance too high"),
    ):  # fmt: skip
        hit = [d for d in steps if d.flags & bits]
        if hit:
            yield Finding(
                code, f"{text}, in {len(hit)} of {len(steps)} steps.", hit[0].case.where, effect, touched(hit, steps)
            )


def touched(hit: Sequence[Done], steps: Sequence[Done]) -> tuple[str, ...]:
    """What steps put in doubt: all of their setting, axis and speed, whose swing, scatter and curve are fitted together."""
    groups = {d.case.group for d in hit}
    places = (place for d in steps if d.case.group in groups for place in (d.case.group, d.case.where))
    return tuple(dict.fromkeys(f"@{place}" for place in places))


def _speed(steps: Sequence[Done], plan: Plan) -> Iterator[Finding]:
    off = [(max(abs(v - d.case.speed) for v in d.speeds) / d.case.speed, d) for d in steps if d.case.speed > 0]
    if off and (most := max(off, key=lambda o: o[0]))[0] > plan.max_speed_error:
        low, high = (v * 30 / math.pi for v in most[1].speeds)
        yield Finding(
            "speed-off",
            f"the pulses say {low:.0f} to {high:.0f} r/min during a step at {most[1].case.speed * 30 / math.pi:.0f} "
            f"r/min: the drive "
            "does not hold the speed, or pulses are missing or doubled.", most[1].case.where, Effect.ERROR,
        )  # fmt: skip
    moving = [d for d in steps if abs(d.slope) * DRIFT_S > max(plan.band * d.case.size, 4 * d.noise)]
    if moving:
        fastest = max(abs(d.slope) for d in moving) * 1e6
        yield Finding("not-at-rest", f"before {len(moving)} of {len(steps)} steps the position still moved, by {fastest:.2f} "
                      "µm/s: wait longer (record_s between steps, settle_s before the first), or start warm.",
                      moving[0].case.where, Effect.INDETERMINATE, touched(moving, steps))  # fmt: skip
    for d in steps:
        if d.case.speed == 0 and d.speeds[1] > 2:
            yield Finding("turns-at-rest", f"the shaft turned at {d.speeds[1]:.1f} rad/s in a step that was to be done at rest",
                          d.case.where, Effect.INDETERMINATE, touched([d], steps))  # fmt: skip
            return


def _kicks(steps: Sequence[Done]) -> Iterator[Finding]:
    """The first push is towards the new set point, at both bearings."""
    count = len(steps[0].kicks)
    for k in range(count):
        wrong = [
            d
            for d in steps
            if d.answered and len(d.kicks) == count and d.kicks[k] < 0 and d.y[d.t > 0.75 * d.t[-1]].mean() > 0
        ]
        if len(wrong) > len(steps) / 2:
            bearing = tuple(steps[0].machine.planes)[k] if count == 2 else "axial"
            yield Finding("current-sign", f"the {bearing} control current answers against the step, and the shaft "
                                          f"goes the right way: "
                          "the current sensors of its coils are exchanged.", wrong[0].case.where, Effect.ERROR)  # fmt: skip


def _came(steps: Sequence[Done]) -> Iterator[Finding]:
    """Where each step ended along its axis and across."""
    told: set[str] = set()
    for d in steps:
        late = d.t > 0.75 * d.t[-1]
        along, across = float(d.y[late].mean()) / d.case.size, float(d.across[late].mean()) / d.case.size
        um = f"{along * d.case.size * 1e6:+.1f} µm of {d.case.size * 1e6:g} µm"
        if abs(across) > ASIDE:
            aside = f"{across * d.case.size * 1e6:+.1f} µm"
            found = ("wrong-axis", f"{d.case.axis} moved by {um}, and the axis across by {aside}: set points, sensors or axes "
                     "are exchanged.")  # fmt: skip
        elif abs(along) < CAME:
            why = "the control current never answered: the set point was not applied"
            if d.answered:
                why = "the control current answered and the shaft did not follow: amplifiers, sensors or a rub"
            found = ("no-step", f"the position moved by {um}; {why}.")
        elif along < 0:
            found = ("wrong-way", f"the position moved by {um}: set point or sensors have the wrong sign.")
        elif abs(along - 1) > SIZE_OFF:
            found = (
                "wrong-size",
                f"the position moved by {um}: the set point is scaled, or the loop holds it loosely.",
            )
        else:
            continue
        if found[0] not in told:
            told.add(found[0])
            yield Finding(*found, d.case.where, Effect.ERROR)


def of_results(
    results: Mapping[Case, Result],
    groups: Mapping[str, Mapping[str, Estimate]],
    plan: Plan,
    *,
    leaning: bool = False,
    untold: Mapping[str, Why] = MappingProxyType({}),
) -> Iterator[Finding]:
    """Steps that do not settle, bands that noise has widened, responses without an oscillation; `untold`: why groups of steps
    tell no damping although there is one (those whose fits go astray: `untold.find_untold`)."""
    for case, result in results.items():
        if result.settled.open:
            yield Finding("not-settled", f"the position runs along the edge of the band ({result.settled.within:.1%}), so that "
                          "its noise hides whether it has settled at the end of the record: record longer, repeat more often, "
                          "take larger steps.", case.where, Effect.INDETERMINATE, (f"settling_time@{case.where}",))  # fmt: skip
        elif not math.isfinite(result.settled.time):
            yield Finding("not-settled", f"still {abs(result.error):.1%} of the step off at the end of the record "
                          f"({plan.band:.1%} is the band): {_longer(result)}.", case.where, Effect.INDETERMINATE,
                          (f"settling_time@{case.where}",))  # fmt: skip
        widest = result.settled.within
        if widest > plan.band:
            yield Finding("band-widened", f"five times the noise of the averaged position is {widest:.1%} of the "
                                          f"step; the settling "
                          f"time is that into this band, not into {plan.band:.1%}.", case.where)  # fmt: skip
    shared = {case.group for case, result in results.items() if result.shared}
    for where, estimates in groups.items():
        if where in shared:
            coupled = [f"{q}@{c.where}" for c in results if c.group == where for q in (*OF_CASE, "settling_time")]
            coupled += [f"{q}@{where}" for q in (*OF_SIZES, *OF_GROUP)]
            if leaning:  # as the rig is built: nothing is wrong with the run
                yield Finding("axes-oblique", OBLIQUE, where, concerns=tuple(coupled))
            else:
                yield Finding("gyroscopic", GYROSCOPIC, where, Effect.INDETERMINATE, tuple(coupled))
        elif untold.get(where) is Why.TORN:
            text = (
                "two oscillations share the response, and one of them is damped so heavily that it hardly swings, as where one "
                "bearing holds the shaft much more softly: damping and frequency of their mean are not told."
            )
            yield Finding("oscillations-unlike", text, where, concerns=tuple(f"{q}@{where}" for q in OF_GROUP))
        elif "damping" not in estimates and where not in untold:
            text = "no oscillation that dies away fits the response: damping and frequency are not told."
            yield Finding("no-oscillation", text, where, concerns=tuple(f"{q}@{where}" for q in OF_GROUP))


def _longer(result: Result) -> str:
    """What to do about a step that has not settled: how long to record, where what is left can be seen to fade."""
    last = min(float(o.t[-1]) for o in result.ones)
    third, fourth = (
        abs(float(np.mean([o.both[0, (o.t > a * last) & (o.t <= (a + 0.25) * last)].mean() - 1 for o in result.ones])))
        for a in (0.5, 0.75)
    )
    if third < FADING * fourth or abs(result.error) <= result.settled.within:
        return "record longer, or look at the integrator and at the controller's model"
    constant = 0.25 * last / math.log(third / fourth)
    enough = last + constant * math.log(abs(result.error) / result.settled.within) + AFTER_S
    return (f"what is left falls to 1/e in {constant:.2g} s, as an integrator takes it away; "
            f"record_s of {math.ceil(2 * enough) / 2:g} s shows it settle")  # fmt: skip


def compare(results: Mapping[Case, Result], names: tuple[str, str]) -> Iterator[Finding]:
    """One setting against the other, at the largest step upwards of each axis and speed."""
    for case, first in results.items():
        other = results.get(Case(names[1], case.speed, case.axis, case.size, case.way))
        largest = max(c.size for c in results)
        if case.setting != names[0] or other is None or case.way < 0 or case.size < largest:
            continue
        parts = [_against(q, unit, scale, first, other, names) for q, unit, scale in
                 (("overshoot", "%", 100.0), ("rise_time", "ms", 1e3), ("settling_time", "ms", 1e3))]  # fmt: skip
        where = f"{case.axis}, {case.speed * 30 / math.pi:.0f} r/min, {case.size * 1e6:g} µm up"
        yield Finding("settings-compared", "; ".join(parts) + ".", where)


def _against(quantity: str, unit: str, scale: float, a: Result, b: Result, names: tuple[str, str]) -> str:
    label = quantity.replace("_", " ")
    texts = []
    for name, r in zip(names, (a, b), strict=True):
        e = r.estimates.get(quantity)
        if e is None:
            texts.append(f"not within the record with {name}")
        else:
            texts.append(f"{scale * e.value:.3g} ± {scale * interval(e).U:.2g} {unit} with {name}")
    return f"{label} {', '.join(texts)}"
