"""Coil map: before anything is levitated, are all coils where the controller takes them to be?

The mover lies in its rings with the current loops on and no position held. Pulses along d and q of every current system show
which coils carry them, which way and how much; what they move shows what currents cannot: whether phases are exchanged,
actuators are exchanged, a coil is connected the other way round. A bearing current is turned around, so that the mover rolls
around its ring: on which side of it the mover lies says where the push goes (`bowl`).

Measurand: `share` of a coil: its true current over what its systems' currents, as the controller has them, ask of it by the
table of the winding; by least squares over d and q of all its systems. 1 is expected. A controller regulates sums of readings:
a sensor whose gain is off by 0.5 % makes its coil's current off by as much, less what its star lets flow.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from bench.figures import Shown
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.rigfile import RigFile
from procedures.coil_map.moving import FAR, moved, settings
from procedures.coil_map.plan import Plan
from procedures.coil_map.requires import requires
from procedures.coil_map.steps import PULSE, TOUR, points, pulses, radial, read_pulses, read_tours
from procedures.shared import assumptions

if TYPE_CHECKING:
    from procedures.coil_map.estimates import Result

SHARE = Quantity("share", "1", "true current of a coil, of what its systems' currents ask of it")


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """What flowed and what moved. Motion is read where currents are right: else it says nothing of the winding."""
    from procedures.coil_map import checks, estimates

    plan, taken = recording.plan, read_pulses(recording)
    far = [(str(e["axis"]), float(e["moved"]), float(e["limit"])) for e in recording.events(FAR)]
    steps = [*recording.steps(PULSE), *recording.steps(TOUR)]
    lost = max((s.lost() / max(s.expected(), 1) for s in steps), default=0.0)
    r = estimates.evaluate(taken, read_tours(recording), recording.rig)
    findings.add(checks.of_signals(lost, plan))
    if not far:
        findings.gate(checks.of_flow(r, plan), so_far=r)
    findings.gate(checks.of_currents(r, plan), so_far=r)
    pushes = list(checks.of_pushes(r, plan))
    findings.gate([*pushes, *checks.of_turns(r, plan, bool(pushes)), *checks.of_end(far)], so_far=r)
    findings.add(checks.coils_unseen(r))
    return r


def measured(r: Result) -> Iterator[Measured]:
    """The share of every coil."""
    yield from (SHARE.measured(estimate, coil) for coil, estimate in r.share.items())


def drawn(r: Result, _: Recording[Plan]) -> Iterable[Shown]:
    """Both tables, and each push that was turned around."""
    from procedures.coil_map import figures

    return figures.all_figures(r)


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many steps it records."""
    can = rig.capabilities.coil_map
    if can is None:
        return 0
    return sum(1 for _ in pulses(can, plan)) + sum(sum(1 for _ in points(can, name, plan)) for name in radial(can))


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    can = rig.capabilities.coil_map
    assert can is not None
    sizes = {"torque": plan.torque_A, "radial force": max(plan.bearing_A, plan.around_A), "axial force": plan.thrust_A}
    for name, system in can.systems.items():
        size = max(sizes[system.gives], plan.beside_A if system.gives == "torque" else 0.0)
        for parameter in (system.d, system.q):
            if size > rig.parameters[parameter].high or -size < rig.parameters[parameter].low:
                yield f"{name}: found {size:g} A; {parameter} is {rig.parameters[parameter].low:g} to " \
                      f"{rig.parameters[parameter].high:g} A"  # fmt: skip
    if can.lasts and plan.hold_s > rig.parameters[can.lasts].high:
        yield f"hold_s: found {plan.hold_s:g} s; {can.lasts} is at most {rig.parameters[can.lasts].high:g} s"
    if plan.rest_s > plan.hold_s / 2:
        yield f"rest_s: found {plan.rest_s:g} s; expected half of hold_s, {plan.hold_s / 2:g} s, or less"


procedure = Procedure(
    name="coil-map",
    title="Coil map: which coil carries what, and what each current moves",
    measures=(SHARE,),
    state=RigState.READY,
    plan=Plan,
    acquire=moved,
    settings=settings,
    evaluate=evaluate,
    measured=measured,
    figures=drawn,
    requires=requires,
    check=check,
    steps_on=steps_on,
    assumes=assumptions.COIL_MAP,
    method=read_method(__file__),
)
