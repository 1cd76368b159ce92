"""Tracking: the centre of mass follows an ellipse, at rest (thesis 2.6.2, Fig. 2.10) or turning (thesis 3.5, Fig. 3.6).

Measurands, per law: peak and rms of the error in y and z, ratio of the amplitudes and phase lag at the reference's
frequency, the tilts psi and theta, what is left to the touchdown rings, and what the coils carry.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from bench.errors import Lacking
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.capabilities import Path
from bench.uncertainty import Estimate
from bench.units import RPM
from procedures.amb_rotor import frame, lift, pushes, wiring
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.geometry import nominal
from procedures.amb_rotor.laws import of_laws
from procedures.amb_rotor.machine import Law
from procedures.shared import first_look
from procedures.tracking import by_points
from procedures.tracking.plan import Plan
from procedures.tracking.requires import requires
from procedures.tracking.steps import GROWN, ORBIT, START, STARTED, Orbit, read_orbits

PEAK = Quantity("error_peak", "m", "greatest error of the centre of mass in the mean revolution of the reference")
PLANE = Quantity("error_peak_plane", "m", "as error_peak, at the sensor where it is greatest")
RMS = Quantity("error_rms", "m", "root mean square of the error of the centre of mass")
RATIO = Quantity("amplitude_ratio", "1", "amplitude at the reference's frequency over the reference's")
LAG = Quantity("phase_lag", "rad", "phase behind the reference at its frequency")
TILT = Quantity("tilt", "rad", "greatest tilt about that axis in the mean revolution of the reference", title="tilt")
DISTANCE = Quantity("ring_distance", "m", "least distance that is left to a touchdown ring")
LOW = Quantity("lower_current", "A", "mean current of the lower coil that carries most")
HIGH = Quantity("upper_current", "A", "mean current of the upper coil that carries most")
CONTOUR = Quantity(
    "contour_peak", "m", "greatest distance of the mean revolution from the ellipse, along its normal, with set points"
)
CONTOUR_RMS = Quantity("contour_rms", "m", "root mean square of the same")
OF_PATH = (PEAK, PLANE, RMS, LOW, HIGH)
OF_POINTS = (CONTOUR, CONTOUR_RMS)
MEASURES = (CONTOUR, CONTOUR_RMS, PEAK, PLANE, RMS, RATIO, LAG, TILT, DISTANCE, LOW, HIGH)
ALONG = {PEAK: "yz", RMS: "yz", RATIO: "yz", LAG: "yz", TILT: ("psi", "theta")}
"""Quantities of a direction of the shaft's motion, which is a part of their place."""
UM = 1e6
MARK_M = 15e-6  # of the jump that the reference starts with
GROW, GROW_S = 25, 0.02
FASTEST_HZ = 100.0  # of set points that a host writes one after the other
NEAR = 0.95  # of the ring's clearance: no reference may go further


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Lifted by the PID, which needs no model; with the poles of T 3.5 where disturbances are compensated."""
    machine = conventions(rig)
    observed = {**machine.variants.get("corrected", {}), **machine.poles} if plan.observed else {}
    path = {} if machine.can.path is None else {machine.can.path.on: 0.0}
    return {**machine.select(machine.plain_law), **path, **observed}


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return lift.STEPS + 1 + 2 * len(plan.order)


def steps_on(rig: RigFile, plan: Plan) -> int:
    """How many there are on a rig: an orbit of set points has no start, and nothing before it."""
    own = step_count(plan) if rig.capabilities.path is not None else lift.STEPS + len(plan.order)
    return own + pushes.count(rig)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look at the rotor on its rings, lift it, nudge it, spin it up, and let it follow the reference with each law."""
    if not lift.lift_and_nudge(rig, record):
        return
    if rig.file.capabilities.path is None:
        half_y, half_z = by_points.sizes(rig.file, plan)
        for law in plan.order:
            lift.write(rig, conventions(rig.file).select(law))
            rig.clock.sleep(plan.settle_s)
            labels = {"law": law, "judged": law in plan.judged, "hz": plan.points_hz, "y_m": half_y, "z_m": half_z,
                      "speed_rad_s": 0.0, "ratio": 1}  # fmt: skip
            if not by_points.follow(rig, plan, record, labels, ORBIT):
                return
        lift.write(rig, conventions(rig.file).select(conventions(rig.file).plain_law))
        return
    _start(rig, plan, record)
    if plan.speed_rad_s and not lift.bring_to_speed(rig, record, plan.speed_rad_s, plan.settle_s):
        return
    machine = conventions(rig.file)
    for law in plan.order:
        lift.write(rig, machine.select(law))
        rig.clock.sleep(plan.settle_s)
        _orbit(rig, plan, record, law)
    lift.write(rig, {_path(rig).on: 0.0})
    if plan.speed_rad_s and rig.drive is not None:
        rig.drive.stop()
    lift.write(rig, machine.select(machine.plain_law))
    rig.clock.sleep(machine.stands_s)


def _start(rig: Rig, plan: Plan, record: Recorder) -> None:
    """The reference starts at rest with a small jump of z, whose time the currents tell. From here on it never stops: its phase
    is known for every law, at any speed."""
    path = _path(rig)
    told = ((path.hz, plan.hz), (path.ratio, plan.ratio), (path.phase, 0.0), (path.ramp_s, 0.0), (path.y, 0.0),
            (path.z, MARK_M))  # fmt: skip
    lift.write(rig, {name: value for name, value in told if name})
    rig.clock.sleep(plan.settle_s)
    with record.step(START):
        rig.clock.sleep(0.1)
        rig.levitation.set(path.on, 1.0)
        record.event(STARTED)  # after the answer: with the write itself it brackets the start
        rig.clock.sleep(0.02)


def _path(rig: Rig) -> Path:
    path = rig.file.capabilities.path
    if path is None:
        raise Lacking("capabilities.path: found none")
    return path


def _orbit(rig: Rig, plan: Plan, record: Recorder, law: Law) -> None:
    """The reference grows, settles, and shrinks to its mark again."""
    for part in range(1, GROW + 1):
        _size(rig, plan, part / GROW)
    with record.step(GROWN, law=law):  # the longer, the better it tells the reference's frequency
        rig.clock.sleep(plan.settle_s)
    half_y, half_z = by_points.sizes(rig.file, plan)
    labels = {"hz": plan.hz, "y_m": half_y, "z_m": half_z, "speed_rad_s": plan.speed_rad_s, "ratio": plan.ratio}
    with record.step(ORBIT, law=law, judged=law in plan.judged, **labels):
        rig.clock.sleep(plan.revolutions / plan.hz + 0.05)
    for part in range(GROW - 1, -1, -1):
        _size(rig, plan, part / GROW)


def _size(rig: Rig, plan: Plan, share: float) -> None:
    path = _path(rig)
    half_y, half_z = by_points.sizes(rig.file, plan)
    lift.write(rig, {path.y: half_y * share, path.z: max(half_z * share, MARK_M)})
    rig.clock.sleep(GROW_S)


@dataclass(frozen=True)
class Results:
    """The settings, the orbits, and the estimates of each law."""

    plan: Plan
    orbits: Sequence[Orbit]
    by_law: Mapping[str, Mapping[str, Estimate]]


def evaluate(recording: Recording[Plan], findings: Findings) -> Results:
    """Errors, tilts and distances of each law's orbit."""
    from procedures.tracking import checks, estimates, lost

    first_look.gate(recording, findings, wiring.before_orbits(recording))
    findings.gate(wiring.before_orbits(recording))
    findings.gate(lost.of_lost_orbit(recording))
    plan, orbits = recording.plan, read_orbits(recording)
    findings.gate(checks.of_signals(orbits, plan), checks.FATAL)
    by_law = estimates.by_law(orbits, recording.rig, plan.runout_m)
    findings.add(checks.of_results(orbits, by_law, plan))
    findings.add(frame.describe(recording.rig, ("y", "z")))
    return Results(plan, orbits, by_law)


def measured(results: Results) -> Iterator[Measured]:
    """The quantities of each law that is judged; the others are in a note."""
    for orbit in results.orbits:
        if orbit.law in results.plan.judged:
            found = results.by_law[orbit.law]
            yield from (quantity.measured(found[name], where) for name, quantity, where in placed(orbit, found))


def placed(orbit: Orbit, found: Iterable[str]) -> Iterator[tuple[str, Quantity, str]]:
    """What is told of an orbit, by the names of `estimates`: quantity and place."""
    for quantity in MEASURES:
        for direction in ALONG.get(quantity, ("",)):
            name = f"{quantity.name}_{direction}" if direction else quantity.name
            if name in found:
                yield name, quantity, f"{direction}, {orbit.where}" if direction else orbit.where


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    machine = conventions(rig)
    if plan.observed and "corrected" not in machine.variants:
        yield "observer: found no capabilities.settings.compensation.corrected; expected observer = false"
    for key, laws in (("laws", plan.laws), ("compare", plan.compare)):
        yield from of_laws(machine, key, laws)
        if len(set(laws)) < len(laws):
            yield f"{key}: found one twice; expected each once"
    if rig.capabilities.path is None:
        yield from _points(rig, plan)
        return
    ring = NEAR * machine.clearance
    far = max(by_points.sizes(rig, plan))
    if far > ring:
        yield f"y_m, z_m: found {far * UM:g} µm; expected at most {ring * UM:g} µm, {NEAR:.0%} of the ring's clearance"
    if (half_z := by_points.sizes(rig, plan)[1]) < MARK_M:
        yield f"z_m: found {half_z * UM:g} µm; expected {MARK_M * UM:g} µm or more, the jump that the reference starts with"
    most = rig.envelope.max_speed_rad_s
    if plan.speed_rad_s > most:
        yield f"speed_rad_s: found {plan.speed_rad_s * RPM:.0f} r/min; the envelope allows {most * RPM:.0f} r/min"
    if plan.speed_rad_s and "drive" not in {role for d in rig.devices.values() for role in d.roles}:
        yield f"speed_rad_s: found {plan.speed_rad_s * RPM:.0f} r/min and no device with role drive; expected 0"
    if 0 < plan.speed_rad_s < 20 * math.pi * plan.hz * plan.ratio:
        yield (
            f"speed_rad_s: found {plan.speed_rad_s * RPM:.0f} r/min; expected 0, or ten times the reference's "
            f"{plan.hz:g} Hz or more: else averaging over a turn takes the reference with it"
        )


def _points(rig: RigFile, plan: Plan) -> Iterator[str]:
    """What set points cannot do."""
    machine = conventions(rig)
    highs = [rig.parameters[name].high / abs(value) for c in "yz" for name, value in machine.point(c, 1.0).items()]
    most = min(NEAR * machine.clearance, *highs)
    if max(by_points.sizes(rig, plan)) > most:
        far = max(by_points.sizes(rig, plan))
        yield f"y_m, z_m: found {far * UM:g} µm; expected at most {most * UM:g} µm, by rings and set points"
    if plan.speed_rad_s:
        yield "speed_rad_s: set points are followed by a shaft at rest; expected 0"
    if plan.ratio != 1:
        yield f"ratio: found {plan.ratio}; set points make an ellipse, expected 1"
    if plan.points_hz * plan.points > FASTEST_HZ:
        yield (f"points, points_hz: found {plan.points_hz * plan.points:g} set points in a second; expected at most "
               f"{FASTEST_HZ:g}")  # fmt: skip


def figures(results: Results, recording: Recording[Plan]) -> Iterable[Figure]:
    """Orbits with the ring, errors over time and over the reference's revolution, tilts, coil currents."""
    from procedures.tracking import figures as drawn

    facts = {o.law: nominal(recording.rig, o.t_0) for o in results.orbits}
    return drawn.all_figures(results.orbits, facts)


procedure = Procedure(
    name="tracking",
    places=("at rest",),
    title="Tracking: the centre of mass follows an ellipse",
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
    steps_on=steps_on,
    untold=lambda rig: OF_POINTS if rig.capabilities.path is not None else OF_PATH,
    reached=("curvature/*",),  # the second order of influences that are listed themselves
    former_steps=lambda plan: lift.STEPS + 1 + len(plan.order),  # what came before an orbit was not recorded
    method=read_method(__file__),
)
