"""Defects that can be planted in the linear-rotary actuator, and what of them the reduced model does not have."""

from __future__ import annotations

from typing import Final

DEFECTS: Final = {
    "drop_fraction": 0.0, "dead_after_s": 0.0, "fault_after_s": 0.0, "drive_fault_after_s": 0.0, "integrator_factor": 1.0,
    "coil_reversed": 0.0, "exchange_phases": 0.0, "exchange_actuators": 0.0, "zero_off_ra": 0.0, "zero_off_la": 0.0,
    "one_zero": 0.0, "adc_late_s": 0.0, "no_pull": 0.0, "position_sign_x1": 1.0, "position_sign_y1": 1.0,
    "cables_exchanged": 0.0, "actuator_reversed": 0.0, "coil_dead": 0.0, "weak_coil": 0.0, "weak_coil_gives": 1.0,
    "factor_kp_s": 1.0, "factor_kp_sl": 1.0, "factor_kp_v": 1.0, "factor_current_max": 1.0, "capacitance_factor": 1.0,
    "hold_one_plane": 0.0, "hold_deaf": 0.0, "gate_channels": 15.0, "gate_lag_s": 0.0,
    "current_unfed": 0.0,
    "factor_ki_b": 1.0, "factor_ki_r": 1.0, "factor_ki_z": 1.0, "discharge_factor": 1.0,
    "mass_error_M1": 0.0, "mass_error_M2": 0.0, "places_exchanged": 0.0, "misplaced": 0.0,
    "ring_missing": 0.0, "ring_other": 0.0, "ring_grip": 0.0,
}  # fmt: skip
"""Planted defects and their harmless values. `coil_reversed`: number of the coil that is connected the other way round;
`exchange_phases`: b and c of rotary actuator 1 or 2, or of both (3), exchanged at the terminals; `exchange_actuators`: 1, the
half-bridges of one drive the other; `cables_exchanged`: 100 j + k, coils of two half-bridges j and k exchanged;
`actuator_reversed`: 1 or 2 rotary, 3 linear, all of its coils the other way round; `coil_dead`: number of a coil that is open;
`weak_coil`: of one that gives a share `weak_coil_gives` of its force; `zero_off_*` rad electrical: encoder turned or moved
after its zero was set; `one_zero`: 1, the firmware takes the zero of the first rotary actuator for both; `adc_late_s`: of the
half-bridges' readings; `no_pull`: 1, the observers do not know the negative stiffness; `position_sign_*`: of a probe;
`factor_*`: what the firmware has of a gain or a limit that it was told; `capacitance_factor`: of every capacitor's own;
`hold_one_plane`: 1, a hold pushes the first plane alone; `hold_deaf`: 1, a hold is answered and does not come; `gate_channels`:
bits x1, x2, y1, y2 of the radial readings that the gate watches; `gate_lag_s`: of a low-pass before it;
`current_unfed`: 1, currents are told without what is fed forward against cogging;
`discharge_factor`: of the time that the DC link takes to discharge, 1e6 with an open bleeder;
`mass_error_*`: share by which a mass is heavier than its certificate; `places_exchanged`: 1, whoever hangs masses takes one
hook for the other; `misplaced`: number of the one hanging at which they do; `ring_missing`: 1, the ring is said to be on and
is not; `ring_other`: share by which another one that is put on has more mass and moment of inertia; `ring_grip`: N m beyond
which it slips on the mover, 0: it sits tight."""
REVERSED: Final = (range(0), range(1, 7), range(7, 13), range(13, 16))
"""Coils of each actuator, by its number."""
OPEN_OHM: Final = 5e3
"""Of a coil that is open: 40 mA at the whole supply."""
FACTORS: Final = ("kp_s", "kp_sl", "kp_v", "current_max", "ki_b", "ki_r", "ki_z")
ELECTRICAL: Final = (
    "coil_reversed",
    "exchange_phases",
    "exchange_actuators",
    "cables_exchanged",
    "actuator_reversed",
    "coil_dead",
    "weak_coil",
    "adc_late_s",
    "factor_kp_s",
    "factor_kp_sl",
    "factor_kp_v",
    "factor_current_max",
    "capacitance_factor",
)
"""What the reduced model knows nothing of."""
