"""Estimators of the velocity in the loop, one beside the other (thesis 4.5, B2 and B3).

Measurands, by estimator: errors of velocity and disturbance before the compensation is switched on, the position after it;
greatest deviation under a load, its integral, the quiet position, the velocity's noise; ratios of these, paired by repeats.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from bench.errors import Lacking
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import NOTHING, Load, RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.estimator_compare.observers import predicted_ratio
from procedures.estimator_compare.plan import Plan
from procedures.estimator_compare.requires import ENGAGE, HANG, captured, requires
from procedures.estimator_compare.steps import read_taken
from procedures.one_axis.bank import RULES, Array, bank
from procedures.one_axis.conventions import OneAxis, conventions
from procedures.shared import assumptions
from procedures.shared.default_masses import nth_lightest

if TYPE_CHECKING:
    from procedures.estimator_compare.estimates import Result

VELOCITY = Quantity(
    "velocity_error", "1", "RMS of velocity less derivative over the derivative's rms, before the switch"
)
DISTURBANCE = Quantity(
    "disturbance_error", "N", "RMS of the estimated disturbance less a constant and a sine, before the switch"
)
AFTER = Quantity(
    "y_50_100",
    "m",
    "RMS position of the shaft 50 to 100 ms after the compensation was switched on",
    title="position after the switch",
)
PEAK = Quantity("peak", "m", "greatest deviation of the shaft after a load is hung")
INTEGRAL = Quantity("integral", "m s", "integral over 1 s of the size of the shaft's deviation after a load is hung")
QUIET = Quantity("quiet", "m", "standard deviation of the shaft's position before the load, the sensor's noise in it")
NOISE = Quantity(
    "velocity_noise", "m/s", "RMS of the estimated velocity above 100 Hz, where the shaft hardly moves, before the load"
)
SINGLES = (VELOCITY, DISTURBANCE, AFTER, PEAK, INTEGRAL, QUIET, NOISE)
RATIOS = tuple(
    Quantity(f"{q.name}_ratio", "1", f"ratio of two estimators' {q.name}, mean of the repeats' own") for q in SINGLES
)
MEASURES = (*SINGLES, *RATIOS)
SPARE_S = 0.5  # of a capture, for the time that a request takes over a link that is busy


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """What is constant and harmonic is compensated while the body is lifted."""
    del plan
    return conventions(rig).choose("compensation", "on")


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return plan.repeats * (len(plan.engaged) + len(plan.loaded))


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """In each repeat the estimators in turn: first those that are switched, then those that are loaded."""
    number, draws = 0, _draws(rig)
    for repeat in range(plan.repeats):
        for estimator in plan.engaged:
            _engage(rig, plan, record, estimator, repeat, number, float(draws.uniform()))
            number += 1
        for estimator in plan.loaded:
            _hang(rig, plan, record, estimator, repeat, number, float(draws.uniform()))
            number += 1


def _draws(rig: Rig) -> np.random.Generator:
    """Random moments, by the noise of the sensors: other ones on each rig and day, and the same in the same simulation."""
    machine = conventions(rig.file)
    readings = [rig.levitation.reading(name) for name in (machine.position, *machine.currents)]
    return np.random.default_rng([round(abs(x) * 1e9) for x in readings])


def _engage(rig: Rig, plan: Plan, record: Recorder, estimator: str, repeat: int, number: int, share: float) -> None:
    machine = conventions(rig.file)
    assert rig.capture is not None
    rig.levitation.write({**machine.choose("estimator", estimator), **machine.choose("compensation", "off")})
    rig.clock.sleep(plan.settle_s + share * plan.spread_s)
    lasts = plan.lead_s + plan.engaged_s
    with record.step(ENGAGE, number=number, estimator=estimator, repeat=repeat):
        rig.capture.arm(captured(machine, ENGAGE), seconds=lasts + SPARE_S)
        rig.clock.sleep(plan.lead_s)
        rig.levitation.write(machine.choose("compensation", "on"))
        rig.capture.wait(lasts + 5.0)
    rig.capture.upload(None, number=number)


def _hang(rig: Rig, plan: Plan, record: Recorder, estimator: str, repeat: int, number: int, share: float) -> None:
    machine = conventions(rig.file)
    assert rig.capture is not None
    rig.levitation.write({**machine.choose("estimator", estimator), **machine.choose("compensation", "on")})
    rig.clock.sleep(plan.calm_s + share * plan.spread_s)
    lasts = plan.lead_s + plan.loaded_s
    with record.step(HANG, number=number, estimator=estimator, repeat=repeat):
        rig.capture.arm(captured(machine, HANG), seconds=lasts + SPARE_S)
        rig.clock.sleep(plan.lead_s)
        rig.operator.hang(Load(plan.load))
        rig.capture.wait(lasts + 5.0)
    rig.capture.upload(None, number=number)
    rig.operator.hang(NOTHING)


def evaluate(recording: Recording[Plan], findings: Findings) -> Result:
    """Each quantity by estimator, and their ratios."""
    from procedures.estimator_compare import checks, estimates
    from procedures.shared.certificates import certified_gain

    plan, taken, rig = recording.plan, read_taken(recording), recording.rig
    findings.gate(checks.of_signals(taken, plan))
    machine = conventions(rig)
    gain = certified_gain(rig, machine.position)
    result = estimates.evaluate(taken, plan, machine.known(rig, "harmonic_hz"), gain)
    findings.add(checks.of_weights(taken, _weights(rig, machine, taken[0].tick_s)))
    findings.add(checks.of_result(result, plan, predicted_ratio(rig, machine)))
    return result


def _weights(rig: RigFile, machine: OneAxis, tick_s: float) -> Array:
    """Of the two filters that overlap, as the controller has them."""
    degree, window_s, rule = (machine.known(rig, meaning) for meaning in ("degree", "window", "rule"))
    return bank(round(degree), round(window_s / tick_s), tuple(RULES)[round(rule)], tick_s).rows


def measured(result: Result) -> Iterator[Measured]:
    """The quantities of each estimator, then the ratios."""
    for q in SINGLES:
        yield from (q.measured(e, where) for where, e in result.estimates[q.name].items())
    for q, single in zip(RATIOS, SINGLES, strict=True):
        yield from (q.measured(e, where) for where, e in result.ratios[single.name].items())


def figures(result: Result, recording: Recording[Plan]) -> Iterable[Figure]:
    """Answers to load and switch, velocity error of each repeat."""
    from procedures.estimator_compare import figures as drawn

    return drawn.all_figures(result, recording.plan)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    machine = conventions(rig)
    for kind, names in (("estimator", {*plan.engaged, *plan.loaded}), ("compensation", {"on", "off"})):
        for name in sorted(names):
            try:
                machine.choose(kind, name)
            except Lacking as error:
                yield str(error)
    for key, chosen in (("engaged", plan.engaged), ("loaded", plan.loaded)):
        if len(set(chosen)) < len(chosen):
            yield f"{key}: found {', '.join(chosen)}; expected each once"
    if plan.load not in rig.masses:
        yield f"load: found {plan.load!r}; expected one of the rig's masses: {', '.join(rig.masses)}"


procedure = Procedure(
    name="estimator-compare",
    title="Velocity estimators in the loop, one beside the other",
    measures=MEASURES,
    state=RigState.LEVITATED,
    plan=Plan,
    planned=lambda rig: nth_lightest(rig, load=0),
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=step_count,
    optional=RATIOS,
    assumes=assumptions.ESTIMATOR_COMPARE,
    method=read_method(__file__),
)
