"""From ramps and a calibration to the motor's force constants as estimates: rows, their best mean, and their budget."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence, propagate
from procedures.force_constant import fit as force_constant_fit
from procedures.force_constant.fit import CROSS, DIRECT, FORCE, MOMENT, Constants, Fit, Ramps
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified, certified_sensors

Array = npt.NDArray[np.float64]
Facts = Mapping[str, Estimate]
ROWS = ("force", "moment")
POWERS = ("square", "cube")
CONSTANTS = ("K_i", "K2_i", "K_o", "K2_o")


@dataclass(frozen=True)
class AxisResult:
    """One axis. `rows` [row][angle] N/A; `bends` N, what the rows have of the current's square and cube, in the order row,
    angle, power; `weight` of the force row; `angles` the rows' mean at each angle and `mean` over a turn, N/A; `cross` N/A
    what the other axis' current gives at the home angle."""

    fit: Fit
    rows: tuple[tuple[Estimate, ...], tuple[Estimate, ...]]
    bends: tuple[Estimate, ...]
    weight: float
    angles: tuple[Estimate, ...]
    mean: Estimate
    cross: Estimate

    @property
    def row_means(self) -> tuple[Estimate, Estimate]:
        """Force row and moment row, each its mean over a turn."""
        return mean_of(self.rows[FORCE]), mean_of(self.rows[MOMENT])


def fact_inputs(facts: Facts, angles: int) -> dict[str, Estimate]:
    """The constants of both AMBs at each angle."""
    return {f"{name}@{k}": facts[f"{name}@{k}"] for name in CONSTANTS for k in range(angles)}


def taken_alone(facts: Facts, angles: int) -> dict[str, Estimate]:
    """The same constants, with the uncertainty of each and without what they share with each other and with this run:
    what a certificate that prints values and uncertainties would pass on."""
    out = {}
    for name in CONSTANTS:
        u = float(np.mean([facts[f"{name}@{k}"].u for k in range(angles)]))
        alone = Influence(id=f"alone/{name}", name=f"{name}, taken alone", u=u, unit="1", kind="B",
                          distribution="normal", source="calibration")  # fmt: skip
        for k in range(angles):
            out[f"{name}@{k}"] = Estimate.of(facts[f"{name}@{k}"].value, alone)
    return out


def rig_inputs(rig: RigFile, axis: str) -> dict[str, Estimate]:
    """What the fit of one axis needs besides the calibration: certificates of the rig file, each as an influence by
    identity, the same identities as in the calibration."""
    g = rig.geometry
    out = {
        "amb_span": certified("geometry/amb_span", g["amb_span"], "span AMB to AMB"),
        "motor_to_outboard_amb": certified(
            "geometry/motor_to_outboard_amb", g["motor_to_outboard_amb"], "span outboard AMB to motor"
        ),
        "amb_gap": certified("geometry/amb_gap", g["amb_gap"], "AMB gap (residual position)"),
        "motor_stiffness": certified(
            "geometry/motor_stiffness", g["motor_stiffness"], "motor stiffness (residual pos.)"
        ),
    }
    machine = conventions(rig)
    channels = {f"{axis}{place}": coil for place, coil in machine.coils_along(axis).items()}
    channels |= {f"m{k}": segment for k, segment in enumerate(machine.segments, 1)}
    out |= certified_sensors(rig, channels)
    if axis == "x":
        for b, name in (("i", "inboard"), ("o", "outboard")):
            stated = rig.machine["amb_asymmetry"]
            out[f"asymmetry_{b}"] = certified(f"machine/amb_asymmetry/{b}", stated, f"{name} AMB: K_x against K_y")
    return out


def constants(r: Ramps, p: Mapping[str, float], bias_A: float) -> Constants:
    """The AMBs' constants along the ramps' axis, from `p`."""
    y = force_constant_fit.vertical(p, len(r.angles))
    return y if r.axis == "y" else force_constant_fit.horizontal(r, p, y, bias_A)


def axis_result(r: Ramps, inputs: Facts, bias_A: float) -> AxisResult:
    """Rows by one propagation over everything that is shared, scatter added, rows combined, means over the angles."""

    def model(p: dict[str, float]) -> dict[str, float]:
        return _named(force_constant_fit.fit(r, p, constants(r, p, bias_A), bias_A))

    values = {name: e.value for name, e in inputs.items()}
    fitted = force_constant_fit.fit(r, values, constants(r, values, bias_A), bias_A)
    found = propagate(model, inputs)
    for name, extra in _scatter(fitted, r).items():
        found[name] = found[name] + extra
    if r.axis == "x":
        _add_curvature(found, r, values, bias_A, fitted)
    count = len(r.angles)
    force, moment = (tuple(found[f"{row}@{k}"] for k in range(count)) for row in ROWS)
    bends = tuple(found[f"{row}/{power}@{k}"] for row in ROWS for k in range(count) for power in POWERS)
    weight = float(force_constant_fit.best_weights(covariance([mean_of(force), mean_of(moment)]))[FORCE])
    loose = force_constant_fit.fit(r, values, constants(r, values, bias_A), bias_A, turning=0.0)
    shift = (loose.terms - fitted.terms)[:, :, DIRECT].mean(axis=1) @ [weight, 1 - weight]
    play = _turning_point(r.axis, float(shift))
    angles = tuple(f * weight + m * (1 - weight) + play for f, m in zip(force, moment, strict=True))
    cross = _cross(r.axis, fitted, found, weight)
    return AxisResult(fitted, (force, moment), bends, weight, angles, mean_of(angles), cross)


def _cross(axis: str, f: Fit, found: Facts, weight: float) -> Estimate:
    """The rows' mean of what the other axis' current gives at the home angle, with the scatter of the steps."""
    w = np.array([weight, 1 - weight])
    steps, dof = force_constant_fit.scatter(f)
    u = math.sqrt(float(w @ steps @ w) * float((f.solvers[0, CROSS] ** 2).sum()))
    left = Influence(id=f"scatter/{axis}/cross", name=f"scatter of the steps, cross, {axis}", u=u, unit="N/A", kind="A",
                     distribution="normal", dof=float(dof), source="residuals of the fits")  # fmt: skip
    return found["force/cross"] * weight + found["moment/cross"] * (1 - weight) + Estimate.of(0.0, left)


def _named(f: Fit) -> dict[str, float]:
    out = {}
    for row, name in enumerate(ROWS):
        out[f"{name}/cross"] = f.terms[row, 0, CROSS]
        for k in range(f.terms.shape[1]):
            out[f"{name}@{k}"] = f.terms[row, k, DIRECT]
            out |= {f"{name}/{power}@{k}": f.bends[row, k, j] for j, power in enumerate(POWERS)}
    return out


def _scatter(f: Fit, r: Ramps) -> dict[str, Estimate]:
    """Type A: the steps' covariance between the rows, which is one for all angles, through the solvers of each, as influences
    of one identity with running numbers."""
    steps, dof = force_constant_fit.scatter(f)
    across = np.linalg.cholesky(steps + 1e-18 * np.eye(2))
    out: dict[str, Estimate] = {}
    for k, angle in enumerate(r.angles):
        maps = np.concatenate([f.solvers[k, [DIRECT]], f.bend_solvers[k]])
        along = np.linalg.cholesky(maps @ maps.T)
        parts = [
            [Estimate.of(0.0, Influence(id=f"scatter/{r.axis}/{6 * k + 2 * j + c + 1}", u=1.0, unit="1", kind="A",
                                        name=f"scatter of the steps at {math.degrees(angle):.0f}°, {r.axis}",
                                        distribution="normal", dof=float(dof), source="residuals of the fits"))
             for c in (0, 1)]
            for j in range(3)
        ]  # fmt: skip
        for row, name in enumerate(ROWS):
            for m, key in enumerate((f"{name}@{k}", *(f"{name}/{power}@{k}" for power in POWERS))):
                terms = [
                    parts[j][c] * float(along[m, j] * across[row, c]) for j in range(m + 1) for c in range(row + 1)
                ]
                out[key] = sum(terms, Estimate.exact(0.0))
    return out


def _add_curvature(found: dict[str, Estimate], r: Ramps, p: Mapping[str, float], bias_A: float, fitted: Fit) -> None:
    """Type A of K2/K, which the horizontal constants are found with at each angle: one influence per AMB and angle,
    of one identity per AMB, whose residuals of all angles give one variance."""
    u = force_constant_fit.curvature(r, p, bias_A)[1]
    y = force_constant_fit.vertical(p, len(r.angles))
    dof = float(len(r.angles) * (r.time.shape[1] - force_constant_fit.TERMS - 1))
    for b, bearing in enumerate("io"):
        shift = np.where(np.arange(2) == b, u, 0.0)[:, None]
        moved = force_constant_fit.fit(r, p, force_constant_fit.horizontal(r, p, y, bias_A, shift), bias_A)
        change, bent = moved.terms[:, :, DIRECT] - fitted.terms[:, :, DIRECT], moved.bends - fitted.bends
        for k, angle in enumerate(r.angles):
            part = Estimate.of(0.0, Influence(id=f"scatter/curvature_{bearing}/{k + 1}", u=1.0, unit="1", kind="A", dof=dof,
                                              name=f"scatter of K2/K at {math.degrees(angle):.0f}°, x",
                                              distribution="normal", source="residuals of the fits"))  # fmt: skip
            for row, name in enumerate(ROWS):
                found[f"{name}@{k}"] += part * float(change[row, k])
                for j, power in enumerate(POWERS):
                    found[f"{name}/{power}@{k}"] += part * float(bent[row, k, j])


def _turning_point(axis: str, shift: float) -> Estimate:
    """Where the current turns round the branch is not sure: at most the whole of it could be wrong."""
    if shift == 0:
        return Estimate.exact(0.0)
    influence = Influence(id=f"hysteresis/alpha_{axis}", name="hysteresis at the turning points", unit="1", kind="B",
                          u=abs(shift) / math.sqrt(3), distribution="rectangular",
                          source="branch of the turning points set to zero")  # fmt: skip
    return Estimate.of(0.0, influence)


def mean_of(estimates: Sequence[Estimate]) -> Estimate:
    """Arithmetic mean."""
    return sum(estimates, Estimate.exact(0.0)) * (1 / len(estimates))


def covariance(estimates: Sequence[Estimate]) -> Array:
    """Covariance (n, n) from shared influences."""
    ids = sorted({i for e in estimates for i in e.contributions})
    table = np.array([[c.get(i, 0.0) for i in ids] for c in (e.contributions for e in estimates)])
    out: Array = table @ table.T
    return out


def chi_squared(estimates: Sequence[Estimate]) -> float:
    """How far `estimates` are from zero altogether, by their full covariance."""
    values = np.array([e.value for e in estimates])
    return float(values @ np.linalg.solve(covariance(estimates), values))


def differences(result: AxisResult) -> list[Estimate]:
    """Force row less moment row at each angle."""
    return [f - m for f, m in zip(*result.rows, strict=True)]


def misfit(result: AxisResult) -> tuple[float, int]:
    """Chi-squared and degrees of freedom of everything that must be nought: rows' differences, square and cube."""
    parts = [*differences(result), *result.bends]
    return chi_squared(parts), len(parts)


def suspect(r: Ramps, inputs: Facts, bias_A: float, result: AxisResult) -> str:
    """Which mistake in the calibration would make forces, moments and levels agree, as words; "" if none of those tried."""
    parts = [*differences(result), *result.bends]
    precision = np.linalg.inv(covariance(parts))
    values = {name: e.value for name, e in inputs.items()}
    given = force_constant_fit.vertical(values, len(r.angles))

    def remaining(c: Constants) -> float:
        f = force_constant_fit.fit(r, values, c, bias_A)
        d = np.concatenate([f.terms[FORCE, :, DIRECT] - f.terms[MOMENT, :, DIRECT], f.bends.reshape(-1)])
        return float(d @ precision @ d)

    tried = {
        f"with the opposite sign of {name} they would agree": Constants(given.k * sign, given.k2 * k2_sign)
        for b, name in enumerate(("K_i", "K_o"))
        for sign in [np.where(np.arange(2) == b, -1.0, 1.0)[:, None]]
        for k2_sign in (sign, np.ones_like(sign))
    }
    tried |= {
        f"with the constants of the angles {math.degrees(r.angles[n]):.0f}° further on they would agree": Constants(
            np.roll(given.k, -n, axis=1), np.roll(given.k2, -n, axis=1)
        )
        for n in range(1, len(r.angles))
    }
    tried["with the constants of the two AMBs exchanged they would agree"] = Constants(given.k[::-1], given.k2[::-1])
    best = min(tried, key=lambda text: remaining(tried[text]))
    return best if remaining(tried[best]) < 0.01 * remaining(given) else ""
