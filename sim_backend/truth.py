"""The truth of one simulated rig: drawn for a seed from exactly the distributions that the rig file states.

Every draw has a name and its own stream, a hash of seed and name, so that adding one leaves the others as they were.
The bench never sees any of it; tests and campaigns read `truth.json`.
"""

from __future__ import annotations

import difflib
import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special

from bench.errors import ConfigError
from bench.rigfile import RigFile
from bench.toleranced import Toleranced
from sim_backend.core.params import PlantParams, beta_of
from sim_backend.quantities import quantities

Array = npt.NDArray[np.float64]
AXES = ("xi", "yi", "xo", "yo", "z")
COILS = tuple(f"i_{axis}_{coil}" for axis in AXES for coil in "pn")
DEFECTS = {
    "current_sign_i": 1.0, "current_sign_o": 1.0, "exchange_current_axes": 0.0, "exchange_current_bearings": 0.0,
    "position_sign_yi": 1.0, "position_sign_yo": 1.0, "exchange_position_axes_o": 0.0, "stuck_position_yo": 0.0,
    "stuck_current_yo_p": 0.0, "coil_limit_yo_p": 0.0, "mass_error_M1": 0.0, "mass_error_M2": 0.0, "mass_error_M3": 0.0,
    "mass_error_M4": 0.0, "hanger_off_at_zero": 0.0, "drop_fraction": 0.0, "integrator_factor": 1.0, "dead_after_s": 0.0,
    "fault_after_s": 0.0, "drive_fault_after_s": 0.0, "exchange_segments": 0.0, "segment_sign_1": 1.0,
    "encoder_sign": 1.0, "lever_slip": 0.0, "drive_brakes": 0.0,
}  # fmt: skip
"""Planted defects and their harmless values. Mass errors are relative."""
SEGMENTS = tuple(f"i_m{k}" for k in range(1, 5))


def uniform(seed: int, name: str) -> float:
    """A number in (0, 1), the same for the same seed and name everywhere."""
    digest = hashlib.sha256(f"{seed}:{name}".encode()).digest()
    return (int.from_bytes(digest[:7], "little") + 0.5) / 2**56


def draw_one(t: Toleranced, seed: int, name: str) -> float:
    """A value from the distribution that `t` states."""
    p = uniform(seed, name)
    if t.distribution == "normal":
        return t.value + t.standard_uncertainty * float(special.ndtri(p))
    half = t.half_width or 0.0
    if t.distribution == "rectangular":
        return t.value + half * (2 * p - 1)
    if t.distribution == "triangular":
        return t.value + half * (math.sqrt(2 * p) - 1 if p < 0.5 else 1 - math.sqrt(2 - 2 * p))
    return t.value + half * math.sin(math.pi * (p - 0.5))


@dataclass(frozen=True)
class Truth:
    """Every drawn value by name, planted defects, and what follows from them."""

    seed: int
    values: Mapping[str, float]
    defects: Mapping[str, float]
    plant: PlantParams
    quantities: Mapping[str, float]

    def load(self, label: str) -> tuple[float, float]:
        """Hung mass in kg and its weight in air in N for a load's label; the hanger is on, and "" is nothing else.

        Raises:
            KeyError: the rig has no such mass.
        """
        kg = 0.0
        if label:
            kg = self.values[f"masses.{label}"] * (1 + self.defects.get(f"mass_error_{label}", 0.0))
        if label or not self.defects["hanger_off_at_zero"]:
            kg += self.values["hanger"]
        return kg, _weight(kg, self.values)

    def on_lever(self, side: str, label: str) -> tuple[float, float, float]:
        """Mass in kg on the lever, its weight in air in N, and its arm in m, positive on the left.

        Raises:
            KeyError: the rig has no such mass, or no lever.
        """
        arm = self.values[f"geometry.lever_{side}"] * {"left": 1, "right": -1}[side]
        if not label:
            return 0.0, 0.0, arm
        kg = self.values[f"masses.{label}"] * (1 + self.defects.get(f"mass_error_{label}", 0.0))
        return kg, _weight(kg, self.values), arm


def _weight(kg: float, v: Mapping[str, float]) -> float:
    density = v["mass_density"]
    true = kg * (1 - 1.2 / 8000) / (1 - 1.2 / density)  # `kg` is a conventional mass, OIML D 28
    return true * v["site.gravity"] * (1 - v["site.air_density"] / density)


def draw(
    rig: RigFile,
    seed: int,
    overrides: Mapping[str, float] | None = None,
    settings: Mapping[str, float] | None = None,
) -> Truth:
    """Draw a rig. `overrides` set drawn values or defects by name, or the truth of K_i and K_o directly. `settings` are
    the controller parameters that a procedure will write: the measurands hold for the bias among them.

    Raises:
        ConfigError: an override names nothing, or the rig file has nothing to simulate.
    """
    if not rig.simulation:
        raise ConfigError(
            f"rig {rig.name}: found no [simulation] table, so that there is nothing to simulate; expected --backend live"
        )
    tolerances = stated(rig)
    values = {name: draw_one(t, seed, name) for name, t in tolerances.items()}
    values |= {k: float(v) for k, v in rig.simulation.items() if isinstance(v, int | float)}
    defects = dict(DEFECTS)
    wanted = dict(overrides or {})
    bias = tuple({**{n: p.default for n, p in rig.parameters.items()}, **(settings or {})}[f"bias_{b}"] for b in "io")
    targets = {k: wanted.pop(k) for k in ("K_i", "K_o") if k in wanted}
    for name, value in wanted.items():
        table = defects if name in defects else values
        if name not in table:
            known = [*tolerances, *defects, "K_i", "K_o"]
            close = difflib.get_close_matches(name, known, 3)
            raise ConfigError(
                f"--truth {name}: no such value; {'did you mean' if close else 'expected one of'} {', '.join(close or known)}"
            )
        table[name] = float(value)
    for name, value in targets.items():  # K is proportional to the slope at the centre
        slope = f"slope_{name[-1]}"
        values[slope] *= value / quantities(_plant(values, defects), bias)[name]
    plant = _plant(values, defects)
    return Truth(seed, values, defects, plant, quantities(plant, bias))


def nominal(rig: RigFile) -> Mapping[str, float]:
    """Overrides that put every drawn value at what the rig file states."""
    return {name: t.value for name, t in stated(rig).items()}


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """Every toleranced number of a rig file by its name; one that holds for several sensors once for each."""
    out = {f"geometry.{k}": t for k, t in rig.geometry.items()} | {f"masses.{k}": t for k, t in rig.masses.items()}
    out |= {"hanger": rig.hanger, "mass_density": rig.mass_density, "site.gravity": rig.site.gravity,
            "site.air_density": rig.site.air_density}  # fmt: skip
    for b in "io":
        out[f"amb_gap_{b}"] = rig.geometry["amb_gap"]
        if "amb_asymmetry" in rig.machine:
            out[f"asymmetry_{b}"] = rig.machine["amb_asymmetry"]
    currents = [s for name, s in rig.sensors.items() if name.startswith("i_")]
    for coil in (*COILS, *SEGMENTS):
        sensor = rig.sensors.get(coil, currents[0])
        out |= {f"{coil}.gain": sensor.gain, f"{coil}.offset": sensor.offset}
    out |= {f"drift_{k}": rig.simulation["drift"] for k in range(len(COILS))}
    for axis in AXES:
        certified = rig.sensors.get(f"pos_{axis}")
        out[f"position_gain_{axis}"] = certified.gain if certified else rig.simulation["position_gain"]
        out[f"position_offset_{axis}"] = certified.offset if certified else rig.simulation["position_offset"]
    for k in range(4):
        out |= {f"segment_gain_{k}": rig.simulation["segment_gain"], f"segment_drift_{k}": rig.simulation["drift"]}
    out |= {name: t for name, t in rig.machine.items() if name in ("pole_pairs", "polar_inertia", "ring_inertia")}
    for axis in "xy":
        out[f"motor_offset_{axis}"] = rig.simulation["motor_offset"]
    shared = {"drift", "position_gain", "position_offset", "segment_gain", "motor_offset"}
    return out | {k: t for k, t in rig.simulation.items() if isinstance(t, Toleranced) and k not in shared}


def _four(v: Mapping[str, float], a: str, b: str, c: str, d: str) -> tuple[float, float, float, float]:
    return v[a], v[b], v[c], v[d]


def _plant(v: Mapping[str, float], d: Mapping[str, float]) -> PlantParams:
    outboard = v["geometry.com_to_outboard_amb"]
    nominal = PlantParams()
    limit = list(nominal.coil_limit)
    if d["coil_limit_yo_p"]:
        limit[6] = d["coil_limit_yo_p"]
    return PlantParams(
        gravity=v["site.gravity"],
        tilt=v["tilt"],
        eccentricity=v["eccentricity"],
        z_amb=(outboard - v["geometry.amb_span"], outboard),
        z_sensor=(-v["geometry.com_to_inboard_sensor"], v["geometry.com_to_outboard_sensor"]),
        z_motor=outboard + v["geometry.motor_to_outboard_amb"],
        z_hook=outboard + v["geometry.hook_to_outboard"],
        z_lever=outboard + v["geometry.hook_to_outboard"],
        polar_inertia=v["polar_inertia"],
        pole_pairs=v["pole_pairs"],
        beta=(beta_of(v["slope_i"], v["amb_gap_i"]), beta_of(v["slope_o"], v["amb_gap_o"])),
        asymmetry=(v["asymmetry_i"], v["asymmetry_o"]),
        gap=(v["amb_gap_i"], v["amb_gap_o"]),
        offset_x=(v["offset_xi"], v["offset_xo"]),
        offset_y=(v["offset_yi"], v["offset_yo"]),
        runout=tuple(v[f"runout_{b}{n}"] for b in "io" for n in range(1, 5)),
        runout_phase=tuple(v[f"runout_phase_{b}{n}"] for b in "io" for n in range(1, 5)),
        target=tuple(v.get(f"target_{b}{n}", 0.0) for b in "io" for n in range(1, 5)),
        target_phase=tuple(v.get(f"target_phase_{b}{n}", 0.0) for b in "io" for n in range(1, 5)),
        hysteresis=v["hysteresis"],
        alpha_d=v["alpha_d"],
        alpha_c=v["alpha_c"],
        alpha_x=v["geometry.motor_stiffness"],
        alpha_tau=v["alpha_tau"],
        alpha_2=v["alpha_2"],
        alpha_3=v["alpha_3"],
        alpha_4=v["alpha_4"],
        alpha_6=v["alpha_6"],
        beta_2=v["beta_2"],
        beta_4=v["beta_4"],
        motor_x=v["motor_offset_x"],
        motor_y=v["motor_offset_y"],
        gamma_zero=v["gamma_zero"],
        segment_gain=_four(v, *(f"segment_gain_{k}" for k in range(4))),
        exchange_segments=d["exchange_segments"],
        viscous=v["viscous"],
        drag_share=v["drag_share"],
        coulomb=v["coulomb"],
        brake=d["drive_brakes"],
        lever_slip=d["lever_slip"],
        detent=v["detent"],
        detent_phase=v["detent_phase"],
        clearance=v["geometry.clearance"],
        coil_limit=tuple(limit),
        current_gain=tuple(v[f"{c}.gain"] for c in COILS),
        current_offset=tuple(v[f"{c}.offset"] for c in COILS),
        current_drift=tuple(v[f"drift_{k}"] for k in range(10)),
        current_noise=v["current_noise"],
        segment_sense=_four(v, *(f"{c}.gain" for c in SEGMENTS)),
        segment_offset=_four(v, *(f"{c}.offset" for c in SEGMENTS)),
        segment_drift=_four(v, *(f"segment_drift_{k}" for k in range(4))),
        encoder_sign=d["encoder_sign"],
        position_gain=tuple(v[f"position_gain_{a}"] for a in AXES),
        position_offset=tuple(v[f"position_offset_{a}"] for a in AXES),
        position_sign=(1.0, d["position_sign_yi"], 1.0, d["position_sign_yo"], 1.0),
        position_noise=v["position_noise"],
        stuck=(0.0, 0.0, 0.0, d["stuck_position_yo"], 0.0),
        exchange_axes=(0.0, d["exchange_position_axes_o"]),
        lost_radius=0.92 * v["geometry.clearance"],
    )
