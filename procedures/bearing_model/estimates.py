"""Force constants and offsets with their influences, from positions and certificates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.uncertainty import Estimate
from procedures.amb_rotor import magnetics
from procedures.amb_rotor.keys import gap_key
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.magnetics import AxisFit, Statics
from procedures.amb_rotor.places import Held
from procedures.bearing_model import comparison
from procedures.bearing_model.adjustment import Adjusted, adjust
from procedures.bearing_model.comparison import Sums
from procedures.bearing_model.grid import bias_by_axis
from procedures.bearing_model.inputs import LOADED, fit_inputs
from procedures.shared.type_a import scatter

Array = npt.NDArray[np.float64]
TRUST = 1e-4  # of the load: jitter of currents whose squares count, bending, the telemetry's last digits


@dataclass(frozen=True)
class Analysis:
    """Everything the measurements, findings and figures are made of.

    `statics` of all positions and `compared` of those of the first pass, which both models are compared on, with the adjusted
    inputs; `bias_A` of that pass by axis, of bearings that have one; `noise_N` is the standard deviation of a sample's and of
    a batch's force within its step, by axis; `inputs` as certified; `samples` how many there are in the comparison;
    `offsets_known` m by axis, what the controller takes them for.
    """

    held: Held
    statics: Statics
    compared: Statics
    fits: dict[str, AxisFit]
    inputs: dict[str, Estimate]
    adjusted: Adjusted
    estimates: dict[str, Estimate]
    noise_N: dict[str, tuple[float, float]]
    bias_A: dict[str, float]
    samples: int
    offsets_known: dict[str, float]


def evaluate(recording: Recording[Any], held: Held) -> Analysis:
    """Adjustment and comparison; `estimates` by quantity and axis, of the comparison by quantity and AMB.

    Raises:
        AnalysisError: the positions determine nothing.
    """
    first, bias = float(held.labels["bias_A"][0]), bias_by_axis(recording.rig, recording.plan)
    inputs = fit_inputs(recording.rig, recording.plan.coupled)
    values = {name: e.value for name, e in inputs.items()}
    unloaded = find_unloaded(held, values)
    found = adjust(held.means(), inputs, *_start(held, values, unloaded), unloaded)
    s = magnetics.statics(held.means(), found.values)
    chosen = held.chosen(held.labels["bias_A"] == first) if math.isfinite(first) else held
    compared = magnetics.statics(chosen.means(), found.values)
    estimates = dict(found.estimates)
    fits, noise = {}, {}
    for k, a in enumerate(held.machine.axes):
        if k in unloaded:
            continue
        linear = magnetics.linear(compared.r[k], compared.p[k], compared.n[k], compared.force[k])
        fits[a] = AxisFit(found.terms[k], found.residuals[k], linear)
        slopes = {f"k_linear_{a}": [1, 0], f"stiffness_linear_{a}": [0, 1]}
        scattered = scatter(linear, slopes, f"bearing-model/linear/{a}", f"scatter of the linear fit, {a}")
        estimates |= {name: e + float(linear.terms[j]) for j, (name, e) in enumerate(scattered.items())}
        sums = Sums.of(chosen, found.values, k, fits[a])
        estimates |= sums.estimates(a)
        noise[a] = sums.noise_N
    estimates |= comparison.by_bearing(estimates, held.machine)
    estimates |= of_slopes(found, held.machine, bias)
    return Analysis(held, s, compared, fits, inputs, found, estimates, noise, bias, len(chosen.of_step),
                    _offsets_known(recording, held.machine))  # fmt: skip


def _offsets_known(recording: Recording[Any], machine: AmbRotor) -> dict[str, float]:
    named = {a: machine.model_offset(a) for a in machine.axes}
    return {a: recording.rig.parameters[name].default for a, name in named.items() if name}


def find_unloaded(held: Held, values: dict[str, float]) -> tuple[int, ...]:
    """Numbers of the axes that carry none of the weight: they tell their offsets, and no force constant."""
    load = np.abs(magnetics.statics(held.means(), values).force.mean(axis=1))
    return tuple(k for k in range(len(load)) if load[k] < LOADED * load.max())


def of_slopes(found: Adjusted, machine: AmbRotor, bias: Mapping[str, float]) -> dict[str, Estimate]:
    """K_i and K_x by axis, slopes of the force at the magnetic centre with the bias i_b of its own bearing in both coils:
    K_i = 4 beta i_b / gap^2, K_x = 4 beta i_b^2 / gap^3. What the gap has in beta it mostly takes out of them again."""
    out = {}
    for a, current in bias.items():
        if f"beta_{a}" in found.estimates:
            beta, gap = found.estimates[f"beta_{a}"], found.estimates[gap_key(machine, a)]
            out[f"K_i_{a}"] = beta / (gap * gap) * (4 * current)
            out[f"K_x_{a}"] = beta / (gap * gap * gap) * (4 * current**2)
    return out


def _start(held: Held, values: dict[str, float], unloaded: tuple[int, ...]) -> tuple[Array, Array, Array]:
    """Noise (4,) of a position's mean force, the same (4,) for the weights, and the terms (4, 2) that fit each axis by itself;
    without a load, the force constant that the others have on average, and the offset at which both coils pull alike.

    The noise is that of the batches; the weights also hold what the model is not trusted with. That does not average out over
    N positions; so each of them gets N of its variance.
    """
    s, parts = magnetics.statics(held.means(), values), magnetics.statics(held.parts(), values)
    noise, weighed, terms = np.zeros(4), np.zeros(4), np.zeros((4, 2))
    gaps = [values[gap_key(held.machine, a)] for a in held.machine.axes]
    for k in (k for k in range(4) if k not in unloaded):
        terms[k] = magnetics.nonlinear(s.r[k], s.p[k], s.n[k], s.force[k], gaps[k]).terms
    for k in unloaded:
        others = [terms[j][0] for j in range(4) if j not in unloaded]
        alike = gaps[k] * (s.n[k] - s.p[k]) / (s.n[k] + s.p[k])
        terms[k] = float(np.mean(others)), float((alike - s.r[k]).mean())
    for k in range(4):
        beta, offset = terms[k]
        force = magnetics.magnet(beta, offset, gaps[k], parts.r[k], parts.p[k], parts.n[k]) - parts.force[k]
        batches = force.reshape(len(held), -1)
        noise[k] = math.sqrt(float(batches.var(axis=1, ddof=1).mean()) / batches.shape[1])
        coil = (
            0.0 if "l_is" in values else beta * float((s.p[k] ** 2).mean()) / gaps[k] ** 2
        )  # a small load is a difference
        pull = float(s.force[k].mean()) if coil == 0 else max(abs(float(s.force[k].mean())), coil)
        weighed[k] = math.hypot(noise[k], math.sqrt(len(held)) * TRUST * pull)
    return noise, weighed, terms
