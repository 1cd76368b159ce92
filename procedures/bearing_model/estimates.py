"""Force constants and offsets with their influences, from positions and certificates."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.amb_rotor import magnetics
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.magnetics import AxisFit, Statics
from procedures.amb_rotor.places import Held
from procedures.bearing_model import comparison
from procedures.bearing_model.adjustment import Adjusted, adjust
from procedures.bearing_model.comparison import Sums
from procedures.shared.certificates import certified
from procedures.shared.type_a import scatter

Array = npt.NDArray[np.float64]
LENGTHS = {"l_is": "com_to_inboard_sensor", "l_os": "com_to_outboard_sensor", "l_oa": "com_to_outboard_amb",
           "amb_span": "amb_span", "l_c": "com_to_coupling", "gap": "amb_gap"}  # fmt: skip
TRUST = 1e-4  # of the load: jitter of currents whose squares count, bending, the telemetry's last digits


@dataclass(frozen=True)
class Analysis:
    """Everything the measurements, findings and figures are made of.

    `statics` of all positions and `compared` of those at `bias_A`, which both models are compared on, with the adjusted
    inputs; `noise_N` is the standard deviation of a sample's and of a batch's force within its step, by axis; `inputs` as
    certified; `samples` how many there are in the comparison.
    """

    held: Held
    statics: Statics
    compared: Statics
    fits: dict[str, AxisFit]
    inputs: dict[str, Estimate]
    adjusted: Adjusted
    estimates: dict[str, Estimate]
    noise_N: dict[str, tuple[float, float]]
    bias_A: float
    samples: int


def evaluate(recording: Recording[Any], held: Held) -> Analysis:
    """Adjustment and comparison; `estimates` by quantity and axis, of the comparison by quantity and AMB.

    Raises:
        AnalysisError: the positions determine nothing.
    """
    bias = recording.plan.biases_A[0]
    inputs = fit_inputs(recording.rig, recording.plan.coupled)
    found = adjust(held.means(), inputs, *_start(held, {name: e.value for name, e in inputs.items()}))
    s = magnetics.statics(held.means(), found.values)
    chosen = held.chosen(held.labels["bias_A"] == bias)
    compared = magnetics.statics(chosen.means(), found.values)
    estimates = dict(found.estimates)
    fits, noise = {}, {}
    for k, a in enumerate(held.machine.axes):
        linear = magnetics.linear(compared.r[k], compared.p[k], compared.n[k], compared.force[k])
        fits[a] = AxisFit(found.terms[k], found.residuals[k], linear)
        slopes = {f"k_linear_{a}": [1, 0], f"stiffness_linear_{a}": [0, 1]}
        scattered = scatter(linear, slopes, f"bearing-model/linear/{a}", f"scatter of the linear fit, {a}")
        estimates |= {name: e + float(linear.terms[j]) for j, (name, e) in enumerate(scattered.items())}
        sums = Sums.of(chosen, found.values, k, fits[a])
        estimates |= sums.estimates(a)
        noise[a] = sums.noise_N
    estimates |= comparison.by_bearing(estimates, held.machine)
    return Analysis(held, s, compared, fits, inputs, found, estimates, noise, bias, len(chosen.of_step))


def _start(held: Held, values: dict[str, float]) -> tuple[Array, Array, Array]:
    """Noise (4,) of a position's mean force, the same (4,) for the weights, and the terms (4, 2) that fit each axis by itself.

    The noise is that of the batches; the weights also hold what the model is not trusted with. That does not average out over
    N positions; so each of them gets N of its variance.
    """
    s, parts = magnetics.statics(held.means(), values), magnetics.statics(held.parts(), values)
    noise, weighed, terms = np.zeros(4), np.zeros(4), np.zeros((4, 2))
    for k in range(4):
        terms[k] = magnetics.nonlinear(s.r[k], s.p[k], s.n[k], s.force[k], values["gap"]).terms
        beta, offset = terms[k]
        force = magnetics.magnet(beta, offset, values["gap"], parts.r[k], parts.p[k], parts.n[k]) - parts.force[k]
        batches = force.reshape(len(held), -1)
        noise[k] = math.sqrt(float(batches.var(axis=1, ddof=1).mean()) / batches.shape[1])
        weighed[k] = math.hypot(noise[k], math.sqrt(len(held)) * TRUST * float(s.force[k].mean()))
    return noise, weighed, terms


def fit_inputs(rig: RigFile, coupled: bool) -> dict[str, Estimate]:
    """What the fits need besides the positions: certificates of the rig file as influences by identity."""
    g, m, machine = rig.geometry, rig.machine, conventions(rig)
    inputs = {"mass": certified("machine/mass", m["mass"], "mass of the shaft"),
              "axes": certified("machine/radial_axes", m["radial_axes"], "angle of the axes to the vertical"),
              "gravity": certified("site/gravity", rig.site.gravity, "gravity")}  # fmt: skip
    inputs |= {key: certified(f"geometry/{name}", g[name], name.replace("_", " ")) for key, name in LENGTHS.items()}
    spring = certified("geometry/coupling_stiffness", g["coupling_stiffness"], "stiffness of the coupling")
    inputs["coupling"] = spring if coupled else Estimate.exact(0.0)
    for d in "yz":
        name = f"machine/coupling_offset/{d}"
        inputs[f"relaxed_{d}"] = certified(name, m["coupling_offset"], f"where the coupling is relaxed, {d}")
    for a in machine.axes:
        probe = machine.position(a)
        inputs[f"gain_{a}"] = certified(f"sensors/{probe}/gain", rig.sensors[probe].gain, f"gain of {probe}")
        inputs[f"zero_{a}"] = certified(f"sensors/{probe}/offset", rig.sensors[probe].offset, f"zero of {probe}")
        inputs[f"runout_{a}"] = certified(
            f"machine/runout/{a}", m["runout"], f"runout of {probe} where the shaft rests"
        )
    for c, channel in ((f"{a}_{side}", channel) for a in machine.axes
                       for side, channel in zip("pn", machine.pair(a), strict=True)):  # fmt: skip
        sensor = rig.sensors[channel]
        inputs[f"gain_{c}"] = certified(f"sensors/{channel}/gain", sensor.gain, f"gain of {channel}")
        inputs[f"offset_{c}"] = certified(f"sensors/{channel}/offset", sensor.offset, f"offset of {channel}")
    return inputs
