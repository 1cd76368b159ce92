"""From a passage to estimates: vectors at the captures' speeds, critical speeds and amplification factors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from bench.analysis.criticals import Critical, criticals
from bench.analysis.transient import settled
from bench.analysis.vectors import complexes, parts
from bench.recording import Recording
from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import merged
from procedures.estimators import unbalance_bearings, unbalance_estimates
from procedures.estimators.runup_data import Curve, Passage, curve, near
from procedures.estimators.unbalance_data import AXES, Dwell
from procedures.estimators.unbalance_estimates import Result, Results, Runout

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
DAMPED = 2.5  # amplification factor under which API 617 sees no critical speed
MATCHED = 0.1  # of a speed: where the same critical is looked for in a curve that differs a little
UNITS = {"speed": "rad/s", "amplitude": "m", "factor": "1"}
LAG = "what is left of the lag of the response"
FEW = 8  # draws where only the shift of a number is of interest


class Settings(Protocol):
    """The part of a plan that the estimates need."""

    @property
    def law(self) -> str: ...
    @property
    def speeds_rad_s(self) -> tuple[float, ...]: ...
    @property
    def running_rad_s(self) -> float: ...
    @property
    def blocks(self) -> int: ...
    @property
    def beta_share(self) -> float: ...
    @property
    def offset_u_m(self) -> float: ...


@dataclass(frozen=True)
class Peak:
    """A greatest amplitude at a probe: `speed` rad/s, `factor` (None where half power lies outside the record), `amplitude` m
    0-pk, `margin` from the running speed; half-power speeds `low`, `high`; `raw_speed` before the lag was taken off."""

    axis: str
    number: int
    speed: Estimate
    amplitude: Estimate
    factor: Estimate | None
    margin: Estimate
    low: float
    high: float
    raw_speed: float

    @property
    def critical(self) -> bool:
        """API: an amplification factor of 2.5 or more; one that may be so counts."""
        return self.factor is not None and self.factor.value + 2 * self.factor.u >= DAMPED

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        return f"{self.axis}, peak {self.number}"


@dataclass(frozen=True)
class Run:
    """A passage with its curve; `shaft` (4, b) vectors of the shaft's centre, lag taken off; `peaks` of all probes; what the
    turns about the captures' speeds say, None where none was passed."""

    passage: Passage
    curve: Curve
    shaft: Complex
    peaks: tuple[Peak, ...]
    near: Results | None
    slow: Dwell | None
    clearance: float = field(default=math.nan)


def run(passage: Passage, slow: Dwell | None, recording: Recording, plan: Settings) -> Run:  # type: ignore[type-arg]
    """All estimates of a passage."""
    rig = recording.rig
    found = curve(passage, plan.blocks)
    passed = [n for s in sorted(plan.speeds_rad_s) if (n := near(passage, recording, s, plan.law)) is not None]
    clearance = rig.geometry["clearance"].value
    if not passed:
        return Run(passage, found, found.values[:4], (), None, slow, clearance)
    dwells, left = [], []
    for dwell, width in passed:
        moved, rest = _still(found, dwell, width)
        dwells.append(moved)
        left.append(rest)
    results = unbalance_estimates.results([*([] if slow is None else [slow]), *dwells], rig, plan)
    results = replace(results, dwells=tuple(_with(r, rest) for r, rest in zip(results.dwells, left, strict=True)))
    inputs = unbalance_bearings.stated(rig, plan)
    shaft, peaks = [], []
    for k in range(4):
        line = _Line(found, k, inputs[f"gain_{k}"].value, results.runouts[1.0])
        shaft.append(line.curve(2))
        peaks += _peaks(line, inputs[f"gain_{k}"], plan.running_rad_s)
    return Run(passage, found, np.array(shaft), tuple(peaks), results, slow, clearance)


@dataclass(frozen=True)
class _Line:
    """A probe's vectors over speed, less its runout."""

    found: Curve
    k: int
    gain: float
    runout: Runout

    @property
    def covariance(self) -> Array:
        return np.asarray(self.found.covariance[self.k] / self.gain**2)

    def curve(self, rounds: int, less: complex = 0.0) -> Complex:
        """With the lag taken off so often; a runout that is greater by `less`."""
        c = self.found
        values = np.asarray(c.values[self.k] / self.gain - self.runout.values[self.k] - less, np.complex128)
        if not rounds:
            return values
        return settled(c.speed, values, self.covariance, c.acceleration, c.width, rounds)

    def criticals(self, rounds: int, less: complex = 0.0, draws: int = FEW) -> list[Critical]:
        """Of that curve."""
        return criticals(self.found.speed, self.curve(rounds, less), self.covariance, draws=draws)


def _peaks(line: _Line, gain: Estimate, running: float) -> list[Peak]:
    """With the influence of the scatter, of the runout, of what is left of the lag, and of the probe's gain."""
    axis, out = AXES[line.k], []
    best = line.criticals(2, draws=120)
    few, again, raw = line.criticals(2), line.criticals(1), line.criticals(0)
    offs = []
    for j in range(2):
        part = line.runout.parts[2 * line.k + j]
        offs.append((part, line.criticals(2, part.u * (1j if j else 1.0)) if part.u else few))
    for number, c in enumerate(best, 1):
        where = f"{axis}/{number}"
        base, once, first = _same(few, c), _same(again, c), _same(raw, c)
        left = np.abs(once - base)
        numbers = {"speed": c.speed, "amplitude": c.amplitude, "factor": c.factor}
        moved = [(part, (_same(some, c) - base) / part.u) for part, some in offs if part.u]
        made = {
            name: _number(where, name, value, c.covariance[j, j], float(left[j]), [(p, float(m[j])) for p, m in moved])
            for j, (name, value) in enumerate(numbers.items())
        }
        speed, amplitude = made["speed"], made["amplitude"]
        if speed is None or amplitude is None:
            continue
        amplitude = Estimate(amplitude.value, "m", merged([(1.0, amplitude), (-c.amplitude / gain.value, gain)]))
        margin = Estimate(
            abs(c.speed - running) / running, "1", merged([(math.copysign(1 / running, c.speed - running), speed)])
        )
        out.append(Peak(axis, number, speed, amplitude, made["factor"], margin, c.low, c.high, float(first[0])))
    return out


def _number(
    where: str, name: str, value: float, variance: float, left: float, moved: Sequence[tuple[Estimate, float]]
) -> Estimate | None:
    """A number of a critical with its influences; None where the record does not give it."""
    unit = UNITS[name]
    if not math.isfinite(value + variance + left):
        return None
    scatter = Influence(f"scatter/{where}/{name}", "scatter of the passage", math.sqrt(variance), unit, "A", "normal")
    rest = Influence(f"lag/{where}/{name}", LAG, left / math.sqrt(3), unit, "B", "rectangular")
    terms = [(1.0, Estimate.of(0.0, scatter)), (1.0, Estimate.of(0.0, rest))]
    terms += [(slope, part) for part, slope in moved if math.isfinite(slope)]
    return Estimate(value, unit, merged(terms))


def _same(some: Sequence[Critical], c: Critical) -> Array:
    """Speed, amplitude and factor (3,) of the critical that is the same one; NaN where none is."""
    close = [x for x in some if abs(x.speed / c.speed - 1) < MATCHED]
    if not close:
        return np.full(3, np.nan)
    x = min(close, key=lambda x: abs(x.speed - c.speed))
    return np.array([x.speed, x.amplitude, x.factor])


def _still(c: Curve, dwell: Dwell, width: float) -> tuple[Dwell, Complex]:
    """The dwell's vectors as they would be if the speed stood, and what that leaves open (4,) m, of the probes."""
    moved = np.zeros(12, complex)
    left = np.zeros(4, complex)
    at = dwell.speed
    for k in range(12):
        args = (c.speed, c.values[k], c.covariance[k], c.acceleration)
        shift = [settled(*args, np.full(c.speed.size, width), n) - c.values[k] for n in (1, 2)]
        moved[k] = _at(c.speed, shift[1], at)
        if k < 4:
            left[k] = _at(c.speed, shift[0], at) - moved[k]
    values = dwell.track.values.copy()
    values[0, :, 0] += moved
    return replace(dwell, track=replace(dwell.track, values=values)), left


def _at(speed: Array, values: Complex, where: float) -> complex:
    pairs = parts(values[:, None])
    return complex(complexes(np.array([np.interp(where, speed, p) for p in pairs.T]))[0])


def _with(r: Result, left: Complex) -> Result:
    """With what is left of the lag in the budget of the vectors and half axes."""
    out: dict[tuple[str, str], Estimate] = dict(r.estimates)
    for k, axis in enumerate(AXES):
        half = abs(left[k]) / math.sqrt(3)
        rest = Influence(f"lag/{r.dwell.where}/{axis}", LAG, half, "m", "B", "rectangular")
        for name in ("vector_cos", "vector_sin"):
            e = out[name, axis]
            out[name, axis] = Estimate(e.value, e.unit, merged([(1.0, e), (1.0, Estimate.of(0.0, rest))]), e.sampler)
    covariance = r.vectors.covariance + np.diag(np.repeat(np.abs(left) ** 2 / 3, 2))
    return replace(r, estimates=out, vectors=replace(r.vectors, covariance=covariance))


def asked_margin(peak: Peak, running: float) -> float:
    """Separation margin that API 617 asks for a critical of that factor, as a share of the running speed."""
    assert peak.factor is not None
    part = 0.17 * (1 - 1 / (max(peak.factor.value, DAMPED) - 1.5))
    return 0.1 + part if peak.speed.value > running else part
