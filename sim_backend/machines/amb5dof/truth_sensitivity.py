"""The truth of a sensitivity on the AMB stand: its closed loop linearised where the shaft floats, as the core computes it.

Shaft with bending modes and gyroscopic moments, coils, the core's own integration steps, one sample of delay, notches, the
rates' low-pass, integrators. Of the loop opened at the differential current reference of axis j, all others closed:
S_jj = after/inject = ((I - C P)^-1)_jj, P from the references to the readings and C back.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bench.analysis.responses import image_distance
from sim_backend.core import TICK_S
from sim_backend.machines.amb5dof.linear import notch
from sim_backend.machines.amb5dof.params import AmbControl, AmbParams
from sim_backend.machines.amb5dof.plant import TRACE, ccs, derivative
from sim_backend.machines.amb5dof.reference_law import Model
from sim_backend.machines.amb5dof.truth_step import floating
from sim_backend.machines.amb5dof.truth_unbalance import angle_of
from sim_backend.machines.peaks import greatest

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
MOVING = [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, *range(12, 20)]  # of the core's state: all but the angle and the speed
SHAFT, COILS, AXES = len(MOVING), 10, 5
STEP_M, STEP_A = 1e-8, 1e-6  # of the numerical derivatives
SETTLED_S = 20.0  # until the flatness law's integrators hold what its model does not know
SMALL_A, STEP_HZ, LINES = 1e-3, 2.0, 12  # of the lines about a peak, and to either side of it
SHARES = (0.125, 0.25, 0.375)  # of a step: by one of them the lines stand apart from their images
ORDERS, CLEAR_HZ = (1.0, 2.0, 3.0, 4.0), 3.0  # what turns with the shaft, and how far lines keep from it


@dataclasses.dataclass(frozen=True)
class Loop:
    """A tick of plant: x+ = a x + b u, y = c x, u the differential references that act (5,), y the readings; `controller`, of
    z (m,), the law's response (m, 5, 5) from readings to references."""

    a: Array
    b: Array
    c: Array
    controller: Callable[[Complex], Complex]

    def plant(self, hz: Array) -> Complex:
        """From references, as the law gives them, to readings: (m, 5, 5), the sample of delay included."""
        z = np.exp(2j * np.pi * hz * TICK_S)
        inner = z[:, None, None] * np.eye(len(self.a)) - self.a
        return np.asarray(
            self.c @ np.linalg.solve(inner, np.broadcast_to(self.b, (hz.size, *self.b.shape))) / z[:, None, None]
        )

    def sensitivity(self, hz: npt.ArrayLike) -> Complex:
        """S_jj at `hz` (m,) of the axes yi, zi, yo, zo, x: (m, 5)."""
        at = np.atleast_1d(np.asarray(hz, np.float64))
        back = self.controller(np.exp(2j * np.pi * at * TICK_S)) @ self.plant(at)
        return np.asarray(np.diagonal(np.linalg.inv(np.eye(AXES) - back), axis1=1, axis2=2))

    def peak(self, axis: int, low: float, high: float) -> tuple[float, float]:
        """Greatest abs(S_jj) between two frequencies in Hz, and where."""
        return greatest(lambda hz: np.abs(self.sensitivity(hz)[:, axis]), low, high, points=4000, fine=200, rounds=4)


def loop(p: AmbParams, settings: Mapping[str, float], speed: float = 0.0, substeps: int = 2) -> Loop:
    """Where the quiet machine floats at `speed` rad/s, under law 0 or 1 of the controller's `settings`.

    What turns with the shaft is left out at speed: an orbit of some micrometres adds some tenths of a percent to the peak (the
    bearings' slopes go with it), which `quiet_peak` has. At rest runout stays, since it shifts where the shaft floats.
    """
    plant = floating(even(p) if speed else p, settings, speed, SETTLED_S)
    at, state = plant.run(10, 1)[1][-1, :AXES], plant.state()
    rates, pulls = _slopes(dataclasses.replace(p, unbalance=(0.0,) * 2), state["s"], state["coil"])
    a, b = _tick(p, rates, pulls, substeps)
    known = AmbControl.__dataclass_fields__
    control = AmbControl(**{k: v for k, v in settings.items() if k in known})
    return Loop(
        a,
        b,
        _readings(p),
        _law(control, () if control.law == 0 else _inverted(control, at, _told(p, state["coil"]), speed)),
    )


def even(p: AmbParams) -> AmbParams:
    """Without what turns with the shaft."""
    return dataclasses.replace(p, runout=(0.0,) * 16, unbalance=(0.0,) * 2)


def quiet_peak(
    p: AmbParams, settings: Mapping[str, float], axis: int, speed: float, substeps: int = 2, periods: int = 3
) -> tuple[float, float]:
    """Greatest abs(S_jj) and where, Hz, of the quiet machine that turns with its unbalance and its runout, by lines of SMALL_A
    about the peak of its linearised loop, apart from what its orbit makes of them: n times the speed, and images of the lines
    about it. No noise, no pulse that is missing or doubled; still single lines are off by some tenths of a percent, which on a
    flat peak is a hertz: a cubic through their ratios to the linearised loop takes the mean of all."""
    p = dataclasses.replace(p, pulse_missing=0.0, pulse_doubled=0.0)
    linear, turn = loop(p, settings, speed, substeps), speed / (2 * math.pi)
    near = linear.peak(axis, 2.0, 2000.0)[1]
    hz = _about(near, max(SHARES, key=lambda share: image_distance(share, turn / STEP_HZ, ORDERS)))
    hz = hz[np.abs(hz[:, None] - turn * np.array(ORDERS)).min(axis=1) > CLEAR_HZ] if speed else hz
    plant, period = floating(p, settings, speed, SETTLED_S, substeps), round(1 / TICK_S / (STEP_HZ * SHARES[0]))
    whole = _about(near, (hz[0] / STEP_HZ) % 1)
    made = {"inject_axis": axis, "inject_amplitude": SMALL_A, "inject_hz": whole[0], "inject_step": STEP_HZ,
            "inject_lines": whole.size}  # fmt: skip
    for name, value in made.items():
        plant.set(name, float(value))
    plant.run(10000)
    start, trace = plant.tick, plant.run(periods * period, 1)[1]
    t = (start + np.arange(len(trace), dtype=np.float64)) * TICK_S
    seen = {n: trace[:, TRACE.index(n)] for n in ("inject", "after", "pulses", "pulse_age")}
    turning = np.outer(ORDERS, angle_of(t, seen["pulses"], seen["pulse_age"])) if speed else np.empty((0, t.size))
    waves = np.exp(1j * np.concatenate([2 * np.pi * np.outer(whole, t), turning]))
    design = np.concatenate([np.ones((1, t.size)), waves.real, waves.imag]).T
    both = np.linalg.lstsq(design, np.array([seen["inject"], seen["after"]]).T, rcond=None)[0]
    parts = both[1 : 1 + len(waves)] - 1j * both[1 + len(waves) :]
    size = np.abs(parts[: whole.size, 1] / parts[: whole.size, 0])[np.isin(whole, hz)]
    fine = np.linspace(hz[0], hz[-1], 20001)
    beside = np.polynomial.Polynomial.fit(hz, size / np.abs(linear.sensitivity(hz)[:, axis]), 3)
    curve = beside(fine) * np.abs(linear.sensitivity(fine)[:, axis])
    return float(curve.max()), float(fine[curve.argmax()])


def _about(near: float, share: float) -> Array:
    """Lines in Hz to either side of a peak, `share` of a step beside whole ones."""
    return np.asarray(STEP_HZ * (math.floor(near / STEP_HZ) + share + np.arange(-LINES, LINES + 1)), np.float64)


def _slopes(p: AmbParams, s: Array, coil: Array) -> tuple[Array, Array]:
    """Derivatives of the shaft's rates to its state (18, 18) and to the coil currents (18, 10)."""
    rates, pulls = np.empty((SHAFT, SHAFT)), np.empty((SHAFT, COILS))
    still = s.copy()
    still[5] = 0.0

    def of(moved: Array, current: Array) -> Array:
        return derivative(p, moved, current)[MOVING]

    for k, place in enumerate(MOVING):
        h = STEP_M * (1.0 if place < 6 or 12 <= place < 16 else 1e3) * np.eye(20)[place]
        rates[:, k] = (of(still + h, coil) - of(still - h, coil)) / (2 * h[place])
    for k in range(COILS):
        h = STEP_A * np.eye(COILS)[k]
        pulls[:, k] = (of(still, coil + h) - of(still, coil - h)) / (2 * STEP_A)
    return rates, pulls


def _tick(p: AmbParams, rates: Array, pulls: Array, substeps: int) -> tuple[Array, Array]:
    """Shaft and coils over a tick (28, 28) and (28, 5): Runge and Kutta's steps as the core makes them, coils exact."""
    axis = np.repeat(np.eye(AXES), 2, axis=0) * np.tile([1.0, -1.0], AXES)[:, None]
    to = axis / np.array(p.current_gain)[:, None]
    h, size = TICK_S / substeps, SHAFT + COILS
    keep = math.exp(-p.amplifier_rate * h / 2)
    whole = np.concatenate(
        [np.eye(size), np.zeros((AXES, size))]
    ).T  # columns: a unit of each state, then of each input
    m, c, u = whole[:SHAFT], whole[SHAFT:], np.concatenate([np.zeros((COILS, size)), to], axis=1)
    for _ in range(substeps):
        c1 = u + (c - u) * keep
        c2 = u + (c1 - u) * keep
        k1 = rates @ m + pulls @ c
        k2 = rates @ (m + h / 2 * k1) + pulls @ c1
        k3 = rates @ (m + h / 2 * k2) + pulls @ c1
        k4 = rates @ (m + h * k3) + pulls @ c2
        m, c = m + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), c2
    out = np.concatenate([m, c])
    return out[:, :size], out[:, size:]


def _readings(p: AmbParams) -> Array:
    """Readings yi zi yo zo x of the state, (5, 28); where the probes see the shaft along its axis is left out."""
    out = np.zeros((AXES, SHAFT + COILS))
    for b, station in enumerate((-p.l_is, p.l_os)):
        y, z = out[2 * b], out[2 * b + 1]
        y[1], y[4] = 1.0, station
        z[2], z[3] = 1.0, -station
        for mode in range(2):
            if any(p.mode_on):
                y[10 + 2 * mode] = z[11 + 2 * mode] = p.shape_sensor[2 * mode + b]
    out[4, 0] = 1.0
    return np.asarray(out * (np.array(p.position_gain) * np.array(p.position_sign))[:, None])


def _law(c: AmbControl, slopes: Sequence[Array]) -> Callable[[Complex], Complex]:
    """From readings to differential references, at the samples."""
    back, on_q, on_rate, on_v = slopes or (np.zeros((AXES, AXES)),) * 4
    keep = 1 / (1 + 2 * math.pi * c.derivative_hz * TICK_S)
    gains = c.k1, (c.k2_cac if c.law == 2 else c.k2_ccs)
    summed = c.k0 * TICK_S * np.array([1.0, *(float(c.integral != 0),) * 4])
    notches = [notch(c.notch1_hz, c.notch1_q), notch(c.notch2_hz, c.notch2_q)]

    def controller(z: Complex) -> Complex:
        seen = np.ones((z.size, AXES), complex)
        for b0, b1, b2, a1, a2 in notches:
            seen[:, :4] *= ((b0 + b1 / z + b2 / z**2) / (1 + a1 / z + a2 / z**2))[:, None]
        rate = ((1 - keep) * (1 - 1 / z) / TICK_S / (1 - keep / z))[:, None, None]
        if c.law == 0:  # the integral is as it was before this sample
            whole = -(c.kp + c.ki * TICK_S / (z - 1))[:, None, None] - c.kd * rate
            return np.asarray(whole * np.eye(AXES) * seen[:, None, :])
        held = (z / (z - 1))[:, None, None] * np.diag(summed)
        forward = on_q - on_v @ (gains[0] * np.eye(AXES) + held) + (on_rate - gains[1] * on_v) * rate
        return np.asarray(forward @ back * seen[:, None, :])

    return controller


def _told(p: AmbParams, coil: Array) -> Array:
    """Differential references (5,) under which the coils carry `coil` (10,): the amplifiers follow their own current sensors,
    whose gains and offsets the law does not know."""
    pairs = (coil * np.array(p.current_gain) + np.array(p.current_offset)).reshape(AXES, 2)
    return np.asarray((pairs[:, 0] - pairs[:, 1]) / 2)


def _inverted(c: AmbControl, at: Array, wanted: Array, speed: float) -> tuple[Array, Array, Array, Array]:
    """Coordinates of the readings, and the slopes of the differential currents to coordinates, rates and accelerations, where
    the probes read `at` (5,) and the law asks for the differential currents `wanted` (5,)."""
    model, still = Model(c), np.zeros(AXES)
    q0 = model.coordinates(at, at[4])

    def currents(q: Array, rate: Array, v: Array) -> Array:
        force, xi = model.flat(q, rate, v, speed), model.gaps(q)
        return np.array([ccs(force[k], model.beta[k], model.gap[k], xi[k], c.bias) for k in range(AXES)])

    def slopes(of: Callable[[Array], Array], size: float) -> Array:
        return np.array([(of(h) - of(-h)) / (2 * size) for h in size * np.eye(AXES)]).T

    def of(v: Array) -> Array:
        return currents(q0, still, v)

    v = still.copy()  # what the integrators hold
    for _ in range(6):
        turn = slopes(lambda h, v=v: of(v + h), 1e-3)  # type: ignore[misc]
        v = v - np.linalg.solve(turn, of(v) - wanted)
    back = slopes(lambda at: model.coordinates(at, 0.0), 1e-6)
    on_q = slopes(lambda q: currents(q0 + q, still, v), 1e-8)
    on_rate = slopes(lambda rate: currents(q0, rate, v), 1e-3)
    return back, on_q, on_rate, slopes(lambda h: of(v + h), 1e-3)
