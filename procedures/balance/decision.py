"""Deciding within a balancing: may a trial weight turn, did it act as it should, what corrects, is it enough.

`acquire` decides by captures, the analysis says the same of the telemetry. Nothing here moves anything.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bench.analysis.balance import bound, split
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import propagate_stacked
from bench.units import RPM
from procedures.amb_rotor.conventions import conventions
from procedures.balance.plan import Plan
from procedures.balance.planes import Plane, names_of, planes_of
from procedures.balance.solution import Trials
from procedures.balance.steps import Read, Run, Weight
from procedures.synchronous import bearings, facts, runout
from procedures.synchronous.bearings import Known
from procedures.synchronous.runout import Stand

if TYPE_CHECKING:
    from procedures.balance.estimates import Balanced

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
LEAST = 0.5  # of what it should do, by the forces: less, and a trial weight moved nothing
OFF, ASTRAY = 0.25, 0.25  # of a weight: size, and what shows in the other plane
CLOSE, FAR = 0.06, 4.0  # a size that is nearer passes; one between that and OFF within so many of its u
TURNED_RAD, SLIPPED_RAD = math.radians(12), math.radians(15)
SURE = 3.0  # of its u: a turn that what is known of the stand does not make
JUST_RAD = 1e-6
AMPLIFIED = 5.0  # by a loop that nobody knows, at most, of the response of a free shaft
LIGHTER = 0.25  # of the planned trial weight: what is allowed beside a shaft that moves far; u = 1 mg is 4 % of 25 mg
MILLIGRAM = 1e-6  # kg
SMALL_KG_M = 1e-30
LIGHTEST_KG = 1e-6  # what a laboratory balance still tells from nothing


def gain(rig: RigFile, plan: Plan, plane: int) -> float:
    """Greatest response of a probe to an unbalance in a plane on the way to the highest speed, m/(kg m): a rigid shaft in the
    loop that the controller's gains are meant to make, s^2 + k2 s + k1 in each degree of freedom."""
    known = bearings.Known(None, plan.beta_share, plan.offset_u_m)
    stand = Stand.of({n: e.value for n, e in bearings.collect_inputs(rig, known).items()})
    arm = (-stand.l_iu, stand.l_ou)[plane]
    own = max(abs(1 / stand.mass + arm * at / stand.inertia) for at in (-stand.l_is, stand.l_os))
    return float((_amplified(rig, plan, stand) if _loop_is_known(rig, plan) else AMPLIFIED) * own)


def _loop_is_known(rig: RigFile, plan: Plan) -> bool:
    """Whether the response follows from what the controller knows of its bearings, its gains and its bias."""
    machine = conventions(rig)
    if not bearings.has_model(rig):
        return False
    gained = all(machine.gain(key, machine.axes[0]) for key in ("kp", "kd")) and all(
        axis in machine.biases for axis in machine.axes
    )
    return plan.law in machine.can.flatness or gained


def _amplified(rig: RigFile, plan: Plan, stand: Stand) -> float:
    """The greatest response up to the highest speed over that of a free shaft far above its rigid modes."""
    p = {n: q.default for n, q in rig.parameters.items()}
    machine = conventions(rig)
    if (flat := machine.can.flatness.get(plan.law)) is None:
        means = np.concatenate([np.zeros(4), np.repeat([p[machine.biases[a]] for a in machine.axes], 2)])
        kp, kd = (p[machine.gain(key, machine.axes[0])] for key in ("kp", "kd"))
        plus, minus, k_x = runout.slopes(stand, means)
        force = float((plus - minus)[[0, 2]].sum())
        k1, k2 = (force * kp - float(k_x[[0, 2]].sum())) / stand.mass, force * kd / stand.mass
    else:
        k1, k2 = p[flat.k1], p[flat.k2]
    w = np.linspace(1.0, max(plan.speeds_rad_s), 400)
    return float((w**2 / np.abs(k1 - w**2 + 1j * w * k2)).max())


def allowed_kg(rig: RigFile, plan: Plan, plane: int, before: float = 0.0) -> float:
    """The greatest trial weight whose predicted response, beside `before` m that is there, stays within the plan's share of
    the least clearance and the envelope."""
    c, radius = facts.clearance(rig), planes_of(rig)[plane].radius.value
    room = plan.max_share * (c.value - math.sqrt(3) * c.u) - before
    return float(min(max(room, 0.0) / gain(rig, plan, plane) / radius, rig.envelope.max_trial_weight_kg))


def trial_kg(rig: RigFile, plan: Plan, present: Run, plane: int) -> tuple[float, float]:
    """The trial weight to fix beside what a run with the weights that are on the shaft now showed, kg, and the heaviest that is
    allowed: the planned one, else the allowed one in whole milligrams; 0 where that is too light to tell anything by."""
    before = max(r.farthest for r in (*present.reads, *([present.again] if present.again else [])))
    planned, allowed = plan.trial_kg[plane], allowed_kg(rig, plan, plane, before)
    if planned <= allowed:
        return planned, allowed
    lighter = math.floor(allowed / MILLIGRAM) * MILLIGRAM
    return (lighter if lighter >= LIGHTER * planned else 0.0), allowed


def slow_runout(slow: Read | None, base: Run, rig: RigFile, known: Known) -> Complex:
    """Runout (4,) m by the slow roll and the forces, with what is known of the bearings; none without a slow roll."""
    if slow is None:
        return np.zeros(4, complex)
    stand = Stand.of({n: e.value for n, e in bearings.collect_inputs(rig, known).items()})
    return runout.find_runout(stand, {1.0: slow.turning}, base.fastest.turning).runout[1.0]


@dataclass(frozen=True)
class Shown:
    """A trial `weight`, and by speed and plane (s, 2) what the forces say that it `added`, over what it should; the angle from
    the mark to the scale's zero is still in it. `turn_u` (s,) rad: of the angle at a speed against that at the highest;
    `size_u`: of the size at the highest; names of the planes, `sides`."""

    weight: Weight
    added: Complex
    turn_u: Callable[[int], float]
    size_u: Callable[[], float]
    sides: tuple[str, str]


def observe(before: Run, having: Run, weight: Weight, rig: RigFile, known: Known) -> Shown:
    """What the forces say of a weight, with what is known of the bearings; runout cancels."""
    own = planes_of(rig)[weight.plane]
    u = own.turned(weight.unbalance(own.radius.value))
    pairs = list(zip(before.reads, having.reads, strict=True))
    inputs = bearings.collect_inputs(rig, known)

    def added(s: Stand, k: int) -> Complex:
        none = np.zeros(4, complex)
        a, b = (runout.unbalances(s, read.turning, none)[0] for read in pairs[k])
        return np.asarray((b - a) / u)

    def turn_u(k: int) -> float:
        """Near the rigid modes a share of the forces counts several times: at 4000 r/min gap, offsets and betas make 9°."""

        def turn(v: Mapping[str, Array]) -> dict[str, Array]:
            s = Stand.of(v)
            return {"turn": np.angle(added(s, k)[..., weight.plane] / added(s, -1)[..., weight.plane])}

        return propagate_stacked(turn, inputs)["turn"].u

    def size_u() -> float:
        sizes = propagate_stacked(lambda v: {"size": np.abs(added(Stand.of(v), -1)[..., weight.plane])}, inputs)
        by_forces = sizes["size"].u
        by_noise = _scatter(nominal, pairs[-1], weight.plane) / abs(u)
        stated = math.hypot(own.radius.u / own.radius.value, own.weight_mass.standard_uncertainty / weight.kg)
        return math.hypot(by_forces, by_noise, stated)

    nominal = Stand.of({name: e.value for name, e in inputs.items()})
    return Shown(weight, np.array([added(nominal, k) for k in range(len(pairs))]), turn_u, size_u, names_of(rig))


def _scatter(s: Stand, reads: tuple[Read, Read], plane: int) -> float:
    """Standard uncertainty of how much two dwells' unbalances in a plane differ, kg m, along that difference, as their vectors
    scatter: far from the probes and at low speeds it is what counts."""
    none, variance = np.zeros(4, complex), 0.0
    a, b = (runout.unbalances(s, read.turning, none)[0][plane] for read in reads)
    way = np.conj(b - a) / max(abs(b - a), SMALL_KG_M)
    for read, at in zip(reads, (a, b), strict=True):
        covariance = read.vectors.covariance
        steps = np.sqrt(np.diag(covariance))
        slopes = np.zeros(steps.size)
        for k in np.flatnonzero(steps):
            moved = read.turning.vectors.copy()
            moved[k // 2] += (1j if k % 2 else 1.0) * steps[k]
            there = runout.unbalances(s, replace(read.turning, vectors=moved), none)[0][plane]
            slopes[k] = ((there - at) * way).real / steps[k]
        variance += float(slopes @ covariance @ slopes)
    return math.sqrt(max(variance, 0.0))


def of_trial(trial: Shown) -> Iterator[Finding]:
    """Did a trial weight do what it should, in its own plane, at every speed alike?"""
    weight, added, sides = trial.weight, trial.added, trial.sides
    p, where, name = (
        weight.plane,
        f"trial {sides[weight.plane]}",
        f"{weight.kg * 1e3:g} g in the {sides[weight.plane]} plane",
    )
    own, other = float(np.abs(added[-1, p])), float(np.abs(added[-1, 1 - p]))
    if own < LEAST and other < LEAST:
        text = (f"the trial weight of {name} moved nothing: by the forces it acts as {own:.0%} of itself. Is it mounted, and "
                "was it there while the shaft turned? No correction is given.")  # fmt: skip
        yield Finding("trial-moved-nothing", text, where, Effect.ERROR)
    elif own < LEAST:
        text = (f"the trial weight of {name} acts in the {sides[1 - p]} plane, as {other:.0%} of itself: it sits in the wrong "
                "plane.")  # fmt: skip
        yield Finding("weight-in-other-plane", text, where, Effect.ERROR)
    elif abs(own - 1) > OFF or other > ASTRAY or (abs(own - 1) > CLOSE and abs(own - 1) > FAR * trial.size_u()):
        text = (f"by the forces the trial weight of {name} acts as {own:.0%} of itself there and as {other:.0%} in the other "
                "plane: suspect its mass, its place or the plane's radius, or an unbalance that changed with it.")  # fmt: skip
        yield Finding("weight-not-as-stated", text, where, Effect.ERROR)
    turns = np.abs(np.angle(added[:, p] / added[-1, p])) if own >= LEAST else np.zeros(1)
    k, turn = int(np.argmax(turns)), float(turns.max())
    if turn > SLIPPED_RAD and turn > SURE * trial.turn_u(k):
        text = (f"what the trial weight of {name} adds is turned by {math.degrees(turn):.0f}° from one speed to another: it is "
                "loose.")  # fmt: skip
        yield Finding("weight-loose", text, where, Effect.ERROR)


def of_trials(inboard: Shown, outboard: Shown) -> Iterator[Finding]:
    """Both weights sit on one scale: the same angle from the mark."""
    first, second = inboard.added, outboard.added
    turn = float(np.angle(second[-1, 1] / first[-1, 0]))
    if abs(turn) > TURNED_RAD and min(abs(first[-1, 0]), abs(second[-1, 1])) >= LEAST:
        text = (f"by the forces the trial weights' scales are turned against each other by {math.degrees(turn):+.0f}°: one of "
                "the weights sits at another angle than stated, or the planes' scales do not agree.")  # fmt: skip
        yield Finding("weight-angle", text, "trials", Effect.ERROR)


def find_slips(run: Run) -> Iterator[Finding]:
    """The slowest speed again at the end of a run: what turned with the shaft must be the same."""
    if run.again is None:
        return
    a, b = run.reads[0].vectors.values[:4], run.again.vectors.values[:4]
    noise = 2.5 * np.hypot(run.reads[0].vectors.u_amplitude[:4], run.again.vectors.u_amplitude[:4])
    over = np.abs(b - a) - noise - np.maximum(0.1 * np.abs(a), 0.3e-6)
    k = int(np.argmax(over))
    if over[k] > 0:
        turn = math.degrees(float(np.angle(b[k] / a[k])))
        text = (f"between the first and the last dwell at {run.reads[0].speed * RPM:.0f} r/min a vector went from "
                f"{abs(a[k]) * 1e6:.2f} to {abs(b[k]) * 1e6:.2f} µm 0-pk and turned by {-turn:+.0f}° of lag: ")  # fmt: skip
        if run.weights:
            yield Finding("weight-loose", text + "a weight has slipped or come off at speed.", run.name, Effect.ERROR)
        else:
            yield Finding("response-changed", text + "suspect a part that came loose, or a shaft that bent.", run.name,
                          Effect.ERROR)  # fmt: skip


@dataclass(frozen=True)
class Correction:
    """Weights to fix by plane as (plane, kg, angle rad); `reached`: none is needed; `too_heavy` kg, where one is."""

    weights: tuple[tuple[int, float, float], ...]
    reached: bool
    too_heavy: float = 0.0


def is_reached(balance: Balanced, name: str) -> tuple[bool, bool]:
    """Of each plane, whether the farthest point of the 95 % region of a run's unbalance lies within U_per."""
    found = balance.unbalance[name]
    inside = [bound(found.one(p)) <= balance.permissible[p].value for p in (0, 1)]
    return inside[0], inside[1]


def correction(balance: Balanced, name: str, rig: RigFile, plan: Plan) -> Correction:
    """What takes the unbalance of a run away, at the plan's positions where it has some."""
    if all(is_reached(balance, name)):
        return Correction((), reached=True)
    wanted: list[tuple[int, float, float]] = []
    for p, u in enumerate(balance.unbalance[name].values):
        holes = holes_of(balance.planes[p], plan)
        for part in split(-complex(u), holes):
            kg = abs(part) / balance.planes[p].radius.value
            if kg >= LIGHTEST_KG:
                wanted.append((p, kg, _told(float(np.angle(part)), holes)))
    heaviest = max((kg for _, kg, _ in wanted), default=0.0)
    most = rig.envelope.max_trial_weight_kg
    return Correction(tuple(wanted), reached=False, too_heavy=heaviest if heaviest > most else 0.0)


def holes_of(plane: Plane, plan: Plan) -> int:
    """How many places a plane has, equally spaced; 0: any angle."""
    return plan.positions or plane.positions


def _told(angle: float, positions: int) -> float:
    """As the operator is told it, rad from 0 to below a whole turn, which rounding alone may make of an angle just below 0."""
    whole = 2 * math.pi
    if positions:
        return round(angle / whole * positions) % positions * whole / positions
    return angle % whole if whole - angle % whole > JUST_RAD else 0.0


def before_trial(base: Run, last: Run, having: Run) -> Run:
    """The run that a trial weight is told against: the `last` one where what it had on stayed on, else the base run."""
    return last if set(last.weights) <= set(having.weights) else base


def trials_of(runs: Sequence[Run], rig: RigFile) -> Trials | None:
    """The trials among runs in order, None where one is missing."""
    named = {r.name: r for r in runs}
    names = ["base", *(f"trial {s}" for s in names_of(rig))]
    if any(n not in named for n in names):
        return None
    base, i, o = (named[n] for n in names)
    if not i.weights or not o.weights:
        return None
    return Trials(base, (base, before_trial(base, i, o)), (i, o), (i.weights[-1], o.weights[-1]), planes_of(rig))
