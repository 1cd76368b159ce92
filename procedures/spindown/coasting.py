"""Spindown of a shaft that an external drive turns, with a once-per-turn mark: the drive lets go, and the shaft coasts down.

The mark counts one way, so that all run-downs go one way, at the bias that the controller has: B and T_c of that. The times of
the mark's edges are the angle; nothing else is fitted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.errors import NotReached
from bench.figures import Figure, Series
from bench.findings import Effect, Finding, Findings
from bench.procedure.rig import Rig
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.roles import SPEED, is_bound
from bench.uncertainty import Estimate
from procedures.amb_rotor.conventions import conventions
from procedures.spindown import coasts, fit
from procedures.spindown.coasts import COAST, SPIN, Coasting, Short, read_coasts, slowest
from procedures.spindown.plan import Plan

NOT_REACHED = "not-reached"


@dataclass(frozen=True)
class Coasted:
    """The run-downs and what they say, by quantity."""

    runs: tuple[Coasting, ...]
    estimates: Mapping[str, Estimate]


def settings(rig: RigFile) -> dict[str, float]:
    """Lifted by the law that needs no model, nothing compensated."""
    return conventions(rig).lifting


def steps(plan: Plan) -> int:
    """How many `acquire` records."""
    return 2 * plan.repeats


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Turn the levitated shaft by the drive, let go of it, and wait until it is slow; several times."""
    assert rig.drive is not None  # `requires` asks for one
    for repeat in range(plan.repeats):
        labels = {"repeat": repeat, "by": "drive"}
        try:
            rig.drive.reach(plan.speed_rad_s)
        except NotReached as error:
            record.event(
                NOT_REACHED, wanted=plan.speed_rad_s, reached=rig.drive.speed_rad_s, by="drive", why=str(error)
            )
            break
        with record.step(SPIN, speed_rad_s=plan.speed_rad_s, **labels):
            rig.clock.sleep(plan.steady_s)
        rig.drive.coast()
        with record.step(COAST, **labels):
            begun, end = rig.clock.now_ns(), max(plan.end_speed_rad_s, slowest(rig.file))
            rig.clock.sleep(plan.start_delay_s + 0.5)
            while _speed(rig) > end and rig.clock.now_ns() - begun < plan.coast_s * 1e9:
                rig.clock.sleep(0.1)
    rig.drive.stop()
    rig.drive.coast()
    rig.clock.sleep(conventions(rig.file).stands_s)


def _speed(rig: Rig) -> float:
    """As the mark tells it, else as the drive does, rad/s."""
    if is_bound(rig.file, SPEED):
        return abs(rig.levitation.reading(SPEED))
    return abs(rig.drive.speed_rad_s) if rig.drive is not None else 0.0


def evaluate(recording: Recording[Plan], findings: Findings) -> Coasted:
    """B and T_c by the inertia of the rig file."""
    findings.gate(_before(recording))
    plan, rig = recording.plan, recording.rig
    try:
        runs = read_coasts(recording)
    except Short as error:
        findings.end(Finding("run-down-short", str(error), "B", Effect.ERROR))
    findings.gate(coasts.of_runs(runs, conventions(rig), plan))
    found = coasts.estimates_of(runs, rig)
    findings.add(coasts.of_result(runs, found, plan))
    findings.add(coasts.of_drive(recording))
    text = "J_z is the rig file's value, not measured here; B and T_c carry its tolerance"
    findings.add([Finding("inertia-as-stated", text, "J_z"), Finding(
        "one-way", "the mark counts one way: what acts one way only cannot be told from friction, and is in T_c.", "T_c"
    )])  # fmt: skip
    return Coasted(runs, found)


def _before(recording: Recording[Any]) -> Iterator[Finding]:
    for event in recording.events(NOT_REACHED):
        text = f"the shaft did not reach {event['wanted']:.0f} rad/s: it turned at {event['reached']:.0f} rad/s. {event['why']}"
        yield Finding("speed-not-reached", text, "drive", Effect.ERROR)
    if not recording.events(NOT_REACHED) and not len(recording.steps(COAST)):
        yield Finding("no-run-down", "no run-down was recorded", "", Effect.ERROR)


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    if not plan.speed_rad_s < rig.envelope.max_speed_rad_s:
        yield (f"speed_rad_s: found {plan.speed_rad_s:g} rad/s; expected less than the envelope's "
               f"{rig.envelope.max_speed_rad_s:g} rad/s")  # fmt: skip
    end = max(plan.end_speed_rad_s, slowest(rig))
    if end > plan.speed_rad_s / 2:
        yield (f"end_speed_rad_s: found {end:g} rad/s; expected half of {plan.speed_rad_s:g} rad/s or less, or viscous and "
               "constant drag cannot be told apart")  # fmt: skip
    if plan.added_inertia:
        yield "added_inertia: found true; a ring is mounted where a motor turns the rotor, not on this shaft"
    if plan.run_up == "motor":
        yield "run_up: found motor; the rig file has no device in the role rotation"
    if plan.motor_carries:
        yield "motor_carries: found true; there is no motor that could carry an end of the shaft"


def figures(found: Coasted) -> Iterable[Figure]:
    """Speed over time with its fit, and what the fit leaves of the angle."""
    shown, left = [], []
    for r in found.runs:
        c, thin = r.coast, slice(None, None, max(1, len(r.t) // 60))
        speed = np.gradient(r.angle, r.t)
        shown += [Series(r.where, r.t[thin], speed[thin], "points"),
                  Series(f"{r.where}, fit", r.t[thin], fit.speed(r.t[thin], c.b, c.c, c.speed))]  # fmt: skip
        left.append(Series(r.where, r.t[thin], 1e3 * c.fit.residuals[thin], "both"))
    yield Figure("speed", "Speed after the release", "By the spacing of the mark's edges, with the fit of viscous and constant "
                 "drag; a few edges are drawn.", "time (s)", "speed (rad/s)", tuple(shown))  # fmt: skip
    yield Figure("residuals-angle", "Residuals of the angle", "Measured angle less its fit, a few edges. A wave over all of it "
                 "would be drag of another shape.", "time (s)", "residual (mrad)", tuple(left),
                 lines=(("zero", 0.0),))  # fmt: skip
