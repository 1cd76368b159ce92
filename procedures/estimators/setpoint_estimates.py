"""From set-point steps to estimates with influences: scatter of the repeats, sampling, shape of the model, sensors' gains."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.estimators import setpoint_data, stepmodel
from procedures.estimators.inputs import certified
from procedures.estimators.setpoint_data import Case, Done
from procedures.estimators.stepmodel import Mode, Response, Settling

Array = npt.NDArray[np.float64]
NEIGHBOUR = 0.08  # what a second mode that is not told apart does to damping, as a share: bound over drawn machines
NEIGHBOUR_HZ = 0.045  # and to the frequency
APART, APART_HZ = (
    0.025,
    0.02,
)  # where two are told apart: filters that still ring, and the shaft's compliance in bending
BENDS = 0.01  # of the bandwidth, likewise
CURVE = 3e-3  # of the overshoot's excursion: what the spline leaves of a means' curve
RISE_SHARE = 0.01  # of a period: the same for crossings


@dataclass(frozen=True)
class Result:
    """Responses of the steps of one case, and the mean of each quantity with its influences; no settling time where the
    position does not settle."""

    case: Case
    responses: tuple[Response, ...]
    settled: Settling
    estimates: Mapping[str, Estimate]


def by_case(steps: list[Done], rig: RigFile, band: float) -> dict[Case, Result]:
    """Every case's result.

    Raises:
        AnalysisError: a step does not get to nine tenths of its size.
    """
    out = {}
    for case, done in setpoint_data.by_case(steps).items():
        responses = tuple(_response(d) for d in done)
        settled = _settled(done, band)
        out[case] = Result(case, responses, settled, _estimates(case, done, responses, settled, rig))
    return out


def _settled(done: Sequence[Done], band: float) -> Settling:
    n = min(int((d.t >= 0).sum()) for d in done)
    steps = np.array([(d.y / d.case.size)[d.t >= 0][:n] for d in done])
    noise = float(np.sqrt(np.mean([d.noise**2 for d in done]))) / done[0].case.size
    return stepmodel.settling(
        done[0].t[done[0].t >= 0][:n], steps, band, noise, float(np.mean([d.samples for d in done]))
    )


def _response(d: Done) -> Response:
    try:
        return stepmodel.response(d.t, d.y / d.case.size)
    except AnalysisError as error:
        raise AnalysisError(f"{d.case.where}: {error}") from error


def _estimates(
    case: Case, done: Sequence[Done], r: Sequence[Response], settled: Settling, rig: RigFile
) -> dict[str, Estimate]:
    where = case.where
    period = float(done[0].t[1] - done[0].t[0])

    def mean(name: str, unit: str, of: Callable[[Response], float]) -> Estimate:
        return repeated(f"{name}/{where}", unit, [of(x) for x in r])

    overshoot = mean("overshoot", "1", lambda x: x.overshoot)
    out = {
        "overshoot": overshoot + bound(f"means/{where}", "means over a period", CURVE * (1 + overshoot.value), "1"),
        "rise_time": mean("rise_time", "s", lambda x: x.rise)
        + bound("sampling/rise", "sampling", RISE_SHARE * period, "s"),
        "steady_error": mean("steady_error", "m", lambda x: case.way * x.error * case.size) + _gained(case, rig),
    }
    if math.isfinite(settled.time):
        scatter = Influence(id=f"scatter/settling_time/{where}", name="scatter of the repeats", u=settled.u, unit="s", kind="A",
                            distribution="normal", dof=float(len(r) - 1), source=f"{len(r)} steps, one left out in "
                                                                                 f"turn")  # fmt: skip
        out["settling_time"] = (
            Estimate.of(settled.time, scatter)
            + bound(f"start/{where}", "start of the step within a period", period / 2, "s")
            + bound(f"period/{where}", "sampling", period / 2, "s")
            + bound(f"edge/{where}", "noise at the edge of the band", settled.edge, "s")
        )
    if all(math.isfinite(x.bandwidth) for x in r):
        shape = bound(
            f"shape/bandwidth/{where}",
            "shape of the model",
            max(x.shape + (x.misfit + BENDS) * x.bandwidth for x in r),
            "Hz",
        )
        out["bandwidth"] = mean("bandwidth", "Hz", lambda x: x.bandwidth) + shape
    return out


def by_group(steps: list[Done], results: Mapping[Case, Result]) -> dict[str, dict[str, Estimate]]:
    """Of each setting, axis and speed: the oscillation, and how far size and direction matter."""
    out: dict[str, dict[str, Estimate]] = {}
    for group, done in setpoint_data.by_group(steps).items():
        out[group] = oscillation(group, done) | _linearity([r for c, r in results.items() if c.group == group])
    return out


def oscillation(group: str, done: Sequence[Done]) -> dict[str, Estimate]:
    """Damping and natural frequency from all steps together, those of large ones weighing more; uncertainty by leaving out
    one block of steps after the other. Nothing where there is no oscillation."""
    blocks = min(len(done), 8)
    n = min(len(d.t) for d in done)
    whole, t = _pooled(done, n), done[0].t[:n]
    out: dict[str, Estimate] = {}
    best = math.inf
    for count in (1, 2):
        if count == 2 and not np.any(whole[1]):
            continue
        try:
            mode = stepmodel.modes(t, whole, count)
            left = [
                stepmodel.modes(t, _pooled([d for k, d in enumerate(done) if k % blocks != b], n), count)
                for b in range(blocks)
            ]
        except (AnalysisError, np.linalg.LinAlgError):
            continue
        if not (0 < mode.damping < 0.95 and all(0 < m.damping < 0.95 for m in left)):
            continue
        made = _oscillation(group, count, mode, left)
        if made["damping"].u < best:
            best, out = made["damping"].u, made
    return out


def _oscillation(group: str, count: int, mode: Mode, left: Sequence[Mode]) -> dict[str, Estimate]:
    out = {}
    for name, unit, value, others, beside in (
        ("damping", "1", mode.damping, [m.damping for m in left], NEIGHBOUR if count == 1 else APART),
        (
            "natural_frequency",
            "Hz",
            mode.frequency,
            [m.frequency for m in left],
            NEIGHBOUR_HZ if count == 1 else APART_HZ,
        ),
    ):
        n = len(others)
        u = math.sqrt((n - 1) / n * float(((np.array(others) - np.mean(others)) ** 2).sum()))
        jackknife = Influence(id=f"scatter/{name}/{group}", name="scatter of the steps", u=u, unit=unit, kind="A",
                              distribution="normal", dof=float(n - 1), source=f"{n} blocks of steps left out in "
                                                                              f"turn")  # fmt: skip
        text = (
            "a neighbouring mode, a shaft that bends" if count == 1 else "filters that still ring, a shaft that bends"
        )
        out[name] = Estimate.of(value, jackknife) + bound(f"mode/{name}/{group}", text, beside * value, unit)
    return out


def _pooled(done: Sequence[Done], n: int) -> Array:
    """Position and tilt (2, n) per metre of step over many steps, each shifted to the common samples: least squares over sizes.
    Starts differ by less than a period, which shifts the phase of an oscillation and nothing else."""
    weight = sum(d.case.size**2 for d in done)
    return np.asarray(sum(d.case.size * np.array([d.y[:n], d.tilt[:n]]) for d in done) / weight)


def _linearity(results: Sequence[Result]) -> dict[str, Estimate]:
    sizes = sorted({r.case.size for r in results})
    of = {(r.case.size, r.case.way): r.estimates["overshoot"] for r in results}
    if any((s, w) not in of for s in (sizes[0], sizes[-1]) for w in (1, -1)):
        return {}
    top = [of[sizes[-1], w] for w in (1, -1)]
    out = {"way_effect": top[0] - top[1]}
    if len(sizes) > 1:
        out["size_effect"] = (top[0] + top[1] - of[sizes[0], 1] - of[sizes[0], -1]) * 0.5
    return out


def repeated(identity: str, unit: str, values: Sequence[float]) -> Estimate:
    """Mean of repeats with its Type A uncertainty."""
    u = float(np.std(values, ddof=1)) / math.sqrt(len(values))
    influence = Influence(id=f"scatter/{identity}", name="scatter of the repeats", u=u, unit=unit, kind="A",
                          distribution="normal", dof=float(len(values) - 1), source=f"{len(values)} steps")  # fmt: skip
    return Estimate.of(float(np.mean(values)), influence)


def bound(identity: str, name: str, half: float, unit: str) -> Estimate:
    """Zero, within a half width."""
    influence = Influence(
        id=identity, name=name, u=half / math.sqrt(3), unit=unit, kind="B", distribution="rectangular"
    )
    return Estimate.of(0.0, influence)


def _gained(case: Case, rig: RigFile) -> Estimate:
    """Zero m, with what the gains of the position sensors make of the step's length."""
    out = Estimate.exact(0.0, "m")
    for channel, share in setpoint_data.shares(rig, case.axis).items():
        gain = certified(f"sensors/{channel}/gain", rig.sensors[channel].gain, f"gain of {channel}")
        out = out + (gain - gain.value) * (-case.way * case.size * share / gain.value)
    return Estimate(out.value, "m", out.sensitivities)
