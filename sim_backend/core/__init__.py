"""The C core behind a typed facade: parameters as frozen dataclasses, `Plant.run` as the only way time passes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from cffi import FFI

from sim_backend.core.build import library
from sim_backend.core.params import ControlParams, PlantParams

Array = npt.NDArray[np.float64]

CHANNELS: Final = (
    *("pos_xi", "pos_yi", "pos_xo", "pos_yo", "pos_z", "angle", "speed"),
    *(f"i_{axis}_{coil}" for axis in ("xi", "yi", "xo", "yo", "z") for coil in "pn"),
    *(f"i_m{k}" for k in range(1, 5)),
    "flags",
)
TICK_S: Final = 1e-4
PERIOD_TICKS: Final = 10
OFF, READY, LIFT, LEVITATE, LAND = range(5)
TRIPS: Final = {1: "LEVITATION_LOST", 2: "OVERCURRENT", 4: "OVERSPEED"}


def _open() -> tuple[FFI, Any]:
    header = (Path(__file__).parent / "tsbs.h").read_text(encoding="utf-8")
    declarations = header.split("/* declarations begin */")[1].split("/* declarations end */")[0]
    ffi = FFI()
    ffi.cdef(declarations)
    return ffi, ffi.dlopen(str(library()))


_ffi, _lib = _open()


def _fill(struct: Any, values: Mapping[str, Any]) -> None:
    for name, value in values.items():
        if isinstance(value, tuple):
            getattr(struct, name)[0 : len(value)] = list(value)
        else:
            setattr(struct, name, value)


@dataclass(frozen=True, slots=True)
class DriveLaw:
    """An external speed-controlled drive on the shaft: torque = gain * (speed - shaft's speed), at most `limit`.

    `gain` N m s/rad, `limit` N m, `ramp` rad/s^2: how fast the speed goes to its target.
    """

    gain: float
    limit: float
    ramp: float


class Plant:
    """The machine with its controller's law. Owns its time: `run` is the only thing that advances it.

    Args:
        params: the plant; every field has the nominal machine's value.
        control: initial values of the law's parameters.
        seed: of all noise.
        substeps: integration steps per control tick.
    """

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
        _fill(self._p, vars(self.params))
        _fill(self._c, vars(control or ControlParams()))
        _lib.tsbs_start(self._p, self._c, self._s, seed & (2**64 - 1))

    @property
    def tick(self) -> int:
        """Control ticks since the start."""
        return int(self._s.tick)

    @property
    def mode(self) -> int:
        """OFF, READY, LIFT, LEVITATE or LAND; the law follows it from the next tick on."""
        return int(self._s.law.mode)

    @mode.setter
    def mode(self, mode: int) -> None:
        state = self._s.law
        # A lift that is broken off is landed from where it stands, and the other way round: the smooth step is its own
        # mirror image.
        broken_off = (state.mode, mode) in ((LIFT, LAND), (LAND, LIFT))
        if state.mode == OFF or (mode == LIFT and not broken_off):
            state.fresh = 1
        state.lift_clock = self._c.lift_time_s - state.lift_clock if broken_off else 0
        state.mode = mode

    @property
    def moved(self) -> bool:
        """Whether the lift or landing has run its course."""
        return bool(self._s.law.lift_clock >= self._c.lift_time_s)

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

    @property
    def age_ticks(self) -> int:
        """Ticks run since the last completed telemetry period."""
        return int(self._s.in_period)

    def set(self, name: str, value: float) -> None:
        """Set a parameter of the law by its name, SI.

        Raises:
            KeyError: the law has no such parameter.
        """
        if name not in ControlParams.__dataclass_fields__:
            raise KeyError(name)
        setattr(self._c, name, value)

    def get(self, name: str) -> float:
        """A parameter of the law, SI."""
        if name not in ControlParams.__dataclass_fields__:
            raise KeyError(name)
        return float(getattr(self._c, name))

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

    def drive(self, law: DriveLaw | None, target_rad_s: float = 0.0) -> None:
        """Let an external drive turn the shaft to a speed from the next tick on; None: it gives no torque. A drive that
        is switched on takes over at the speed that the shaft has."""
        s = self._s
        if law is None:
            s.drive_gain = 0.0
            return
        if s.drive_gain == 0:
            s.drive_speed = s.s[11]
        s.drive_gain, s.drive_limit, s.drive_ramp, s.drive_target = law.gain, law.limit, law.ramp, target_rad_s

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
    def shaft_speed(self) -> float:
        """True speed of the shaft, rad/s."""
        return float(self._s.s[11])

    @property
    def drive_torque(self) -> float:
        """Torque of the external drive at the present, N m."""
        s = self._s
        return float(min(max(s.drive_gain * (s.drive_speed - s.s[11]), -s.drive_limit), s.drive_limit))

    @property
    def currents(self) -> tuple[float, ...]:
        """True currents in A: ten coils, then four motor segments."""
        return (*self._s.coil, *self._s.segment)

    @property
    def trips(self) -> int:
        """Latched trip bits (see TRIPS)."""
        return int(self._s.trips)

    def clear_trips(self) -> None:
        """Forget latched trips."""
        self._s.trips = 0
        self._s.lost_ticks = 0

    def run(self, ticks: int) -> Array:
        """Advance by `ticks` control ticks, or to the end of the telemetry period in which a trip occurs.

        Returns:
            (n, len(CHANNELS)) float64, one row per completed telemetry period of ten ticks.
        """
        limit = (ticks + PERIOD_TICKS - 1) // PERIOD_TICKS + 1
        rows = np.empty((limit, len(CHANNELS)))
        done = _lib.tsbs_run(self._p, self._c, self._s, ticks, _ffi.from_buffer("double[]", rows.data), limit)
        tick = self.tick
        return rows[: tick // PERIOD_TICKS - (tick - done) // PERIOD_TICKS]

    def state(self) -> dict[str, Any]:
        """True state, for tests: `s` (14,) positions and rates, `coil` (10,), `segment` (4,), weight in N."""
        s = self._s
        return {
            "s": np.array(list(s.s)),
            "coil": np.array(list(s.coil)),
            "segment": np.array(list(s.segment)),
            "weight": float(s.weight),
        }

    def set_state(self, s: Array) -> None:
        """Put the shaft somewhere, for tests: (14,) positions and rates."""
        self._s.s[0:14] = [float(x) for x in s]


def derivative(
    params: PlantParams,
    s: Array,
    coil: Array,
    segment: Array,
    *,
    play: Array | None = None,
    gamma: float = 0.0,
    hung_mass: float = 0.0,
    weight: float = 0.0,
    lever: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
) -> Array:
    """Right-hand side of the mechanics, (14,), for tests against the reference. `lever`: weight N, moment N m, how far it
    has slipped rad, inertia added to the shaft's kg m^2."""
    p = _ffi.new("tsbs_params *")
    _fill(p, vars(params))

    def c(x: Array) -> Any:
        return _ffi.new("double[]", [float(v) for v in x])

    out = _ffi.new("double[14]")
    _lib.tsbs_derivative(p, c(s), c(coil), c(segment), c(np.zeros(4) if play is None else play), gamma, hung_mass,
                         weight, c(np.array(lever)), out)  # fmt: skip
    return np.array(list(out))


def normals(seed: int, stream: int, count: int) -> Array:
    """`count` draws of the core's normal generator, for tests."""
    out = np.empty(count)
    _lib.tsbs_normals(seed, stream, _ffi.cast("double *", out.ctypes.data), count)
    return out
