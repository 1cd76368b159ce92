"""What can be wrong with loads on an axis, and what the data can say about it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.load_response.estimates import (
    BAND,
    COMPLIANCE,
    FRICTION,
    MOVED,
    SCALE,
    Answered,
    Result,
    Static,
    both_ways,
    named,
)
from procedures.load_response.plan import Plan
from procedures.load_response.steps import Change, Looked, Rest
from procedures.shared import signals

HELD = ("HOLDING", "MOVING")
SURE = 5.0  # standard uncertainties
UNLIKE = 0.05  # relative, of the force given over stiffness times deviation
RUBS = 0.03  # N per N of load, by which friction may grow beyond what is stated
CONSTANT = 0.05  # of friction: a constant force that is told


def of_signals(rests: Sequence[Rest], found: Sequence[Change], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing recorded, not held, losses, at the limit, not at rest, a load that nothing answers."""
    steps: list[Looked] = [*rests, *found]
    if not steps:
        yield Finding(
            "no-loads", "found no load; expected those of the plan (was the run stopped early?)", "", Effect.ERROR
        )
        return
    for s in steps:
        if other := [name for name in s.states if rig.binding.mode(name) not in HELD]:
            text = f"the controller was in {', '.join(other)}: its loops did not hold the axis."
            yield Finding("axis-not-held", text, _where(s), Effect.ERROR)
            return
    lost, expected = (np.array([float(getattr(s, key)) for s in steps]) for key in ("lost", "expected"))
    yield from signals.losses(lost, expected, plan.max_lost, lambda share: _where(steps[int(np.argmax(share))]))
    for name in dict.fromkeys(s.axis for s in steps):
        yield from _limited([s for s in steps if s.axis == name], name)
        yield from _restless([r for r in rests if r.axis == name], name, rig, plan)
        yield from _unanswered([c for c in found if c.axis == name], name)


def _where(s: Looked) -> str:
    return f"{s.axis}, {s.load_name}"


def _limited(steps: Sequence[Looked], axis: str) -> Iterator[Finding]:
    hit = [s for s in steps if s.limited > 0]
    if hit:
        worst = max(hit, key=lambda s: s.limited)
        text = (f"the loop asked for the greatest force that it may in {len(hit)} of {len(steps)} steps ({worst.limited:.1%} "
                "of the worst one): what is measured is the limit. Hang less, or move back by less.")  # fmt: skip
        yield Finding("load-limited", text, _where(worst), Effect.INDETERMINATE, (f"@{axis}",))


def _restless(rests: Sequence[Rest], axis: str, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    turns = rig.encoders[axis].measures == "angle"
    most, scale, unit = (plan.max_drift_rad, 1e3, "mrad") if turns else (plan.max_drift_m, 1e6, "µm")
    moving = [r for r in rests if r.drift > most]
    if moving:
        worst = max(moving, key=lambda r: r.drift)
        text = (f"the axis had not come to rest in {len(moving)} of {len(rests)} approaches: the reading goes on by "
                f"{worst.drift * scale:.3g} {unit}, {most * scale:.3g} {unit} allowed. Settle longer, or look at what shakes "
                "it.")  # fmt: skip
        yield Finding("axis-restless", text, _where(worst), Effect.INDETERMINATE, _static(axis, turns))


def _static(axis: str, turns: bool) -> tuple[str, ...]:
    return tuple(f"{named(name, turns)}@{axis}" for name in (COMPLIANCE, BAND, FRICTION, SCALE))


def _unanswered(found: Sequence[Change], axis: str) -> Iterator[Finding]:
    silent = [c for c in found if not c.seen]
    if silent:
        text = (f"{len(silent)} of {len(found)} loads put on or taken off moved the axis by no more than its counts: friction "
                "or a brake holds it, or nobody hung anything.")  # fmt: skip
        yield Finding("load-unanswered", text, _where(silent[0]), Effect.INDETERMINATE, (f"@{axis}",))


def of_result(r: Result, rests: Sequence[Rest], plan: Plan) -> Iterator[Finding]:
    """Axes that stick, loads on the wrong side, loads that contradict each other, loops that are no springs."""
    for s in r.statics:
        held = [*_stuck(s)]
        yield from held
        if any(f.effect is not Effect.NOTE for f in held):
            continue
        wrong = [*_sides(s)]
        yield from wrong
        if not wrong:
            yield from _contradictions(s, [x for x in rests if x.axis == s.axis.name], plan)
            yield from _constant(s)
    yield from _driven(r.answered)


def _stuck(s: Static) -> Iterator[Finding]:
    turns = s.axis.unit == "rad"
    if s.moved.min() < MOVED:
        at = int(np.argmin(s.moved))
        text = (f"moved past and back, the axis went {s.moved[at]:.0%} of the way ({MOVED:.0%} expected at least): friction "
                "or a brake holds it. Neither compliance nor friction is stated. Move further past: lead_m, "
                "lead_rad.")  # fmt: skip
        yield Finding(
            "load-stuck", text, f"{s.axis.name}, {s.loads[at].name}", Effect.INDETERMINATE, _static(s.axis.name, turns)
        )
        return
    weak = [q.name for q, used in zip(s.loads, s.used, strict=True) if not used]
    if not both_ways(s):
        text = f"{', '.join(weak)}: friction holds the axis against as much. No compliance is stated. Hang more."
        yield Finding("load-stuck", text, s.axis.name, Effect.INDETERMINATE, _static(s.axis.name, turns))
    elif weak:
        text = f"{', '.join(weak)} moved the axis by less than friction holds; what they show is not used."
        yield Finding("load-within-friction", text, s.axis.name)


def _sides(s: Static) -> Iterator[Finding]:
    """A load drives the axis in its own direction: each side by itself, against no load."""
    none = s.pairs.mean[s.force == 0].mean()
    for sign in (1, -1):
        rows = (np.sign(s.force) == sign) & s.used
        shift = float(np.mean(s.pairs.mean[rows].mean(axis=1) - none)) * sign
        if shift <= 0:
            source = next(q.source for q in s.loads if q.source is not None and q.source.sign == sign)
            text = (f"loads on {source.name} drive the axis the other way: they hang on the other side, or the encoder counts "
                    "against the rig file.")  # fmt: skip
            yield Finding("load-on-wrong-side", text, f"{s.axis.name}, {source.name}", Effect.ERROR)


def _contradictions(s: Static, rests: Sequence[Rest], plan: Plan) -> Iterator[Finding]:
    name, turns = s.axis.name, s.axis.unit == "rad"
    if len(s.by_mass) > 1:
        apart = max(s.by_mass) / min(s.by_mass) - 1
        noise = s.deviation.u / s.deviation.value * math.sqrt(2 * len(s.by_mass))
        if apart > plan.max_apart + SURE * noise:
            text = (f"compliances by each mass alone differ by {apart:.1%}, {plan.max_apart:.0%} allowed: a mass is not what "
                    "its label says, or the force bends over the load.")  # fmt: skip
            yield Finding("load-masses-differ", text, name, Effect.INDETERMINATE, _static(name, turns))
    yield from _unlike_ways(s, plan)
    kp = float(np.mean([r.stiffness for r in rests]))
    spring = -s.given.value / (kp * s.deviation.value)
    if abs(spring - 1) > UNLIKE:
        text = (f"the force that the controller gives goes by {spring:.3f} times stiffness and deviation, 1 expected: an "
                "integrator is on, or it gives less than its loop asks for.")  # fmt: skip
        yield Finding("no-spring", text, name, Effect.INDETERMINATE, _static(name, turns))
    for source, (value, u) in s.rubbed.items():
        if not turns and value > RUBS + SURE * u:
            text = (f"friction grows by {value:.1%} of the load beyond what the pulley is stated to rub with, {RUBS:.0%} "
                    "allowed: it is stiff, or its cord rubs.")  # fmt: skip
            yield Finding("pulley-rubs", text, f"{name}, {source}", Effect.INDETERMINATE, _static(name, turns))


def _unlike_ways(s: Static, plan: Plan) -> Iterator[Finding]:
    """The same masses one way and the other, against no load."""
    none = s.pairs.mean[s.force == 0].mean()
    per = [float(np.sum(s.pairs.mean[rows].mean(axis=1) - none) / np.sum(s.force[rows]))
           for sign in (1, -1) for rows in [(np.sign(s.force) == sign) & s.used]]  # fmt: skip
    apart = max(per) / min(per) - 1
    most = 3 * plan.max_apart
    if apart > most:
        text = (f"the axis is {apart:.1%} softer one way than the other, {most:.0%} allowed: a load is less than it should be "
                "on one side, or the force differs by its direction.")  # fmt: skip
        yield Finding(
            "load-ways-differ", text, s.axis.name, Effect.INDETERMINATE, _static(s.axis.name, s.axis.unit == "rad")
        )


def _constant(s: Static) -> Iterator[Finding]:
    """What acts without load; friction that differs both ways looks just like it."""
    acts = s.deviation.zero / s.deviation.value
    u = s.deviation.u_zero / s.deviation.value
    friction = float(s.pairs.half.mean()) / s.deviation.value
    if abs(acts) > SURE * u + CONSTANT * friction:
        unit = s.axis.force
        text = (f"without load {acts:+.3g} {unit} act along the axis: a tilt, a force that is constant, or friction that "
                "differs both ways; these look alike here.")  # fmt: skip
        yield Finding("constant-force", text, s.axis.name)


def _driven(answered: Sequence[Answered]) -> Iterator[Finding]:
    """A load that is put on drives the axis its own way, farther than the integrator takes it beyond on its way back."""
    for a in answered:
        if a.on and a.answers.against.mean() > a.answers.peak.mean():
            text = ("the load drove the axis the other way: it hangs on the other side, or the encoder counts against the rig "
                    "file.")  # fmt: skip
            yield Finding("load-on-wrong-side", text, a.where, Effect.ERROR)
