"""What can be wrong with inertia by sines, and what their data can say about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.axis_inertia.estimates import Result, named
from procedures.axis_inertia.plan import Plan
from procedures.axis_inertia.sequence import part
from procedures.axis_inertia.steps import Sine
from procedures.shared import signals
from procedures.stages.recorded import not_held

SHARE = 0.01  # of samples that may be limited
FOLLOWED = 0.3  # of its amplitude: what is less is no sine that was followed
LEAST = 0.02  # of what the axis moves, that a part adds
APART = 4.5  # standard uncertainties


def of_sines(sines: Sequence[Sine], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing recorded, not held, losses, sines that were not followed."""
    if not sines:
        text = "no axis played a sine; expected the plan's (was the run stopped early?)"
        yield Finding("sines-missing", text, "", Effect.ERROR)
        return
    if (wrong := not_held(((s.where, s.states) for s in sines), rig)) is not None:
        yield wrong
        return
    yield from signals.losses_of(sines, plan.max_lost)
    for s in sines:
        if s.limited > SHARE or s.went < FOLLOWED:
            text = (f"it went {s.went:.0%} of its sine, and did not get the force that its loop asks for "
                    f"in {s.limited:.1%} of the samples. Smaller or slower sines.")  # fmt: skip
            yield Finding("sine-not-followed", text, s.where, Effect.INDETERMINATE)
            return


def of_parts(r: Result, plan: Plan) -> Iterator[Finding]:
    """A part that is not there, or is the wrong way round."""
    for name, m in r.moved.items():
        if m.by_map[1, 0] - m.by_map[0, 0] < LEAST * abs(m.by_map[0, 0]):
            text = f"the axis is not heavier with the {part(r.of[name], plan)} on: was it mounted?"
            yield Finding("part-not-seen", text, name, Effect.ERROR)


def of_result(r: Result, plan: Plan) -> Iterator[Finding]:
    """Scatter, friction, sines apart; the map's scale."""
    for name, axis in r.of.items():
        e, m, mine = r.estimates[named(axis), name], r.moved[name], (f"{named(axis)}@{name}",)
        if not (e.value > 0 and e.u <= plan.max_u * e.value):
            text = f"it is known to {e.u / abs(e.value):.2g} of it, standard uncertainty; {plan.max_u:g} is wanted."
            yield Finding("inertia-not-shown", text, name, Effect.INDETERMINATE, mine)
        off, u = r.apart[name]
        if abs(off) > max(plan.max_apart, APART * u):
            text = f"one sine tells {off:+.1%} of what the first one does; {plan.max_apart:.0%} is allowed."
            yield Finding("sines-apart", text, name, Effect.INDETERMINATE, mine)
        rubbed = float(m.rubs[1, 0] / m.rubs[0, 0] - 1)
        if abs(rubbed) > plan.max_rubbed:
            text = (f"friction is {rubbed:+.0%} with the part on; {plan.max_rubbed:.0%} is allowed. Something rubs that did "
                    "not before.")  # fmt: skip
            yield Finding("friction-changed", text, name, Effect.INDETERMINATE, mine)
        scale = r.parts[name] / float(m.by_map[1, 0] - m.by_map[0, 0])
        text = (f"one {axis.force} of the controller's map is {scale:.4g} {axis.force} by the part; by the map alone it would "
                f"be {m.by_map[0, 0]:.4g} {e.unit}.")  # fmt: skip
        yield Finding("map-scale", text, name)
