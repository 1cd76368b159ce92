"""What a passage would show if the bearings' forces were linear: an orbit of amplitude a in a gap s bends them by (a/s)^2.

A critical speed is that of small orbits. A large one changes what T (2.4b) gives: the force's first harmonic over a turn (its
describing function) is K_p i_p + K_n i_n + K_x x + N. What the slopes leave out, N, follows from the measured currents, places
and their second harmonics. The shaft q then obeys

    Z q = w^2 B' U + A' N,    Z = D(w) - A' K_x A - A' (K_p C_p + K_n C_n) A_s,

with C the loop's own answer of a coil to its probe, so that q - Z^-1 A' N is what linear forces would give, whatever the
amplitude. The slopes are those at the mean place with the currents that carry the mean force when nothing turns.

The PID's C is the ratio of a coil's vector to its probe's. The flatness laws invert T (2.4b) themselves: they ask for the force
-g M q, with one g of all four motions that the balance of forces gives, and take off N(i, x late) with their own idea of gap,
offsets and place. They are late by the angle of g to the one that was set.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.rigfile.capabilities import Flatness
from procedures.run_up.steps import Curve
from procedures.synchronous.runout import SCALE, Stand, impedance

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
TURN = np.arange(24) * (2 * np.pi / 24)


@dataclass(frozen=True)
class _Turns:
    """Of b blocks, at the AMBs: mean place and currents, first and second harmonics; `shaft` (4, b) m at the probes, `read`
    with the runout."""

    speed: Array
    place: Array
    x1: Complex
    x2: Complex
    amps: Array
    i1: Complex
    i2: Complex
    read: Complex


def bend(s: Stand, c: Curve, runouts: Mapping[float, Complex], law: str, gains: Mapping[str, float]) -> Complex:
    """What large orbits add to the shaft's vectors at the probes, (4, b) m.

    Args:
        s: what the forces rest on.
        c: the passage.
        runouts: by order, (4,) m; orders 1 and 2.
        law: of the controller, "" as it is set: a flatness, or else the one that holds each axis by itself.
        gains: of the controller, by name, SI.
    """
    t = _turns(s, c, runouts)
    k_p, k_n, k_x = _slopes(s, t)
    whole = _beyond(s, t, (k_p, k_n, k_x), t.x1, t.x2)
    if (flat := c.machine.can.flatness.get(law)) is None:
        loop = _decentral(s, t, k_p, k_n, k_x)
    else:
        loop, late = _flat(s, t, (k_p, k_n, k_x), whole, flat, gains)
        whole = whole - _inverted(s, c, gains, late)
    at_amb, at_probe = s.axes, s.probes
    return np.asarray(at_probe @ np.linalg.solve(loop, (at_amb.T @ whole).T[..., None])[..., 0].T)


def _turns(s: Stand, c: Curve, runouts: Mapping[float, Complex]) -> _Turns:
    to_amb = s.axes @ np.linalg.inv(s.probes)
    gain, amp = s.gain[:, None], s.i_gain[:, None]
    place = to_amb @ ((c.means[:, :4].T - s.zero[:, None]) / gain) + s.offset[:, None]
    read = c.values[:4] / gain
    second = np.asarray(np.where(np.isfinite(c.second), c.second, 0), np.complex128)
    x2 = np.where(np.isfinite(c.second[:4]), second[:4] / gain - runouts[2.0][:, None], 0.0)
    return _Turns(
        c.speed, place, to_amb @ (read - runouts[1.0][:, None]), to_amb @ x2, (c.means[:, 4:].T - s.i_zero[:, None]) / amp,
        c.values[4:] / amp, second[4:] / amp, read,
    )  # fmt: skip


def _force(s: Stand, place: Array, i: Array) -> Array:
    """T (2.4b) of the four axes, N; currents of the eight coils."""
    beta, gap = (x.reshape(4, *[1] * (place.ndim - 1)) for x in (s.beta, s.gap))
    return np.asarray(beta * ((i[::2] / (gap - place)) ** 2 - (i[1::2] / (gap + place)) ** 2))


def _over(t: _Turns, s: Stand, x1: Complex, x2: Complex) -> Array:
    """Forces over a turn (4, b, n)."""
    turn = np.exp(1j * TURN)
    place = t.place[..., None] + (x1[..., None] * turn + x2[..., None] * turn**2).real
    return _force(s, place, t.amps[..., None] + (t.i1[..., None] * turn + t.i2[..., None] * turn**2).real)


def _slopes(s: Stand, t: _Turns) -> tuple[Array, Array, Array]:
    """K_p, K_n N/A and K_x N/m (4, b) of small orbits: with the currents that carry the same mean force."""
    near, far = s.gap[:, None] - t.place, s.gap[:, None] + t.place
    beta = s.beta[:, None]
    mean = _over(t, s, t.x1, t.x2).mean(axis=-1)
    p, n = t.amps[::2], t.amps[1::2]
    for _ in range(3):  # Newton
        more = (mean - beta * ((p / near) ** 2 - (n / far) ** 2)) / (2 * beta * (p / near**2 + n / far**2))
        p, n = p + more, n - more
    return 2 * beta * p / near**2, -2 * beta * n / far**2, 2 * beta * (p**2 / near**3 + n**2 / far**3)


def _beyond(s: Stand, t: _Turns, k: tuple[Array, Array, Array], x1: Complex, x2: Complex) -> Complex:
    """N, the first harmonic of the forces beyond the slopes (4, b), at a place that may be late."""
    first = 2 * (_over(t, s, x1, x2) * np.exp(-1j * TURN)).mean(axis=-1)
    return np.asarray(first - k[0] * t.i1[::2] - k[1] * t.i1[1::2] - k[2] * x1)


def _inverted(s: Stand, c: Curve, gains: Mapping[str, float], late: Complex) -> Complex:
    """N as the law takes it off (4, b): with its own gap and magnetic offsets, at what the probes read, late."""
    offset = np.array([gains[c.machine.model_offset(axis)] for axis in c.machine.axes])
    gap = np.full(4, gains[c.machine.can.model["gap"]])
    idea = replace(s, gap=gap, offset=offset, gain=np.ones(4), zero=np.zeros(4))
    t = _turns(idea, c, {1.0: np.zeros(4, complex), 2.0: np.zeros(4, complex)})
    return _beyond(idea, t, _slopes(idea, t), t.x1 * late, t.x2 * late**2)


def _decentral(s: Stand, t: _Turns, k_p: Array, k_n: Array, k_x: Array) -> Complex:
    """Z (b, 4, 4) where each coil answers to its own probe."""
    answer = (k_p * t.i1[::2] + k_n * t.i1[1::2]) / t.read
    at_amb, at_probe = s.axes, s.probes
    return np.asarray(impedance(s, k_x.T, t.speed, t.speed) - at_amb.T @ (answer.T[..., None] * at_probe))


def _flat(
    s: Stand, t: _Turns, k: tuple[Array, Array, Array], whole: Complex, flat: Flatness, gains: Mapping[str, float]
) -> tuple[Complex, Complex]:
    """Z (b, 4, 4) where the law asks for accelerations, and by how much it is late, e^(-j angle) (b,)."""
    at_amb, mass = s.axes, np.diag([s.mass, s.mass, s.inertia, s.inertia])
    force = at_amb.T @ (k[0] * t.i1[::2] + k[1] * t.i1[1::2] + k[2] * t.x1 + whole)
    end = np.array([[1, 0, 0, -s.l_c], [0, 1, s.l_c, 0.0]])
    held = s.coupling * end.T @ end
    q = np.linalg.solve(s.probes, t.read)
    asked, made = SCALE[:, None] * (mass @ q), SCALE[:, None] * (force - held @ q)
    g = -(asked.conj() * made).sum(axis=0) / (np.abs(asked) ** 2).sum(axis=0)
    w = t.speed
    rate = 1j * w / (1 + 1j * w / (2 * math.pi * gains[flat.derivative_hz]))
    meant = gains[flat.k1] + gains[flat.k2] * rate + gains[flat.integral] * gains[flat.k0] / (1j * w)
    turned = g / meant
    free = impedance(s, np.zeros(4), w, w)
    return free - held + g[:, None, None] * mass, turned / np.abs(turned)
