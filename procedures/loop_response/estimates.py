"""Bandwidth and greatest sensitivity of each loop, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.loop_response import fit, ideal
from procedures.loop_response.fit import Point
from procedures.loop_response.injection import REFERENCE, SENSOR, ability, chosen, integrator_s, sensitive, settle_s
from procedures.loop_response.plan import Plan
from procedures.loop_response.steps import REFINED, Taken, of_loop
from procedures.position_loops.lines import counted

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Result:
    """Of one loop: its sines by frequency into the reference and into the reading, what was fitted about -3 dB and about the
    greatest sensitivity (None: it could not be), and the quantities by name."""

    axis: str
    response: list[Taken]
    sensitivity: list[Taken]
    crossing: Point | None = None
    summit: Point | None = None
    estimates: Mapping[str, Estimate] = field(default_factory=dict)


def results(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> tuple[list[Result], list[Finding]]:
    """Each loop's, and what could not be told."""
    out, failed = [], []
    for axis in chosen(rig, plan):
        response, sensitivity = (of_loop(taken, axis, place) for place in (REFERENCE, SENSOR))
        found: dict[str, Estimate] = {}
        crossing = summit = None
        try:
            crossing = fit.crossing(*_columns(of_loop(taken, axis, REFERENCE, REFINED), rig))
            found["bandwidth"] = _bandwidth(crossing, of_loop(taken, axis, REFERENCE, REFINED), axis, rig, plan)
        except AnalysisError as error:
            failed.append(_failed("no-crossing", str(error), axis, "bandwidth"))
        if (computed := ideal.bandwidth(rig, plan, axis)) is not None:
            found["bandwidth_ideal"] = computed
        if axis in sensitive(rig, plan):
            try:
                summit = fit.summit(*_columns(of_loop(taken, axis, SENSOR, REFINED), rig))
                found |= _greatest(summit, of_loop(taken, axis, SENSOR, REFINED), axis, rig, plan)
            except AnalysisError as error:
                failed.append(_failed("no-maximum", str(error), axis, "s_max"))
        out.append(Result(axis, response, sensitivity, crossing, summit, found))
    return out, failed


def _failed(code: str, why: str, axis: str, name: str) -> Finding:
    return Finding(code, f"{axis}: {why}. Look at its figure; change low_hz, high_hz or lines.", axis, Effect.INDETERMINATE,
                   (f"{name}@{axis}",))  # fmt: skip


def _columns(some: Sequence[Taken], rig: RigFile) -> tuple[Array, Array, Array]:
    """Frequencies, sizes and their standard uncertainties by noise and counts."""
    lines = [t.line for t in some if t.line is not None]
    u = [math.hypot(t.line.u, rounding(t, rig)) for t in some if t.line is not None]
    return np.array([t.hz for t in some]), np.array([x.size for x in lines]), np.array(u)


def _bandwidth(at: Point, some: Sequence[Taken], axis: str, rig: RigFile, plan: Plan) -> Estimate:
    slope = 1 / abs(float(at.of_hz[0]))  # d ln size / d ln hz
    shares = np.array([t.hz for t in some]) / at.hz
    per = at.hz / slope  # Hz of a share of the size
    return (
        Estimate.exact(at.hz, "Hz")
        + Estimate.of(0.0, _scatter(at, at.of_hz, some, axis, "bandwidth", at.hz, "Hz"))
        + _bound(
            f"interpolation/{axis}", "curve between the lines", at.hz * ideal.misfit(rig, plan, axis, shares), "Hz"
        )
        + _bound(f"settling/{axis}", "what is left of the beginning", per * unsettled(some, axis, rig, plan), "Hz")
    )


def _greatest(at: Point, some: Sequence[Taken], axis: str, rig: RigFile, plan: Plan) -> dict[str, Estimate]:
    left = unsettled(some, axis, rig, plan)
    size = (
        Estimate.exact(at.size, "1")
        + Estimate.of(0.0, _scatter(at, at.of_size, some, axis, "s_max", at.size, "1"))
        + _bound(f"settling/{axis}/s_max", "what is left of the beginning", at.size * left, "1")
    )
    hz = Estimate.exact(at.hz, "Hz") + Estimate.of(0.0, _scatter(at, at.of_hz, some, axis, "s_max_hz", at.hz, "Hz"))
    return {"s_max": size, "s_max_hz": hz}


def _scatter(
    at: Point, slopes: Array, some: Sequence[Taken], axis: str, name: str, scale: float, unit: str
) -> Influence:
    """Of the readings beside each line: what is not the sine's."""
    u = scale * math.sqrt(float(slopes @ at.fit.covariance @ slopes))
    dof = float(np.mean([t.line.dof for t in some if t.line is not None]))
    return Influence(id=f"scatter/{axis}/{name}", name="noise and counts of the readings", u=u, unit=unit, kind="A",
                     distribution="normal", dof=dof, source="bins beside the lines; converter")  # fmt: skip


def _bound(identity: str, name: str, half: float, unit: str) -> Estimate:
    return Estimate.of(0.0, Influence(id=identity, name=name, u=half / math.sqrt(3), unit=unit, kind="B",
                                      distribution="rectangular", source="docs/reference/loop-response.md"))  # fmt: skip


def unsettled(some: Sequence[Taken], axis: str, rig: RigFile, plan: Plan) -> float:
    """By which share of itself a line may be wrong by what its beginning has left: a transient as large as the sine that fades
    with the integrator leaves e^-n of it after n time constants; in p periods it is a slope, of which 1/(pi p) looks like the
    sine."""
    slow = max(plan.start_s, settle_s(rig, plan, axis)) / max(_tau(rig, plan, axis), 1e-9)
    return math.exp(-min(slow, 700.0)) / (math.pi * min(t.periods for t in some))


def _tau(rig: RigFile, plan: Plan, axis: str) -> float:
    return integrator_s(rig, plan, ability(rig).loops[axis])


def rounding(t: Taken, rig: RigFile) -> float:
    """Standard uncertainty of |y| by the counts of the reading, as a share of what was injected."""
    assert rig.capture is not None
    assert t.line is not None
    scale = rig.capture.channels[ability(rig).loops[t.axis].channel].scale
    return counted(scale, t.line.rms, t.line.swing) / t.amplitude
