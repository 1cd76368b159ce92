"""How the twin's controller begins: a PID for each axis by the rig file's nominal numbers, and where its probes look.

The rule (docs/reference/twin.md): an axis k with the row a_k in q'' = M^-1 sum a_k F_k feels the mass m_k = (d/n)/(a_k M^-1
a_k'), of d free motions and n radial axes, so that the mean of the squared frequencies of decentralised feedback is w^2.
With the slopes K_i = dF/di and K_x = dF/dx where the axis carries its share of the weight,
    K_i kp = m_k w^2 + K_x,  K_i kd = 2 z m_k w,  K_i ki = m_k w^3 / 30,  w = 1/(4 T), z = 0.6,
where T is the loop's delay: one and a half ticks, the amplifier, the derivative's low-pass and a notch filter at each bending
mode. w is less where kp would ask for
more than twice the bias at the touchdown ring, or else the lift is lost in the limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import ConfigError
from bench.rigfile import RigFile
from bench.rigfile.supports import once_per_rig, radial_supports
from sim_backend.machines.twin.columns import TELLS_APART, Columns
from sim_backend.machines.twin.nominal import Nominal, nominal_of, set_in, transverse

Array = npt.NDArray[np.float64]
Many = tuple[float, ...]
ROOM = 0.25  # rad: of phase that the loop's delay takes at the frequency w
DAMPING = 0.6
SLOWER = 30.0  # times that the integrator is slower than w
BIAS = 0.4  # of the current limit
REACH = 2.0  # times the bias, at the touchdown ring
STIFFER = 1.5  # times the field's own slope, at least
COORDINATES = ("x", "y", "z", "psi", "theta")


@dataclass(frozen=True)
class TwinControl:
    """The law's parameters. Arrays are by axis, the axial one last; `map` is from probes to axes, `steer` from set points
    of the shaft; `hold` is what of i_p^2 - i_n^2 carries the weight at the centre, A^2."""

    map: Many
    steer: Many
    kp: Many
    ki: Many
    kd: Many
    bias: Many
    hold: Many
    derivative_hz: float
    lift_time_s: float
    current_limit: float
    notch: Many = (0.0,) * 6
    slew: float = 0.0
    slew_tilt: float = 0.0
    path_on: float = 0.0
    path_y: float = 0.0
    path_z: float = 0.0
    path_hz: float = 10.0
    path_phase: float = 0.0
    path_ramp_s: float = 1.0
    path_ratio: float = 1.0
    inject_axis: float = -1.0
    inject_amplitude: float = 0.0
    inject_hz: float = 100.0
    inject_lines: float = 1.0
    inject_step: float = 0.0


@dataclass(frozen=True)
class Point:
    """Where an axis works: its bias, by how much its coils' currents differ from it (+ and -), slopes N/A and N/m."""

    bias: float
    current: float
    per_current: float
    per_metre: float


@once_per_rig
def control_of(rig: RigFile) -> TwinControl:
    """By the rules, where `[simulation]` sets nothing.

    Raises:
        ConfigError: an axis cannot carry its share of the weight, or no probe sees what it holds.
    """
    n = nominal_of(rig)
    columns = Columns(n.geometry, n, {})
    masses, axes = _masses(n, columns), n.layout.axes
    points = [working_point(n, k, force) for k, force in enumerate(n.carried)]
    low_pass = n.set("derivative_hz", min(0.2 / n.tick_s, 2000.0))
    notches = [(n.set(f"mode_{k}", 1.0), n.set("notch_q", 1.0)) for k in (1, 2) if n.set(f"mode_{k}_on", 0.0)]
    slow = 1 / n.amplifier_hz + 1 / low_pass + sum(1 / (hz * q) for hz, q in notches)
    delay = 1.5 * n.tick_s + slow / (2 * math.pi)
    most = n.set("bandwidth", ROOM / delay / (2 * math.pi)) * 2 * math.pi
    kp, ki, kd = [], [], []
    for axis, m, point in zip(axes, masses, points, strict=True):
        w = _limited(most, m, point, columns.stop if axis is n.layout.axial else min(n.clearances))
        kp.append(n.set("kp", (m * w * w + point.per_metre) / point.per_current, axis.name))
        ki.append(n.set("ki", m * w**3 / SLOWER / point.per_current, axis.name))
        kd.append(n.set("kd", 2 * DAMPING * m * w / point.per_current, axis.name))
    hold = [
        (p.bias + p.current) ** 2 if len(a.coils) == 1 else 4 * p.bias * p.current
        for a, p in zip(axes, points, strict=True)
    ]
    return TwinControl(
        map=_map(n, columns), steer=_steer(n, columns), kp=tuple(kp), ki=tuple(ki), kd=tuple(kd),
        bias=tuple(p.bias for p in points), hold=tuple(hold), derivative_hz=low_pass,
        lift_time_s=n.set("lift_time", 1.0), slew=n.set("slew", 0.0), slew_tilt=n.set("slew_tilt", 0.0),
        current_limit=n.current_limit,
        notch=tuple(x for hz, q in notches for x in notch(hz, q, n.tick_s)),
    )  # fmt: skip


def notch(hz: float, q: float, tick_s: float) -> Many:
    """b0 = b2, b1 = a1 and a2 of (s^2 + w^2)/(s^2 + s w/Q + w^2) by the bilinear transform, prewarped at w; none above half the
    tick's rate, of which the controller sees nothing."""
    if hz * tick_s >= 0.5:
        return 0.0, 0.0, 0.0
    g = math.tan(math.pi * hz * tick_s)
    a = 1 / (1 + g / q + g * g)
    return (1 + g * g) * a, 2 * (g * g - 1) * a, (1 - g / q + g * g) * a


def _limited(w: float, m: float, point: Point, away: float) -> float:
    """rad/s: no more than the current gives room for, and no less than what the field's own slope asks for."""
    held = REACH * point.bias * point.per_current / away - point.per_metre
    return min(w, math.sqrt(max(held, STIFFER * point.per_metre) / m))


def _masses(n: Nominal, columns: Columns) -> list[float]:
    """Of each axis, what the loop is laid out for, kg."""
    basis, m = columns.free.basis, n.mass
    rows = radial_rows(columns) @ basis
    inverse = np.linalg.inv(basis.T @ np.diag([m, m, transverse(n), transverse(n)]) @ basis)
    felt = np.einsum("ki,ij,kj->k", rows, inverse, rows)
    return [*(basis.shape[1] / len(rows) / float(x) for x in felt), *((m,) if n.layout.axial is not None else ())]


def radial_rows(columns: Columns) -> Array:
    """Of the radial axes by y, z, psi and theta: (n, 4)."""
    return np.array([columns.axis(axis)[:4] for axis in columns.layout.radial])


def bias_of(n: Nominal, bearing: str) -> float:
    """A: as set, else the default of the parameter that the capabilities bind, else BIAS of the current limit."""
    parameter = n.rig.capabilities.bias.get(bearing, "")
    known = n.rig.parameters.get(parameter)
    default = BIAS * n.current_limit if known is None else known.default
    stated = set_in(n.rig, "bias", bearing)
    return default if stated is None else n.set("bias", default, bearing)


def working_point(n: Nominal, k: int, force: float) -> Point:
    """Where an axis gives `force`, at its centre: F = beta ((b + i)^2/near^2 - (b - i)^2/far^2), solved for i as T (2.25)
    is; one coil carries it with its bias.

    Raises:
        ConfigError: it cannot.
    """
    axis = n.layout.axes[k]
    beta, gap, xi = n.beta(k), n.gap(axis.bearing), n.offset(k)
    near, far = gap - xi, gap + xi
    key = f"rig {n.rig.name}: bearings.{axis.bearing}.axes.{axis.name}"
    if len(axis.coils) == 1:
        if force <= 0.02 * n.mass * n.gravity:
            found = f"{key}.coils: found one, which pulls the way in which {-force:.3g} N of the weight pull"
            upper = "; on a shaft that stands, call the upper end `far_end`" if axis is n.layout.axial else ""
            raise ConfigError(
                f"{found}; expected two, or one on the axis' positive side that carries the weight{upper}"
            )
        bias = near * math.sqrt(force / beta)
        if bias > 0.8 * n.current_limit:
            found = f"{key}: carries {force:.3g} N with {bias:.3g} A; expected 0.8 of its current limit of "
            raise ConfigError(
                f"{found}{n.current_limit:.3g} A at most: set simulation.beta or simulation.current_limit"
            )
        return Point(bias, 0.0, 2 * beta * bias / near**2, 2 * beta * bias**2 / near**3)
    bias = bias_of(n, axis.bearing)
    most, least = 4 * beta * bias**2 / near**2, -4 * beta * bias**2 / far**2
    if bias <= 0 or not 0.9 * least < force < 0.9 * most:
        found = f"{key}: carries {force:.3g} N of the weight and gives {least:.3g} to {most:.3g} N with a bias of {bias:.3g} A"
        raise ConfigError(f"{found}; expected room of a tenth: set simulation.beta or simulation.bias")
    low, high = -bias, bias
    for _ in range(60):
        i = (low + high) / 2
        low, high = (i, high) if beta * (((bias + i) / near) ** 2 - ((bias - i) / far) ** 2) < force else (low, i)
    plus, minus = bias + i, bias - i
    return Point(
        bias, i, 2 * beta * (plus / near**2 + minus / far**2), 2 * beta * (plus**2 / near**3 + minus**2 / far**3)
    )


def located(columns: Columns) -> tuple[Array, Array, float]:
    """From readings of the radial probes to the free motions (n, probes), the basis of those (4, n), and the worst part of
    a motion of an axis that no probe sees."""
    basis = columns.free.basis
    seen = np.array([columns.probe(name)[:4] for name in columns.layout.looking]) @ basis
    rows = radial_rows(columns) @ basis
    length = np.array([1.0, 1.0, *(2 * [max(float(np.abs(radial_rows(columns)[:, 2:]).max()), 1e-3)])]) @ np.abs(basis)
    back = np.linalg.pinv(seen / length, rcond=TELLS_APART)
    unseen = rows / length @ (np.eye(len(length)) - back @ (seen / length))
    return back / length[:, None], basis, float(np.abs(unseen).max())


def _map(n: Nominal, columns: Columns) -> Many:
    layout, rig = n.layout, n.rig
    back, basis, unseen = located(columns)
    if unseen > 1e-3:
        found = f"rig {rig.name}: probes: found none that see all that the radial bearings hold"
        raise ConfigError(f"{found}; expected probes in as many planes and directions as their axes have")
    table = np.zeros((16, 16))
    signs = np.array([rig.probes[name].sign for name in layout.probes], float)
    table[: len(layout.looking), : len(layout.radial)] = (radial_rows(columns) @ basis @ back).T
    if layout.axial is not None:
        if not layout.along:
            raise ConfigError(
                f"rig {rig.name}: probes: found none along the shaft; expected one for bearings.{layout.axial.bearing}"
            )
        table[len(layout.looking) : len(layout.probes), len(layout.radial)] = 1 / len(layout.along)
    table[: len(layout.probes)] *= signs[:, None]
    return tuple(table.ravel().tolist())


def _steer(n: Nominal, columns: Columns) -> Many:
    """y and z along the axes of the first bearing from the near end; x towards the far end; tilts about y and z."""
    axes = radial_supports(n.rig)[0].axes
    one = n.layout.sense * axes[0].direction
    two = n.layout.sense * axes[1].direction if len(axes) > 1 else one + n.layout.sense * math.pi / 2
    way = np.array([[math.cos(one), math.cos(two)], [math.sin(one), math.sin(two)]])
    table = np.zeros((5, 16))
    rows = radial_rows(columns)
    table[1:3, : len(rows)] = (rows[:, :2] @ way).T
    table[3:5, : len(rows)] = (rows[:, 2:] @ way).T
    if n.layout.axial is not None:
        table[0, len(rows)] = 1.0
    return tuple(table.ravel().tolist())
