"""Force constant and magnetic offset of the radial AMBs from eccentric positions (thesis 2.3, Table 2.2).

Measurands, of each radial AMB and axis: beta of T (2.4b), and the offset: how far the shaft is from the
magnetic centre, at the AMB's plane, where both sensors of that axis read zero (their mean over a turn). Beside them what the
linear model without intercept, T (2.9), makes of the same data.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

from bench.errors import DeviceFault, OperatorAbort
from bench.figures import Figure
from bench.findings import Finding, Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.requires import Requires
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.amb_rotor import lift, rings
from procedures.amb_rotor.conventions import AMB_ROTOR, conventions
from procedures.amb_rotor.laws import of_laws
from procedures.amb_rotor.places import HOLD, LIFT, LIFT_LOST, REST, TILT, Held, channels, of_readings, read_steps
from procedures.bearing_model import checks, estimates, wiring
from procedures.bearing_model import figures as drawn
from procedures.bearing_model.comparison import COMPARED
from procedures.bearing_model.estimates import Analysis
from procedures.bearing_model.plan import Plan
from procedures.shared import assumptions, first_look

AXES = AMB_ROTOR.axes
BETA = {a: Quantity(f"beta_{a}", "N m^2/A^2", f"force constant of axis {a}, at the same gap for all") for a in AXES}
OFFSET = {
    a: Quantity(f"offset_{a}", "m", f"axis {a}: from the magnetic centre to where the sensors read zero") for a in AXES
}
OF_LINEAR = {
    "k_linear": Quantity("k_linear", "N/A", "K_i of the linear model without intercept (not a slope of the bearing)"),
    "stiffness_linear": Quantity("stiffness_linear", "N/m", "K_xi of the linear model without intercept"),
    "misfit": Quantity("misfit", "N^2", "sum of squared residuals of the nonlinear model, over all samples"),
    "misfit_linear": Quantity("misfit_linear", "N^2", "sum of squared residuals of the linear model, over all samples"),
    "misfit_ratio": Quantity("misfit_ratio", "1", "residual sum of the linear model over that of the nonlinear one"),
    "misfit_ratio_means": Quantity(
        "misfit_ratio_means",
        "1",
        "the same over batch means, where noise covers less",
        title="misfit ratio of batch means",
    ),
}
MEASURES = (*BETA.values(), *OFFSET.values(), *OF_LINEAR.values())
REST_S = 0.3
BIAS_STEP_A = 0.1
MARGIN = 5e-6  # of the radius: noise, and what the controller swings on the way
GEOMETRY = ("com_to_inboard_sensor", "com_to_outboard_sensor", "com_to_outboard_amb", "amb_span", "amb_gap", "clearance",
            "com_to_coupling", "coupling_stiffness")  # fmt: skip
MACHINE = ("mass", "radial_axes", "runout", "coupling_offset")
REACHED = ("sensors/*", "!sensors/pos_*/offset", "!sensors/i_?o_p/gain", "geometry/amb_gap", "geometry/coupling_stiffness",
           "geometry/com_to_coupling", "geometry/com_to_*_sensor")  # fmt: skip
"""Certificates that the adjustment contradicts before an error of theirs moves a result by 2 U: where what one carries of a
result's standard uncertainty is less than what the positions say of it, both as shares (docs/reference/bearing-model.md)."""
ASKED = "Is the motor's coupling taken off the shaft, so that nothing but the AMBs holds it?"


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Controller parameters that the runner writes before levitation: flatness with constant current sum."""
    machine = conventions(rig)
    integrating = machine.can.settings.get("integrator", {}).get("on", {})
    return {**machine.select(plan.law), **dict.fromkeys(machine.biases, plan.biases_A[0]), **integrating}


def grid(plan: Plan) -> list[tuple[float, float]]:
    """Positions (y, z) within the circle, row by row to and fro, so that every move is a short one."""
    n = math.floor(plan.radius_m / plan.spacing_m + 1e-9)
    levels = [round(k * plan.spacing_m, 9) for k in range(-n, n + 1)]
    rows = []
    for k, z in enumerate(levels):
        row = [(y, z) for y in levels if math.hypot(y, z) <= plan.radius_m * (1 + 1e-9)]
        rows.append(row if k % 2 == 0 else row[::-1])
    return list(itertools.chain.from_iterable(rows))


def tilts(plan: Plan) -> list[tuple[float, float]]:
    """(psi, theta) of the check of the wiring."""
    t = plan.tilt_rad
    return [(0.0, 0.0), (t, 0.0), (-t, 0.0), (0.0, t), (0.0, -t)]


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return 2 + len(tilts(plan)) + len(plan.biases_A) * len(grid(plan))


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look at the shaft on its rings, lift it, tilt it a little, then the grid at each bias."""
    if not plan.coupled and not rig.operator.ask(ASKED):
        raise OperatorAbort("the coupling is on the shaft; expected it off, or a plan with coupled = true")
    with record.step(REST):
        rig.clock.sleep(REST_S)
    machine = conventions(rig.file)
    readings = {name: rig.levitation.reading(name) for name in machine.positions}
    if any(rings.of_readings(readings, rig.file)) or not _lift(rig, record):
        return
    rig.clock.sleep(3 * plan.settle_s)
    tilted = _tilt(rig, plan, record)
    for k, bias in enumerate(plan.biases_A):
        _set_bias(rig, plan, bias)
        held = []
        for y, z in grid(plan) if k % 2 == 0 else reversed(grid(plan)):
            lift.write(rig, {**machine.point("y", y), **machine.point("z", z)})
            rig.clock.sleep(plan.settle_s)
            with record.step(HOLD, y_m=y, z_m=z, bias_A=bias):
                held.append(_watched(rig, plan, record))
        if k == 0 and not first_look.passes(rig, record, _of_first(rig.file, plan, held, tilted)):
            return
    lift.write(rig, {**machine.point("y", 0.0), **machine.point("z", 0.0)})
    rig.clock.sleep(plan.settle_s)


def _lift(rig: Rig, record: Recorder) -> bool:
    with record.step(LIFT):
        try:
            transition(rig, RigState.LEVITATED)
        except DeviceFault as fault:
            record.event(LIFT_LOST, fault=str(fault))
            return False
    return True


def _set_bias(rig: Rig, plan: Plan, bias: float) -> None:
    """In small steps: each one is a push, until the integrators have taken it up."""
    biases = conventions(rig.file).biases
    before = rig.levitation.get(biases[0])
    count = math.ceil(abs(bias - before) / BIAS_STEP_A - 1e-3)
    for k in range(count):
        lift.write(rig, dict.fromkeys(biases, before + (bias - before) * (k + 1) / count))
        rig.clock.sleep(plan.settle_s / 2)
    rig.clock.sleep(plan.settle_s if count else 0.0)


def _watched(rig: Rig, plan: Plan, record: Recorder) -> dict[str, float]:
    """Positions and currents at a place, as they come while the step is recorded, SI."""
    machine = conventions(rig.file)
    return first_look.watched(rig, record, (*machine.positions, *machine.currents), plan.average_s)


def _of_first(
    rig: RigFile, plan: Plan, held: Sequence[Mapping[str, float]], tilted: Sequence[Mapping[str, float]]
) -> list[Finding]:
    """What the positions at the first bias show of the wiring, by what was read in each."""
    (y, z), (psi, theta) = zip(*grid(plan), strict=True), zip(*tilts(plan), strict=True)
    machine = conventions(rig)
    places = of_readings({"y_m": y, "z_m": z}, held, machine)
    tilt = of_readings({"psi_rad": psi, "theta_rad": theta}, tilted, machine)
    return list(wiring.of_wiring(places, tilt, rig)) or list(wiring.of_models(places, tilt, rig, plan))


def _tilt(rig: Rig, plan: Plan, record: Recorder) -> list[dict[str, float]]:
    seen = []
    machine = conventions(rig.file)
    for psi, theta in tilts(plan):
        lift.write(rig, {**machine.point("psi", psi), **machine.point("theta", theta)})
        rig.clock.sleep(plan.settle_s)
        with record.step(TILT, psi_rad=psi, theta_rad=theta):
            seen.append(_watched(rig, plan, record))
    lift.write(rig, machine.point("theta", 0.0))
    return seen


def read(recording: Recording[Plan]) -> tuple[Held, Held]:
    """The positions, and the tilts before them."""
    batches = recording.plan.batches
    return read_steps(recording, HOLD, ("y_m", "z_m", "bias_A"), batches), read_steps(
        recording, TILT, ("psi_rad", "theta_rad"), batches
    )


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis:
    """The adjustment of all positions, and both models compared."""
    findings.gate(rings.before(recording))
    held, tilted = read(recording)
    findings.gate(first_look.with_first(recording, _of_data(recording, held, tilted)), checks.FATAL)
    a = estimates.evaluate(recording, held)
    findings.add(checks.of_results(a, recording.plan))
    return a


def measured(a: Analysis) -> Iterator[Measured]:
    """Each axis, then the comparison of each AMB."""
    for axis in a.held.machine.axes:
        yield BETA[axis].measured(a.estimates[f"beta_{axis}"])
        yield OFFSET[axis].measured(a.estimates[f"offset_{axis}"])
    for where in a.held.machine.planes:
        for name in COMPARED:
            yield OF_LINEAR[name].measured(a.estimates[f"{name}_{where}"], where)


def _of_data(recording: Recording[Plan], held: Held, tilted: Held) -> Iterator[Finding]:
    plan, rig = recording.plan, recording.rig
    found = [*checks.of_signals(held, tilted, plan), *wiring.of_wiring(held, tilted, rig)]
    yield from found
    if not any(f.code in checks.FATAL for f in found):
        yield from wiring.of_models(held, tilted, rig, plan)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from of_laws(conventions(rig), "law", [plan.law])
    places = len(grid(plan))
    if places < 9:
        yield f"spacing_m, radius_m: found {places} positions; expected nine or more"
    g = rig.geometry
    room = min(rings.room(rig), rig.envelope.max_levitated_position_m) - MARGIN
    if plan.radius_m > room:
        yield (
            f"radius_m: found {plan.radius_m * 1e6:.1f} µm; the ring, the sensors' zeros and their runout leave "
            f"{room * 1e6:.1f} µm"
        )
    machine = conventions(rig)
    for name in (*machine.point("y", 0.0), *machine.point("z", 0.0)):
        if plan.radius_m > rig.parameters[name].high:
            yield f"radius_m: found {plan.radius_m * 1e6:.1f} µm; {name} goes to {rig.parameters[name].high * 1e6:.0f} µm"
    arm = max(g[k].value for k in ("com_to_inboard_sensor", "com_to_outboard_sensor"))
    tilted = machine.point("psi", plan.tilt_rad)
    if any(abs(value) > rig.parameters[name].high for name, value in tilted.items()) or plan.tilt_rad * arm > room:
        yield f"tilt_rad: found {plan.tilt_rad * 1e6:.0f} µrad; reference and ring allow less"
    allowed, limit = rig.parameters[machine.biases[0]], rig.parameters[machine.can.current_limit].default
    low, high = allowed.low, min(allowed.high, limit / 2)
    for bias in plan.biases_A:
        if not low <= bias <= high:
            yield (
                f"biases_A: found {bias:g} A; parameter and amplifiers, which have to give twice that, leave {low:g} to "
                f"{high:g} A"
            )


def figures(a: Analysis, recording: Recording[Plan]) -> Iterable[Figure]:
    """Positions, currents, forces by both models and residuals."""
    return drawn.all_figures(a, recording.rig)


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    return Requires(
        lacks=(*machine.lacks, *machine.unweighed),
        channels=channels(machine),
        sensors=(*machine.positions, *machine.currents),
        capabilities=("set_points", "bias", "current_limit"),
        geometry=GEOMETRY,
        machine=MACHINE,
        uses=("settings.law",),
    )


procedure = Procedure(
    name="bearing-model",
    title="Force constants and magnetic offsets of the radial AMBs by eccentric positioning",
    measures=MEASURES,
    state=RigState.READY,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    settings=settings,
    step_count=step_count,
    reached=REACHED,
    assumes=assumptions.BEARING_MODEL,
    method=read_method(__file__),
)
