"""Force constants of radial actuators by weights hung on the mover, and what both give together.

Measurands, per true ampere of the bearing current that gives the force: K_B of each plane; K_mean of both planes together with
a weight at a hook, W/(i_1 + i_2), which is all that one place tells.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from bench.errors import AnalysisError
from bench.figures import Figure
from bench.findings import Effect, Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import Load, RigState
from bench.procedure.states import transition, within_reach
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from procedures.bearing_constant import estimates
from procedures.bearing_constant.estimates import Result
from procedures.bearing_constant.plan import Plan
from procedures.bearing_constant.requires import requires
from procedures.bearing_constant.stand import captured, hooks, masses, rate, set_points, settle_s, visits
from procedures.bearing_constant.steps import VISIT, read_visits
from procedures.shared import assumptions, planned
from procedures.shared.rates import of_rate

K_B = Quantity(estimates.K_B, "N/A", "force of a radial actuator per ampere along it", title="bearing constant")
K_MEAN = Quantity(estimates.K_MEAN, "N/A", "weight at a hook over the currents of both planes together that carry it",
                  title="constant of both planes together")  # fmt: skip
MEASURES = (K_B, K_MEAN)
MARGIN_S = 1e-3  # of a capture
ONCE = 6  # visits of a round


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """The observer."""
    return planned.observer(rig, plan.observer)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Hang, lift, settle, capture."""
    hangs: Load | None = None
    for number, (hook, label) in enumerate(visits(rig.file, plan), start=1):
        if hangs is None or (hangs.label, hangs.hook) != (label, hook):
            with within_reach(rig):
                hangs = rig.operator.hang(Load(label, hook))
        else:  # a lift of its own, and nobody is needed
            transition(rig, RigState.READY)
            transition(rig, RigState.LEVITATED)
        _look(rig, plan, record, hangs, number)


def _look(rig: Rig, plan: Plan, record: Recorder, hangs: Load, number: int) -> None:
    assert rig.capture is not None
    for name, value in set_points(rig.file, plan).items():
        rig.levitation.write({name: value})
    rig.clock.sleep(settle_s(rig.file, plan))
    labels: dict[str, float | str] = {"number": number, "hook": hangs.hook, "load": hangs.label}
    with record.step(VISIT, **labels):
        rig.capture.arm(list(captured(rig.file)), seconds=plan.average_s + MARGIN_S, rate_hz=rate(rig.file, plan))
        rig.capture.wait(plan.average_s + 5.0)
    rig.capture.upload(None, **labels)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """Constants by all visits."""
    from procedures.bearing_constant import checks

    rig, plan = recording.rig, recording.plan
    seen = read_visits(recording)
    findings.gate(checks.of_signals(seen, plan, rig))
    try:
        found = estimates.result(seen, rig, plan)
    except AnalysisError as error:
        findings.end(Finding("constants-not-told", f"{error}.", "", Effect.ERROR))
    findings.add(checks.of_result(found, plan, rig))
    return found


def measured(r: Result) -> Iterator[Measured]:
    """The constants of each plane, and of both at each hook."""
    for quantity in MEASURES:
        for (name, where), estimate in r.estimates.items():
            if name == quantity.name:
                yield quantity.measured(estimate, where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    for key, asked, known in (("hooks", plan.hooks, rig.hooks), ("masses", plan.masses, rig.masses)):
        if unknown := [name for name in asked if name not in known]:
            yield f"{key}: found {', '.join(unknown)}; expected some of {', '.join(known)}"
            return
        if len(set(asked)) != len(asked) or len(asked) > 2:
            yield f"{key}: found {', '.join(asked)}; expected two at most, each once"
            return
    if len(hooks(rig, plan)) == 1 and not plan.hooks:
        yield "hooks: found one; expected two, or a plan that names it: K_B of each plane is not told by one place"
    if len(masses(rig, plan)) == 1:
        yield f"masses: found {masses(rig, plan)[0]} alone; expected two, each the other's check"
    yield from planned.of_observer(rig, plan.observer)
    yield from of_rate(rig, plan.rate_hz)
    yield from Envelope(rig).problems_of(dict(set_points(rig, plan)))


def figures(r: Result, recording: Recording[Plan]) -> Iterable[Figure]:
    """The current of each plane over the weight."""
    from procedures.bearing_constant import figures as drawn

    del recording
    return drawn.all_figures(r)


def left_out(plan: Plan) -> tuple[Quantity, ...]:
    """One place tells no constant of each plane."""
    return (K_B,) if len(plan.hooks) == 1 else ()


procedure = Procedure(
    name="bearing-constant",
    title="Force constants of radial actuators by weights",
    measures=MEASURES,
    state=RigState.LEVITATED,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=lambda plan: ONCE * plan.rounds,
    left_out=left_out,
    optional=(K_B,),
    reached=("scatter/*",),
    assumes=assumptions.BEARING_CONSTANT,
    method=read_method(__file__),
)
