"""Defects that can be planted in the rotary-linear motor."""

from __future__ import annotations

from typing import Final

from sim_backend import instrument, load_cells
from sim_backend.machines.rlsrm.device import SETTABLE
from sim_backend.machines.rlsrm.params import PHASES

NAMES: Final = tuple(name.lower() for name in PHASES)
CHOICES: Final = ("pulse_s", "open_phase", "rule", "priority", "x_wave", "angle_wave", "integrators_wait", "safe_holds")
FACTORS: Final = tuple(sorted(SETTABLE - set(CHOICES)))
DEFECTS: Final = {
    "drop_fraction": 0.0, "dead_after_s": 0.0, "fault_after_s": 0.0, "drive_fault_after_s": 0.0, "integrator_factor": 1.0,
    "exchange_phases": 0.0, "exchange_stators": 0.0, "angle_zero_off": 0.0, "counts_share": 1.0, "truncate": 0.0,
    "cold_told": 0.0, "brake_x": 0.0, "brake_angle": 0.0, "along_path": 1.0, "lock_loose": 1.0,
    "hook_exchanged": 0.0, "lever_exchanged": 0.0, "hanger_off_at_zero": 0.0,
    "mass_error_M1": 0.0, "mass_error_M2": 0.0, "mass_error_M3": 0.0, "mass_error_M4": 0.0,
    **instrument.DEFECTS, **load_cells.DEFECTS,
    **{f"current_factor_{name}": 1.0 for name in NAMES}, **{f"told_factor_{name}": 1.0 for name in NAMES},
    **{f"voltage_share_{name}": 1.0 for name in NAMES}, **{f"factor_{name}": 1.0 for name in FACTORS},
}  # fmt: skip
"""Planted defects and their harmless values. `exchange_phases`: b and c of stator 1 or 2, or of both (3), exchanged at the
terminals; `exchange_stators`: 1, the amplifiers of one drive the other; `angle_zero_off` rad: both stators turned against the
encoder's mark; `counts_share`: counts that arrive of the angle's, 0.25 without the fourfold; `truncate`: 1, encoders give the
next lower count instead of the nearest; `cold_told`: 1, temperatures are told as those of the start; `brake_x` N, `brake_angle`
N m: friction that was left on an axis; `along_path`: 0, each axis rubs by itself; `hook_exchanged`: 1, weights hang on the
wrong side of their pulleys; `lever_exchanged`: 1, on the wrong side of the disc; `lock_loose`: factor on what the locks give
way by; `current_factor_*`: of what an amplifier's loop reads of its current, over the sensor's own gain; `told_factor_*`: of
what is told of it alone, -1 for a sensor that is connected the other way round; `voltage_share_*`: of the supply, that an
amplifier can give; `factor_*`: what the controller has of a parameter that it was told; `mass_error_*`: share by which a mass
is heavier than its certificate."""
