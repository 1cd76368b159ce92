"""The truth of a sensitivity test of a rig's twin: its loop linearised where the quiet machine floats, as the core computes it.

Shaft with bending modes and gyroscopic moments, coils that follow their own current sensors, one sample of delay, notch and
derivative filters, integrators. At rest the runout that the probes see where the shaft stands shifts where it floats. Of the
loop opened at the current reference of axis j, all others closed: S_jj = after/inject = ((I - C P)^-1)_jj, P from the
references to the readings and C back.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.peaks import greatest
from sim_backend.machines.twin.control import TwinControl
from sim_backend.machines.twin.params import TwinParams
from sim_backend.machines.twin.plant import TwinPlant, derivative
from sim_backend.machines.twin.quiet import floating, quiet

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

MOVING = [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, *range(12, 20)]  # of the core's state: all but the angle and the speed
SHAFT, COILS = len(MOVING), 32
STEP_M, STEP_A = 1e-8, 1e-6  # of the numerical derivatives
SETTLED_S = 20.0  # until slow integrators are at rest
AT_ONCE = 500  # frequencies


@dataclasses.dataclass(frozen=True)
class Closed:
    """A tick of plant: x+ = a x + b u, y = c x, u the references that act (axes,), y the readings (probes,); `control`, with
    which the law answers; which axes are asked for, None of one that the machine has not; s from tick to tick."""

    a: Array
    b: Array
    c: Array
    control: TwinControl
    asked: tuple[int | None, ...]
    tick_s: float

    def sensitivity(self, hz: npt.ArrayLike) -> Complex:
        """S_jj at `hz` (m,) of the axes, (m, axes): NaN of one that the machine has not."""
        at = np.atleast_1d(np.asarray(hz, np.float64))
        return np.concatenate([self._some(part) for part in np.array_split(at, -(-at.size // AT_ONCE))])

    def _some(self, hz: Array) -> Complex:
        z, axes = np.exp(2j * np.pi * hz * self.tick_s), self.b.shape[1]
        inner = z[:, None, None] * np.eye(len(self.a)) - self.a
        plant = self.c @ np.linalg.solve(inner, np.broadcast_to(self.b, (z.size, *self.b.shape))) / z[:, None, None]
        held = np.linalg.inv(np.eye(axes) - self._law(z) @ plant)
        out = np.diagonal(held, axis1=1, axis2=2)[:, [k or 0 for k in self.asked]].copy()
        out[:, [k is None for k in self.asked]] = np.nan
        return np.asarray(out)

    def _law(self, z: Complex) -> Complex:
        """From readings to references at `z` (m,), (m, axes, probes): the integral is as it was before the sample."""
        (probes, axes), c = (len(self.c), self.b.shape[1]), self.control
        keep = 1 / (1 + 2 * np.pi * c.derivative_hz * self.tick_s)
        kp, ki, kd = (np.array(gains[:axes]) for gains in (c.kp, c.ki, c.kd))
        rate = (1 - keep) * (1 - 1 / z) / self.tick_s / (1 - keep / z)
        gain = kp + ki * self.tick_s / (z[:, None] - 1) + kd * rate[:, None]
        for b0, b1, a2 in (c.notch[k : k + 3] for k in range(0, len(c.notch), 3)):
            if b0:  # none of a mode that is above half of the tick's rate
                gain = gain * ((b0 + b1 / z + b0 / z**2) / (1 + b1 / z + a2 / z**2))[:, None]
        return np.asarray(-gain[:, :, None] * np.array(c.map).reshape(16, 16)[:probes, :axes].T)

    def peak(self, axis: int, low: float, high: float) -> tuple[float, float]:
        """Greatest abs(S_jj) between two frequencies in Hz, and where."""
        return greatest(lambda hz: np.abs(self.sensitivity(hz)[:, axis]), low, high, points=1000, fine=100, rounds=5)


def loop(rig: RigFile, drawn: Truth, settings: Mapping[str, float], axes: Sequence[str], speed: float = 0.0) -> Closed:
    """Of `axes` by name, under every parameter in `settings`, at `speed` rad/s: what turns with the shaft is then left out."""
    plant = floating(rig, drawn, settings, speed, SETTLED_S, _even if speed else quiet).plant
    p, names = plant.params, plant.axes
    a, b = _tick(p, *_slopes(_even(p), plant))
    asked = tuple(names.index(axis) if axis in names else None for axis in axes)
    return Closed(a, b, _readings(p), _set(plant), asked, p.tick)


def _even(p: TwinParams) -> TwinParams:
    """Quiet, and without what turns with the shaft."""
    return dataclasses.replace(quiet(p), unbalance=(0.0,) * 4, runout_c=(0.0,) * 64, runout_s=(0.0,) * 64)


def _set(plant: TwinPlant) -> TwinControl:
    """The law as it was set."""
    kp, ki, kd = (tuple(plant.get(f"{gain}.{axis}") for axis in plant.axes) for gain in ("kp", "ki", "kd"))
    return dataclasses.replace(plant.params.control, derivative_hz=plant.get("derivative_hz"), kp=kp, ki=ki, kd=kd)


def _slopes(p: TwinParams, plant: TwinPlant) -> tuple[Array, Array]:
    """Derivatives of the shaft's rates to its state (18, 18) and to the coil currents (18, 32)."""
    state, rates, pulls = plant.state(), np.empty((SHAFT, SHAFT)), np.empty((SHAFT, COILS))
    still, coil, load = state["s"].copy(), state["coil"], np.zeros(9)
    for k, place in enumerate(MOVING):
        h = STEP_M * (1.0 if place < 6 or 12 <= place < 16 else 1e3) * np.eye(20)[place]
        both = derivative(p, still + h, coil, load) - derivative(p, still - h, coil, load)
        rates[:, k] = both[MOVING] / (2 * h[place])
    for k in range(COILS):
        h = STEP_A * np.eye(COILS)[k]
        pulls[:, k] = (derivative(p, still, coil + h, load) - derivative(p, still, coil - h, load))[MOVING] / (
            2 * STEP_A
        )
    return rates, pulls


def _tick(p: TwinParams, rates: Array, pulls: Array) -> tuple[Array, Array]:
    """Shaft and coils over a tick (50, 50) and (50, axes): amplifiers hold their references by their own current sensors."""
    from scipy import linalg  # what has no sensitivity starts without it

    axes, size = p.radial + p.axial, SHAFT + COILS
    to = np.zeros((COILS, axes))
    for k in range(axes):
        to[k, k] = 1 / p.current_gain[k]
        to[16 + k, k] = -1 / p.current_gain[16 + k] if p.coils[k] == 2 else 0.0
    a = np.zeros((size + axes, size + axes))
    a[:SHAFT, :SHAFT], a[:SHAFT, SHAFT:size] = rates, pulls
    a[SHAFT:size, SHAFT:size] = -p.amplifier_rate * np.eye(COILS)
    a[SHAFT:size, size:] = p.amplifier_rate * to
    whole = linalg.expm(a * p.tick)
    return whole[:size, :size], whole[:size, size:]


def _readings(p: TwinParams) -> Array:
    """Readings of the probes, of the state, (probes, 50)."""
    out = np.zeros((p.probes, SHAFT + COILS))
    out[:, 0] = np.array(p.probe_x)[: p.probes]
    columns = np.array(p.probe).reshape(8, 16)[:, : p.probes].T
    out[:, 1:5] = columns[:, :4]
    out[:, 10:14] = columns[:, 4:]
    read = np.array(p.position_gain) * np.array(p.position_sign)
    return np.asarray(out * read[: p.probes, None])
