"""What wiring can be wrong in, as findings: each says which cable to look at."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from procedures.coil_map import decode, winding
from procedures.coil_map.estimates import Pushed, Result
from procedures.coil_map.plan import Plan
from procedures.coil_map.steps import WAYS

DEAD = 0.5  # of its share, below which a coil carries nothing
ELSEWHERE = 0.05  # of a pulse, in a coil that its system does not have
APART = 0.03  # by which two sensors of one current may differ, beside so many standard uncertainties
SURE = 9.0  # noise of a loop is not white: twice 4.5
STAR = 0.05  # of a pulse: what a star's currents may sum up to
CROSS = 0.06  # A of a bearing current that 1 A of torque current along d may push like
EXPLAINS = 0.7  # of what a sound winding leaves, at most, that a coil must leave
TURNED = 0.6  # rad, electrical, that the mover may turn while a push goes around
ALONG = 0.35  # of what q moves, that d may
MOVES = 10e-6  # that a turned push moves its plane by at least
CABLE = "Look at the cable of"


def _wrong(code: str, text: str, where: str, effect: Effect = Effect.ERROR) -> Finding:
    return Finding(code, text, where, effect)


def of_flow(r: Result, plan: Plan) -> Iterator[Finding]:
    """Pulses in which nothing flowed."""
    for name in r.can.systems:
        for way in WAYS:
            if (name, way) not in r.rows:
                text = (f"in no pulse of {name} along {way} a current flowed in its coils: the parameter does not reach the "
                        "current loops, or they are off.")  # fmt: skip
                yield _wrong("current-not-stepped", text, name)


def of_currents(r: Result, plan: Plan) -> Iterator[Finding]:
    """Whether each coil carries what it should."""
    open_ = list(_stars(r))
    if open_:
        yield from open_
        return
    dead = [c for c in r.can.coils if abs(r.coils[c]) < DEAD]
    for coil in dead:
        text = (f"coil {coil} carries {r.coils[coil]:.2f} of what it is asked for: its circuit is open, or its sensor is dead. "
                f"{CABLE} {coil}, its star point, its half-bridge.")  # fmt: skip
        yield _wrong("coil-dead", text, coil)
    if dead:
        return
    yield from _elsewhere(r)
    for (name, way), (along, across) in zip(r.rows, r.read, strict=True):
        if abs(along - 1) > plan.max_off or abs(across) > plan.max_off:
            text = (f"of 1 A along {way} of {name} the controller has {along:.2f} A along and {across:+.2f} A across: its "
                    "loops do not reach what they are told.")  # fmt: skip
            yield _wrong("current-not-followed", text, name)
    for coil in r.can.coils:
        own, (bridge, u) = r.coils[coil], r.bridges.get(coil, (math.nan, math.nan))
        if abs(own - bridge) > APART + SURE * u:
            which = coil if abs(own - 1) > APART / 2 else r.can.bridges[coil]  # the loops go by the coil's own
            text = (f"of what coil {coil} is asked for its own sensor reads {own:.3f}, that of its half-bridge {bridge:.3f}: "
                    f"one of them is wrong, rather {which}. Compare their gains.")  # fmt: skip
            yield _wrong("current-sensors-disagree", text, coil, Effect.INDETERMINATE)
        elif abs(own - 1) > plan.max_off:
            text = f"coil {coil} carries {own:.3f} of what it is asked for ({plan.max_off:.0%} is allowed). {CABLE} {coil}."
            yield _wrong("coil-share-off", text, coil, Effect.INDETERMINATE)


def _stars(r: Result) -> Iterator[Finding]:
    names = list(r.can.coils)
    open_ = [star for star in r.can.stars
             if float(np.nanmax(np.abs(r.found[:, [names.index(c) for c in star]].sum(axis=1)))) > STAR]  # fmt: skip
    if not open_:
        return
    pair = decode.across_stars(r.can, r.expected, r.found)
    if pair is None and any(abs(r.coils[c] - b) > APART + SURE * u for c, (b, u) in r.bridges.items()):
        return  # a sensor of one coil, which is told below
    which = (f"The cables of {pair[0]} and {pair[1]} exchanged would make it so." if pair
             else "A current leaks, or more than two cables are exchanged.")  # fmt: skip
    stars = "; ".join(", ".join(star) for star in open_)
    text = f"currents of coils that end in one star do not add up to nothing ({stars}). {which}"
    yield _wrong("stars-do-not-close", text, pair[0] if pair else open_[0][0])


def _elsewhere(r: Result) -> Iterator[Finding]:
    for (name, way), row in zip(r.rows, r.found, strict=True):
        far = {c: x for c, x in zip(r.can.coils, row, strict=True)
               if c not in r.can.systems[name].coils and abs(x) > ELSEWHERE}  # fmt: skip
        if far:
            each = ", ".join(f"{c} {x:+.2f} A" for c, x in far.items())
            text = f"1 A along {way} of {name} flows in coils that it does not have, too: {each}. {CABLE} these."
            yield _wrong("current-elsewhere", text, name)


def of_pushes(r: Result, plan: Plan) -> Iterator[Finding]:
    """Whether every radial system moves its own plane, the right way and as hard in every direction."""
    home = {name: p.most for name, p in r.pushed.items()}
    if moved := {n: m for n, m in home.items() if n != m and r.pushed[n].far[m] > MOVES}:
        each = "; ".join(f"{n} moves {', '.join(r.can.systems[m].axes)}" for n, m in moved.items())
        both = all(home.get(m) == n for n, m in moved.items())
        cables = " and ".join(f"{_span(r, n)}" for n in moved)
        text = (f"a bearing current moves another plane than its own: {each}. "
                + (f"The actuators are exchanged, or their probes: look at the cables of {cables}." if both
                   else "Look at the cables of these coils and of these probes."))  # fmt: skip
        yield _wrong("actuators-exchanged", text, next(iter(moved)))
    for name, p in r.pushed.items():
        if p.far[p.most] < MOVES:
            text = (f"{plan.around_A:g} A of {name}, turned around, move the mover by {p.far[p.most] * 1e6:.1f} µm: nothing "
                    "pushes. Look whether it is free in its rings, and at its probes.")  # fmt: skip
            yield _wrong("nothing-moves", text, name)
        else:
            yield from _of_push(r, name, p, plan)


def _span(r: Result, name: str) -> str:
    coils = list(r.can.systems[name].coils)
    return f"{coils[0]} to {coils[-1]}"


def _of_push(r: Result, name: str, p: Pushed, plan: Plan) -> Iterator[Finding]:
    bowl, system = p.bowl, r.can.systems[name]
    cross = math.hypot(*bowl.m)
    if bowl.roundness < plan.min_round or cross > CROSS or p.turned > TURNED:
        yield _of_coil(r, name, p)
    elif bowl.mirrored:
        pairs = decode.exchanged_phases(system, bowl.angle, float(p.tour.phi.mean()))
        each = ", ".join(f"{a} and {b}" for a, b in pairs)
        text = (f"what {name} pushes turns the other way than its current: two phases are exchanged, and no current shows it. "
                f"Exchange the cables of {each}. {_probe(system.axes)}")  # fmt: skip
        yield _wrong("phases-exchanged", text, name)
    elif abs(bowl.angle) > math.pi - plan.max_angle_rad:
        text = (f"{name} pushes the opposite way: every coil of it ({_span(r, name)}) is connected the other way round, or "
                f"{' and '.join(system.axes)} read with the wrong sign.")  # fmt: skip
        yield _wrong("system-reversed", text, name)
    elif abs(bowl.angle) > plan.max_angle_rad:
        text = (f"what {name} pushes stands {math.degrees(bowl.angle):+.0f}° (electrical) from where it should: the cables of "
                f"{_span(r, name)} are moved on in a ring, or the zero of the angle is off by as much.")  # fmt: skip
        yield _wrong("push-turned", text, name)


def _of_coil(r: Result, name: str, p: Pushed) -> Finding:
    """One coil that gives less force than the others, or the opposite one, if that explains where the mover lay."""
    coil, gives, left, sound = decode.weak_coil(r.can, p.tour, p.places)
    shown = (f"{name} pushes {p.bowl.roundness:.2f} as hard in one direction as in the other, 1 A of torque current along d "
             f"pushes like {math.hypot(*p.bowl.m):.2f} A of it, and the mover turned by {math.degrees(p.turned):.0f}° "
             "(electrical)")  # fmt: skip
    if left > EXPLAINS * sound:
        text = (f"{shown}: no single coil explains that well, {coil} best. {CABLE} {coil}, then at those of {_span(r, name)}, "
                "and whether the mover is free.")  # fmt: skip
        return _wrong("pushes-unexplained", text, name)
    what = "is connected the other way round" if gives < -0.4 else f"gives some {gives:.0%} of its force"
    text = f"{shown}: coil {coil} {what} (leaves {left * 1e6:.1f} µm, a sound winding {sound * 1e6:.1f} µm). {CABLE} {coil}."
    return _wrong("coil-reversed" if gives < -0.4 else "coil-weak", text, coil)


def _probe(axes: Sequence[str]) -> str:
    return f"A probe that reads with the wrong sign ({' or '.join(axes)}) looks the same."


def of_turns(r: Result, plan: Plan, explained: bool) -> Iterator[Finding]:
    """Whether a torque current turns and a thrust moves along, the right way, and that along d neither; `explained` where
    what carries the torque pushes wrongly as well."""
    for name, system in r.can.systems.items():
        if system.gives == "radial force" or (explained and system.gives == "torque") or (name, "q") not in r.moved:
            continue
        axis = system.axes[0]
        q, d = (r.moved[name, way][axis] if (name, way) in r.moved else 0.0 for way in ("q", "d"))
        least = plan.min_turn_rad if system.gives == "torque" else plan.min_along_m
        shown = f"q {_told(q, system.gives)}, d {_told(d, system.gives)}"
        if max(abs(q), abs(d)) < least:
            text = f"pulses of {name} move {axis} by nothing ({shown}): more than friction holds, or no force."
            yield _wrong("nothing-moves", text, name)
        elif q < least or abs(d) > ALONG * abs(q):
            causes = decode.thrust(system, d, q, r.phi[name]) if system.gives == "axial force" else []
            which = (
                f"It would be so with {'; or '.join(causes)}." if causes else f"Look at the cables of {_span(r, name)}."
            )
            text = f"pulses of {name} should move {axis} up along q and not along d, and moved it: {shown}. {which}"
            yield _wrong("moves-wrongly", text, name)


def _told(x: float, gives: str) -> str:
    return f"{x * 1e3:+.2f} mrad" if gives == "torque" else f"{x * 1e6:+.0f} µm"


def of_signals(lost: float, plan: Plan) -> Iterator[Finding]:
    """Lost samples."""
    if lost > plan.max_lost:
        text = f"{lost:.2%} of the samples of a step are missing ({plan.max_lost:.2%} is allowed). Look at the link."
        yield _wrong("missing-samples", text, "telemetry", Effect.INDETERMINATE)


def of_end(far: Sequence[tuple[str, float, float]]) -> Iterator[Finding]:
    """A mover that went too far, at which the run ended."""
    for axis, moved, limit in far:
        text = (f"the mover went too far: {axis} by {moved:+.3g}, {limit:.3g} is allowed (m or rad). The run ended there. Look "
                "at what pushed it last.")  # fmt: skip
        yield _wrong("mover-too-far", text, axis)


def coils_unseen(r: Result) -> Iterator[Finding]:
    """Coils whose force no pulse shows where the mover lies: alone along their axis, with hardly any q in them."""
    for name, system in r.can.systems.items():
        if system.gives != "axial force" or winding.beside(r.can, name):
            continue
        for coil in system.coils:
            row = winding.taken_by(system, coil, r.phi[name], -1.0)[1]
            if row[1] > 1 - ALONG and abs(row[0]) < ALONG:
                text = (
                    f"coil {coil} hardly carries any q where the mover lies: whether it is connected the right way "
                    "round shows in no motion here. Move it along by a quarter of a pair of poles, measure again."
                )
                yield Finding("coil-not-shown", text, coil)
