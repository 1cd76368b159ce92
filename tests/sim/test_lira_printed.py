"""Every number of the page that sets L's beside ours, worked out anew from the machine's own parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bench.rigfile import load_rig
from procedures.mission.plan import Plan
from sim_backend.core.plant import Array
from sim_backend.machines.lira.params import ControlParams, PlantParams
from sim_backend.machines.lira.plant import MEASURED, POSITION_TICKS, TICKS_S

PAGE = Path(__file__).parents[2] / "docs/explanation/linear-rotary-numbers.md"
P, C = PlantParams(), ControlParams()
HZ = np.geomspace(10.0, 1e5, 400_001)
S = 2j * np.pi * HZ
POLE = math.sqrt(2 * P.pull[0] / P.mass)


@cache
def rows() -> dict[str, tuple[str, str]]:
    """Printed and ours, by the first cell."""
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    cells = [[c.strip() for c in line.strip("|").split("|")] for line in lines]
    return {first: (printed, ours) for first, printed, ours in cells if first not in ("L", "---")}


def corner(loop: Array) -> float:
    """Where loop/(1 + loop) falls to -3 dB, Hz."""
    return float(HZ[np.flatnonzero(abs(loop / (1 + loop)) >= math.sqrt(0.5))[-1]])


def position(kp: float, ki: float, kd: float, inertia: float, pull: float = 0.0) -> str:
    return f"{corner((kd * S + kp + ki / S) / (inertia * S * S - pull)):.1f} Hz with an ideal actuator"


def kilo(hz: float) -> str:
    return f"{hz / 1e3:.2f} kHz"


STATOR, CAPACITOR = C.kp_s + C.ki_s / S, C.kp_v + C.ki_v / S
C_F, C_D, R_D = P.filter_c[0], P.damper_c[0], P.damper_r[0]
DAMPED = CAPACITOR / (C_F * S + 1 / (R_D + 1 / (C_D * S)))
PRINTED = {
    "K_L": f"{P.force_constant:g} N/A",
    "K_R per rotary actuator": f"{P.torque_constant[0]:g} N m/A",
    "K_B per rotary actuator": f"{P.bearing_constant[1]:g} N/A",
    "K_pull per rotary actuator": f"{P.pull[0] / 1e3:g} N/mm",
    "m": f"{P.mass:g} kg",
    "J": f"{P.polar_inertia:g} kg m²",
    'τ_pp, "pole pitch"': f"{P.pair_pitch * 1e3:g} mm",
    "cogging force": f"{P.cogging_force:g} N",
    "cogging torque": f"{P.cogging_torque:g} N m",
    "R_rot, L_rot": f"{P.coil_r[0]:g} Ω, {P.coil_l[0] * 1e3:g} mH",
    "R_lin, L_lin": f"{P.coil_r[14]:g} Ω, {P.coil_l[14] * 1e3:g} mH",
    "L_f": f"{P.filter_l[0] * 1e6:g} µH",
    "C_f = C_d": f"{C_F * 1e6:g} µF",
    "R_f": f"{R_D:g} Ω",
    "Ψ_lin": f"{C.psi_lin * 1e3:g} mWb",
    "Ψ_rot": f"{C.psi_rot * 1e3:g} mWb",
    "U_DC": f"{P.supply:g} V; 200 V for Fig. 6",
    "bearing limit": f"{C.sat_b:g} N",
    "rotary limit": f"{C.sat_r:g} N m",
    "linear limit": f"{C.sat_z:g} N",
    "position loops": f"{TICKS_S / POSITION_TICKS / 1e3:g} kHz",
    "measurements": f"{len(MEASURED)}",
    "places": f"{Plan().places_m[0] * 1e3:g} and {Plan().places_m[1] * 1e3:g} mm, "
              f"{math.degrees(Plan().angles_rad[0]):g} and {math.degrees(Plan().angles_rad[1]):g}°",
}  # fmt: skip
"""What is taken over as printed."""

OURS: dict[str, Callable[[], str]] = {
    "f_sw": lambda: f"both edges, {TICKS_S / 1e3:g} kHz",
    "Ψ_lin": lambda: f"K_L τ/(3 π) = {P.force_constant * P.pair_pitch / (3 * math.pi) * 1e3:.1f} mWb",
    "Ψ_rot": lambda: f"K_R/24 = {P.torque_constant[0] / 24 * 1e3:.2f} mWb a coil: with 3 P Ψ the printed one would give "
                     f"{24 * C.psi_rot:.3f} N m/A, with 1.5 P Ψ {12 * C.psi_rot:.3f}.",
    "unstable pole, (20)": lambda: f"{POLE:.2f} rad/s = {POLE / (2 * math.pi):.2f} Hz",
    "its bearing loop, at least": lambda: f"twice the pole: {POLE / math.pi:.0f} Hz",
    "innermost loop, ideally": lambda: f"240 Hz · 5³ = {240 * 5**3 / 1e3:.1f} kHz; {250 * 5**3 / 1e3:g} kHz is 250 Hz · 5³",
    "pole along z, (22)": lambda: "at τ_pp/4 √(4 π F_cogg/(τ_pp m)) = "
                          f"{math.sqrt(4 * math.pi * P.cogging_force / (P.pair_pitch * P.mass)):.1f} rad/s",
    "(the same of the angle)": lambda: f"48 T_cogg = {48 * P.cogging_torque:.2f} N m/rad: "
                               f"{math.sqrt(48 * P.cogging_torque / P.polar_inertia):.1f} rad/s",
    "bearing limit": lambda: f"{C.sat_b / P.bearing_constant[0]:.2f} A of K_B; as much as the pull at "
                             f"{C.sat_b / P.pull[0] * 1e6:.1f} µm",
    "rotary limit": lambda: f"{C.sat_r / sum(P.torque_constant):.2f} A of K_R",
    "linear limit": lambda: f"{C.sat_z / P.force_constant:.2f} A of K_L",
    "bearing, f_BW": lambda: position(C.kp_b, C.ki_b, C.kd_b, P.mass / 2, P.pull[0]),
    "rotary, f_BW": lambda: position(C.kp_r, C.ki_r, C.kd_r, P.polar_inertia),
    "linear, f_BW": lambda: position(C.kp_z, C.ki_z, C.kd_z, P.mass),
    "stator current, f_BW": lambda: f"{kilo(corner(STATOR / (P.coil_l[0] * S + P.coil_r[0])))} with ideal inner loops; with "
                            f"the printed gain the linear actuator would have "
                            f"{corner(STATOR / (P.coil_l[14] * S + P.coil_r[14])):.0f} Hz",
    "capacitor voltage, f_BW": lambda: f"{kilo(corner(DAMPED))} with the damper, {kilo(corner(CAPACITOR / (2 * C_F * S)))} "
                               "with 2 C_f and none",
    "inductor current, f_BW": lambda: kilo(corner(C.kp_i / (P.filter_l[0] * S))),
    "reading of a register": lambda: f"52 of them {52 * 0.25:.1f} µs of a period of {1e6 * POSITION_TICKS / TICKS_S:.2f} µs",
    "rise time, (23)": lambda: f"1/(3 · 0.12 ms) = {kilo(1 / 0.36e-3)}; 0.35/t_r would be {0.35 / 0.12:.2f}",
}  # fmt: skip


@pytest.mark.parametrize("row", PRINTED)
def test_what_is_as_printed(row: str) -> None:
    printed, ours = rows()[row]
    assert printed == PRINTED[row]
    assert "as printed" in ours or row in OURS


@pytest.mark.parametrize("row", OURS)
def test_what_follows(row: str) -> None:
    assert OURS[row]() in rows()[row][1]


def test_the_firmwares_own_numbers() -> None:
    rig = load_rig("lira")
    assert [rig.parameters[name].default for name in ("gate", "gate.time")] == [20e-6, 0.25]
    assert rows()["gate"][0] == "±20 µm for 250 ms"
    assert [rig.parameters[name].default for name in ("v.land", "z.off")] == [10e-3, 2.7e-3]
    assert rows()["landing"][0] == "10 mm/s, bearings off at 2.7 mm"
    assert f"L_lin/L_rot: {C.kp_s * P.coil_l[14] / P.coil_l[0]:.1f} V/A" in PAGE.read_text(encoding="utf-8")


def test_no_row_is_left_out() -> None:
    told_elsewhere = {"gate", "landing", "what f_sw allows it"}
    assert set(rows()) == set(PRINTED) | set(OURS) | told_elsewhere
