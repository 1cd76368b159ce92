"""The AMB stand's core behind a typed facade, `AmbPlant.run` is how time passes."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from sim_backend.core.plant import TICK_S, Array, fill, open_core
from sim_backend.core.turning import TurningPlant
from sim_backend.machines.amb5dof.params import AmbControl, AmbParams

AXES: Final = ("yi", "zi", "yo", "zo", "x")
COILS: Final = tuple(f"{axis}_{coil}" for axis in AXES for coil in "pn")
CHANNELS: Final = (
    *(f"pos_{axis}" for axis in AXES),
    *("angle", "speed"),
    *(f"i_{coil}" for coil in COILS),
    *("u_i", "u_o", "u_x", "pulses", "pulse_age", "inject", "flags"),
)
"""Of a telemetry period: means of positions, currents and injection; greatest |voltage| of each bearing; angle and speed as
the pulses tell them, pulses so far and the age of the last, all as of the period's last reading."""
TRACE: Final = (
    *(f"pos_{axis}" for axis in AXES),
    *(f"i_{coil}" for coil in COILS),
    *(f"u_{coil}" for coil in COILS),
    *("inject", "before", "after", "angle", "speed", "pulses", "pulse_age"),
)
"""Of one tick. `before` and `after`: half the difference of the injected axis' current references without and with `inject`."""
FLAGS: Final = {1: "SATURATED", 2: "VOLTAGE_LIMIT", 4: "CONTACT_I", 8: "CONTACT_O", 16: "CONTACT_X", 32: "CLIPPED"}
PID, CCS, CAC = range(3)


_ffi, _lib = open_core(Path(__file__).with_name("amb5dof.h"))


class AmbPlant(TurningPlant):
    """The machine with its controller's laws. Owns its time: `run` is the only thing that advances it.

    Args:
        params: the plant; every field has the nominal machine's value.
        control: initial values of the laws' parameters.
        seed: of all noise.
        substeps: integration steps per control tick; at least five while a voltage is limited, ten near a ring.

    A row of `run` has CHANNELS, the readings of a tick TRACE; plane 0 is the inboard one.
    """

    settable = frozenset(AmbControl.__dataclass_fields__)
    widths = len(CHANNELS), len(TRACE)
    _ffi, _advance = _ffi, _lib.amb_run

    def __init__(
        self, params: AmbParams | None = None, seed: int = 0, *, control: AmbControl | None = None, substeps: int = 2
    ) -> None:
        self.params = params or AmbParams()
        self._p: Any = _ffi.new("amb_params *")
        self._c: Any = _ffi.new("amb_control *")
        state: Any = _ffi.new("amb_state *")
        state.substeps = substeps
        self._s: Any = state
        fill(self._p, vars(self.params))
        fill(self._c, vars(control or AmbControl()))
        _lib.amb_start(self._p, self._c, self._s, seed & (2**64 - 1))

    @property
    def speed(self) -> float:
        """Speed in rad/s as the pulses tell it."""
        return float(self._s.tacho.speed)

    @property
    def pulse_age_s(self) -> float:
        """Time since the last once-per-turn pulse, or since the start."""
        return float(self.tick * TICK_S - self._s.tacho.last)

    @property
    def currents(self) -> tuple[float, ...]:
        """True currents of the ten coils in A."""
        return tuple(self._s.coil)

    def twin(self) -> AmbPlant:
        """Another one in the same state, whose noise goes on as this one's does: what the two do differently follows from what
        is done to them."""
        other = AmbPlant(self.params)
        other._c[0], other._s[0] = self._c[0], self._s[0]
        return other

    def state(self) -> dict[str, Any]:
        """True state, for tests: `s` (20,) as in `amb5dof.h`, `coil` (10,), `observer` (4, 5)."""
        s = self._s
        inner = np.array([list(row) for row in s.law.observer.x])
        return {"s": np.array(list(s.s)), "coil": np.array(list(s.coil)), "observer": inner}


def _vector(values: Array) -> Any:
    return _ffi.new("double[]", [float(v) for v in values])


def derivative(params: AmbParams, s: Array, coil: Array, torque: float = 0.0) -> Array:
    """Right-hand side of the mechanics, (20,), for tests against the reference; `torque` N m on the shaft."""
    p, out = _ffi.new("amb_params *"), _ffi.new("double[20]")
    fill(p, vars(params))
    _lib.amb_derivative(p, _vector(s), _vector(coil), torque, out)
    return np.array(list(out))


def ccs(force: float, beta: float, gap: float, xi: float, bias: float) -> float:
    """Differential current A of a force N by T (2.25), branch-free, for tests."""
    return float(_lib.amb_ccs(force, beta, gap, xi, bias))


def cac(force: float, beta: float, gap: float, xi: float, eta: float) -> tuple[float, float]:
    """Coil currents A of a force N by T (2.22), for tests."""
    pair = _ffi.new("double[2]")
    _lib.amb_cac(force, beta, gap, xi, eta, pair)
    return float(pair[0]), float(pair[1])


def follow(params: AmbParams, current: float, reference: float, time: float) -> float:
    """Coil current A after `time` s under a constant reference, voltage limit included, for tests."""
    p = _ffi.new("amb_params *")
    fill(p, vars(params))
    return float(_lib.amb_follow(p, current, reference, time))


def observer_gains(control: AmbControl, speed: float) -> Array:
    """The five correction gains of the observer with the disturbances inside, at a speed in rad/s, for tests."""
    c: Any = _ffi.new("amb_control *")
    o: Any = _ffi.new("amb_observer *")
    fill(c, vars(control))
    _lib.amb_observer_gains(c, o, speed)
    return np.array(list(o.gain))
