"""Torque constant of the motor over the phase angle, by known weights on a lever (thesis 6.6.4, gravity added).

Measurand: alpha_tau, torque per mean true current of the four segments at the home angle, peak over the phase angle gamma;
with it gamma_0t, where over gamma that peak lies.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bench.errors import RotorNotArrived
from bench.figures import Figure
from bench.findings import Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import NOTHING, Load, RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence, propagate
from procedures.servomotor import hold
from procedures.servomotor.conventions import conventions
from procedures.servomotor.direction import of_probe
from procedures.servomotor.loads import check_masses
from procedures.servomotor.parameters import BIASES, CURRENTS, named, stated, write
from procedures.shared import assumptions, continued, first_look
from procedures.shared.continued import Done
from procedures.shared.step_table import of_samples, record_step
from procedures.torque_constant import checks
from procedures.torque_constant.inputs import arms_u, fit_inputs, masses_u
from procedures.torque_constant.plan import Plan
from procedures.torque_constant.requires import requires
from procedures.torque_constant.steps import (
    OnLever,
    OverDetent,
    Sideways,
    TorqueData,
    read_torques,
    read_wiring,
    wiring,
)

if TYPE_CHECKING:
    from procedures.torque_constant.fit import Balance, Detent

Array = npt.NDArray[np.float64]
ALPHA_TAU = Quantity("alpha_tau", "N m/A", "torque per mean true segment current at the home angle, peak over gamma")
GAMMA_0T = Quantity("gamma_0t", "rad", "phase angle at which the torque per current is largest")
MEASURES = (ALPHA_TAU, GAMMA_0T)


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Lifted with the angle released: no loop is closed before the encoder's direction is known."""
    return named(rig, {**dict.fromkeys(BIASES, plan.bias_A), **hold.RELEASED})


def visits(plan: Plan) -> list[float]:
    """The phase angles in rad in the order in which they are visited: outwards on alternating sides, then back on the others.

    So gamma and -gamma lie evenly about the middle. A scale (magnets, current sensors) that drifts evenly in time is at right
    angles to all that is alike at gamma and -gamma (alpha_tau, a bent cosine), and moves gamma_0t by at most 19 % (five
    angles) of what it would in ascending order; fitted along, it costs u(gamma_0t) 2 % at most.
    """
    half = plan.gammas // 2
    ascending = [float(g) for g in np.linspace(-plan.gamma_max_rad, plan.gamma_max_rad, plan.gammas)]
    outwards = [g if k % 2 == 0 else -g for k, g in enumerate(ascending[plan.gammas - half :])]
    return [*outwards, *ascending[half : plan.gammas - half], *(-g for g in reversed(outwards))]


def sequence(plan: Plan) -> list[tuple[str, Load]]:
    """Side and load of the steps at one phase angle: up on the left, up on the right, nothing before, between and after."""
    up = [Load(label) for label in plan.masses]
    nothing = ("", NOTHING)
    return [nothing, *(("left", x) for x in up), nothing, *(("right", x) for x in up), nothing]


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return 2 + 4 + plan.detent_angles + plan.gammas * len(sequence(plan))


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look at the wiring and the detent without load, then hang every mass on both ends at every phase angle. A run that goes
    on with a stopped one looks at the wiring again, for it is lifted anew, and begins with the last step that was done."""
    done, each = continued.done(record, OnLever.kind), len(sequence(plan))
    hold.probe(rig, record)
    hold.hold(rig, plan.ki_theta)
    if not _at_home(rig, record, 0.0):
        return
    if not _wiring(rig, plan, record):
        return
    for k in range(0 if done.labels else plan.detent_angles):
        angle = 2 * math.pi / detent_order(rig.file) * k / plan.detent_angles
        if not _at_home(rig, record, angle):
            return
        rig.clock.sleep(plan.settle_s)
        with record_step(record, OverDetent(angle)):
            rig.clock.sleep(plan.average_s)
    if not _at_home(rig, record, 0.0):
        return
    for visit, gamma in enumerate(visits(plan)):
        if done.leaves_out((visit + 1) * each - 1):
            continue
        write(rig, {"motor.phase": gamma})
        if not _loads(rig, plan, record, gamma, done, visit * each):
            return
    write(rig, {"motor.phase": 0.0})
    hold.hold(rig)


def _at_home(rig: Rig, record: Recorder, angle: float) -> bool:
    """Turn to an angle and wait until the rotor stands there; a rotor that does not is told in the recording."""
    try:
        rig.rotation.point(angle)
    except RotorNotArrived as error:
        record.event("not-held", angle=angle, text=str(error))
        hold.release(rig)
        return False
    return True


def _wiring(rig: Rig, plan: Plan, record: Recorder) -> bool:
    """Sideways currents of both signs, to see in the outboard AMB's currents which segment is which; False where two are
    exchanged and nobody says to go on."""
    ramp, machine = stated(rig.file, "motor.ramp").default, conventions(rig.file)
    seen: list[tuple[Sideways, dict[str, Array], int]] = []
    for name, other in (("i_x", "i_y"), ("i_y", "i_x")):
        for value in (plan.wiring_A, -plan.wiring_A):
            write(rig, {CURRENTS[name]: value})
            rig.clock.sleep(2 * plan.wiring_A / ramp + min(plan.settle_s, 0.5))
            asked = {name: value, other: 0.0}
            with record.step(Sideways.kind, **asked):
                read = first_look.samples(rig, record, machine.coils_of("xo", "yo"), 0.2)
            answer = {f"side_{axis}": machine.control(f"{axis}o", read.__getitem__) for axis in "xy"}
            seen.append((Sideways(**asked), answer, rig.clock.now_ns()))
        write(rig, {CURRENTS[name]: 0.0})
    rig.clock.sleep(plan.wiring_A / ramp + min(plan.settle_s, 0.5))
    return first_look.passes(rig, record, checks.wiring(wiring(of_samples(*zip(*seen, strict=True)), machine), machine))


def _loads(rig: Rig, plan: Plan, record: Recorder, gamma: float, done: Done, begin: int) -> bool:
    """All loads at one phase angle, whose first step has the number `begin`; False where those on the left, at the first angle,
    show a wrong sign and nobody says to go on. Of the steps `done` by a run that this one continues the last one is repeated,
    and none of the others."""
    hanging, machine = "", conventions(rig.file)
    seen: list[list[float]] = []
    for number, (side, load) in enumerate(sequence(plan), begin):
        if done.leaves_out(number):
            continue
        if done.repeats(number):
            load = Load(str(done.labels[number]["load"]))  # what really hung
        if hanging and hanging != side:
            rig.operator.lever("left" if hanging == "left" else "right", NOTHING)
        if side:
            load = rig.operator.lever("left" if side == "left" else "right", load)
        hanging = side
        rig.clock.sleep(plan.settle_s)
        with record_step(record, OnLever(gamma, side, load.label), again=done.repeats(number)):
            read = first_look.watched(rig, record, machine.turning, plan.average_s)
        seen.append([read[name] for name in machine.turning])
        left_done = number == len(seen) - 1 == len(plan.masses) + 1
        if left_done and not first_look.passes(rig, record, checks.segments(np.array(seen), machine)):
            return False
    return True


def detent_order(rig: RigFile) -> float:
    """Periods of the detent in a turn: the poles."""
    return 2 * rig.machine["pole_pairs"].value


@dataclass(frozen=True)
class Analysis:
    """Everything the measurements, findings and figures are made of."""

    data: TorqueData
    inputs: dict[str, Estimate]
    detent: Detent
    balance: Balance
    estimates: dict[str, Estimate]


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis:
    """The balance of torques, with its fit and estimates."""
    from procedures.torque_constant import halves

    findings.gate([*of_probe(recording), *checks.of_events(recording)])
    plan, machine = recording.plan, conventions(recording.rig)
    first_look.gate(recording, findings, _sideways(recording))
    data = read_torques(recording)
    findings.gate(checks.of_signals(data, machine, plan))
    a = _fitted(recording, data)
    values = {name: e.value for name, e in a.inputs.items()}
    mass_u = masses_u(recording.rig, plan.masses)
    findings.add(halves.findings(recording, a.detent, values, a.balance.pole_pairs, a.estimates))
    findings.add(checks.of_fit(data, machine, a.balance, a.detent, values, mass_u, arms_u(recording.rig), plan))
    return a


def _sideways(recording: Recording[Plan]) -> Iterator[Finding]:
    """What the sideways currents show, read when it is asked for."""
    yield from checks.wiring(read_wiring(recording), conventions(recording.rig))


def measured(a: Analysis) -> Iterator[Measured]:
    """Both quantities."""
    for quantity in MEASURES:
        yield quantity.measured(a.estimates[quantity.name])


def _fitted(recording: Recording[Plan], data: TorqueData) -> Analysis:
    """Fit and estimates with their influences."""
    from procedures.torque_constant import fit
    from procedures.torque_constant.fit import NO_DETENT

    plan, rig = recording.plan, recording.rig
    inputs, pairs, count = fit_inputs(rig, plan.masses), rig.machine["pole_pairs"].value, len(plan.masses)
    held = NO_DETENT
    if len(data.detent_angle):
        held = fit.detent(data.detent_angle, data.detent_current, detent_order(rig))

    values = {name: e.value for name, e in inputs.items()}
    u = fit.uneven(fit.balance(data.steps, values, count, pairs, held), data.steps)

    def model(p: dict[str, float]) -> dict[str, float]:
        fitted = fit.balance(data.steps, p, count, pairs, held, u)
        return {"alpha_tau": fitted.alpha, "gamma_0t": fitted.gamma_0}

    found = fit.balance(data.steps, values, count, pairs, held, u)
    estimates = propagate(model, inputs)
    root = np.linalg.cholesky(found.covariance)
    parts = [
        Influence(id=f"scatter/{k + 1}", name=f"scatter of the steps ({k + 1})", u=1.0, unit="1", kind="A",
                  distribution="normal", dof=float(found.dof), source="residuals of the fit")
        for k in range(2)
    ]  # fmt: skip
    for row, name in enumerate(("alpha_tau", "gamma_0t")):
        for k in range(row + 1):
            estimates[name] = estimates[name] + Estimate.of(0.0, parts[k]) * float(root[row, k])
    return Analysis(data, inputs, held, found, estimates)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from check_masses(rig, plan.masses)
    if not rig.masses.keys() >= set(plan.masses):
        return
    turn = plan.gamma_max_rad * rig.machine["pole_pairs"].value
    if turn > math.pi / 3:
        yield (f"gamma_max_rad: found {plan.gamma_max_rad:g} rad, {math.degrees(turn):.0f} deg of the electrical turn; "
               "expected 60 deg or less, where the motor still has half of its torque")  # fmt: skip


def figures(a: Analysis, recording: Recording[Plan]) -> Iterable[Figure]:
    """Torque over current per side, the constant over gamma with residuals, detent, one step."""
    from procedures.torque_constant import figures as drawn

    return drawn.all_figures(recording, a.data, a.balance, a.detent, recording.rig.machine["pole_pairs"].value)


procedure = Procedure(
    name="torque-constant",
    title="Torque constant of the motor over the phase angle by weights on a lever",
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
    step_count=step_count,
    continues=OnLever.kind,
    reached=("masses/*", "!masses/density", "geometry/lever_*"),
    assumes=assumptions.TORQUE_CONSTANT,
    method=read_method(__file__),
)
