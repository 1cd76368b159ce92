"""The twin's core behind a typed facade; `TwinPlant.run` is how time passes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal, overload

import numpy as np

from sim_backend.core.plant import Array, CorePlant, fill, open_core
from sim_backend.machines.twin.control import COORDINATES, TwinControl
from sim_backend.machines.twin.params import TwinParams
from sim_backend.machines.twin.told import Told

COLUMNS: Final = 116
GAINS: Final = ("kp", "ki", "kd")
PATH: Final = ("on", "y", "z", "hz", "phase", "ramp_s", "ratio")
INJECT: Final = ("axis", "amplitude", "hz", "lines", "step")
PLAIN: Final = ("slew", "slew_tilt", "lift_time_s", "current_limit", "derivative_hz")

_ffi, _lib = open_core(Path(__file__).with_name("twin.h"))


class TwinPlant(CorePlant):
    """A rig's twin with its controller's law. Owns its time: `run` is the only thing that advances it.

    Attributes:
        axes: names of the bearings' axes, the axial one last: what `inject.axis` counts.
        channels: columns of the rows of `run`: means over a telemetry period of positions, currents, voltages and
        injection; the
            greatest |voltage| of each bearing; what the mark tells as of the period's last reading; `status.*`, 1 where it was
            so at any time of the period.
        trace_channels: columns of the readings of a tick.

    Args:
        params: the machine and how its controller begins.
        seed: of all noise.
        substeps: integration steps in 100 us; at least five while a voltage is limited, ten near a ring.
    """

    def __init__(self, params: TwinParams, seed: int = 0, *, substeps: int = 2) -> None:
        self.params = params
        self._p: Any = _ffi.new("twin_params *")
        self._c: Any = _ffi.new("twin_control *")
        self._s: Any = _ffi.new("twin_state *")
        fill(self._p, {**core_fields(params), "substeps": max(1, substeps)})
        fill(self._c, vars(params.control))
        names = params.names
        self.axes, self.tick_s, self.period_ticks = names.axes, params.tick, params.period
        self.channels = tuple(dict.fromkeys(name for name, _ in names.rows))
        self.trace_channels = tuple(name for name, _ in names.ticks)
        self._several = _joined(names.rows)
        _told(self._p, names.rows, names.ticks)
        self._settable = {name: (field, where) for name, field, where in settable(params.names)}
        self.set("slew", params.control.slew)
        _lib.twin_start(self._p, self._s, seed & (2**64 - 1))

    def set(self, name: str, value: float) -> None:
        """Set a parameter of the law, SI: `ref.axis.AXIS`, `ref.shaft.x` (y, z, psi, theta), each without its second word
        too, `slew`, `slew_tilt`, `bias.BEARING`, `kp.AXIS` (ki, kd), `inject.*`, `path.*`, `lift_time_s`, `current_limit`,
        `derivative_hz`.

        Raises:
            KeyError: the law has no such parameter.
        """
        field, where = self._settable[name]
        if name == "slew" and self.params.own_slew:
            value = min(value or math.inf, self.params.own_slew)
        if not where:
            setattr(self._c, field, value)
        for k in where:
            getattr(self._c, field)[k] = value

    def get(self, name: str) -> float:
        """A parameter of the law, SI.

        Raises:
            KeyError: the law has no such parameter.
        """
        field, where = self._settable[name]
        found = getattr(self._c, field)
        return float(found[where[0]] if where else found)

    @property
    def settings(self) -> tuple[str, ...]:
        """Names that `set` knows."""
        return tuple(self._settable)

    @property
    def speed(self) -> float:
        """Speed in rad/s as the pulses tell it; 0 without a mark."""
        return float(self._s.tacho.speed) if self.params.names.marked else 0.0

    @property
    def pulse_age_s(self) -> float | None:
        """Time since the last once-per-turn pulse, or since the start; None without a mark."""
        return float(self.tick * self.tick_s - self._s.tacho.last) if self.params.names.marked else None

    @property
    def turn_s(self) -> float | None:
        """The longer one of the last two times between pulses: one may be doubled. None before there are three pulses."""
        t = self._s.tacho
        return (
            float(max(t.last - t.before, t.before - t.earlier)) if self.params.names.marked and t.pulses >= 3 else None
        )

    @property
    def phase(self) -> float:
        """Phase of the path at the last reading, rad, for tests."""
        return float(self._s.law.phase)

    def weights(self, plane: int, unbalance: float, angle: float) -> None:
        """Mount a weight in addition to what is there: the plane's number; mass times radius, kg m; its angle from the
        shaft's mark in the sense in which the shaft turns, rad."""
        self._s.weight_c[plane] += unbalance * np.cos(angle)
        self._s.weight_s[plane] += unbalance * np.sin(angle)

    def without_weights(self, plane: int) -> None:
        """Take off every weight that has been mounted in a plane; what is mounted afterwards sits tight until it slips."""
        self._s.weight_c[plane] = self._s.weight_s[plane] = 0.0
        self._s.loose = 0

    def load(self, wrench: tuple[float, ...], ramp_s: float) -> None:
        """Let forces on x, y, z, moments psi, theta and four modal forces (N, N m) take the place of what acted, in
        `ramp_s`."""
        ticks = max(1, round(ramp_s / self.tick_s))
        self._s.load_rate[0:9] = [(new - old) / ticks for new, old in zip(wrench, self._s.load, strict=True)]
        self._s.load_ticks = ticks

    def turn(self, angle: float) -> None:
        """Turn the shaft by hand, at rest, rad: its mark then stands at that angle from where it is told."""
        self._s.s[5] = angle - self.params.pulse_angle

    def mount(self, inertia: float) -> None:
        """Put a part of `inertia` kg m^2 about the shaft on it, in place of what was."""
        self._p.polar_inertia = self.params.polar_inertia + inertia

    @property
    def currents(self) -> tuple[float, ...]:
        """True currents of the coils in A: of the axes' positive ones, then of the negative ones."""
        n = len(self.axes)
        return (*self._s.coil[0:n], *self._s.coil[16 : 16 + n])

    @overload
    def run(self, ticks: int, trace: Literal[0] = 0) -> Array: ...
    @overload
    def run(self, ticks: int, trace: Literal[1, 2, 5, 10, 20, 50, 100]) -> tuple[Array, Array]: ...
    @overload
    def run(self, ticks: int, trace: int) -> Array | tuple[Array, Array]: ...
    def run(self, ticks: int, trace: int = 0) -> Array | tuple[Array, Array]:
        """Advance by `ticks` control ticks, or to the end of the telemetry period in which a trip occurs.

        Returns:
            (n, len(channels)), one row per completed telemetry period; with `trace`, also the readings of every `trace`-th tick
            (tick a multiple of it), (k, len(trace_channels)).
        """
        start, period = self.tick, self.period_ticks
        limit = (ticks + period - 1) // period + 1
        rows = np.empty((limit, len(self.params.names.rows)))
        kept = np.empty((ticks // trace + 1 if trace else 0, len(self.trace_channels)))
        at, into = (_ffi.cast("double *", x.ctypes.data) for x in (rows, kept))
        _lib.twin_run(self._p, self._c, self._s, ticks, at, limit, into, trace)
        rows = self._shown(rows[: self.tick // period - start // period])
        return (rows, kept[: -(-self.tick // trace) - -(-start // trace)]) if trace else rows

    def _shown(self, rows: Array) -> Array:
        """A ring that stands in several planes is touched where it is in any."""
        if self._several is None:
            return rows
        return np.array([rows[:, where].max(axis=1) for where in self._several]).T.reshape(
            len(rows), len(self.channels)
        )

    def twin(self) -> TwinPlant:
        """Another one in the same state, whose noise goes on as this one's does."""
        other = TwinPlant(self.params)
        other._p[0], other._c[0], other._s[0] = self._p[0], self._c[0], self._s[0]
        return other

    def state(self) -> dict[str, Any]:
        """True state, for tests: `s` (20,) as in `twin.h`, `coil` (32,)."""
        return {"s": np.array(list(self._s.s)), "coil": np.array(list(self._s.coil))}

    def set_state(self, s: Array) -> None:
        """Put the shaft somewhere, for tests: (20,) positions and rates."""
        self._s.s[0:20] = [float(x) for x in s]


def core_fields(p: TwinParams) -> Mapping[str, Any]:
    """What of the parameters is the core's."""
    return {name: value for name, value in vars(p).items() if name not in ("control", "names", "own_slew")}


def _joined(rows: tuple[tuple[str, int], ...]) -> list[list[int]] | None:
    """Columns by name, where a name has several."""
    where: dict[str, list[int]] = {}
    for k, (name, _) in enumerate(rows):
        where.setdefault(name, []).append(k)
    return list(where.values()) if len(where) < len(rows) else None


def _told(p: Any, rows: tuple[tuple[str, int], ...], ticks: tuple[tuple[str, int], ...]) -> None:
    p.told, p.traced = len(rows), len(ticks)
    p.tell[0 : len(rows)] = [place for _, place in rows]
    p.trace[0 : len(ticks)] = [place for _, place in ticks]


def settable(names: Told) -> list[tuple[str, str, tuple[int, ...]]]:
    """Names of the law's parameters, the field of each, and where in it."""
    out: list[tuple[str, str, tuple[int, ...]]] = [(name, name, ()) for name in PLAIN]
    for way in ("ref.shaft", "ref"):  # an axis may have the name of a coordinate: the longer names tell them apart
        out += [(f"{way}.{name}", "ref", (k,)) for k, name in enumerate(COORDINATES)]
    for k, axis in enumerate(names.axes):
        out += [(f"{way}.{axis}", "ref_axis", (k,)) for way in ("ref.axis", "ref")]
        out += [(f"{gain}.{axis}", gain, (k,)) for gain in GAINS]
    for bearing in names.bearings:
        out.append((f"bias.{bearing}", "bias", tuple(k for k, b in enumerate(names.of_bearing) if b == bearing)))
    out += [(f"path.{name}", f"path_{name}", ()) for name in PATH]
    return out + [(f"inject.{name}", f"inject_{name}", ()) for name in INJECT]


def _vector(values: Array) -> Any:
    return _ffi.new("double[]", [float(v) for v in values])


def derivative(p: TwinParams, s: Array, coil: Array, load: Array, torque: float = 0.0) -> Array:
    """Right-hand side of the mechanics, (20,), for tests against the reference: of the state (20,), currents (32,), what hangs
    (9,) and `torque` N m on the shaft."""
    core, out = _ffi.new("twin_params *"), _ffi.new("double[20]")
    fill(core, {**core_fields(p), "substeps": 2})
    _lib.twin_derivative(core, _vector(s), _vector(coil), _vector(load), torque, out)
    return np.array(list(out))


def follow(p: TwinParams, axis: int, current: float, reference: float, time: float) -> float:
    """Coil current A after `time` s under a constant reference, voltage limit included, for tests."""
    core = _ffi.new("twin_params *")
    fill(core, core_fields(p))
    return float(_lib.twin_follow(core, axis, current, reference, time))


__all__ = ["COLUMNS", "TwinControl", "TwinPlant", "derivative", "follow"]
