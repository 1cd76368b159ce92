"""What can be wrong with the constants of actuators, and what their data can say about it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.actuator_constant.estimates import Looked, Result
from procedures.actuator_constant.plan import Plan
from procedures.actuator_constant.steps import Added, Common, Taken
from procedures.position_loops import recorded
from procedures.position_loops.motors import around, inertia, motors
from procedures.shared import signals

OFF = 0.05  # share by which the captured sine may differ from what was asked for
SUM_OFF = 0.03  # by which a motor's current may differ from what its coils carry
NOISE = 5.0  # standard uncertainties beside that
UNEXPLAINED = 1e-4  # chance that a sound run's lines lie so far off their curve, all its curves together
APART = 4.0  # standard uncertainties that constants of two places may lie apart


def of_signals(taken: Sequence[Taken], added: Sequence[Added], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing injected or captured, not levitated, another sine than was asked for, loops at their limit, losses."""
    if not taken:
        yield Finding("no-sines", "no sine was injected; expected those of the plan (was the run stopped early?)", "",
                      Effect.ERROR)  # fmt: skip
        return
    missing = [t for t in taken if not t.position.size]
    if (told := recorded.not_captured("sine-not-captured", "sines", missing, len(taken))) is not None:
        yield told
        return
    steps = [(t.where, t.common) for t in taken] + [(f"{a.common.loop}, {a.size:+g} A added", a.common) for a in added]
    if (told := recorded.not_held(((where, common.states) for where, common in steps), rig)) is not None:
        yield told
        return
    lost, expected = np.array([(c.lost, c.expected) for _, c in steps], dtype=float).T
    yield from signals.losses(lost, expected, plan.max_lost, lambda share: steps[int(np.argmax(share))][0])
    for t in taken:
        if abs(t.wave - 1) > OFF:
            text = (f"the captured sine has {t.wave:.3g} of the amplitude asked for: another frequency, or none. Look at the "
                    "rig file's capabilities.loop_injection.")  # fmt: skip
            yield Finding("sine-wrong", text, t.where, Effect.ERROR)
            break
    yield from _limited(steps, rig)
    yield from _coils(taken)


def _limited(steps: Sequence[tuple[str, Common]], rig: RigFile) -> Iterator[Finding]:
    """A loop at its limit still moves as its current says; but it is no sine any more, and may be about to let go."""
    hit = [(where, c) for where, c in steps if c.limited > 0]
    for loop in dict.fromkeys(c.loop for _, c in hit):
        some = [(where, c) for where, c in hit if c.loop == loop]
        worst, share = max(((w, c.limited) for w, c in some), key=lambda x: x[1])
        text = (f"the loop was at its limit in {len(some)} steps ({share:.1%} of the time in the worst). Inject less: share, "
                "counts or amplitude; or add less: added_A.")  # fmt: skip
        yield Finding("loop-limited", text, worst, Effect.INDETERMINATE, _concerned(rig, loop))


def _concerned(rig: RigFile, loop: str) -> tuple[str, ...]:
    name = "K_torque" if around(rig, loop) else "K_force"
    return (*(f"{name}@{motor}" for motor in motors(rig, loop)), f"@{loop}")


def _coils(taken: Sequence[Taken]) -> Iterator[Finding]:
    """A symmetric winding's current is sqrt(2/n) times the root of its coils' squares."""
    for t in taken:
        for name, coils in t.coils.items():
            along, (said, u) = float(np.linalg.norm(coils)) * math.sqrt(2 / coils.size), t.said[name]
            if abs(along - said) > SUM_OFF * said + NOISE * u:
                text = (f"the current of {name} is {said:.3g} A, its coils carry {along:.3g} A: another coil, or one that "
                        "is read wrongly.")  # fmt: skip
                yield Finding("currents-disagree", text, t.where, Effect.ERROR)
                return


def of_results(results: Sequence[Result], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Lines lost in noise or off their curve, places that disagree."""
    count = sum(len(r.looked) + len(r.ringed) for r in results)
    for r in results:
        for x in (*r.looked, *r.ringed):
            yield from _shown(r.loop, x, rig, plan)
            yield from _explained(r.loop, x, count, rig)
        yield from _agree(r, r.looked, rig)
        yield from _agree(r, r.ringed, rig)
        yield from _with_ring(r, rig)


def _shown(loop: str, x: Looked, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    lost = [one for one in x.lines if abs(one.ratio) < plan.min_signal * one.u]
    if lost:
        worst = min(lost, key=lambda one: abs(one.ratio) / one.u)
        text = (f"{len(lost)} lines are lost in noise: {abs(worst.ratio) / worst.u:.2g} standard uncertainties in the "
                f"worst, {plan.min_signal:g} wanted. Does its channel show this loop and this current?")  # fmt: skip
        yield Finding("loop-not-shown", text, f"{loop}, {x.place.name}, {worst.hz:.4g} Hz", Effect.INDETERMINATE,
                      _concerned(rig, loop))  # fmt: skip


def _explained(loop: str, x: Looked, count: int, rig: RigFile) -> Iterator[Finding]:
    found = x.response.fit
    if found.p_value < UNEXPLAINED / max(count, 1):
        text = (f"the lines are off the curve of a mass by more than their noise, chi-squared {found.chi2:.3g} of {found.dof} "
                "degrees of freedom: something springs or slips, or the loop changed meanwhile.")  # fmt: skip
        yield Finding("misfit", text, f"{loop}, {x.place.name}", Effect.INDETERMINATE, _concerned(rig, loop))


def _agree(r: Result, looked: Sequence[Looked], rig: RigFile) -> Iterator[Finding]:
    """A constant is none of the place; a coil that is reversed, or read wrongly, makes it one."""
    for motor in motors(rig, r.loop) if looked else ():
        first, *others = [(x.place.name, x.constants[motor]) for x in looked]
        for name, other in others:
            apart = other - first[1]
            if abs(apart.value) > APART * apart.u:
                text = (f"the constant at {name} differs by {other.value / first[1].value - 1:+.2%} from that at {first[0]}, "
                        f"more than {APART:g} standard uncertainties: a coil is reversed or read wrongly.")  # fmt: skip
                yield Finding("places-disagree", text, motor, Effect.INDETERMINATE, _concerned(rig, r.loop))
                return


def _with_ring(r: Result, rig: RigFile) -> Iterator[Finding]:
    """Nothing but the inertia may have changed: what pulls back at a place takes the current it took. And the inertia by the
    ring is the rig file's, or one of them is wrong: another ring, one that slips."""
    concerned = (*_concerned(rig, r.loop), f"inertia@{r.loop}")
    for bare, ringed in zip(r.looked, r.ringed, strict=False):
        (was, u), (now, v) = ((x.response.slope, math.sqrt(x.response.covariance[1, 1])) for x in (bare, ringed))
        if abs(now - was) > APART * math.hypot(u, v):
            text = (f"what pulls back there takes {now:.4g} A/rad with the ring on, {was:.4g} A/rad without, more apart than "
                    f"{APART:g} standard uncertainties: not the inertia alone is another.")  # fmt: skip
            yield Finding("changed-with-ring", text, f"{r.loop}, {bare.place.name}", Effect.INDETERMINATE, concerned)
            break
    if not r.inertias:
        return
    found, stated = r.estimates["inertia", r.loop], inertia(rig, r.loop)
    reach = tolerance(stated)
    if abs(found.value - stated.value) > reach + APART * found.u:
        text = (f"the ring gives {found.value:.5g} kg m^2, the rig file {stated.value:.5g} ± {reach:.2g} kg m^2: another ring, "
                "one that slips or does not sit, or another mover.")  # fmt: skip
        yield Finding("inertia-contradicted", text, r.loop, Effect.INDETERMINATE, concerned)


def tolerance(stated: Estimate) -> float:
    """How far a stated value may be off: half the width of its interval, all of it where that has ends."""
    rectangular = all(i.distribution == "rectangular" for i in stated.sensitivities)
    return stated.u * (math.sqrt(3) if rectangular else 2.0)
