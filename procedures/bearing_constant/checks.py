"""What can be wrong with the visits, and what their data can say about it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.rigfile.places import Places
from bench.rigfile.toleranced import Toleranced
from procedures.bearing_constant.estimates import K_B, Result
from procedures.bearing_constant.plan import Plan
from procedures.bearing_constant.steps import Visit
from procedures.position_loops import recorded
from procedures.shared import signals
from procedures.shared.leastsquares import linear

SURE = 4.5  # standard uncertainties that a sound rig does not reach
TILTED = 0.02  # of the heaviest weight, that may scatter between the planes: a millimetre of where it hangs
LEAST = 1e-3  # share by which weights may disagree whatever the scatter
DEG = 180 / math.pi
AIMED = math.radians(1.0)  # of the gravity against the probes' axes


def of_signals(visits: Sequence[Visit], plan: Plan, rig: RigFile) -> Iterator[Finding]:
    """None, not captured, not levitated, losses, loops at their limit, off the set point."""
    if not visits:
        yield Finding("no-visits", "no visit was recorded (was the run stopped early?)", "", Effect.ERROR)
        return
    missing = [v for v in visits if v.currents is None]
    if (told := recorded.not_captured("visit-not-captured", "visits", missing, len(visits))) is not None:
        yield told
        return
    if (told := recorded.not_held(((v.where, v.states) for v in visits), rig, "visit-not-held", "mover")) is not None:
        yield told
        return
    yield from signals.losses_of(visits, plan.max_lost)
    worst = max(visits, key=lambda v: v.limited)
    if worst.limited > 0:
        text = f"a loop was at its limit in {worst.limited:.1%} of the time: then it holds nothing. Hang less."
        yield Finding("visit-limited", text, worst.where, Effect.INDETERMINATE)
    far = max(visits, key=lambda v: float(np.abs(v.positions).max()))
    off = float(np.abs(far.positions).max())
    if off > plan.max_off_m:
        text = (f"a radial reading was {off * 1e6:.2g} µm off its set point in the mean, {plan.max_off_m * 1e6:.2g} µm "
                "allowed: the magnets pull with the rest. Settle longer.")  # fmt: skip
        yield Finding("visit-unsettled", text, far.where, Effect.INDETERMINATE)


def of_result(r: Result, plan: Plan, rig: RigFile) -> Iterator[Finding]:
    """Visits that scatter, weights that disagree, that hung elsewhere, forces that are turned."""
    most = max(v.newtons for v in r.visits)
    tilts = math.sqrt(float(r.tilting @ r.tilting) / r.answers[0].dof)
    if tilts > TILTED * most:
        worst = r.visits[int(np.argmax(np.abs(r.tilting)))]
        text = (f"what one plane carries more than the other scatters by {tilts:.2g} N from visit to visit, "
                f"{TILTED * most:.2g} N allowed; the one that is farthest off is named. Was it the right hook?")  # fmt: skip
        yield Finding("visits-disagree", text, worst.where, Effect.INDETERMINATE, _all(r))
    if r.scatter > plan.max_scatter * most:
        left = np.abs(r.answers[0].left) + np.abs(r.answers[1].left)
        worst = r.visits[int(np.argmax(left))]
        text = (f"forces of the visits scatter by {r.scatter * 1e3:.2g} mN, {plan.max_scatter * most * 1e3:.2g} mN allowed. "
                "The one that is farthest off is named: did another mass hang, or at another place?")  # fmt: skip
        yield Finding("visits-disagree", text, worst.where, Effect.INDETERMINATE)
    yield from _masses(r)
    yield from _places(r, rig)
    for plane, a in zip(r.planes, r.answers, strict=True):
        stated = rig.capabilities.force_currents.get(plane.motor)
        tolerated = AIMED + (_half(stated.stated) if stated is not None else math.radians(5.0))
        if abs(a.turned) > tolerated + SURE * a.u_turned:
            text = (f"the current of {plane.motor} that carries a weight is turned by {a.turned * DEG:.2g}° from up, "
                    f"{tolerated * DEG:.2g}° tolerated: its encoder's zero is off, or its probes are turned. K_B has the "
                    "length of the answer and does not change; what else the controller asks of it does.")  # fmt: skip
            yield Finding("weight-turned", text, plane.motor)


def _half(t: Toleranced) -> float:
    return abs(t.value) + (t.half_width or 3 * t.standard_uncertainty)


def _masses(r: Result) -> Iterator[Finding]:
    """Whether both masses weigh as their certificates say, against each other."""
    labels = sorted(
        {v.load for v in r.visits if v.load}, key=lambda label: max(v.newtons for v in r.visits if v.load == label)
    )
    if len(labels) != 2:
        return
    x = np.column_stack([*([v.newtons if v.load == label else 0.0 for v in r.visits] for label in labels),
                         np.ones(len(r.visits))])  # fmt: skip
    try:
        found = linear(x, r.forces)
    except AnalysisError:
        return
    light, heavy = found.terms[:2]
    apart = float(light - heavy)
    u = math.sqrt(found.covariance[0, 0] + found.covariance[1, 1] - 2 * found.covariance[0, 1])
    if abs(apart) > max(SURE * u, LEAST):
        text = (f"by the currents {labels[0]} weighs {apart:+.2%} too much against {labels[1]}. Which masses hung? Look at "
                "their certificates.")  # fmt: skip
        yield Finding("masses-disagree", text, f"{labels[0]}, {labels[1]}", Effect.INDETERMINATE, _all(r))


def _places(r: Result, rig: RigFile) -> Iterator[Finding]:
    """Whether each weight hung where it should, by what the planes share of it."""
    if not r.places:
        return
    hold = rig.capabilities.hold
    middle = _spread(hold.middle) if hold is not None and hold.middle is not None else 0.0
    half, centre = (r.planes[0].at - r.planes[1].at) / 2, (r.planes[0].at + r.planes[1].at) / 2
    plane = max(_tolerance(rig, f"motors/{p.motor}") for p in r.planes)
    for hook, (at, u) in r.places.items():
        stated = Places(rig).place(f"hooks/{hook}").value - centre
        room = (
            _tolerance(rig, f"hooks/{hook}") + middle + (rig.hook_seat.half_width or 0.0) + abs(stated) / half * plane
        )
        if abs(at - stated) > room + SURE * u:
            text = (f"by the currents the weight hung {at * 1e3:+.1f} mm from the middle between the planes; "
                    f"{stated * 1e3:+.1f} mm are stated, {room * 1e3:.1f} mm tolerated. Which hook was it? Do the currents of "
                    f"{r.planes[0].motor} belong to its plane?")  # fmt: skip
            yield Finding("weight-misplaced", text, hook, Effect.INDETERMINATE, _all(r))


def _spread(t: Toleranced) -> float:
    return t.half_width or 3 * t.standard_uncertainty


def _tolerance(rig: RigFile, part: str) -> float:
    return sum(abs(term.factor) * _spread(term.number) for term in Places(rig).place(part).terms)


def _all(r: Result) -> tuple[str, ...]:
    return tuple(f"{name}@{where}" for name, where in r.estimates if name == K_B or where in r.hooks)
