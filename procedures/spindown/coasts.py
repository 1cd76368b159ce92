"""Run-downs by the edges of a once-per-turn mark: one fit each, what can be wrong with them, and B and T_c of them all."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.tachometer import Tachometer
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from bench.uncertainty import Estimate, Influence, propagate
from procedures.amb_rotor.machine import AmbRotor
from procedures.shared import signals
from procedures.spindown import fit
from procedures.spindown.checks import drives_on
from procedures.spindown.estimates import RESIDUAL_DOF, drive_drag
from procedures.spindown.fit import Coast
from procedures.spindown.plan import Plan
from procedures.synchronous import facts, mark

Array = npt.NDArray[np.float64]
SPIN, COAST = "spin", "coast"
LAGS = 20  # edges over which the residuals may repeat themselves
TIMED_S = 2e-6  # how well an edge is timed, at least: waves of as much of a turn are none
WAVE_RAD = 1.5e-3  # and no less: of an angle that is told in steps
FEWEST = 400  # edges that tell viscous from constant drag
SLOWEST_BY_ANGLE, SLOWEST = (
    15.0,
    2.0,
)  # rad/s: below, the angle is not carried on from the mark, or edges come too seldom


class Short(AnalysisError):
    """A run-down of too few edges of the mark."""


@dataclass(frozen=True)
class Coasting:
    """One run-down: its mark's edges `t` (n,) s from the first used, `angle` (n,) rad, and their fit."""

    repeat: int
    t: Array
    angle: Array
    coast: Coast
    tacho: Tachometer
    lost: int
    expected: int
    flags: int

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        return f"run {self.repeat + 1}"


def slowest(rig: RigFile) -> float:
    """Below this speed, rad/s, a run-down is not looked at."""
    return SLOWEST_BY_ANGLE if mark.by_angle(rig) else SLOWEST


def read_coasts(recording: Recording[Plan]) -> tuple[Coasting, ...]:
    """Every run-down.

    Raises:
        AnalysisError: there are none, or one has no edges.
        Short: one has too few edges.
    """
    found = tuple(_read(recording, step) for step in recording.steps(COAST))
    if not found:
        raise AnalysisError("found no run-down (was the run stopped early?)")
    return found


def _read(recording: Recording[Plan], step: Step) -> Coasting:
    plan, rig = recording.plan, recording.rig
    data = step.read(*mark.told(rig), STATUS)
    t = (data["t_ns"] - step.start_ns) * 1e-9
    tacho = mark.tachometer_of(rig, t, data)
    speed = tacho.speed(np.clip(tacho.times, tacho.times[0], tacho.times[-1]))
    below = np.flatnonzero(speed < max(plan.end_speed_rad_s, slowest(rig)))
    first = int(np.searchsorted(tacho.times, plan.start_delay_s))
    last = int(below[0]) if below.size else len(tacho.times)
    at, angle = tacho.times[first:last], 2 * math.pi * tacho.turns[first:last]
    if len(at) < 2:
        raise AnalysisError(f"run-down {int(step.labels['repeat']) + 1}: found no edges above the end speed")
    if len(at) < FEWEST:
        reached = bool(below.size) or bool(speed[-1] <= 1.05 * max(plan.end_speed_rad_s, slowest(rig)))
        ends = float(speed[first]), float(speed[last - 1])
        raise Short(f"run {int(step.labels['repeat']) + 1}: {lacking(len(at), ends, plan, rig, reached=reached)}")
    since, turned = at - at[0], (angle - angle[0]).astype(np.float64)
    return Coasting(int(step.labels["repeat"]), since, turned, fit.of_angle(since, turned, LAGS, FEWEST), tacho, step.lost(),
                    step.expected(), int(np.bitwise_or.reduce(data[STATUS].astype(np.int64))))  # fmt: skip


def lacking(edges: int, ends: tuple[float, float], plan: Plan, rig: RigFile, *, reached: bool) -> str:
    """What a run-down of so few edges from one speed to another, rad/s, lacks, and how to give it."""
    first, last = ends
    text = (f"the mark gives {edges} edges from {first:.3g} to {last:.3g} rad/s; {FEWEST} or more are needed to tell viscous "
            "from constant drag, one a turn. ")  # fmt: skip
    if not reached:
        longer = math.ceil(plan.coast_s * FEWEST / edges)
        return f"{text}It was cut off by coast_s = {plan.coast_s:g} s: give it {longer} s at least, down to end_speed_rad_s"
    need, most = (
        last + (first - last) * FEWEST / edges,
        rig.envelope.max_speed_rad_s,
    )  # viscous: turns go with the speed lost
    if need < most:
        return (
            f"{text}Start it faster: speed_rad_s = {math.ceil(need):d} or more, with a coast_s that lets it come down"
        )
    return (f"{text}That takes a start at about {need:.0f} rad/s; envelope.max_speed_rad_s is {most:g}. By one edge a turn the "
            "drag of this shaft cannot be told: it wants less drag, as of a drive that uncouples, or an encoder")  # fmt: skip


def of_runs(runs: Sequence[Coasting], machine: AmbRotor, plan: Plan) -> Iterator[Finding]:
    """Lost samples, edges, contact, limits, drag of another shape."""
    lost, expected = np.array([(r.lost, r.expected) for r in runs], dtype=float).T
    yield from signals.losses(lost, expected, plan.max_lost, lambda share: runs[int(np.argmax(share))].where)
    for r in runs:
        for kind, times in (("missing", r.tacho.missing), ("doubled", r.tacho.doubled)):
            if times:
                text = f"once-per-turn pulses are {kind}, {len(times)} times: look at the pickup and its level."
                yield Finding(f"pulse-{kind}", text, r.where, Effect.ERROR)
    for bits, code, text in ((machine.current_limit, "current-saturated", "a coil current was at its limit"),
                             (machine.contact, "contact", "the rotor touched a touchdown bearing")):  # fmt: skip
        hit = [r for r in runs if r.flags & bits]
        if hit:
            yield Finding(code, f"{text} in {len(hit)} of {len(runs)} run-downs", hit[0].where, Effect.INDETERMINATE)
    for r in runs:
        rms = float(np.sqrt(np.mean(r.coast.fit.residuals**2)))
        most = max(WAVE_RAD, TIMED_S * r.coast.speed)
        if rms > most:
            text = (f"viscous and constant drag leave residuals of {rms * 1e3:.1f} mrad rms in the angle, {most * 1e3:.1f} "
                    "mrad are allowed: the drag has another shape, or changes during the run-down.")  # fmt: skip
            yield Finding("drag-not-linear", text, r.where, Effect.INDETERMINATE)


def estimates_of(runs: Sequence[Coasting], rig: RigFile) -> dict[str, Estimate]:
    """B (N m s/rad), T_c (N m) and J_z (kg m^2): the mean of the run-downs, with the scatter of the repeats where that is more
    than the fits let expect.

    Raises:
        AnalysisError: one run-down only.
    """
    values = np.array([[r.coast.b, r.coast.c] for r in runs])
    if len(values) < 2:
        raise AnalysisError("run-downs: found one; expected two or more (was the run stopped early?)")
    expected, dof = np.mean([r.coast.covariance for r in runs], axis=0), 2 * (len(values) - 1)
    root = np.linalg.cholesky(expected)
    ratio = float((np.linalg.solve(root, (values - values.mean(axis=0)).T) ** 2).sum() / dof)
    root = root * math.sqrt(max(ratio, 1.0) / len(values))
    parts = [
        Influence(f"scatter/run-downs/{k + 1}", f"scatter of the run-downs ({k + 1})", 1.0, "1", "A", "normal",
                  RESIDUAL_DOF if ratio <= 1.0 else float(dof), "residuals and repeats of the run-downs")
        for k in range(2)
    ]  # fmt: skip
    one, two = (Estimate.of(0.0, part) for part in parts)
    b, c = (float(x) for x in values.mean(axis=0))
    inputs = {
        "b": one * float(root[0, 0]) + b,
        "c": one * float(root[1, 0]) + two * float(root[1, 1]) + c,
        "inertia": facts.shaft_number(rig, "polar_inertia"),
        "drag": drive_drag(rig),
    }
    out = propagate(lambda v: {"B": v["inertia"] * v["b"], "T_c": v["inertia"] * v["c"] - v["drag"]}, inputs)
    return {**out, "J_z": inputs["inertia"]}


def of_result(runs: Sequence[Coasting], found: dict[str, Estimate], plan: Plan) -> Iterator[Finding]:
    """Is it the friction of a free rotor? How long it takes to stop."""
    coulomb = found["T_c"]
    if coulomb.value > plan.max_coulomb_N_m:
        text = (f"a constant torque of {coulomb.value:.3f} N m slows the rotor; a levitated one has at most "
                f"{plan.max_coulomb_N_m:g} N m. A drive or brake that still holds, or something rubs.")  # fmt: skip
        yield Finding("braked", text, "T_c", Effect.INDETERMINATE, ("B",))
    elif coulomb.value < -3 * coulomb.u - 1e-3:
        text = f"a constant torque of {-coulomb.value:.3f} N m drives the coasting rotor."
        yield Finding("driven", text, "T_c", Effect.INDETERMINATE)
    rates = np.array([r.coast.b for r in runs])
    spread = float(np.std(rates, ddof=1) / abs(rates.mean()))
    if spread > 2e-2:
        text = f"b scatters by {spread:.2%}: something changes between run-downs."
        yield Finding("not-repeatable", text, "B", Effect.INDETERMINATE)
    b, c = (float(np.mean([getattr(r.coast, name) for r in runs])) for name in ("b", "c"))
    stop = fit.stopping_time(b, c, plan.speed_rad_s)
    yield Finding(
        "stopping-time", f"from {plan.speed_rad_s:g} rad/s the rotor would stand after {stop:.0f} s.", "free rotor"
    )


def of_drive(recording: Recording[Any]) -> Iterator[Finding]:
    """Does the drive's own stream say that it is off?"""
    name = next((n for n, d in recording.rig.devices.items() if "drive" in d.roles), "")
    if name in recording.streams:
        yield from drives_on(recording, {c.name for c in recording.streams[name].channels})
