"""The TSBS machine behind the simulated controller: what is drawn for it, its plant, its wiring, who works on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from sim_backend.machine import Machine, Truth
from sim_backend.machines.tsbs import liftoff
from sim_backend.machines.tsbs import quantities as of
from sim_backend.machines.tsbs.motions import MOTIONS
from sim_backend.machines.tsbs.operator import SimulatedOperator
from sim_backend.machines.tsbs.params import ControlParams, PlantParams, beta_of
from sim_backend.machines.tsbs.plant import CHANNELS, TRACE, Plant
from sim_backend.spoken import channels_by_reading

AXES = ("xi", "yi", "xo", "yo", "z")
COILS = tuple(f"i_{axis}_{coil}" for axis in AXES for coil in "pn")
SEGMENTS = tuple(f"i_m{k}" for k in range(1, 5))
COIL_OHM, SEGMENT_OHM = 0.6, 0.4  # copper of the windings
Array = npt.NDArray[np.float64]
DEFECTS = {
    "current_sign_i": 1.0, "current_sign_o": 1.0, "exchange_current_axes": 0.0, "exchange_current_bearings": 0.0,
    "position_sign_yi": 1.0, "position_sign_yo": 1.0, "exchange_position_axes_o": 0.0, "stuck_position_yo": 0.0,
    "stuck_current_yo_p": 0.0, "coil_limit_yo_p": 0.0, "mass_error_M1": 0.0, "mass_error_M2": 0.0, "mass_error_M3": 0.0,
    "mass_error_M4": 0.0, "hanger_off_at_zero": 0.0, "drop_fraction": 0.0, "integrator_factor": 1.0, "dead_after_s": 0.0,
    "fault_after_s": 0.0, "drive_fault_after_s": 0.0, "exchange_segments": 0.0, "segment_sign_1": 1.0,
    "encoder_sign": 1.0, "lever_slip": 0.0, "segment_scale_drift": 0.0, "drive_brakes": 0.0, "factor_gamma": 1.0,
    "factor_balance": 1.0, "factor_gamma_max": 1.0, "factor_model_alpha_d": 1.0,
    "factor_model_alpha_c": 1.0, "factor_model_stiffness": 1.0, "factor_circle_radius": 1.0,
    "factor_kp_theta": 1.0, "factor_kd_theta": 1.0, "factor_sine_amplitude": 1.0, "factor_angle_ref": 1.0,
    "factor_gamma_slew": 1.0, "ring_friction": 0.1, "contact_silent": 0.0, "weight_left_kg": 0.0,
    "factor_lag_compensation": 1.0, "factor_segment_max": 1.0, "kept_allocation": 0.0,
}  # fmt: skip
"""Planted defects and their harmless values. Mass errors are relative; `factor_...` is what the controller makes of a
parameter, over what it was told; `kept_...` is what it keeps to instead; `segment_scale_drift` is relative, 1/s, of all four
segments' sensors.
Of `factor_balance` 2 wraps the load's line, 3 turns phi's sign round, 4 has an observer of currents without limits."""

CONTACT = 4 | 8  # of the flags, inboard and outboard

DAILY = frozenset(
    ("site.air_density", *(f"drift_{k}" for k in range(len(COILS))), *(f"segment_drift_{k}" for k in range(4)))
)
"""The weather, and how fast each current sensor drifts."""


def stated(rig: RigFile, segments: tuple[str, ...] = SEGMENTS) -> dict[str, Toleranced]:
    """Every toleranced number of a rig file by its name; one that holds for several sensors once for each. `segments` are the
    readings of the motor's currents."""
    out = {f"geometry.{k}": t for k, t in rig.geometry.items()} | {f"masses.{k}": t for k, t in rig.masses.items()}
    out |= {"hanger": rig.hanger, "mass_density": rig.mass_density, "site.gravity": rig.site.gravity,
            "site.air_density": rig.site.air_density}  # fmt: skip
    for b in "io":
        out[f"amb_gap_{b}"] = rig.geometry["amb_gap"]
        if "amb_asymmetry" in rig.machine:
            out[f"asymmetry_{b}"] = rig.machine["amb_asymmetry"]
    channel = channels_by_reading(rig)
    currents = [s for s in rig.sensors.values() if s.offset.unit == "A"]
    for coil in (*COILS, *segments):
        sensor = rig.sensors.get(channel.get(coil, coil), currents[0])
        out |= {f"{coil}.gain": sensor.gain, f"{coil}.offset": sensor.offset}
    out |= {f"drift_{k}": rig.simulation["drift"] for k in range(len(COILS))}
    for axis in AXES:
        certified = rig.sensors.get(channel.get(f"pos_{axis}", f"pos_{axis}"))
        out[f"position_gain_{axis}"] = certified.gain if certified else rig.simulation["position_gain"]
        out[f"position_offset_{axis}"] = certified.offset if certified else rig.simulation["position_offset"]
    for k in range(4):
        out |= {f"segment_gain_{k}": rig.machine["segment_gain"], f"segment_drift_{k}": rig.simulation["drift"]}
    out["beta_4"] = rig.machine["torque_ripple"]
    out |= {
        name: t
        for name, t in rig.machine.items()
        if name in ("pole_pairs", "polar_inertia", "ring_inertia", "drive_drag")
    }
    for axis in "xy":  # unless the rig file states it for that axis
        out[f"motor_offset_{axis}"] = rig.simulation["motor_offset"]
    shared = {"drift", "position_gain", "position_offset", "motor_offset"}
    return out | {k: t for k, t in rig.simulation.items() if isinstance(t, Toleranced) and k not in shared}


def _four(v: Mapping[str, float], a: str, b: str, c: str, d: str) -> tuple[float, float, float, float]:
    return v[a], v[b], v[c], v[d]


def params(v: Mapping[str, float], d: Mapping[str, float], segments: tuple[str, ...] = SEGMENTS) -> PlantParams:
    """The plant that drawn values `v` and planted defects `d` make."""
    return _sensed(_driven(_carried(v, d), v, d), v, d, segments)


def _carried(v: Mapping[str, float], d: Mapping[str, float]) -> PlantParams:
    """The shaft, what carries it and what turns or hangs on it; the rest nominal."""
    outboard = v["geometry.com_to_outboard_amb"]
    limit = list(PlantParams().coil_limit)
    if d["coil_limit_yo_p"]:
        limit[6] = d["coil_limit_yo_p"]
    return PlantParams(
        gravity=v["site.gravity"],
        tilt=v["tilt"],
        eccentricity=v["eccentricity"],
        z_amb=(outboard - v["geometry.amb_span"], outboard),
        z_hook=outboard + v["geometry.hook_to_outboard"],
        z_lever=outboard + v["geometry.hook_to_outboard"],
        polar_inertia=v["polar_inertia"],
        beta=(beta_of(v["slope_i"], v["amb_gap_i"]), beta_of(v["slope_o"], v["amb_gap_o"])),
        asymmetry=(v["asymmetry_i"], v["asymmetry_o"]),
        gap=(v["amb_gap_i"], v["amb_gap_o"]),
        offset_x=(v["offset_xi"], v["offset_xo"]),
        offset_y=(v["offset_yi"], v["offset_yo"]),
        runout=tuple(v[f"runout_{b}{n}"] for b in "io" for n in range(1, 5)),
        runout_phase=tuple(v[f"runout_phase_{b}{n}"] for b in "io" for n in range(1, 5)),
        hysteresis=v["hysteresis"],
        viscous=v["viscous"],
        drag_share=v["drag_share"],
        coulomb=v["coulomb"],
        brake=v.get("drive_drag", 0.0) + d["drive_brakes"],
        lever_slip=d["lever_slip"],
        clearance=v["geometry.clearance"],
        ring_friction=d["ring_friction"],
        coil_limit=tuple(limit),
        lost_radius=0.92 * v["geometry.clearance"],
    )


def _driven(plant: PlantParams, v: Mapping[str, float], d: Mapping[str, float]) -> PlantParams:
    """The same with its motor."""
    return replace(
        plant,
        z_motor=v["geometry.com_to_outboard_amb"] + v["geometry.motor_to_outboard_amb"],
        pole_pairs=v["pole_pairs"],
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
        detent=v["detent"],
        detent_phase=v["detent_phase"],
    )


def _sensed(
    plant: PlantParams, v: Mapping[str, float], d: Mapping[str, float], segments: tuple[str, ...]
) -> PlantParams:
    """The same with its sensors."""
    return replace(
        plant,
        z_sensor=(-v["geometry.com_to_inboard_sensor"], v["geometry.com_to_outboard_sensor"]),
        target=tuple(v.get(f"target_{b}{n}", 0.0) for b in "io" for n in range(1, 5)),
        target_phase=tuple(v.get(f"target_phase_{b}{n}", 0.0) for b in "io" for n in range(1, 5)),
        current_gain=tuple(v[f"{c}.gain"] for c in COILS),
        current_offset=tuple(v[f"{c}.offset"] for c in COILS),
        current_drift=tuple(v[f"drift_{k}"] for k in range(10)),
        current_noise=v["current_noise"],
        segment_sense=_four(v, *(f"{c}.gain" for c in segments)),
        segment_offset=_four(v, *(f"{c}.offset" for c in segments)),
        segment_drift=_four(v, *(f"segment_drift_{k}" for k in range(4))),
        segment_scale_drift=d["segment_scale_drift"],
        encoder_sign=d["encoder_sign"],
        position_gain=tuple(v[f"position_gain_{a}"] for a in AXES),
        position_offset=tuple(v[f"position_offset_{a}"] for a in AXES),
        position_sign=(1.0, d["position_sign_yi"], 1.0, d["position_sign_yo"], 1.0),
        position_noise=v["position_noise"],
        stuck=(0.0, 0.0, 0.0, d["stuck_position_yo"], 0.0),
        exchange_axes=(0.0, d["exchange_position_axes_o"]),
    )


def quantities(p: PlantParams, settings: Mapping[str, float]) -> dict[str, float]:
    """The true quantities, for the bias among the controller's parameters."""
    most = settings.get("segment_max", ControlParams.segment_max)
    return of.quantities(p, (settings["bias_i"], settings["bias_o"])) | liftoff.quantities(p, most)


def make(p: PlantParams, seed: int, substeps: int) -> Plant:
    """The plant itself."""
    return Plant(p, seed, substeps=substeps)


def operator(rig: RigFile, plant: Plant, truth: Truth) -> SimulatedOperator:
    """Who works on it. What somebody has left hanging hangs on the hook from the start."""
    if left := truth.defects["weight_left_kg"]:
        plant.load(left, left * truth.plant.gravity, 0.0)
    return SimulatedOperator(plant, truth, rig.hook_seat.half_width or 0.0)


def copper_W(plant: Plant) -> float:
    """What its windings dissipate."""
    currents = plant.currents
    return COIL_OHM * sum(i * i for i in currents[:10]) + SEGMENT_OHM * sum(i * i for i in currents[10:])


def places(
    defects: Mapping[str, float], at: Mapping[str, int], channels: tuple[str, ...] = CHANNELS
) -> tuple[slice, list[int]]:
    """Which channels of the core are told, and where each goes among the signals, with planted wiring defects of the
    current telemetry."""
    goes = {name: at[name] for name in channels}

    def exchange(a: str, b: str) -> None:
        goes[a], goes[b] = goes[b], goes[a]

    for b in "io":
        if defects[f"current_sign_{b}"] < 0:  # the sensors of both coils exchanged: the control current changes sign
            exchange(f"i_y{b}_p", f"i_y{b}_n")
    for side in "pn":
        if defects["exchange_current_bearings"]:
            exchange(f"i_xi_{side}", f"i_xo_{side}")
            exchange(f"i_yi_{side}", f"i_yo_{side}")
        if defects["exchange_current_axes"]:
            exchange(f"i_xi_{side}", f"i_yi_{side}")
            exchange(f"i_xo_{side}", f"i_yo_{side}")
    return slice(None), list(goes.values())


def spoil(values: Array, at: Mapping[str, int], defects: Mapping[str, float], first: str = SEGMENTS[0]) -> None:
    """Put planted defects of sensors into telemetry (n, signals), and the angle within a turn. `first`: one of the segments."""
    if defects["contact_silent"]:
        values[:, at["flags"]] = values[:, at["flags"]].astype(np.int64) & ~CONTACT
    values[:, at[first]] *= defects["segment_sign_1"]
    if defects["stuck_current_yo_p"]:
        values[:, at["i_yo_p"]] = 4.0
    values[:, at["angle"]] = (values[:, at["angle"]] + math.pi) % (2 * math.pi) - math.pi


TSBS = Machine(
    name="tsbs", stated=stated, defects=DEFECTS, params=params, quantities=quantities,
    targets={"K_i": "slope_i", "K_o": "slope_o"}, make=make, radial=slice(0, 4),
    integral_gains=frozenset(("ki_i", "ki_o", "ki_z", "ki_m")), turns=True,
    channels=CHANNELS, places=places, spoil=spoil,
    supply_V=148.0, windings={"temp_i": 0.0, "temp_o": 2.0, "temp_m": -3.0}, copper_W=copper_W,
    operator=operator, daily=DAILY, traced=lambda _: TRACE, controls=Plant.settable, motions=MOTIONS,
)  # fmt: skip
