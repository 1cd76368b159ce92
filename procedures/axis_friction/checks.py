"""What can be wrong with friction from passes at constant rates, and what their data can say about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.axis_friction import fit
from procedures.axis_friction.estimates import BIAS, COULOMB, RADIUS, VISCOUS, Result, named
from procedures.axis_friction.plan import Plan
from procedures.axis_friction.steps import Pass
from procedures.shared import signals
from procedures.stages.recorded import not_held

SHARE = 0.01  # of samples that may be limited
APART = 4.5  # standard uncertainties


def of_passes(passes: Sequence[Pass], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing recorded, not held, losses, rates that are none, forces that were not given."""
    if not passes:
        text = "no axis was sent anywhere; expected the plan's passes (was the run stopped early?)"
        yield Finding("passes-missing", text, "", Effect.ERROR)
        return
    if (wrong := not_held(((p.where, p.states) for p in passes), rig)) is not None:
        yield wrong
        return
    yield from signals.losses_of(passes, plan.max_lost)
    worst = max(passes, key=lambda p: p.uneven)
    if worst.uneven > plan.max_uneven:
        text = (f"the rate differs by {worst.uneven:.1%} from one half of its window to the other; {plan.max_uneven:.1%} is "
                "allowed: inertia is in the force. Settle longer.")  # fmt: skip
        yield Finding("rate-uneven", text, worst.where, Effect.INDETERMINATE)
    worst = max(passes, key=lambda p: p.limited)
    if worst.limited > SHARE:
        text = (
            f"in {worst.limited:.1%} of its samples the axis did not get what its loop asks for, or was at its limit."
        )
        yield Finding("not-served", text, worst.where, Effect.INDETERMINATE)


def of_result(r: Result, passes: Sequence[Pass], plan: Plan) -> Iterator[Finding]:
    """Loads that are too light, friction that is none, axes that rub apart; the scale of the map."""
    for name, axis in r.data.of.items():
        mine = tuple(f"{named(n, axis)}@{name}" for n in (COULOMB, VISCOUS, BIAS))
        coulomb = r.estimates[named(COULOMB, axis), name]
        yield from _light(r, passes, name, mine)
        if not (coulomb.value > 0 and coulomb.u <= plan.max_u * coulomb.value):
            text = (f"Coulomb friction is {coulomb.value:.3g} {axis.force} with u {coulomb.u:.2g}; u of {plan.max_u:.2g} of it "
                    "is wanted. More repeats, or other rates.")  # fmt: skip
            yield Finding("friction-not-shown", text, name, Effect.INDETERMINATE, mine)
        if r.data.sources[name]:
            text = (f"one {axis.force} of the controller's map is {r.scales[name]:.4g} {axis.force} by known loads, mean of "
                    "both ways")  # fmt: skip
            yield Finding("force-scale", text, name)
    yield from _apart(r, plan)


def _light(r: Result, passes: Sequence[Pass], name: str, concerned: tuple[str, ...]) -> Iterator[Finding]:
    """A load that pulls down is held by a push up, whichever way the axis goes."""
    signs = {s.name: s.sign for s in r.data.sources[name]}
    for p in passes:
        if p.axis == name and p.load and p.force[name] * signs[p.load] >= 0:
            text = f"the axis was pushed the way the load pulls, {p.force[name]:+.3g}: friction exceeds it. Hang more."
            yield Finding("load-too-light", text, p.where, Effect.INDETERMINATE, concerned)
            return


def _apart(r: Result, plan: Plan) -> Iterator[Finding]:
    """One friction along the path has the radius T_c/F_c, and gives just so much along and around."""
    if r.data.helix is None or r.data.pair is None or r.acted is None or r.radius is None:
        return
    along, around = (r.friction[a.name] for a in r.data.pair)
    if along.coulomb <= 0 or around.coulomb <= 0:
        return
    ratio = around.coulomb / along.coulomb
    off = np.array(fit.misfit(r.data.helix, r.acted, along, around, ratio))
    worst = float(np.abs(off).max())
    told = r.estimates[RADIUS, ""]
    if worst > plan.max_apart:
        axis, rate = np.unravel_index(int(np.argmax(np.abs(off))), off.shape)
        text = (f"with {r.data.helix.v[rate]:.3g} m/s and {r.data.helix.w[rate]:.3g} rad/s at once, {r.data.pair[axis].name} "
                f"rubs by {off[axis, rate]:+.1%} of its Coulomb friction other than one friction along the path; "
                f"{plan.max_apart:.0%} is allowed. By helices its radius is {told.value * 1e3:.3g} mm, by Coulomb torque over "
                f"force {ratio * 1e3:.3g} mm: one axis has a friction of its own.")  # fmt: skip
        yield Finding("axes-rub-apart", text, r.data.pair[axis].name, Effect.INDETERMINATE, (RADIUS,))
