"""The twin with its law, linearised about the centred shaft at standstill, tick by tick: rigid shaft, current loops, one
sample of delay, notch and derivative filters, integrators. Damping and frequency follow from its eigenvalues."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim_backend.machines.twin.params import TwinParams

Array = npt.NDArray[np.float64]
RIGID = (0.1, 4.0)  # of the loops' own frequency: slower are the integrators, faster the filters


@dataclass(frozen=True)
class Loop:
    """Radial axes of one machine: `rows` (n, 4) and `seen` (n, 4), displacements at the axes as they are and as the
    controller has them; slopes of the forces N/A and N/m; gains A/m, A/(m s), A s/m."""

    rows: Array
    seen: Array
    per_current: Array
    per_metre: Array
    kp: Array
    ki: Array
    kd: Array


def loop(p: TwinParams, bias: Array, gains: Mapping[str, Array], offsets: Array) -> Loop:
    """With `bias` (n,) A, `gains` kp, ki, kd (n,) by axis, and `offsets` (n,) m from each magnetic centre to where it is
    held."""
    n = p.radial
    rows = np.array(p.axis).reshape(8, 16)[:4, :n].T
    read = np.array(p.position_sign) * np.array(p.position_gain)
    probes = np.array(p.probe).reshape(8, 16)[:4].T * read[:, None]
    seen = np.array(p.control.map).reshape(16, 16)[:, :n].T @ probes
    weight = p.mass * np.array([p.gravity[1], p.gravity[2], 0.0, 0.0])
    drawn = p.coupling * np.array(
        [*p.coupling_offset, -p.coupling_at * p.coupling_offset[1], p.coupling_at * p.coupling_offset[0]]
    )
    free = free_motions(p)
    carried = np.linalg.lstsq((rows @ free).T, -free.T @ (weight + drawn), rcond=None)[0]
    pairs = [
        _slopes(p, k, float(b), float(f), float(xi))
        for k, (b, f, xi) in enumerate(zip(bias, carried, offsets, strict=True))
    ]
    per_current, per_metre = (np.array(x) for x in zip(*pairs, strict=True))
    return Loop(rows, seen, per_current, per_metre, *(np.asarray(gains[key][:n], float) for key in ("kp", "ki", "kd")))


def free_motions(p: TwinParams) -> Array:
    """Columns (4, m): a basis of what moves."""
    yy, yz, zz = p.free_radial
    kept = np.linalg.eigh(np.array([[yy, yz], [yz, zz]]))
    radial = kept[1][:, kept[0] > 0.5]
    tilts = np.eye(4)[:, 2:] if p.free_tilt else np.zeros((4, 0))
    return np.hstack([np.vstack([radial, np.zeros((2, radial.shape[1]))]), tilts])


def _slopes(p: TwinParams, k: int, bias: float, force: float, xi: float) -> tuple[float, float]:
    """dF/di and dF/dxi where the axis gives `force`; i is what the references of both coils change by with opposite signs, or
    that of the one coil alone. A coil carries (reference - offset)/gain: its amplifier follows its own current sensor."""
    beta, near, far = p.beta[k], p.gap[k] - xi, p.gap[k] + xi
    (gain_p, off_p), (gain_n, off_n) = ((p.current_gain[j], p.current_offset[j]) for j in (k, 16 + k))
    if p.coils[k] == 1:
        i = near * math.sqrt(max(force, 0.0) / beta)
        return 2 * beta * i / near**2 / gain_p, 2 * beta * i**2 / near**3
    plus, minus = (gain_p * near) ** -2, (gain_n * far) ** -2
    # force/beta = plus (bias - off_p + i)^2 - minus (bias - off_n - i)^2: a quadratic in i
    own_p, own_n = bias - off_p, bias - off_n
    a, b, c = plus - minus, 2 * (plus * own_p + minus * own_n), plus * own_p**2 - minus * own_n**2 - force / beta
    i = -c / b if abs(a) * bias < 1e-12 * b else (-b + math.sqrt(max(b * b - 4 * a * c, 0.0))) / (2 * a)
    p_i, n_i = own_p + i, own_n - i
    return 2 * beta * (p_i * plus + n_i * minus), 2 * beta * (p_i**2 * plus / near + n_i**2 * minus / far)


def matrix(p: TwinParams, lp: Loop) -> Array:
    """What a tick makes of the state: free motions and their rates, currents, references that act next, last readings, filtered
    rates, integrals, and two memories of each notch filter by axis."""
    n, free = p.radial, free_motions(p)
    m = free.shape[1]
    moved, driven = _plant(p, lp, free)
    keep = 1 / (1 + 2 * math.pi * p.control.derivative_hz * p.tick)
    size = 2 * m + 9 * n

    def tick(x: Array) -> Array:
        out = np.zeros(size)
        plant, rest = x[: 2 * m + n], x[2 * m + n :]
        applied, previous, filtered, total = (rest[k * n : (k + 1) * n] for k in range(4))
        past = rest[4 * n :].reshape(2, 2, n)
        at, kept = lp.seen @ free @ x[:m], np.zeros((2, 2, n))
        for k in (0, 1):
            b0, b1, a2 = p.control.notch[3 * k : 3 * k + 3] if len(p.control.notch) > 3 * k else (0.0, 0.0, 0.0)
            if b0 == 0:
                continue
            made = b0 * at + past[k, 0]
            kept[k, 0], kept[k, 1] = b1 * at - b1 * made + past[k, 1], b0 * at - a2 * made
            at = made
        rate = keep * filtered + (1 - keep) * (at - previous) / p.tick
        out[: 2 * m + n] = moved @ plant + driven @ applied
        out[2 * m + n :] = np.concatenate(
            [total - lp.kp * at - lp.kd * rate, at, rate, total - lp.ki * p.tick * at, kept.ravel()]
        )
        return out

    return np.array([tick(unit) for unit in np.eye(size)]).T


def _plant(p: TwinParams, lp: Loop, free: Array) -> tuple[Array, Array]:
    """A tick of shaft and current loops."""
    from scipy import linalg  # what has no quantities starts without it

    n, m = p.radial, free.shape[1]
    inverse = np.linalg.inv(free.T @ np.diag([p.mass, p.mass, p.inertia, p.inertia]) @ free)
    rows, s = lp.rows @ free, p.coupling_at
    spring = p.coupling * np.array([[1, 0, 0, s], [0, 1, -s, 0], [0, -s, s * s, 0], [s, 0, 0, s * s]])
    a = np.zeros((2 * m + 2 * n, 2 * m + 2 * n))
    a[:m, m : 2 * m] = np.eye(m)
    a[m : 2 * m, :m] = inverse @ (rows.T @ np.diag(lp.per_metre) @ rows - free.T @ spring @ free)
    a[m : 2 * m, 2 * m : 2 * m + n] = inverse @ rows.T @ np.diag(lp.per_current)
    a[2 * m : 2 * m + n, 2 * m : 2 * m + n] = -p.amplifier_rate * np.eye(n)
    a[2 * m : 2 * m + n, 2 * m + n :] = p.amplifier_rate * np.eye(n)
    whole = linalg.expm(a * p.tick)
    return whole[: 2 * m + n, : 2 * m + n], whole[: 2 * m + n, 2 * m + n :]


def slowest(p: TwinParams, lp: Loop) -> tuple[float, float]:
    """Natural frequency in Hz and damping ratio of the least damped rigid radial mode; damping is negative where it grows,
    and 1, with a frequency of 0, where nothing swings."""
    values = np.linalg.eigvals(matrix(p, lp)).astype(complex)
    poles = np.log(values[abs(values) > 1e-9]) / p.tick
    stiffness = lp.rows.T @ np.diag(lp.kp * lp.per_current - lp.per_metre) @ lp.rows
    net = stiffness / np.array([p.mass, p.mass, p.inertia, p.inertia])[:, None]
    own = math.sqrt(max(float(np.abs(np.linalg.eigvals(net)).max()), 1e-9))
    rigid = [s for s in poles if RIGID[0] * own < abs(s) < RIGID[1] * own and s.imag > 1.0]
    if not rigid:
        return 0.0, 1.0
    s = min(rigid, key=lambda s: -s.real / abs(s))
    return float(abs(s) / (2 * math.pi)), float(-s.real / abs(s))
