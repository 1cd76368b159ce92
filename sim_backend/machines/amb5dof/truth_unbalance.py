"""The truth of a dwell on the AMB stand: what its shaft really does, from the same plant, averaged over many turns.

The probes' readings of that plant, less gain, zero and runout, are the shaft's centre in the probes' planes. The noise of its
sensors stays: where a coil's current is cut off at zero (CAC), noise changes what the loop makes of the shaft, by half a
percent.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from sim_backend.core import LEVITATE, LIFT, READY, TICK_S, DriveLaw
from sim_backend.machines.amb5dof.params import AmbControl, AmbParams
from sim_backend.machines.amb5dof.plant import TRACE, AmbPlant
from sim_backend.machines.amb5dof.truth_step import quiet

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
DRIVE = DriveLaw(gain=0.5, limit=0.2, ramp=210.0)  # so stiff that drag takes nothing from the speed asked for
LIFT_S = 1.0
ORDERS = (1.0, 2.0, 3.0, 4.0)


@dataclasses.dataclass(frozen=True)
class Motion:
    """Vectors of order 1 from the once-per-turn mark: `read` by the probes over their gain, `shaft` of the shaft's centre, (4,)
    m, yi zi yo zo; `d_max` (2,) m, the greatest distance of the shaft's centre from the rings' in each sensor plane."""

    read: Complex
    shaft: Complex
    d_max: tuple[float, float]


def motion(
    p: AmbParams, settings: Mapping[str, float], speed: float, settle_s: float = 8.0, seconds: float = 3.0
) -> Motion:
    """The shaft at `speed` rad/s under the settings of the controller (SI, by name), once the integrators have settled."""
    plant = _turning(p, settings, speed)
    plant.run(round(settle_s * 1e4))
    return _seen(plant, p, seconds)


def response(
    p: AmbParams, settings: Mapping[str, float], speeds: Array, settle_s: float = 1.0, seconds: float = 0.3
) -> Complex:
    """Vectors (n, 4) of the shaft's centre at `speeds` (n,) rad/s, each held, one after the other with one plant; without
    noise and rounding, which short dwells would not average out. (Under CAC noise changes motion by tenths of a percent.)"""
    plant = _turning(quiet(p), settings, float(speeds[0]))
    plant.run(50000)
    out = []
    for speed in speeds:
        s = plant.state()["s"]
        s[11] = speed
        plant.set_state(s)
        plant.drive(None)  # or it would ramp on from where it was
        plant.drive(DRIVE, float(speed))
        plant.run(round(settle_s * 1e4))
        out.append(_seen(plant, p, seconds).shaft)
    return np.array(out)


def _turning(p: AmbParams, settings: Mapping[str, float], speed: float) -> AmbPlant:
    """Lifted and turning at `speed` rad/s; no pulse is missing or doubled, and no probe hums."""
    p = dataclasses.replace(p, pulse_missing=0.0, pulse_doubled=0.0, hum_hz=0.0)
    known = AmbControl.__dataclass_fields__
    control = AmbControl(**{k: v for k, v in settings.items() if k in known} | {"law": 0.0, "observer": 0.0})
    plant = AmbPlant(p, 0, control=control)
    plant.mode = READY
    plant.run(1000)
    plant.mode = LIFT
    plant.run(round(LIFT_S * 1e4) + 500)
    plant.mode = LEVITATE
    s = plant.state()["s"]
    s[11] = speed
    plant.set_state(s)
    plant.drive(DRIVE, speed)
    for name in ("law", "observer"):
        plant.set(name, settings[name])
    return plant


def _seen(plant: AmbPlant, p: AmbParams, seconds: float) -> Motion:
    """What the shaft does now."""
    start, (_, trace) = plant.tick, plant.run(round(seconds * 1e4), 1)
    t = (start + np.arange(len(trace), dtype=np.float64)) * TICK_S
    angle = angle_of(t, *(trace[:, TRACE.index(name)] for name in ("pulses", "pulse_age")))
    inside = (angle >= 0) & (angle < 2 * np.pi * np.floor(angle.max() / (2 * np.pi)))  # whole turns
    gain, zero = (np.array(x[:4])[:, None] for x in (p.position_gain, p.position_offset))
    read = (trace[inside, :4].T - zero) / gain
    waves = np.exp(1j * np.outer(ORDERS, angle[inside]))
    fitted = np.linalg.lstsq(np.vstack([np.ones(inside.sum()), waves.real, -waves.imag]).T, read.T, rcond=None)[0]
    vectors = fitted[1 : 1 + len(ORDERS)] + 1j * fitted[1 + len(ORDERS) :]
    turn = np.linspace(0, 2 * np.pi, 721)
    shaft = fitted[0][:, None] - _runout(p, turn)
    for n, v in zip(ORDERS, vectors, strict=True):
        shaft = shaft + (v[:, None] * np.exp(1j * n * turn)).real
    far = [float(np.hypot(shaft[k], shaft[k + 1]).max()) for k in (0, 2)]
    return Motion(vectors[0], vectors[0] - first(p), (far[0], far[1]))


def angle_of(t: Array, pulses: Array, age: Array) -> Array:
    """Angle from the first pulse on, rad (n,): the speed is held, and pulses lie on a parabola in time, if not on a line."""
    k = np.flatnonzero(np.diff(pulses) == 1) + 1
    at = t[k] - age[k] - t[0]
    turns = np.polynomial.Polynomial.fit(at, np.arange(k.size), 2)
    return np.asarray(2 * np.pi * turns(t - t[0]))


def first(p: AmbParams) -> Complex:
    """Runout of order 1 at each probe as a vector from the mark, (4,) m."""
    return np.array([p.runout[4 * k] * np.exp(1j * (p.runout_phase[4 * k] - p.pulse_angle)) for k in range(4)])


def _runout(p: AmbParams, angle: Array) -> Array:
    """What the journals' runout adds at each probe, (4, n) m."""
    phi = angle - p.pulse_angle
    return np.array([
        sum(p.runout[4 * k + n] * np.cos((n + 1) * phi + p.runout_phase[4 * k + n]) for n in range(4)) for k in range(4)
    ])  # fmt: skip
