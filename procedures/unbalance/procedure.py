"""Unbalance response: dwells of the turning shaft at given speeds, with slow roll, orbits and zones (T 2.6.1, Fig. 2.7).

Measurands, by speed and setting: vectors of the shaft's centre of order 1 at each probe, major half axis of each plane's orbit,
D_max and its share of the clearance (ISO 14839-2), currents and voltages of the coils.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from bench.figures import Shown
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.amb_rotor import lift, pushes, wiring
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.laws import of_laws, of_variants
from procedures.shared import assumptions, first_look
from procedures.synchronous import bearings, dwelling, fitting
from procedures.synchronous.default_speeds import within_envelope
from procedures.synchronous.dwells import can_capture, read_dwells
from procedures.unbalance import sequence
from procedures.unbalance.plan import Plan
from procedures.unbalance.requires import requires

if TYPE_CHECKING:
    from procedures.synchronous.estimates import Results

COSINE = Quantity(
    "vector_cos",
    "m",
    "order 1 of the shaft's centre at a probe's plane, along the probe: cosine component, 0-pk",
    title="order 1, cos",
)
SINE = Quantity(
    "vector_sin",
    "m",
    "as vector_cos: sine component; x = C cos θ + S sin θ, θ from the once-per-turn mark",
    title="order 1, sin",
)
MAJOR = Quantity("major_half_axis", "m", "of the order-1 orbit of the shaft's centre in a sensor plane, 0-pk")
D_MAX = Quantity(
    "d_max",
    "m",
    "greatest distance of the shaft's centre from the clearance's, static offset included (ISO 14839-2)",
    title="D_max",
)
SHARE = Quantity("d_max_share", "1", "D_max over the least clearance", title="D_max / clearance")
READ = Quantity(
    "reading",
    "m",
    "order 1 as the probes read it, runout included: root mean square of the four amplitudes, 0-pk",
    title="order 1 as read",
)
CURRENT = Quantity("current_peak", "A", "coil current of a plane that is exceeded for 1 % of the time")
VOLTAGE = Quantity("voltage_peak", "V", "coil voltage of a plane that is exceeded for 1 % of the time, either way")
MEASURES = (COSINE, SINE, MAJOR, D_MAX, SHARE, READ, CURRENT, VOLTAGE)
OF_CAPTURES = (CURRENT, VOLTAGE)
"""What is read of captures alone."""
LESS_RUNOUT = tuple(q.name for q in (COSINE, SINE, MAJOR, D_MAX, SHARE))


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Lifted by the PID, which needs no model."""
    machine = conventions(rig)
    return {**machine.lifting, **(machine.poles if plan.observed else {})}


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records, for the progress display."""
    return lift.STEPS + (plan.slow_rad_s > 0) + plan.dwells + plan.repeat


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Look at the shaft on its rings, lift it, nudge it, roll it slowly, and let it dwell at each speed with each setting."""
    if not sequence.begin(rig, plan, record):
        return
    if sequence.dwell(rig, plan, record):
        sequence.repeat_lowest(rig, plan, record)
    dwelling.stop(rig)


def evaluate(recording: Recording[Any], findings: Findings) -> Results:
    """Vectors, orbits, D_max and what the coils need, of each dwell."""
    from procedures.synchronous import checks, estimates, identified
    from procedures.synchronous.coil_peaks import find_uncertified
    from procedures.synchronous.hum import listen, of_dwells

    first_look.gate(recording, findings, wiring.before_orbits(recording))
    findings.gate([*wiring.before_orbits(recording), *checks.before(recording)])
    dwells, plan = read_dwells(recording), recording.plan
    findings.gate([*checks.of_signals(dwells, plan.max_lost, plan.max_speed_error), *checks.sampling(dwells, plan.orders),
                   *checks.slow_roll(dwells, plan.speeds_rad_s, LESS_RUNOUT)])  # fmt: skip
    known = bearings.Known.of(recording.calibrations, plan.beta_share, plan.offset_u_m)
    known = identified.of_dwells(dwells, recording.rig, known)
    findings.gate(bearings.unknown(known, recording.rig))
    results = estimates.results(dwells, recording.rig, known)
    findings.add((bearings.describe(known), *find_uncertified(recording.rig), *dwelling.uncaptured(recording.rig)))
    findings.add(dwelling.left_out(recording.rig))
    findings.add(of_dwells(listen(recording, results.slow), results.dwells))
    findings.add(checks.of_results(results))
    return results


def measured(results: Results) -> Iterator[Measured]:
    """The quantities of each dwell but the repeat."""
    known = {q.name: q for q in MEASURES}
    for result in results.dwells:
        if not result.dwell.again:
            for (name, place), estimate in result.estimates.items():
                yield known[name].measured(estimate, f"{place}, {result.dwell.where}" if place else result.dwell.where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from of_laws(conventions(rig), "law", [plan.law])
    yield from of_variants(conventions(rig), "variants", plan.variants)
    yield from fitting.of_speeds(rig, plan.speeds_rad_s)
    if len(set(plan.variants)) < len(plan.variants) or (plan.observed and plan.law in ("", conventions(rig).plain_law)):
        yield "variants: expected each once, and with the plain law off alone: it compensates nothing"
    yield from fitting.of_slow_roll(rig, plan.slow_rad_s, plan.slow_s, plan.speeds_rad_s)
    yield from fitting.of_bearings(rig, plan.slow_rad_s, len(plan.speeds_rad_s))
    yield from fitting.of_captures(rig, plan.capture_s, plan.rate_hz, plan.orders, plan.speeds_rad_s)


def figures(results: Results, recording: Recording[Plan]) -> Iterable[Shown]:
    """Orbits of both planes, Bode pair, polar plot, full spectra, what the coils need."""
    from procedures.unbalance import figures as drawn

    return drawn.all_figures(results, recording.rig)


def of_captures(rig: RigFile) -> tuple[Quantity, ...]:
    """What a rig cannot show whose controller captures nothing, or no coil voltages."""
    if not can_capture(rig):
        return OF_CAPTURES
    return () if conventions(rig).voltages else (VOLTAGE,)


procedure = Procedure(
    name="unbalance",
    places=("at rest",),
    title="Unbalance response of the turning shaft",
    measures=MEASURES,
    state=RigState.READY,
    plan=Plan,
    planned=lambda rig: within_envelope(rig, Plan, "speeds_rad_s"),
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    untold=of_captures,
    check=check,
    settings=settings,
    step_count=step_count,
    steps_on=lambda rig, plan: step_count(plan) + pushes.count(rig),
    needs=lambda plan: bearings.needs(plan.bearings),
    assumes=assumptions.UNBALANCE,
    method=read_method(__file__),
)
