"""The twin's core behind a typed facade; `TwinPlant.run` is how time passes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from sim_backend.core.plant import Array, fill, open_core
from sim_backend.core.turning import TurningPlant
from sim_backend.machines.twin.control import COORDINATES, TwinControl
from sim_backend.machines.twin.params import TwinParams
from sim_backend.machines.twin.told import Told

COLUMNS: Final = 116
GAINS: Final = ("kp", "ki", "kd")
PATH: Final = ("on", "y", "z", "hz", "phase", "ramp_s", "ratio")
INJECT: Final = ("axis", "amplitude", "hz", "lines", "step")
PLAIN: Final = ("slew", "slew_tilt", "lift_time_s", "current_limit", "derivative_hz")

_ffi, _lib = open_core(Path(__file__).with_name("twin.h"))


class TwinPlant(TurningPlant):
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

    _ffi, _advance = _ffi, _lib.twin_run

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
        self.widths = len(names.rows), len(names.ticks)
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
        """Speed in rad/s as the pulses tell it; 0 where nothing turns the shaft."""
        return float(self._s.tacho.speed) if self.params.names.timed else 0.0

    @property
    def pulse_age_s(self) -> float | None:
        """Time since the last once-per-turn pulse, or since the start; None without a mark."""
        return float(self.tick * self.tick_s - self._s.tacho.last) if self.params.names.marked else None

    @property
    def turn_s(self) -> float | None:
        """The longer one of the last two times between pulses: one may be doubled. None before there are three pulses."""
        return super().turn_s if self.params.names.marked else None

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

    def shown(self, rows: Array) -> Array:
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
