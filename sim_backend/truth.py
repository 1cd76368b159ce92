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

Array = npt.NDArray[np.float64]
AXES = ("xi", "yi", "xo", "yo", "z")
COILS = tuple(f"i_{axis}_{coil}" for axis in AXES for coil in "pn")
DEFECTS = {
    "current_sign_i": 1.0, "current_sign_o": 1.0, "exchange_current_axes": 0.0, "exchange_current_bearings": 0.0,
    "position_sign_yi": 1.0, "position_sign_yo": 1.0, "exchange_position_axes_o": 0.0, "stuck_position_yo": 0.0,
    "stuck_current_yo_p": 0.0, "coil_limit_yo_p": 0.0, "mass_error_M1": 0.0, "mass_error_M2": 0.0, "mass_error_M3": 0.0,
    "mass_error_M4": 0.0, "hanger_off_at_zero": 0.0, "drop_fraction": 0.0, "integrator_factor": 1.0, "dead_after_s": 0.0,
    "fault_after_s": 0.0, "drive_fault_after_s": 0.0,
}  # fmt: skip
"""Planted defects and their harmless values. Mass errors are relative."""


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
    stated = _stated(rig)
    values = {name: draw_one(t, seed, name) for name, t in stated.items()}
    values |= {k: float(v) for k, v in rig.simulation.items() if isinstance(v, int | float)}
    defects = dict(DEFECTS)
    wanted = dict(overrides or {})
    bias = tuple({**{n: p.default for n, p in rig.parameters.items()}, **(settings or {})}[f"bias_{b}"] for b in "io")
    targets = {k: wanted.pop(k) for k in ("K_i", "K_o") if k in wanted}
    for name, value in wanted.items():
        table = defects if name in defects else values
        if name not in table:
            known = [*stated, *defects, "K_i", "K_o"]
            close = difflib.get_close_matches(name, known, 3)
            raise ConfigError(
                f"--truth {name}: no such value; {'did you mean' if close else 'expected one of'} {', '.join(close or known)}"
            )
        table[name] = float(value)
    for name, value in targets.items():  # K is proportional to the slope at the centre
        slope = f"slope_{name[-1]}"
        values[slope] *= value / _quantities(_plant(values, defects), bias)[name]
    plant = _plant(values, defects)
    return Truth(seed, values, defects, plant, _quantities(plant, bias))


def _stated(rig: RigFile) -> dict[str, Toleranced]:
    """Every toleranced number of a rig file by its name; one that holds for several sensors once for each."""
    out = {f"geometry.{k}": t for k, t in rig.geometry.items()} | {f"masses.{k}": t for k, t in rig.masses.items()}
    out |= {"hanger": rig.hanger, "mass_density": rig.mass_density, "site.gravity": rig.site.gravity,
            "site.air_density": rig.site.air_density}  # fmt: skip
    for b in "io":
        out[f"amb_gap_{b}"] = rig.geometry["amb_gap"]
    for k, coil in enumerate(COILS):
        sensor = rig.sensors.get(coil) or next(iter(rig.sensors.values()))
        out |= {f"{coil}.gain": sensor.gain, f"{coil}.offset": sensor.offset}
        out[f"drift_{k}"] = rig.simulation["drift"]
    for axis in AXES:
        out |= {f"position_gain_{axis}": rig.simulation["position_gain"],
                f"position_offset_{axis}": rig.simulation["position_offset"]}  # fmt: skip
    for k in range(4):
        out[f"segment_gain_{k}"] = rig.simulation["segment_gain"]
    for axis in "xy":
        out[f"motor_offset_{axis}"] = rig.simulation["motor_offset"]
    shared = {"drift", "position_gain", "position_offset", "segment_gain", "motor_offset"}
    return out | {k: t for k, t in rig.simulation.items() if isinstance(t, Toleranced) and k not in shared}


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
        z_motor=v["geometry.com_to_motor"],
        z_hook=outboard + v["geometry.hook_to_outboard"],
        beta=(beta_of(v["slope_i"], v["amb_gap_i"]), beta_of(v["slope_o"], v["amb_gap_o"])),
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
        motor_x=v["motor_offset_x"],
        motor_y=v["motor_offset_y"],
        gamma_zero=v["gamma_zero"],
        segment_gain=(v["segment_gain_0"], v["segment_gain_1"], v["segment_gain_2"], v["segment_gain_3"]),
        viscous=v["viscous"],
        coulomb=v["coulomb"],
        detent=v["detent"],
        detent_phase=v["detent_phase"],
        clearance=v["geometry.clearance"],
        coil_limit=tuple(limit),
        current_gain=tuple(v[f"{c}.gain"] for c in COILS),
        current_offset=tuple(v[f"{c}.offset"] for c in COILS),
        current_drift=tuple(v[f"drift_{k}"] for k in range(10)),
        current_noise=v["current_noise"],
        position_gain=tuple(v[f"position_gain_{a}"] for a in AXES),
        position_offset=tuple(v[f"position_offset_{a}"] for a in AXES),
        position_sign=(1.0, d["position_sign_yi"], 1.0, d["position_sign_yo"], 1.0),
        position_noise=v["position_noise"],
        stuck=(0.0, 0.0, 0.0, d["stuck_position_yo"], 0.0),
        exchange_axes=(0.0, d["exchange_position_axes_o"]),
        lost_radius=0.92 * v["geometry.clearance"],
    )


def eccentricity(p: PlantParams, angles: Array) -> Array:
    """Vertical distance of each journal from its magnetic centre, (2, n) m, with the sensors reading zero."""
    n = np.arange(1, 5)[:, None]

    def quadrature(amplitudes: tuple[float, ...], phases: tuple[float, ...]) -> Array:
        a, q = np.array(amplitudes)[:, None], np.array(phases)[:, None]
        out: Array = (a * np.sin(n * angles + q)).sum(axis=0)
        return out

    sensed = [
        -quadrature(p.target[4 * b : 4 * b + 4], p.target_phase[4 * b : 4 * b + 4])
        - p.position_offset[1 + 2 * b] / p.position_gain[1 + 2 * b]
        for b in (0, 1)
    ]
    span = p.z_sensor[1] - p.z_sensor[0]
    out = []
    for b in (0, 1):
        share = (p.z_amb[b] - p.z_sensor[0]) / span
        plane = sensed[0] + share * (sensed[1] - sensed[0])
        out.append(plane + p.offset_y[b] + quadrature(p.runout[4 * b : 4 * b + 4], p.runout_phase[4 * b : 4 * b + 4]))
    return np.array(out)


def _quantities(p: PlantParams, bias_A: tuple[float, ...]) -> dict[str, float]:
    """K, K2 and the tangent at own weight, by the measurand's definition (see `procedures.amb_calibration`)."""
    angles = np.linspace(0, 2 * math.pi, 720, endpoint=False)
    xi = eccentricity(p, angles)
    beta, gap, bias = (np.array(x)[:, None] for x in (p.beta, p.gap, bias_A))
    near, far = beta / (gap - xi) ** 2, beta / (gap + xi) ** 2
    k, k2 = 2 * bias * (near + far), near - far
    force = _own_weight(p, angles)
    slope = np.sqrt(k**2 - 4 * k2 * (k2 * bias**2 - force))  # on F = K2 (b^2 + i^2) + K i
    out: dict[str, float] = {}
    for b, name in enumerate("io"):
        out |= {
            f"K_{name}": float(k[b].mean()),
            f"K2_{name}": float(k2[b].mean()),
            f"Kw_{name}": float(slope[b].mean()),
        }
    return out


def _own_weight(p: PlantParams, angles: Array) -> Array:
    """Vertical force (2, n) N of each AMB that carries the bare rotor at the sensors' zero (T 6.11, corrected)."""
    n = np.arange(1, 5)[:, None]
    sensed = []
    for b in (0, 1):
        a, q = np.array(p.target[4 * b : 4 * b + 4])[:, None], np.array(p.target_phase[4 * b : 4 * b + 4])[:, None]
        offset = p.position_offset[1 + 2 * b] / p.position_gain[1 + 2 * b]
        sensed.append(-(a * np.sin(n * angles + q)).sum(axis=0) - offset)
    share = (p.z_motor - p.z_sensor[0]) / (p.z_sensor[1] - p.z_sensor[0])
    pull = p.alpha_x * (sensed[0] + share * (sensed[1] - sensed[0]) + p.motor_y)
    total = p.mass * p.gravity * math.cos(p.tilt) - pull  # F_i + F_o; moments about the centre of mass vanish
    zi, zo = p.z_amb
    outboard = (-p.z_motor * pull - zi * total) / (zo - zi)
    return np.array([total - outboard, outboard])
