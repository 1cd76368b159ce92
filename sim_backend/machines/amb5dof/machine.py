"""The AMB stand behind the simulated controller: what is drawn for it, its plant, its wiring, who works on it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from sim_backend.machine import Machine, Truth
from sim_backend.machines.amb5dof.motions import MOTIONS
from sim_backend.machines.amb5dof.operator import Balancer
from sim_backend.machines.amb5dof.params import AmbParams, runout
from sim_backend.machines.amb5dof.plant import AXES, CHANNELS, COILS, TRACE, AmbPlant
from sim_backend.machines.amb5dof.quantities import quantities
from sim_backend.spoken import channels_by_reading

Array = npt.NDArray[np.float64]
Numbers = Mapping[str, float]
RADIAL = AXES[:4]
ORDERS = (1, 2, 3, 4)
DEFECTS = {
    "position_sign_yi": 1.0, "position_sign_zi": 1.0, "position_sign_yo": 1.0, "position_sign_zo": 1.0,
    "position_sign_x": 1.0, "exchange_planes": 0.0, "exchange_axes": 0.0, "told_planes": 0.0, "told_axes": 0.0,
    "contact_silent": 0.0, "factor_ellipse_on": 1.0, "factor_ellipse_hz": 1.0, "factor_ref_y": 1.0, "factor_ref_z": 1.0,
    "factor_inject_axis": 1.0, "factor_inject_amplitude": 1.0,
    "current_sign_i": 1.0, "current_sign_o": 1.0, "pulse_missing": 0.0,
    "pulse_doubled": 0.0, "pulse_last": 0.0, "loose_speed": 0.0, "loose_shift": 0.0, "loose_weight": 0.0,
    "drop_fraction": 0.0, "integrator_factor": 1.0,
    "dead_after_s": 0.0, "fault_after_s": 0.0, "drive_fault_after_s": 0.0, "weight_lost": 0.0, "weight_astray": 0.0,
    "hum": 0.0, "hum_hz": 50.0, "hum_probe": 0.0,
    "weight_turned": 0.0, "weight_turned_rad": 0.0, "weight_heavy": 0.0, "weight_heavy_by": 0.0,
}  # fmt: skip
"""Planted defects and their harmless values. Current signs act on what is told of a bearing's y and z axes,
`told_*` on the telemetry and captures alone; `factor_*` scales a parameter that the controller is told before it acts;
`hum` m (0-pk) at `hum_hz` is on the readings of all radial probes in phase, or of the `hum_probe`-th alone (1 to 4);
`weight_astray`, `weight_turned` and `weight_heavy` are the numbers of weights, as they are fixed, that go wrong."""
SHARED = {
    "beta": tuple(f"beta_{a}" for a in RADIAL),
    "magnetic_offset": tuple(f"offset_{a}" for a in RADIAL),
    "unbalance": ("unbalance_i", "unbalance_o"),
    "unbalance_phase": ("unbalance_phase_i", "unbalance_phase_o"),
    **{f"runout_{n}": (f"runout_i{n}", f"runout_o{n}") for n in ORDERS},
    "runout_phase": tuple(f"runout_phase_{b}{n}" for b in "io" for n in ORDERS),
    "mode_damping": ("mode_damping_1", "mode_damping_2"),
}
"""Entries of the simulation table that are drawn several times, and the names of the draws."""


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """Every toleranced number of a rig file by its name; one that holds for several axes or planes once for each."""
    out = {f"geometry.{k}": t for k, t in rig.geometry.items()} | {f"machine.{k}": t for k, t in rig.machine.items()}
    out["site.gravity"] = rig.site.gravity
    out["roll"] = out.pop("machine.radial_axes")  # of the axes against the vertical, both together
    out.pop("machine.runout")  # drawn as orders and phases
    for name in ("machine.weight_mass", "machine.weight_angle"):  # drawn for each weight that is fixed
        out.pop(name, None)
    out |= dict.fromkeys(("coupling_offset_y", "coupling_offset_z"), out.pop("machine.coupling_offset"))
    channel = channels_by_reading(rig)
    read = [f"u_{coil}" for coil in COILS if f"u_{coil}" in rig.sensors]
    for name in (*read, *(f"i_{coil}" for coil in COILS), *(f"pos_{axis}" for axis in AXES)):
        sensor = rig.sensors[channel.get(name, name)]
        out |= {f"{name}.gain": sensor.gain, f"{name}.offset": sensor.offset}
    for name, value in rig.simulation.items():
        if isinstance(value, Toleranced):
            out |= dict.fromkeys(SHARED.get(name, (name,)), value)
    return out


def params(v: Numbers, d: Numbers) -> AmbParams:
    """The plant that drawn values `v` and planted defects `d` make."""
    outboard, down = v["geometry.com_to_outboard_amb"], v["site.gravity"]
    lean, seen = v["roll"], _runout(v)
    return AmbParams(
        mass=v["machine.mass"],
        inertia=v["machine.transverse_inertia"],
        polar_inertia=v["machine.polar_inertia"],
        gravity_y=-down * math.cos(lean),
        gravity_z=-down * math.sin(lean),
        l_ia=v["geometry.amb_span"] - outboard,
        l_oa=outboard,
        l_is=v["geometry.com_to_inboard_sensor"],
        l_os=v["geometry.com_to_outboard_sensor"],
        l_iu=v["geometry.com_to_inboard_balance"],
        l_ou=v["geometry.com_to_outboard_balance"],
        l_c=v["geometry.com_to_coupling"],
        coupling=v["geometry.coupling_stiffness"],
        coupling_offset=(v["coupling_offset_y"], v["coupling_offset_z"]),
        beta=tuple(v[f"beta_{a}"] for a in AXES),
        gap=v["geometry.amb_gap"],
        gap_x=v["geometry.axial_gap"],
        offset=(v["offset_yi"], v["offset_zi"], v["offset_yo"], v["offset_zo"]),
        unbalance=(v["unbalance_i"], v["unbalance_o"]),
        unbalance_phase=(v["unbalance_phase_i"], v["unbalance_phase_o"]),
        viscous=v["viscous"],
        coulomb=v["coulomb"],
        clearance=v["geometry.clearance"],
        lost_radius=0.98 * v["geometry.clearance"],
        mode_on=(v["mode_1_on"], v["mode_2_on"]),
        mode_hz=(v["mode_1"], v["mode_2"]),
        mode_damping=(v["mode_damping_1"], v["mode_damping_2"]),
        amplifier_rate=2 * math.pi * v["amplifier_hz"],
        inductance=v["inductance"],
        resistance=v["resistance"],
        u_max=v["supply_V"],
        current_gain=tuple(v[f"i_{coil}.gain"] for coil in COILS),
        current_offset=tuple(v[f"i_{coil}.offset"] for coil in COILS),
        current_noise=v["current_noise"],
        voltage_gain=tuple(v.get(f"u_{coil}.gain", 1.0) for coil in COILS),
        voltage_offset=tuple(v.get(f"u_{coil}.offset", 0.0) for coil in COILS),
        position_gain=tuple(v[f"pos_{axis}.gain"] for axis in AXES),
        position_offset=tuple(v[f"pos_{axis}.offset"] for axis in AXES),
        position_sign=tuple(d[f"position_sign_{axis}"] for axis in AXES),
        position_noise=v["position_noise"],
        position_range=v["position_range"],
        pulse_angle=v["pulse_angle"],
        pulse_missing=d["pulse_missing"],
        pulse_doubled=d["pulse_doubled"],
        pulse_last=d["pulse_last"],
        exchange_planes=d["exchange_planes"],
        exchange_axes=d["exchange_axes"],
        loose_speed=d["loose_speed"],
        loose_shift=d["loose_shift"],
        hum=(*(d["hum"] * (d["hum_probe"] in (0, k)) for k in (1, 2, 3, 4)), 0.0),
        hum_hz=d["hum_hz"] if d["hum"] else 0.0,
        runout=seen["runout"],
        runout_phase=seen["runout_phase"],
    )


def _runout(v: Numbers) -> dict[str, tuple[float, ...]]:
    def of(name: str) -> tuple[float, float, float, float]:
        return v[f"{name}1"], v[f"{name}2"], v[f"{name}3"], v[f"{name}4"]

    return runout(of("runout_i"), of("runout_o"), of("runout_phase_i"), of("runout_phase_o"))


def make(p: AmbParams, seed: int, substeps: int) -> AmbPlant:
    """The plant itself."""
    return AmbPlant(p, seed, substeps=substeps)


def operator(rig: RigFile, plant: AmbPlant, truth: Truth) -> Balancer:
    """Who works on it."""
    return Balancer(plant, rig, truth)


def copper_W(plant: AmbPlant) -> float:
    """What its windings dissipate."""
    return plant.params.resistance * sum(i * i for i in plant.currents)


NEEDED = (*(f"pos_{a}" for a in AXES), *(f"i_{c}" for c in COILS), "angle", "speed", "pulses", "flags")
"""Of the channels of the core, those that its telemetry is nothing without."""


def places(defects: Numbers, at: Mapping[str, int]) -> tuple[list[int], list[int]]:
    """Which channels of the core are told, and where each goes among the signals; a bearing whose current sensors are
    exchanged has the currents of its coils the other way round."""
    told, shown = [k for k, name in enumerate(CHANNELS) if name in at], told_as(defects)
    return told, [at[shown.get(CHANNELS[k], CHANNELS[k])] for k in told]


def told_as(defects: Numbers) -> dict[str, str]:
    """What a channel of the core is told as, where planted defects exchange channels."""
    shown = {name: name for name in (*(f"pos_{a}" for a in AXES), *(f"i_{c}" for c in COILS))}

    def exchange(a: str, b: str) -> None:
        shown[a], shown[b] = shown[b], shown[a]

    for b in "io":
        if defects[f"current_sign_{b}"] < 0:
            for axis in "yz":
                exchange(f"i_{axis}{b}_p", f"i_{axis}{b}_n")
    for a in "yz" if defects["told_planes"] else "":
        exchange(f"pos_{a}i", f"pos_{a}o")
    for b in "io" if defects["told_axes"] else "":
        exchange(f"pos_y{b}", f"pos_z{b}")
    return shown


def traced(defects: Numbers) -> tuple[str, ...]:
    """The names of the readings of a tick, for captures."""
    shown = told_as(defects)
    return tuple(shown.get(name, name) for name in TRACE)


def spoil(values: Array, at: Mapping[str, int], defects: Numbers) -> None:
    """What the telemetry's sixteen bits make of angle, pulses and flags, in place (n, signals)."""
    values[:, at["angle"]] = (values[:, at["angle"]] + math.pi) % (2 * math.pi) - math.pi
    values[:, at["pulses"]] %= 65536
    if defects["contact_silent"]:
        values[:, at["flags"]] = (values[:, at["flags"]].astype(int) & ~12).astype(float)
    low = values[:, at["flags"]] % 16
    values[:, at["flags"]] = low + 2 * (values[:, at["flags"]] - low)  # bit 4 is the watchdog's


AMB5DOF = Machine(
    name="amb5dof", stated=stated, defects=DEFECTS, params=params, quantities=quantities, targets={}, make=make,
    radial=slice(0, 4), integral_gains=frozenset(("ki", "k0")), turns=False,
    channels=NEEDED, places=places, spoil=spoil, supply_V=48.0,
    windings={"temp_i": 0.0, "temp_o": 2.0, "temp_x": -3.0}, copper_W=copper_W, operator=operator,
    traced=traced, controls=AmbPlant.settable, motions=MOTIONS,
)  # fmt: skip
