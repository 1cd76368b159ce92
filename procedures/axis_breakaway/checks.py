"""What can be wrong with ramps until an axis breaks away."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.axis_breakaway.estimates import SHARE, Result, named
from procedures.axis_breakaway.plan import Plan
from procedures.axis_breakaway.steps import Ramp
from procedures.shared import signals
from procedures.stages.recorded import not_held

SOON = 0.05  # s: what moves so early did not stick


def of_ramps(ramps: Sequence[Ramp], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing recorded, not held, losses, axes that never move or did not stick, forces at their limit."""
    if not ramps:
        yield Finding("ramps-missing", "no axis was ramped (was the run stopped early?)", "", Effect.ERROR)
        return
    if (wrong := not_held(((r.where, r.states) for r in ramps), rig)) is not None:
        yield wrong
        return
    yield from signals.losses_of(ramps, plan.max_lost)
    for r in ramps:
        if not r.moved:
            text = "its reading never changed: friction holds it over the whole ramp. A longer span, or something holds it."
            yield Finding("never-broke-away", text, r.where, Effect.ERROR)
            return
    for r in ramps:
        if r.limited:
            yield Finding("not-served", "the loop asked for its greatest force.", r.where, Effect.INDETERMINATE)
            break
    early = [r for r in ramps if r.after < SOON]
    if early:
        text = f"{len(early)} of {len(ramps)} ramps moved within {SOON:g} s: the axis did not stick, or its loop integrates."
        yield Finding("did-not-stick", text, early[0].where, Effect.INDETERMINATE)


def of_result(r: Result, plan: Plan) -> Iterator[Finding]:
    """Scatter, loads that are too light, helices that break away elsewhere than one friction along the path."""
    for name, axis in r.data.of.items():
        e, a = r.estimates[named(axis), name], r.data.axes[name]
        if not (e.value > 0 and e.u <= plan.max_u * e.value):
            text = f"breakaway is {e.value:.3g} {axis.force} with u {e.u:.2g}; u of {plan.max_u:.2g} of it is wanted."
            yield Finding("breakaway-not-shown", text, name, Effect.INDETERMINATE, (f"{named(axis)}@{name}",))
        if (a.down <= 0).any() or (a.up >= 0).any():
            text = "a load does not change the force in its direction: is it on, and on the right side?"
            yield Finding("load-not-seen", text, name, Effect.ERROR)
    for share, value in zip(r.data.shares, r.shares, strict=True):
        e = r.estimates[SHARE, f"{share:g}"]
        if abs(value - 1) > plan.max_apart:
            text = (f"both at once break away at {value:.3f} of one friction along the path, u {e.u:.2g}; axes that rub "
                    f"apart would at "
                    f"up to {2**0.5:.3f}.")  # fmt: skip
            yield Finding("axes-break-apart", text, f"helix {share:g}", Effect.INDETERMINATE, (SHARE,))
