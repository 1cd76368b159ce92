"""Ratio, coupled constant and zero of the commutation with their influences, from step means and the calibrated alpha_d."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.rigfile.roles import ANGLE
from bench.uncertainty import Estimate, Influence
from procedures.force_coupling import fit as force_coupling_fit
from procedures.force_coupling.fit import CouplingFit, Sweep
from procedures.force_coupling.steps import Phase
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified_sensors
from procedures.shared.gradients import by_inputs, linearised
from procedures.shared.step_table import StepTable
from procedures.shared.type_a import scatter

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Analysis:
    """Everything the measurements, findings and figures are made of. `printed` is r as T (6.15) means it, `successive` the
    same from step to step. `turn`: by how much the force turns for the gamma that was told. `moved` rad: gamma_0 less what
    the force constant's calibration found of it, where it did."""

    data: StepTable[Phase]
    fit: CouplingFit
    estimates: dict[str, Estimate]
    printed: float
    successive: float
    turn: Estimate
    moved: Estimate | None


def evaluate(recording: Recording[Any], data: StepTable[Phase], count_rad: float) -> Analysis:
    """Fit, and the three estimates by name; `winding`, the x winding's constant over the y winding's, and `carried` A, the
    force that holds the outboard end up at home over the y winding's constant, beside them."""
    inputs = fit_inputs(recording)
    machine = conventions(recording.rig)
    y, x = (data.stack(machine.positions_of(f"{axis}i", f"{axis}o")) for axis in "yx")
    sweep = Sweep(data.stack(machine.segments), y, x,
                  data.each(lambda step: step.gamma_rad), rotor_angle(data.mean[ANGLE], count_rad), data.time_s)  # fmt: skip

    def model(p: dict[str, float]) -> dict[str, float]:
        return outputs(force_coupling_fit.fit_sweep(sweep, p), p)

    values = {name: e.value for name, e in inputs.items()}
    fit = force_coupling_fit.fit_sweep(sweep, values)
    estimates = by_inputs(model, inputs)
    extra = scatter(fit.fit, _gradients(fit, values), "currents", "scatter of the steps")
    estimates |= {name: estimates[name] + e for name, e in extra.items()}
    once = slice(0, len(data) // 2)
    ratios = [
        force_coupling_fit.as_printed(
            sweep.gamma[once], fit.i_x[once], fit.i_y[once], values["pole_pairs"], successive=way
        )
        for way in (False, True)
    ]
    by_sensors = linearised(lambda p: {"turn": force_coupling_fit.fit_sweep(sweep, p).turn[0]}, inputs)["turn"]
    left = Influence(id="scatter/turn", name="scatter of the steps", u=fit.turn[1], unit="1", kind="A",
                     distribution="normal", dof=float(fit.fit.dof - 1), source="residuals of the fit")  # fmt: skip
    turn = by_sensors + Estimate.of(0.0, left)
    return Analysis(data, fit, estimates, ratios[0], ratios[1], turn, _moved(recording, fit, estimates))


def _moved(recording: Recording[Any], fit: CouplingFit, estimates: dict[str, Estimate]) -> Estimate | None:
    """gamma_0 less that of the force constant's calibration: there the other axis' current gave -a alpha_c sin(M gamma_0)."""
    cross = recording.calibration("force-constant").values.get("alpha_cross@0")
    if cross is None:  # a calibration of before it was handed on
        return None
    poles, zero = recording.rig.machine["pole_pairs"].value, estimates["gamma_0"]
    across = fit.term("a") * estimates["alpha_c"].value
    sine = -cross.value / across
    if not abs(sine) < 1:  # signs and windings are wrong, and named
        return None
    cosine = math.sqrt(1 - sine**2)
    return zero + (cross - cross.value) * (1 / (poles * across * cosine)) - math.asin(sine) / poles


def outputs(fit: CouplingFit, p: dict[str, float]) -> dict[str, float]:
    """The reported values of a fit; alpha_c N/A, gamma_0 rad."""
    zero = fit.term("gamma_0")
    return {
        "alpha_ratio": fit.term("r"),
        "alpha_c": p["alpha_d"] * fit.term("w") / math.cos(p["pole_pairs"] * zero),
        "gamma_0": zero,
        "winding": fit.term("a"),
        "carried": -fit.term("f_y"),
    }


def _gradients(fit: CouplingFit, p: dict[str, float]) -> dict[str, Array]:
    """d output / d terms of the fit, in the order of `coupling.TERMS`."""
    w, turn, unit = fit.term("w"), p["pole_pairs"] * fit.term("gamma_0"), np.eye(len(force_coupling_fit.TERMS))
    alpha_c = p["alpha_d"] / math.cos(turn)
    return {
        "gamma_0": unit[2],
        "alpha_ratio": -unit[0] / w**2,
        "alpha_c": alpha_c * unit[0] + alpha_c * w * math.tan(turn) * p["pole_pairs"] * unit[2],
        "winding": unit[1],
        "carried": -unit[4],
    }


def rotor_angle(mean: Array, count_rad: float) -> Array:
    """Where the rotor stands (N,) rad by the mean reading of its encoder in each step, where a count is `count_rad`.

    Sent to the edge between two counts, it is pushed back from either side and stays there, reading now one and now the
    other. A mean between them is the edge; one on a count is that count, within half of it.
    """
    below = np.floor(mean / count_rad)
    inside = np.abs(mean / count_rad - np.round(mean / count_rad)) > 0.01
    return np.where(inside, (below + 0.5) * count_rad, np.round(mean / count_rad) * count_rad)


def fit_inputs(recording: Recording[Any]) -> dict[str, Estimate]:
    """What the fit needs besides the steps: alpha_d, and certificates of the rig file as influences by identity."""
    rig, alpha_d = recording.rig, recording.calibration("force-constant").values["alpha_d@0"]
    g = rig.geometry
    inputs = {
        "alpha_d": alpha_d,
        "pole_pairs": Estimate.exact(rig.machine["pole_pairs"].value),
        "l_is": Estimate.exact(g["com_to_inboard_sensor"].value),
        "l_os": Estimate.exact(g["com_to_outboard_sensor"].value),
        "z_m": Estimate.exact(g["com_to_motor"].value),
        # Refers currents to the sensors' zero, a matter of nanometres: its tolerance does not show.
        "per_metre": Estimate.exact(g["motor_stiffness"].value / alpha_d.value),
    }
    return inputs | certified_sensors(rig, {f"m{k}": c for k, c in enumerate(conventions(rig).segments, 1)})
