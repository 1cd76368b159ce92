"""The one-axis AMB behind the simulated controller: what is drawn for it, its plant, its wiring, who works on it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from sim_backend.machine import Array, Machine, Numbers, Truth
from sim_backend.machines.amb1dof.operator import Loader
from sim_backend.machines.amb1dof.params import PlantParams
from sim_backend.machines.amb1dof.plant import CHANNELS, TRACE, Plant
from sim_backend.machines.amb1dof.quantities import quantities
from sim_backend.machines.amb1dof.truth_band import band
from sim_backend.machines.amb1dof.truth_compare import compare
from sim_backend.motion import Motions

COIL_OHM = 1.0
DEFECTS = {
    "drop_fraction": 0.0, "dead_after_s": 0.0, "fault_after_s": 0.0, "drive_fault_after_s": 0.0, "integrator_factor": 1.0,
    "position_sign": 1.0,
    "literal_weights": 0.0, "literal_sign": 0.0, "sample_factor": 1.0, "filters_swapped": 0.0, "estimate_late": 0.0,
    "factor_degree": 1.0, "factor_window_s": 1.0,
    "factor_single_window_s": 1.0, "factor_single_reset_s": 1.0, "factor_rule": 1.0, "factor_watched": 1.0,
    "factor_estimator": 1.0,
    "factor_compensate": 1.0, "factor_pole_slow": 1.0, "factor_pole_full": 1.0, "factor_pole_fast": 1.0, "factor_kp": 1.0,
    "factor_kv": 1.0, "factor_inject_amplitude": 1.0, "factor_inject_hz": 1.0, "load_lost": 0.0,
}  # fmt: skip
"""Planted defects and their harmless values. Of the firmware's estimators: `literal_weights`, a_1p as (4.10) and (4.15) print
it, without the sign (-1)^(n-p); `literal_sign`, + before the terms in y as (4.11) prints it; `sample_factor`, the sampling time
that it counts with, as a share of the tick; `filters_swapped`, the two filters of (4.17) exchanged; `estimate_late`, algebraic
estimates told and used a sample late. `factor_*` scales what a parameter sets before it acts; `load_lost` is the share of
a hung weight that the pulley keeps."""

MOTIONS = Motions(band=band, compare=compare)


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """Every toleranced number of a rig file that is drawn, by its name."""
    out = {f"geometry.{k}": t for k, t in rig.geometry.items()} | {f"machine.{k}": t for k, t in rig.machine.items()}
    out |= {f"masses.{k}": t for k, t in rig.masses.items()} | {"site.gravity": rig.site.gravity}
    for name, sensor in rig.sensors.items():
        out |= {f"{name}.gain": sensor.gain, f"{name}.offset": sensor.offset}
    return out | {k: t for k, t in rig.simulation.items() if isinstance(t, Toleranced)}


def params(v: Numbers, d: Numbers) -> PlantParams:
    """The plant that drawn values `v` and planted defects `d` make."""
    return PlantParams(
        mass=v["machine.mass"],
        beta=v["beta"],
        gap=v["geometry.amb_gap"],
        clearance=v["geometry.clearance"],
        load=v["load"],
        harmonic=v["harmonic"],
        harmonic_rate=v["harmonic_rate"],
        harmonic_phase=v["harmonic_phase"],
        amplifier_rate=2 * math.pi * v["amplifier_hz"],
        delay=v["delay"],
        position_gain=d["position_sign"] * v["position.gain"],
        position_offset=v["position.offset"],
        position_noise=v["position_noise_peak"] / 3,
        current_gain=(v["i_p.gain"], v["i_n.gain"]),
        current_offset=(v["i_p.offset"], v["i_n.offset"]),
        current_noise=v["current_noise"],
        lost_position=0.92 * v["geometry.clearance"],
        literal_weights=d["literal_weights"],
        literal_sign=d["literal_sign"],
        sample_factor=d["sample_factor"],
        swapped=d["filters_swapped"],
        late=d["estimate_late"],
    )


def make(p: PlantParams, seed: int, _substeps: int) -> Plant:
    """The plant itself: one step of RK4 in a tick is exact to 2e-8."""
    return Plant(p, seed)


def operator(_rig: RigFile, plant: Plant, truth: Truth) -> Loader:
    """Who works on it."""
    return Loader(plant, truth)


def places(_: Numbers, at: Mapping[str, int]) -> tuple[list[int], list[int]]:
    """Every channel of the core is told under its own name."""
    told = [k for k, name in enumerate(CHANNELS) if name in at]
    return told, [at[CHANNELS[k]] for k in told]


def spoil(values: Array, at: Mapping[str, int], defects: Numbers) -> None:
    """No defect is planted in the telemetry."""


def copper_W(plant: Plant) -> float:
    """What its windings dissipate."""
    return COIL_OHM * sum(i * i for i in plant.currents)


AMB1DOF = Machine(
    name="amb1dof", stated=stated, defects=DEFECTS, params=params, quantities=quantities, targets={}, make=make,
    radial=slice(0, 1), integral_gains=frozenset(), turns=False, channels=CHANNELS, places=places, spoil=spoil,
    supply_V=48.0, windings={}, copper_W=copper_W, operator=operator, traced=lambda _: TRACE, controls=Plant.settable,
    motions=MOTIONS,
)  # fmt: skip
