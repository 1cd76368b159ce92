"""The vertical rows of the force map on a rig: the motor's force from the inboard AMB, and the terms that it shows.

Moments about the outboard AMB, with s from AMB to AMB and e from the outboard AMB to the motor: F_y s = e F_i. The outboard
AMB, whose own stiffness off centre is larger than the motor's, does not enter; the inboard one is held at its zero. Its force
is the calibration's F = K u + K2 v at each angle (see `amb_calibration.fit`), referred to where the rotor is by K b / gap.

Constants of one angle under one load (the shaft's weight, the magnetic offsets, the load itself) are taken off as means of
the group. What is left is (5.25b), and three terms that it lacks because it takes the zero of the commutation as exact: a cross
force alpha_c sin(M gamma_0) i_x, `cross` below, and what a ripple that goes with P theta + M gamma_0 has in quadrature,
sin(P theta) i_y and cos(P theta) i_x. Without the last two, which are small, term 9 would take them for its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.force_map import fit as force_map_fit
from procedures.force_map import selection as force_map_selection
from procedures.force_map.fit import CROSS, FORCE_TERMS, Identifiability, Points
from procedures.force_map.requires import positions
from procedures.force_map.selection import Selection
from procedures.force_map.steps import MapData
from procedures.servomotor.conventions import Servomotor, conventions, displacement, radial_currents, sensor_share
from procedures.shared import gradients as shared_gradients
from procedures.shared import leastsquares, type_a
from procedures.shared.certificates import certified, certified_gain, certified_sensors

Array = npt.NDArray[np.float64]
QUADRATURE = ("ripple_y", "ripple_x")
TERMS = (*FORCE_TERMS, CROSS, *QUADRATURE)
SCALE = dict.fromkeys(TERMS, 1.0) | {"alpha_4": 1e3, "alpha_5": 1e5, "alpha_8": 1e2, "alpha_9": 1e2}
Y_ROW = 1  # of `fit.force_design`
EXCITED = 0.02
MINOR = 0.1  # of a term's standard uncertainty


@dataclass(frozen=True)
class Result:
    """`terms` that the points can tell, their estimates, the force of every point less its group's mean, (n,) N, the part
    of it that the fit leaves, how each term fares when points are left
    out, and the points as the fit used them."""

    terms: tuple[str, ...]
    told: Identifiability
    estimates: Mapping[str, Estimate]
    force: Array
    residuals: Array
    selection: Selection
    points: Points


def inputs_of(rig: RigFile, facts: Mapping[str, Estimate], angles: int) -> dict[str, Estimate]:
    """The calibration's constants of the inboard AMB, and certificates with the identities that it used."""
    g = rig.geometry
    out = {f"{name}@{k}": facts[f"{name}@{k}"] for name in ("K_i", "K2_i") for k in range(angles)}
    for key in ("amb_span", "motor_to_outboard_amb", "amb_gap", "com_to_inboard_sensor", "com_to_outboard_sensor",
                "com_to_outboard_amb"):  # fmt: skip
        out[key] = certified(f"geometry/{key}", g[key])
    machine = conventions(rig)
    out |= certified_sensors(rig, {channel: channel for channel in (*machine.coils["yi"], *machine.segments)})
    return out | {f"gain_{channel}": certified_gain(rig, channel) for channel in positions(machine)}


def points_of(data: MapData, machine: Servomotor, p: Mapping[str, float], angles: int) -> Points:
    """Currents and displacements of the motor, freed of the sensors' gains and the segments' offsets."""
    i1, i2, i3, i4 = ((data.table.mean[c] - p[f"offset_{c}"]) / p[f"gain_{c}"] for c in machine.segments)
    z = p["com_to_outboard_amb"] + p["motor_to_outboard_amb"]
    x, y = (_at(data, machine, p, axis, z) for axis in "xy")
    return Points(*radial_currents(i1, i2, i3, i4), (i1 + i2 + i3 + i4) / 4, x, y, 2 * np.pi * data.angle / angles)


def _at(data: MapData, machine: Servomotor, p: Mapping[str, float], axis: str, z: float) -> Array:
    """Displacement at plane z, m from the centre of mass, outboard positive."""
    inboard, outboard = (data.table.mean[c] / p[f"gain_{c}"] for c in machine.positions_of(f"{axis}i", f"{axis}o"))
    l_is, l_os = (p[name] for name in machine.sensors)
    return displacement(inboard, outboard, sensor_share(z, l_is, l_os))


def motor_force(data: MapData, machine: Servomotor, p: Mapping[str, float], bias_A: float) -> Array:
    """Vertical force of the motor on the shaft, (n,) N, but for a constant at each angle and load."""
    ip, i_n = ((data.table.mean[c] - p[f"offset_{c}"]) / p[f"gain_{c}"] for c in machine.coils["yi"])
    count = 1 + int(data.angle.max())
    k, k2 = (np.array([p[f"{name}@{n}"] for n in range(count)])[data.angle] for name in ("K_i", "K2_i"))
    u, v = (ip**2 - i_n**2) / (4 * bias_A), (ip**2 + i_n**2) / 2 - bias_A**2
    position = _at(data, machine, p, "y", p["com_to_outboard_amb"] - p["amb_span"])
    inboard = k * u + k2 * v + k * bias_A / p["amb_gap"] * position
    force: Array = inboard * p["amb_span"] / p["motor_to_outboard_amb"]
    return force


def _centred(values: Array, group: npt.NDArray[np.int64]) -> Array:
    """Values (n, ...) less the mean of their group."""
    out = values.astype(np.float64).copy()
    for g in np.unique(group):
        out[group == g] -= out[group == g].mean(axis=0)
    return out


def design_of(points: Points, poles: int, group: npt.NDArray[np.int64]) -> Array:
    """(n, 12): (5.25b) and the three terms of a wrong zero of the commutation, each less its group's mean, in units in which
    the constants are of order one."""
    phase = poles * points.theta
    wrong_zero = [points.i_x, np.sin(phase) * points.i_y, np.cos(phase) * points.i_x]
    columns = np.column_stack([force_map_fit.force_design(points, poles)[:, Y_ROW, :], *wrong_zero])
    return _centred(columns * np.array([SCALE[name] for name in TERMS]), group)


def evaluate(
    data: MapData, machine: Servomotor, inputs: Mapping[str, Estimate], bias_A: float, angles: int, poles: int
) -> Result:
    """Terms that can be told, with their influences and the scatter of the fit.

    Raises:
        AnalysisError: the points leave no degree of freedom, or tell no term.
    """
    values = {name: e.value for name, e in inputs.items()}
    points = points_of(data, machine, values, angles)
    whole = design_of(points, poles, data.group)
    told = force_map_fit.identifiability(_excited(whole, points)[:, None, :], TERMS)
    terms = tuple(n for n in TERMS if n not in told.unidentifiable)
    columns = [TERMS.index(n) for n in terms]

    def fitted(p: Mapping[str, float]) -> leastsquares.Fit:
        design = design_of(points_of(data, machine, p, angles), poles, data.group)[:, columns]
        return leastsquares.linear(design, _centred(motor_force(data, machine, p, bias_A), data.group))

    def model(p: dict[str, float]) -> dict[str, float]:
        return {n: float(x) * SCALE[n] for n, x in zip(terms, fitted(p).terms, strict=True)}

    fit = fitted(values)
    lost = fit.dof / max(fit.dof - len(np.unique(data.group)), 1)  # the groups' means took degrees of freedom
    fit = leastsquares.Fit(
        fit.terms, fit.covariance * lost, fit.residuals, fit.chi2, round(fit.dof / lost), fit.jacobian
    )
    estimates = shared_gradients.by_inputs(model, inputs)
    gradients = {n: np.eye(len(terms))[k] * SCALE[n] for k, n in enumerate(terms)}
    spread = type_a.scatter(fit, gradients, "map", "scatter of the points")
    sums = {n: _straight(estimates[n], estimates[n] + spread[n]) for n in terms}
    force = _centred(motor_force(data, machine, values, bias_A), data.group)
    selection = force_map_selection.select(whole[:, None, columns], force[:, None], None, terms)
    return Result(terms, told, sums, force, fit.residuals, selection, points)


def _straight(certified: Estimate, whole: Estimate) -> Estimate:
    """The whole estimate of a term, without its Monte Carlo where certificates and calibration, which alone go through a model
    that may bend, carry under a tenth of its u: a hundred thousand fits would draw what the scatter hides."""
    return replace(whole, sampler=None) if certified.u < MINOR * whole.u else whole


def _excited(design: Array, points: Points) -> Array:
    """The design with columns set to nothing that hardly anything excites: below EXCITED of what their variables would make of
    them together, at their greatest and at the best angle. Friction always leaves a little torque current, for one."""
    x, y = np.abs(points.x).max(), np.abs(points.y).max()
    i = max(np.abs(points.i_x).max(), np.abs(points.i_y).max())
    torque = np.abs(points.i_theta).max()
    most = {"alpha_1": i, "alpha_2": i, "alpha_3": i, "alpha_4": x * torque, "alpha_5": y, "alpha_6": i * torque,
            "alpha_7": i * torque, "alpha_8": y * i**2, "alpha_9": x * i**2, CROSS: i,
            **dict.fromkeys(QUADRATURE, i)}  # fmt: skip
    possible = np.array([most[name] * SCALE[name] for name in TERMS])
    return np.where(np.abs(design).max(axis=0) < EXCITED * possible, 0.0, design)
