"""The TSBS machine's core behind a typed facade: parameters as frozen dataclasses, `Plant.run` as the only way time passes."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Literal, overload

import numpy as np
import numpy.typing as npt

from sim_backend.core.plant import PERIOD_TICKS, TICK_S, Array, CorePlant, fill, open_core
from sim_backend.machines.tsbs.params import ControlParams, PlantParams

CHANNELS: Final = (
    *("pos_xi", "pos_yi", "pos_xo", "pos_yo", "pos_z", "angle", "speed"),
    *(f"i_{axis}_{coil}" for axis in ("xi", "yi", "xo", "yo", "z") for coil in "pn"),
    *(f"i_m{k}" for k in range(1, 5)),
    "flags",
)
TRACE: Final = (
    *CHANNELS[:7],
    *(f"i_m{k}" for k in range(1, 5)),
    *(f"i_d{k}" for k in range(1, 5)),
    *("gamma", "demand_x", "demand_y", "torque_asked", "torque_given", "torque_bound", "lambda", "load_x", "load_y"),
)
"""Of one tick: what is read, and what the law makes of it, which the amplifiers are told a tick later."""
SHARED: Final = ("pole_pairs", "phases", "literal_7_6b", "literal_7_13", "literal_7_14", "literal_7_18")
"""What the controller has of the machine's parameters."""
_ffi, _lib = open_core(Path(__file__).with_name("tsbs.h"))


class Plant(CorePlant):
    """The machine with its controller's law. Owns its time: `run` is the only thing that advances it.

    Args:
        params: the plant; every field has the nominal machine's value.
        control: initial values of the law's parameters.
        seed: of all noise.
        substeps: integration steps per control tick.
    """

    settable = frozenset(ControlParams.__dataclass_fields__)

    def __init__(
        self,
        params: PlantParams | None = None,
        seed: int = 0,
        *,
        control: ControlParams | None = None,
        substeps: int = 2,
    ) -> None:
        self.params = params or PlantParams()
        self._p: Any = _ffi.new("tsbs_params *")
        self._c: Any = _ffi.new("tsbs_control *")
        state: Any = _ffi.new("tsbs_state *")
        state.substeps = substeps
        self._s: Any = state
        fill(self._p, vars(self.params))
        fill(self._c, vars(control or ControlParams()) | {name: getattr(self.params, name) for name in SHARED})
        _lib.tsbs_start(self._p, self._c, self._s, seed & (2**64 - 1))

    @property
    def lift_timeout_s(self) -> float:
        """How much longer than its own time a lift may take, s. An end that the motor lifts may have to wait on its ring until
        its field has been turned so far that it can."""
        return 60.0 if self._c.lift_by else 5.0

    @property
    def speed(self) -> float:
        """Speed in rad/s as the controller's filter sees it."""
        return float(self._s.speed)

    @property
    def pulse_age_s(self) -> None:
        """There are no pulses: an encoder tells the angle all the time."""

    @property
    def turn_s(self) -> None:
        """There are no pulses."""

    def load(self, mass_kg: float, weight_N: float, ramp_s: float, *, seat_m: float = 0.0) -> None:
        """Hang `mass_kg` in place of what hangs; its weight (net of buoyancy) is handed over in `ramp_s`. `seat_m` is
        how far outboard of the hook plane the strap seats."""
        s = self._s
        self._p.z_hook = self.params.z_hook + seat_m
        if s.hung_mass == 0:
            s.s[12] = s.s[1] - self._p.z_hook * s.s[3]
            s.s[13] = s.s[7] - self._p.z_hook * s.s[9]
        s.hung_mass = mass_kg
        s.weight_to = weight_N
        s.weight_rate = abs(weight_N - s.weight) / max(ramp_s, TICK_S)

    def lever(self, mass_kg: float, weight_N: float, arm_m: float, ramp_s: float) -> None:
        """Hang `mass_kg` on the lever in place of what hangs there, its weight handed over in `ramp_s`. `arm_m` is positive
        on the left (-x), where the weight turns the shaft forward; the lever starts level with the rotor's home."""
        s, ramp, moment = self._s, max(ramp_s, TICK_S), weight_N * arm_m
        s.lever_weight_to, s.lever_weight_rate = weight_N, abs(weight_N - s.lever_weight) / ramp
        s.lever_moment_to, s.lever_moment_rate = moment, abs(moment - s.lever_moment) / ramp
        s.lever_inertia, s.slip = mass_kg * arm_m**2, 0.0

    def mount(self, inertia: float) -> None:
        """Put a ring of `inertia` kg m^2 on the shaft in place of the one that is there; 0 takes it off."""
        self._s.ring_inertia = inertia

    @property
    def slip(self) -> float:
        """How far the lever has slipped since a mass was hung on it, rad, for tests."""
        return float(self._s.slip)

    @property
    def currents(self) -> tuple[float, ...]:
        """True currents in A: ten coils, then the amplitudes of four motor segments."""
        return (*self._s.coil, *(abs(i) for i in self._segment))

    @property
    def _segment(self) -> list[complex]:
        parts = list(self._s.segment)
        return [complex(*pair) for pair in zip(parts[:4], parts[4:], strict=True)]

    @overload
    def run(self, ticks: int, trace: Literal[0] = 0) -> Array: ...
    @overload
    def run(self, ticks: int, trace: Literal[1, 2, 5, 10, 20, 50, 100]) -> tuple[Array, Array]: ...
    @overload
    def run(self, ticks: int, trace: int) -> Array | tuple[Array, Array]: ...
    def run(self, ticks: int, trace: int = 0) -> Array | tuple[Array, Array]:
        """Advance by `ticks` control ticks, or to the end of the telemetry period in which a trip occurs.

        Returns:
            (n, len(CHANNELS)) float64, one row per completed telemetry period of ten ticks; with `trace`, also the readings of
            every `trace`-th tick, (k, len(TRACE)).
        """
        start = self.tick
        limit = (ticks + PERIOD_TICKS - 1) // PERIOD_TICKS + 1
        rows = np.empty((limit, len(CHANNELS)))
        kept = np.empty((ticks // trace + 1 if trace else 0, len(TRACE)))
        at = _ffi.from_buffer("double[]", rows.data)
        into = _ffi.from_buffer("double[]", kept.data) if trace else _ffi.NULL
        _lib.tsbs_run(self._p, self._c, self._s, ticks, at, limit, into, trace)
        rows = rows[: self.tick // PERIOD_TICKS - start // PERIOD_TICKS]
        return (rows, kept[: -(-self.tick // trace) - -(-start // trace)]) if trace else rows

    def state(self) -> dict[str, Any]:
        """True state, for tests: `s` (14,) positions and rates, `coil` (10,), `segment` (4,) complex in the stator's frame,
        `turn`, what turns the law's frame into that, weight in N."""
        s = self._s
        return {
            "s": np.array(list(s.s)),
            "coil": np.array(list(s.coil)),
            "segment": np.array(self._segment),
            "turn": complex(s.applied.turn_c, s.applied.turn_s),
            "weight": float(s.weight),
        }

    def shaft(self) -> Array:
        """True positions and rates of the shaft, (14,), to be read; as in `state`, which takes ten times as long."""
        return np.frombuffer(bytes(_ffi.buffer(self._s.s)), np.float64)

    def set_state(self, s: Array) -> None:
        """Put the shaft somewhere, for tests: (14,) positions and rates."""
        self._s.s[0:14] = [float(x) for x in s]


def derivative(
    params: PlantParams,
    s: Array,
    coil: Array,
    segment: npt.ArrayLike,
    *,
    play: Array | None = None,
    gamma: float = 0.0,
    hung_mass: float = 0.0,
    weight: float = 0.0,
    lever: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
) -> Array:
    """Right-hand side of the mechanics, (14,), for tests against the reference. `segment` (4,) along the field that gamma
    turns, complex where it has a part across it; `lever`: weight N, moment N m, how far it has slipped rad, inertia added to
    the shaft's kg m^2."""
    p = _ffi.new("tsbs_params *")
    fill(p, vars(params))

    def c(x: Array) -> Any:
        return _ffi.new("double[]", [float(v) for v in x])

    out, along = _ffi.new("double[14]"), np.asarray(segment)
    currents, lag = np.concatenate([along.real, along.imag]), np.zeros(4) if play is None else play
    _lib.tsbs_derivative(p, c(s), c(coil), c(currents), c(lag), gamma, hung_mass, weight, c(np.array(lever)), out)
    return np.array(list(out))


def normals(seed: int, stream: int, count: int) -> Array:
    """`count` draws of the core's normal generator, for tests."""
    out = np.empty(count)
    _lib.core_normals(seed, stream, _ffi.cast("double *", out.ctypes.data), count)
    return out
