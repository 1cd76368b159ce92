"""Sensitivity of the control loops by injection (ISO 14839-3 in its sense): S = V1/E at each axis, all other loops closed.

Measurands, by axis and speed: greatest |S| with its frequency, phase margin, and how far the loop's gain may fall and rise.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from bench.analysis.responses import Response, image_distance
from bench.errors import AnalysisError
from bench.figures import Figure
from bench.findings import Findings
from bench.procedure import Measured, Procedure, Quantity, read_method
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.capture import Layout
from procedures.amb_rotor import lift, pushes, wiring
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.laws import of_laws
from procedures.sensitivity import estimates, fitting, modes, sines
from procedures.sensitivity.estimates import Candidate, Result
from procedures.sensitivity.fitting import chosen_axes
from procedures.sensitivity.injection import Comb, combs, inject, repeated
from procedures.sensitivity.plan import Plan
from procedures.sensitivity.requires import requires
from procedures.sensitivity.steps import (
    HALF,
    INJECT,
    MODE,
    REFINED,
    SCAN,
    SURVEY,
    WIRING,
    captured_channels,
    folds,
    grid_of,
    read_taken,
    sensitivity,
)
from procedures.shared import assumptions, first_look

S_MAX = Quantity("s_max", "1", "greatest |V1/E| of an axis, all other loops closed (ISO 14839-3)", title="S_max")
AT = Quantity("s_max_hz", "Hz", "frequency of the greatest |V1/E|", title="frequency of S_max")
PHASE = Quantity("phase_margin", "rad", "least angle of the open loop L = 1/S - 1 from -1 where |L| = 1, either way")
FALL = Quantity("gain_reduction", "1", "factor to which the loop's gain may fall before it is unstable")
RISE = Quantity("gain_increase", "1", "factor to which the loop's gain may rise before it is unstable")
MEASURES = (S_MAX, AT, PHASE, FALL, RISE)
MARGIN_S = 0.1  # of a capture, for the first and last pulse
FOLLOWED_HZ, FOLLOWED = 8.0, 12  # lines at its odd multiples: below 200 Hz coils follow their references


def surveys(plan: Plan, speed: float) -> list[tuple[str, float, Comb]]:
    """The combs of the first pass with their kind and what they are about: the whole range, and finer about the modes.

    The lines of the whole range stand half a step off its multiples: what the bearings' curvature makes of two lines, sum
    and difference, falls between them (Pintelon and Schoukens, System Identification, 2nd ed., 3.4). Where the shaft turns
    it is a quarter where that keeps them apart from their images by the orbit.
    """
    a, step = plan.amplitude_A, 2 * plan.low_hz
    share = _share(step, speed)
    high = plan.high_step_hz * (math.floor(plan.middle_hz / plan.high_step_hz) + 0.5)
    out = [(WIRING, 0.0, Comb(FOLLOWED_HZ, 2 * FOLLOWED_HZ, FOLLOWED, a))]
    out += [(SURVEY, 0.0, c) for c in combs(share * step, step, min(plan.middle_hz, plan.high_hz), a)]
    if high < plan.high_hz:
        out += [(SURVEY, 0.0, c) for c in combs(high, plan.high_step_hz, plan.high_hz, a)]
    if plan.scan_step_hz and high < plan.high_hz:
        first = plan.middle_hz + _share(plan.scan_step_hz, speed) * plan.scan_step_hz
        out += [(SCAN, 0.0, c) for c in combs(first, plan.scan_step_hz, plan.high_hz, a)]
    for hz in plan.modes_hz:
        step = estimates.binary(plan.mode_damping * hz)  # half of the half-power width 2 zeta f
        low = step * math.floor((hz - plan.mode_within_hz) / step)
        out += [(MODE, hz, c) for c in combs(low, step, hz + plan.mode_within_hz, a)]
    return out


def _share(step: float, speed: float) -> float:
    """By which share of a step lines stand off its multiples: half of one, or where the turning shaft's orbit has their images
    clear of them."""
    turns = speed / (2 * math.pi * step)
    return max((0.5, 0.25, 0.75), key=lambda share: image_distance(share, turns)) if speed else 0.5


def refinements(plan: Plan, about: Candidate, speed: float) -> list[tuple[str, float, Comb]]:
    """The second pass about a peak, at the plan's amplitude and at half of it."""
    first, step, count = about.lines(speed)
    return [(k, about.hz, Comb(first, step, count, plan.amplitude_A * f)) for k, f in ((REFINED, 1.0), (HALF, 0.5))]


def first_pass(rig: RigFile, plan: Plan, speed: float) -> list[tuple[str, float, Comb]]:
    """What is injected first: combs, or sines where the controller makes one at a time."""
    made = sines.surveys(rig, plan) if sines.makes_one(rig) else surveys(plan, speed)
    return [(kind, about, repeated(comb, sines.rate(rig, plan))) for kind, about, comb in made]


def size(rig: RigFile, kind: str, speed: float) -> int:
    """Bytes of a sample of what is captured."""
    assert rig.capture is not None
    return Layout.of(rig.capture, captured_channels(conventions(rig), kind, speed)).sample.itemsize


def settings(rig: RigFile, plan: Plan) -> dict[str, float]:
    """Lifted by the PID, which needs no model; nothing compensated, nothing injected."""
    del plan
    can = rig.capabilities.injection
    return {**conventions(rig).lifting, **({can.axis: can.off} if can is not None else {})}


def step_count(plan: Plan) -> int:
    """How many steps `acquire` records at least, for the progress display."""
    return lift.STEPS + len(plan.speeds_rad_s) * max(1, len(plan.axes)) * (len(surveys(plan, 0.0)) + 2)


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Lift the shaft, nudge it, and at each speed inject into each axis: the survey, then finer where it peaks."""
    if not lift.lift_and_nudge(rig, record):
        return
    machine = conventions(rig.file)
    lift.write(rig, machine.select(plan.law))
    rig.clock.sleep(plan.settle_s)
    number = 0
    for speed in sorted(plan.speeds_rad_s):
        if speed and not lift.bring_to_speed(rig, record, speed, plan.settle_s):
            break
        for axis in chosen_axes(rig.file, plan):
            number = _axis(rig, plan, record, speed, axis, number)
    if rig.drive is not None and max(plan.speeds_rad_s) > 0:
        rig.drive.stop()
        rig.drive.coast()
        rig.clock.sleep(machine.stands_s)
    lift.write(rig, machine.select(machine.plain_law))


def _axis(rig: Rig, plan: Plan, record: Recorder, speed: float, axis: str, number: int) -> int:
    """Both passes of an axis; the number of the next capture."""
    seen: list[Response] = []
    scans: list[Response] = []
    about_modes: list[Response] = []
    one = sines.makes_one(rig.file)
    for kind, about, comb in first_pass(rig.file, plan, speed):
        found = _take(rig, plan, record, speed, axis, kind, about, comb, number)
        if found is not None and kind != WIRING:
            {SCAN: scans, MODE: about_modes}.get(kind, seen).append(found)
        number += 1
    for comb in modes.unnamed(scans, plan):
        found = _take(rig, plan, record, speed, axis, MODE, comb.hz[comb.count // 2], comb, number)
        about_modes += [found] if found is not None else []
        number += 1
    if one:
        seen, about_modes = sines.as_one([*seen, *about_modes]), []
    for candidate in estimates.candidates(seen, one, about_modes):
        again = sines.refinements(rig.file, plan, candidate) if one else refinements(plan, candidate, speed)
        for kind, about, comb in again:
            _take(rig, plan, record, speed, axis, kind, about, comb, number)
            number += 1
    return number


def _take(
    rig: Rig, plan: Plan, record: Recorder, speed: float, axis: str, kind: str, about: float, comb: Comb, number: int
) -> Response | None:
    """Inject, capture, upload; what S seems to be, for deciding how to go on; None where that cannot be told."""
    comb = repeated(comb, sines.rate(rig.file, plan))
    labels: dict[str, float | str] = {
        "axis": axis, "speed_rad_s": speed, "pass": kind, "about_hz": about, "number": number, "first_hz": comb.first,
        "step_hz": comb.step, "lines": comb.count, "period_s": comb.period_s, "amplitude_A": comb.amplitude,
    }  # fmt: skip
    assert rig.capture is not None
    pulses = MARGIN_S + 4 * math.pi / speed if speed else 0.0
    seconds = comb.period_s * (plan.refined_periods if kind in (REFINED, HALF) else plan.periods)
    if kind in (REFINED, HALF):  # as many as fit
        most = rig.capture.memory_bytes / size(rig.file, kind, speed) / sines.rate(rig.file, plan) - pulses
        seconds = comb.period_s * min(plan.refined_periods, math.floor(most / comb.period_s))
    seconds += pulses
    with inject(rig, axis, comb, plan.survey_start_s if kind == SURVEY else plan.start_s):
        with record.step(INJECT, **labels):
            names = captured_channels(conventions(rig.file), kind, speed)
            rig.capture.arm(names, seconds=seconds, rate_hz=sines.rate(rig.file, plan))
            rig.capture.wait(seconds + 5.0)
    data, grid = rig.capture.upload(None, **labels), grid_of(labels)
    if folds(grid, data.rate_hz):
        return None
    t = data.start_ns * 1e-9 + np.arange(len(data.columns["inject"])) / data.rate_hz
    try:
        return sensitivity(data.columns, t, data.rate_hz, grid, conventions(rig.file).pulsed)[0]
    except AnalysisError:
        return None  # which the analysis tells


def evaluate(recording: Recording[Any], findings: Findings) -> list[Result]:
    """S, its peak and the margins, of each axis and speed."""
    from procedures.sensitivity import checks

    first_look.gate(recording, findings, wiring.before_orbits(recording))
    findings.gate([*wiring.before_orbits(recording), *checks.before(recording)])
    plan, taken = recording.plan, sines.joined(read_taken(recording))
    findings.gate(checks.of_signals(taken, plan))
    results = estimates.results(taken)
    findings.add(checks.of_results(results, plan))
    return results


def measured(results: Sequence[Result]) -> Iterator[Measured]:
    """The quantities of each axis and speed."""
    known = {q.name: q for q in MEASURES}
    for result in results:
        for name, estimate in result.estimates.items():
            yield known[name].measured(estimate, result.where)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    yield from of_laws(conventions(rig), "law", [plan.law])
    yield from fitting.of_plan(
        rig, plan, [(kind, comb) for s in plan.speeds_rad_s for kind, _, comb in first_pass(rig, plan, s)]
    )


def figures(results: Sequence[Result], recording: Recording[Plan]) -> Iterable[Figure]:
    """|S| over its zones, Bode pair of S, Nyquist plot and coherence, by speed."""
    from procedures.sensitivity import figures as drawn

    del recording
    return drawn.all_figures(results)


procedure = Procedure(
    name="sensitivity",
    places=("at rest",),
    title="Sensitivity of the control loops",
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
    steps_on=lambda rig, plan: step_count(plan) + pushes.count(rig),
    optional=(PHASE, FALL, RISE),  # a margin that the survey does not resolve is not told
    assumes=assumptions.SENSITIVITY,
    method=read_method(__file__),
)
