"""What the firmware's command line can get and set, and what it measures: names, units, ranges, scales. Ranges and scales are
stand-ins."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from sim_backend.machines.lira.plant import DQ, MEASURED


@dataclass(frozen=True)
class Setting:
    """A parameter: its name on the line, the field of the firmware, unit and range."""

    name: str
    field: str
    unit: str
    low: float
    high: float


def _loop(way: str, gain: str, turn: str, tops: tuple[float, float, float, float]) -> tuple[Setting, ...]:
    kp, ki, kd, limit = tops
    return (
        Setting(f"kp.{way}", f"kp_{way}", gain, 0, kp),
        Setting(f"ki.{way}", f"ki_{way}", f"{gain}/s", 0, ki),
        Setting(f"kd.{way}", f"kd_{way}", f"{gain}*s", 0, kd),
        Setting(f"sat.{way}", f"sat_{way}", turn, 0, limit),
        Setting(f"l11.{way}", f"l11_{way}", "1", 0, 1),
        Setting(f"l22.{way}", f"l22_{way}", "1", 0, 1),
    )


SETTINGS: Final = (
    *_loop("b", "N/m", "N", (2e6, 5e7, 1e4, 40)),
    *_loop("r", "N*m/rad", "N*m", (200, 2000, 5, 1.5)),
    *_loop("z", "N/m", "N", (1e6, 5e7, 5000, 300)),
    Setting("kp.s", "kp_s", "V/A", 0, 200),
    Setting("ki.s", "ki_s", "V/A/s", 0, 1e6),
    Setting("kp.sl", "kp_sl", "V/A", 0, 2000),
    Setting("ki.sl", "ki_sl", "V/A/s", 0, 1e6),
    Setting("kp.v", "kp_v", "A/V", 0, 2),
    Setting("ki.v", "ki_v", "A/V/s", 0, 1e5),
    Setting("kp.i", "kp_i", "V/A", 0, 50),
    Setting("imax", "current_max", "A", 0, 40),
    Setting("observer", "observer", "1", 0, 2),
    Setting("limit_after_ff", "limit_after_ff", "1", 0, 1),
    Setting("m", "model_mass", "kg", 0.1, 10),
    Setting("j", "model_inertia", "kg*m^2", 1e-5, 1),
    Setting("pull", "model_pull", "N/m", 0, 1e6),
    Setting("psi.rot", "psi_rot", "Wb", 0, 1),
    Setting("psi.lin", "psi_lin", "Wb", 0, 1),
    Setting("fcogg", "model_cogging_force", "N", 0, 100),
    Setting("tcogg", "model_cogging_torque", "N*m", 0, 1),
    Setting("zero.ra1", "zero_ra1", "rad", -math.pi, math.pi),
    Setting("zero.ra2", "zero_ra2", "rad", -math.pi, math.pi),
    Setting("zero.la", "zero_la", "rad", -math.pi, math.pi),
    Setting("gate", "gate_m", "m", 0, 1e-4),
    Setting("gate.time", "gate_s", "s", 0, 5),
    Setting("z.off", "z_off", "m", 0, 5e-3),
    Setting("v.land", "v_land", "m/s", 0, 0.1),
    Setting("watchdog_s", "watchdog_s", "s", 0.02, 10),
    Setting("u.dc", "supply_V", "V", 48, 450),
    Setting("hold.bound", "hold_bound_m", "m", 0, 5e-5),
)
INJECTED: Final = ("inject_axis", "inject_place", "inject_amplitude", "inject_hz")
"""What the line's `inj` says, by the names that rig files may have for it."""
LONGEST_HOLD_S: Final = 6e-3
LONGEST_STEP_S: Final = 1.0
STEPPED: Final = "step_s"
"""How long a step of its `step` lasts, likewise; 0: until another."""
HELD: Final = ("hold_across", "hold_A", "hold_s")
"""What its `hold` says, likewise."""
BY_NAME: Final = {s.name: s for s in SETTINGS}
AXES_OF_LINE: Final = {"x1": "x1", "x2": "x2", "y1": "y1", "y2": "y2", "z": "z", "gamma": "angle"}


@dataclass(frozen=True)
class Measurement:
    """A channel of a capture: its name on the line, the machine's column, unit, what a count of sixteen bits is worth."""

    name: str
    column: str
    unit: str
    lsb: float


def _measurement(column: str) -> Measurement:
    name = "gamma" if column == "angle" else column
    if column[0] == "u":
        return Measurement(name, column, "V", 0.122)
    if column.startswith("i_f"):
        return Measurement(name, column, "A", 24.4e-3)
    if column[0] == "i":
        return Measurement(name, column, "A", 7.3e-3)
    if column == "angle":
        return Measurement(name, column, "rad", 2 * math.pi / 2**16)
    return Measurement(name, column, "m", 1e-6 if column == "z" else 0.25e-6)


INNER: Final = tuple(Measurement(f"i_{name}", f"i_{name}", "A", 4e-4) for name in DQ)
"""The firmware's own dq currents, to 13 A: of the 7.3 mA that a coil is read to little is left, and it is rounded once more."""
WAVE: Final = Measurement("wave", "wave", "1", 2**-15)
"""The sine that is injected, as a share of its amplitude."""
HOLDS: Final = Measurement("held", "held", "1", 1.0)
"""1 while the bearings' currents are held."""
MEASUREMENTS: Final = (*(_measurement(c) for c in MEASURED), *INNER, WAVE, HOLDS)
"""The 52 and the firmware's own, in the order of a capture's mask, the first one in its lowest bit."""
