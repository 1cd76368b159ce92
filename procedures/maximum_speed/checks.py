"""What can be wrong with a run to the maximum speed, and what its data can say about it. Each check names its suspect.

Thresholds are chosen so that a sound rig trips one in fewer than one run in a thousand; each is stated where it stands.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.uncertainty import Estimate, interval
from bench.units import RPM
from procedures.maximum_speed.estimates import Result
from procedures.maximum_speed.plan import NAMES, WORDS, Plan
from procedures.maximum_speed.steps import CARRIED_A, GUARDED, NOT_CARRIED, SET_POINT, UNSTEADY, Window
from procedures.servomotor.checks import idle
from procedures.servomotor.conventions import Servomotor
from procedures.shared import signals

ALL = 0.999  # of the samples of a capture, in which the law gives all that there is
SAME = 1e-4  # of the limit: the bound told is computed in single precision from what is captured beside it, 2e-7 A off
SAME_A = 0.01  # torque current by the sensors and by the law: the amplifiers close on these sensors
SAME_SHARE = 5e-3  # of lambda
LATE_RAD = 0.02  # of the commutation: compensated, 1e-3 is left; not compensated, 0.05 at 30 rad/s
NOISE_A = 0.05  # on an amplitude: ten of a sensor's standard deviations
CONSTANT_N_m = 0.1  # one way: 1 % of a segment and 0.3 % of its sensor at 4 A
SURE = 1.5
"""In U: beyond, a speed contradicts its expectation. Four fifths of its variance is the tolerance of the inertia, which has
ends: a rectangle with a normal part of half its standard deviation is beyond 1.5 U in 4 of 10 000 runs, beyond 1.3 U in 41."""
TIME_CONSTANTS = 8.0  # J/B that a speed must have had after a change of the sharing


def of_events(recording: Recording[Plan]) -> Iterator[Finding]:
    """What the run itself met."""
    for event in recording.events(GUARDED):
        yield Finding(
            "guarded",
            f"the rotor reached {abs(event['guard']):.1f} rad/s, the speed reference that guards the run: what ends there is "
            "no maximum speed. Give a lower limit_A.", WORDS[event["sharing"]], Effect.ERROR,
        )  # fmt: skip
    for event in recording.events(UNSTEADY):
        text = f"the speed still changes by {event['change']:.2%} from one second to the next after {event['waited']:.0f} s."
        yield Finding("unsteady", text, WORDS[event["sharing"]], Effect.INDETERMINATE)
    wanted = recording.plan.carried_A
    for event in recording.events(SET_POINT):
        if wanted and event["i_y"] > wanted + CARRIED_A:
            yield Finding(
                "carried-more",
                f"the set point goes no further than {event['at'] * 1e6:.0f} µm, where i_y is {event['i_y']:.2f} A; "
                f"{wanted:.2f} A was asked for. The speeds are those with {event['i_y']:.2f} A.", "set point",
            )  # fmt: skip
    for event in recording.events(NOT_CARRIED):
        yield Finding(
            "not-carried",
            f"i_y is {event['found']:.2f} A, {event['wanted']:.2f} A was asked for: the set point ended at "
            f"{event['at'] * 1e6:.0f} µm.", "set point", Effect.ERROR,
        )  # fmt: skip


def of_windows(windows: Sequence[Window], machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    """Lost samples, contact, limits, an AMB that should be idle."""
    lost, expected = np.array([(w.lost, w.expected) for w in windows], dtype=float).T
    yield from signals.losses(lost, expected, plan.max_lost, lambda share: windows[int(np.argmax(share))].where)
    flags = np.array([w.flags for w in windows], dtype=np.int64)
    meanings = ((machine.amb_limit, "current-saturated", "an AMB amplifier was at its limit"),
                (machine.segment_limit, "current-saturated", "a segment was asked for more than its amplifier gives"),
                (machine.contact, "contact", "the rotor touched a touchdown bearing"))  # fmt: skip
    yield from signals.flagged(flags, meanings, lambda hit: windows[int(np.argmax(hit))].where)
    yield from idle([w.coils for w in windows], machine, [w.where for w in windows])


def of_law(windows: Sequence[Window], limit_A: float) -> Iterator[Finding]:
    """Whether the controller does what it was told: all the torque that T (6.19) leaves, shared as asked, within the limit."""
    below = min(windows, key=lambda w: w.told.at_bound)
    if below.told.at_bound < ALL:
        yield Finding(
            "below-bound",
            f"the law gives all the torque current that there is in {below.told.at_bound:.1%} of the samples only: the speed "
            "reference takes part, or something else asks for less.", below.where, Effect.INDETERMINATE,
        )  # fmt: skip
    yield from list(_sharing(windows)) or list(_bounds(windows, limit_A))
    yield from _currents(windows)


def _sharing(windows: Sequence[Window]) -> Iterator[Finding]:
    """A lambda that is nearer to what the other sharing makes of the same i_x and i_y."""
    for w in windows:
        told, asked, other = w.told.told_share, w.told.share, w.told.other_share
        if abs(told - asked) > max(SAME_SHARE, abs(told - other)):
            yield Finding(
                "sharing-not-switched",
                f"λ is {told:.3f} where {WORDS[w.sharing]} makes {asked:.3f} of i_x and i_y: the segments are not "
                "shared as was asked.", w.where, Effect.INDETERMINATE,
            )  # fmt: skip
            return


def _bounds(windows: Sequence[Window], limit_A: float) -> Iterator[Finding]:
    off = max(windows, key=lambda w: abs(w.told.told_bound - w.told.bound))
    if abs(off.told.told_bound - off.told.bound) > SAME * limit_A:
        yield Finding(
            "bound-differs",
            f"the law's bound is {off.told.told_bound:.4f} A where {limit_A:g} A leave {off.told.bound:.4f} A beside i_x and "
            "i_y: it has another limit, or computes another bound.", off.where, Effect.INDETERMINATE,
        )  # fmt: skip
    most = max(windows, key=lambda w: w.told.largest)
    if most.told.largest > limit_A + NOISE_A:
        text = f"a segment carries {most.told.largest:.3f} A of amplitude, {limit_A:g} A are its limit."
        yield Finding("limit-exceeded", text, most.where, Effect.INDETERMINATE)


def _currents(windows: Sequence[Window]) -> Iterator[Finding]:
    for w in windows:
        along, across = float(w.told.along.mean()), float(w.told.across.mean())
        size = math.copysign(math.hypot(along, across), along)
        if abs(size - w.told.given) > SAME_A:
            yield Finding(
                "current-differs",
                f"the segments carry {size:.3f} A of torque current, the law gives {w.told.given:.3f} A: an amplifier does not "
                "follow, or a sensor's sign or channel is another.", w.where, Effect.INDETERMINATE,
            )  # fmt: skip
            break


def of_lag(result: Result, plan: Plan) -> Iterator[Finding]:
    """Whether the currents lie along the field: late, they give less torque and another force."""
    where, lag = max(((s, x.lag) for s, x in result.of.items()), key=lambda found: abs(found[1]))
    if plan.commutation == "ahead" and abs(lag) > LATE_RAD:
        yield Finding(
            "commutation-late",
            f"the currents lie {math.degrees(lag):.1f}° of the electrical turn behind the field at "
            f"{result.of[where].speed:.0f} rad/s, {math.degrees(LATE_RAD):.1f}° are allowed: their lag is not compensated, or "
            "not by the right time.",
            WORDS[where], Effect.INDETERMINATE,
        )  # fmt: skip


def of_result(result: Result, plan: Plan) -> Iterator[Finding]:
    """Whether speeds, ratio and slope are what the facts expect."""
    shortest = TIME_CONSTANTS * result.time_constant_s
    if plan.dwell_s < shortest:
        text = (
            f"dwell_s: {plan.dwell_s:g} s are less than {TIME_CONSTANTS:g} J/B, {shortest:.1f} s: give at least that."
        )
        yield Finding("dwell-short", text, "dwell_s", Effect.INDETERMINATE)
    found = list(_contradictions(result))
    yield from found or [_agreement(result)]
    for name, e in _one_way(result).items():
        if abs(e) > CONSTANT_N_m:
            text = f"{e * 1e3:+.0f} mN m drive the rotor forward whichever way it turns ({CONSTANT_N_m * 1e3:g} mN m allowed)."
            yield Finding("direction-dependent", text, WORDS[name], Effect.INDETERMINATE)


def _contradictions(result: Result) -> Iterator[Finding]:
    e = result.estimates
    if (far := _beyond(e["ratio_apart"])) > SURE:
        expected = e["predicted_op"].value / e["predicted_half"].value
        yield Finding(
            "ratio-contradicts",
            f"the ratio of the speeds is {e['ratio'].value:.4f}, the torque currents make it {expected:.4f} "
            f"({far:.1f} U apart): the torque of the pairs of segments differs by more than their tolerance, a sensor of "
            "their currents is wrong, or the drag is not viscous.", "ratio", Effect.INDETERMINATE,
        )  # fmt: skip
    for s, name in NAMES.items():
        apart = e[f"apart_{name}"]
        if (far := _beyond(apart)) > SURE:
            share = apart.value / e[f"predicted_{name}"].value
            yield Finding(
                "speed-contradicts",
                f"{e[f'speed_{name}'].value * RPM:.1f} r/min are {share:+.1%} off what torque constant and drag make of the "
                f"torque current ({far:.1f} U): B, T_c or alpha_tau are not those of this state any more (bias, temperature, "
                "a brake), or the encoder's zero has moved.", WORDS[s], Effect.INDETERMINATE,
            )  # fmt: skip
    if (far := _beyond(e["slope_apart"])) > SURE:
        text = (f"torque over speed rises by {e['torque_slope'].value:.4f} N m s/rad from one run to the other, the spindown's "
                f"B is {result.drag.value:.4f} ({far:.1f} U apart).")  # fmt: skip
        yield Finding("slope-contradicts", text, "torque_slope", Effect.INDETERMINATE)


def _beyond(apart: Estimate) -> float:
    """How far from nothing, in U."""
    U = interval(apart).U
    return abs(apart.value) / U if U > 0 else 0.0


def _agreement(result: Result) -> Finding:
    e, said = result.estimates, []
    for s, name in NAMES.items():
        apart = e[f"apart_{name}"]
        said.append(
            f"{WORDS[s]}: {e[f'speed_{name}'].value * RPM:.1f} r/min, {apart.value / e[f'predicted_{name}'].value:+.2%} off "
            f"what the facts expect ({_beyond(apart):.2f} U)"
        )
    return Finding("speeds-as-expected", "; ".join(said) + ".", "")


def _one_way(result: Result) -> dict[str, float]:
    """Torque that drives forward whichever way the rotor turns, N m, by sharing, less what a lag makes with the encoder's zero:
    a current `across` the field that is the same in both directions gives alpha_tau sin(M gamma_0t) of torque."""
    out = {}
    for s, x in result.of.items():
        ways = {d: [w for w in x.windows if w.direction == d] for d in (1, -1)}
        speed = {d: float(np.mean([w.speed for w in found])) for d, found in ways.items()}
        current = {d: float(np.mean([d * w.segments.mean() for w in found])) for d, found in ways.items()}
        drag, per_A = result.drag.value, result.per_A.value
        across = -x.current * math.tan(x.lag)
        found = (drag * (speed[1] - speed[-1]) - per_A * (current[1] - current[-1])) / 2
        out[s] = found - per_A * math.tan(result.turned) * across
    return out
