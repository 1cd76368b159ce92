"""Parameters of a rig's twin, SI: `TwinParams` is what `twin.h` has, of numbers that were drawn by identity."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from bench.rigfile import RigFile
from sim_backend.machines.twin.columns import Columns
from sim_backend.machines.twin.control import TwinControl, control_of
from sim_backend.machines.twin.layout import AxisPart, Geometry, Numbers, layout_of
from sim_backend.machines.twin.nominal import nominal_of
from sim_backend.machines.twin.rules import ORDERS, short
from sim_backend.machines.twin.told import Told, told_of

Many = tuple[float, ...]
AXES, PROBES, PLANES, RINGS = 16, 16, 4, 8


@dataclass(frozen=True)
class TwinParams:
    """One machine. Axes: the radial ones, then the axial one; probes: those that look from the side, then those along the
    shaft; `TwinControl` is how its controller begins, `Told` what it tells and by which names.

    Left out: what the axial motion moves of the stations, motional emf, eddy currents, hysteresis, the amplifiers' ripple, the
    gyroscopic split of the bending modes, the mass of what hangs.
    """

    control: TwinControl
    names: Told
    radial: int
    axial: int
    probes: int
    rings: int
    planes: int
    bearings: int
    tick: float
    period: int
    readings: int  # 1 where a sample of the telemetry is the last reading of its period
    mass: float
    inertia: float
    polar_inertia: float
    gravity: Many  # x, y, z
    free_tilt: float  # 0: all radial axes pull in one plane, and tilts are held
    free_radial: Many  # projector yy, yz, zz on what radial motion is free
    axis: Many  # y, z, psi, theta and bending, by axis
    beta: Many
    gap: Many
    offset: Many  # where the magnetic centre reads as if the shaft were displaced, m
    beta_x: float
    gap_x: float
    offset_x: float
    sense_x: float
    bearing: tuple[int, ...]
    coils: tuple[int, ...]
    plane: Many
    unbalance: Many
    unbalance_phase: Many
    ring: Many
    clearance: Many
    stop: float
    ring_stiffness: float
    ring_damping: float
    ring_friction: float
    ring_radius: float
    coupling: float
    coupling_at: float
    coupling_offset: Many
    viscous: float
    coulomb: float
    amplifier_rate: float
    inductance: Many
    resistance: float
    u_max: float
    coil_limit: float
    current_gain: Many
    current_offset: Many
    current_noise: float
    current_lsb: float
    voltage_gain: Many
    voltage_offset: Many
    probe: Many
    probe_x: Many
    position_gain: Many
    position_offset: Many
    position_sign: Many
    position_noise: Many
    position_lsb: float
    position_range: float
    runout_c: Many
    runout_s: Many
    trip_current: float
    trip_speed: float
    shape_plane: Many = (0.0,) * 8
    shape_ring: Many = (0.0,) * 16
    shape_coupling: Many = (0.0, 0.0)
    mode_on: Many = (0.0, 0.0)
    mode_hz: Many = (1.0, 1.0)
    mode_damping: Many = (2e-3, 2e-3)
    mode_mass: Many = (1.0, 1.0)
    coulomb_speed: float = 0.5
    hum: Many = (0.0,) * PROBES
    hum_hz: float = 0.0
    pulse_angle: float = 0.0
    pulse_missing: float = 0.0
    pulse_doubled: float = 0.0
    pulse_last: float = 0.0
    loose_speed: float = 0.0
    loose_shift: float = 0.0
    start_angle: float = 0.0
    lost_share: float = 0.98
    lost_time: float = 0.1
    own_slew: float = 0.0  # m/s: a rate at which the controller follows set points, whatever it is told; 0: none


def params(rig: RigFile, v: Numbers, d: Numbers) -> TwinParams:
    """The plant that drawn values `v` and planted defects `d` make.

    Raises:
        ConfigError: a rig file describes what cannot be held.
    """
    n, layout = nominal_of(rig), layout_of(rig)
    columns = Columns(Geometry(rig, layout, v), n, v)
    free = columns.free
    parts: dict[str, object] = {
        **_shaft(columns, v), **_bearings(columns, v, d), **_planes(columns, v), **_contact(columns, v),
        **_flexible(columns, v), **_amplifiers(columns, v), **_probes(columns, v, d), **_mark(columns, v, d),
    }  # fmt: skip
    return TwinParams(
        control=_control(rig, d), names=told_of(rig, d), radial=len(layout.radial), axial=int(layout.axial is not None),
        probes=len(layout.probes), rings=len(layout.rings), planes=len(layout.planes),
        bearings=len(rig.bearings), tick=n.tick_s, period=n.period_ticks,
        readings=int(rig.binding.samples == "reading"), free_tilt=float(free.tilts), free_radial=free.radial,
        coil_limit=n.current_limit, own_slew=d["own_slew"], trip_current=n.set("trip_current", 1.15 * n.current_limit),
        trip_speed=n.set("trip_speed", 1.1 * rig.envelope.max_speed_rad_s), **parts,  # type: ignore[arg-type]
    )  # fmt: skip


def _control(rig: RigFile, d: Numbers) -> TwinControl:
    """With integrators as slow as planted, also where no parameter sets them."""
    control = control_of(rig)
    if d["integrator_factor"] == 1.0:  # the cached one, as it is
        return control
    return replace(control, ki=tuple(d["integrator_factor"] * ki for ki in control.ki))


def padded(values: Sequence[float], length: int, fill: float = 0.0) -> Many:
    """As many numbers as the core has."""
    return (*values, *(fill for _ in range(length - len(values))))


def _shaft(c: Columns, v: Numbers) -> dict[str, object]:
    shaft, g = c.rig.shaft, c.geometry
    assert shaft is not None

    def number(key: str, other: float) -> float:
        stated = getattr(shaft, key)
        return v.get(key, other) if stated is None else g.number(stated, f"shaft.{key}")

    tilt = number("tilt", v.get("tilt", 0.0))
    down = v["site.gravity"]
    coupling = c.rig.coupling
    stiffness = offset = 0.0
    if coupling is not None:
        stiffness = 0.0 if coupling.stiffness is None else g.number(coupling.stiffness, "coupling.stiffness")
        offset = 0.0 if coupling.offset is None else g.number(coupling.offset, "coupling.offset")
    return {
        "mass": number("mass", 0.0), "inertia": number("transverse_inertia", 0.0),
        "polar_inertia": number("polar_inertia", 0.0),
        "gravity": (-down * math.sin(tilt) * c.layout.sense, -down * math.cos(tilt), 0.0),
        "coupling": stiffness, "coupling_at": g.station("coupling") if coupling is not None else 0.0,
        "coupling_offset": (offset, v.get("coupling_offset_z", 0.0)), "viscous": v["viscous"], "coulomb": v["coulomb"],
    }  # fmt: skip


def _bearings(c: Columns, v: Numbers, d: Numbers) -> dict[str, object]:
    """Coils that are exchanged pull the other way, as if the axis looked there."""
    layout, order = c.layout, {name: k for k, name in enumerate(c.rig.bearings)}
    ways = [-1.0 if d.get(f"exchange_coils.{a.name}") else 1.0 for a in layout.axes]
    rows = [tuple(w * x for x in c.axis(a)) for a, w in zip(layout.radial, ways, strict=False)]

    def each(key: str) -> Many:
        return tuple(v[f"{key}.{a.name}"] for a in layout.axes)

    offsets = tuple(w * x for w, x in zip(ways, each("magnetic_offset"), strict=True))
    gaps = tuple(c.gap(a) for a in layout.axes)
    many = len(layout.radial)
    last = layout.axial is not None
    return {
        "axis": columnwise(rows, AXES, 8), "beta": padded(each("beta")[:many], AXES), "gap": padded(gaps[:many], AXES, 1.0),
        "offset": padded(offsets[:many], AXES), "beta_x": each("beta")[-1] if last else 0.0,
        "gap_x": gaps[-1] if last else 1.0, "offset_x": offsets[-1] if last else 0.0,
        "sense_x": layout.sense * ways[-1] if last else 1.0, "bearing": tuple(order[a.bearing] for a in layout.axes),
        "coils": tuple(len(a.coils) for a in layout.axes), "inductance": padded(each("inductance"), AXES, 1.0),
    }  # fmt: skip


def columnwise(rows: Sequence[Many], wide: int, coordinates: int) -> Many:
    """Rows by part to a table coordinate by coordinate, each padded."""
    return tuple(x for j in range(coordinates) for x in padded([row[j] for row in rows], wide))


def _planes(c: Columns, v: Numbers) -> dict[str, object]:
    names = [short(part) for part in c.layout.planes]
    return {
        "plane": padded([c.geometry.station(part) for part in c.layout.planes], PLANES),
        "unbalance": padded([v[f"unbalance.{name}"] for name in names], PLANES),
        "unbalance_phase": padded([v[f"unbalance_phase.{name}"] for name in names], PLANES),
    }  # fmt: skip


def _contact(c: Columns, v: Numbers) -> dict[str, object]:
    keys = ("ring_stiffness", "ring_damping", "ring_friction", "ring_radius")
    return {
        "ring": padded([c.geometry.station(r.part) for r in c.layout.rings], RINGS),
        "clearance": padded(c.clearances, RINGS, 1.0), "stop": c.stop, **{key: v[key] for key in keys},
    }  # fmt: skip


def _flexible(c: Columns, v: Numbers) -> dict[str, object]:
    """Off where nothing switches a mode on: shapes and modal mass are those of a uniform beam with free ends."""
    on = (c.nominal.set("mode_1_on", 0.0), c.nominal.set("mode_2_on", 0.0))
    shapes = [c.shape(c.geometry.station(part)) for part in c.layout.planes]
    rings = [c.shape(c.geometry.station(r.part)) for r in c.layout.rings]
    quarter = c.nominal.mass / 4
    return {
        "mode_on": on, "mode_hz": (v["mode_1"], v["mode_2"]), "mode_damping": (v["mode_damping"], v["mode_damping"]),
        "mode_mass": (quarter, quarter), "shape_plane": padded([x for s in shapes for x in s], 2 * PLANES),
        "shape_ring": padded([x for s in rings for x in s], 2 * RINGS),
        "shape_coupling": c.shape(c.geometry.station("coupling")) if c.rig.coupling is not None else (0.0, 0.0),
    }  # fmt: skip


def _amplifiers(c: Columns, v: Numbers) -> dict[str, object]:
    def sided(channels: Callable[[AxisPart], tuple[str, ...]], key: str, other: float) -> Many:
        sides = [
            [v.get(f"{channels(a)[k]}.{key}", other) if k < len(channels(a)) else other for a in c.layout.axes]
            for k in (0, 1)
        ]
        return tuple(x for side in sides for x in padded(side, AXES, other))

    n = c.nominal
    return {
        "amplifier_rate": 2 * math.pi * v["amplifier_hz"], "resistance": v["resistance"], "u_max": v["supply_V"],
        "current_noise": v["current_noise"], "current_lsb": n.set("current_lsb", 10 / 3 * n.current_limit / 65536),
        "current_gain": sided(lambda a: a.coils, "gain", 1.0), "current_offset": sided(lambda a: a.coils, "offset", 0.0),
        "voltage_gain": sided(lambda a: a.voltages, "gain", 1.0), "voltage_offset": sided(lambda a: a.voltages, "offset", 0.0),
    }  # fmt: skip


def _probes(c: Columns, v: Numbers, d: Numbers) -> dict[str, object]:
    """Probes that are exchanged give each other's readings, with the errors of the channels where they arrive."""
    layout, rig = c.layout, c.rig
    seen = list(layout.probes)
    for k, one in enumerate(layout.probes):
        for other in layout.probes[k + 1 :]:
            if d.get(f"exchange_probes.{one}.{other}"):
                a, b = layout.probes.index(one), layout.probes.index(other)
                seen[a], seen[b] = seen[b], seen[a]
    rows = [c.probe(name) for name in seen]
    waves = [[c.runout(name, order) for name in seen] for order in ORDERS]
    channels = [rig.probes[name].channel for name in layout.probes]
    lsb = c.nominal.set("position_lsb", 2 * v["position_range"] / 65536)
    hummed = [
        d["hum"] * (d["hum_probe"] in (0, k + 1)) * (name in layout.looking) for k, name in enumerate(layout.probes)
    ]
    return {
        "probe": columnwise([row[:8] for row in rows], PROBES, 8), "probe_x": padded([row[8] for row in rows], PROBES),
        "position_gain": padded([v[f"{ch}.gain"] for ch in channels], PROBES, 1.0),
        "position_offset": padded([v[f"{ch}.offset"] for ch in channels], PROBES),
        "position_sign": padded([rig.probes[p].sign * d[f"probe_sign.{p}"] for p in layout.probes], PROBES, 1.0),
        "position_noise": padded([c.noise(ch) for ch in channels], PROBES), "position_lsb": lsb,
        "position_range": v["position_range"], "hum": padded(hummed, PROBES), "hum_hz": d["hum_hz"] if d["hum"] else 0.0,
        "runout_c": tuple(x for order in waves for x in padded([w[0] for w in order], PROBES)),
        "runout_s": tuple(x for order in waves for x in padded([w[1] for w in order], PROBES)),
    }  # fmt: skip


def _mark(c: Columns, v: Numbers, d: Numbers) -> dict[str, object]:
    """The shaft's angle is its mark's, counted from y; the pulse comes when the mark is at its direction."""
    keys = ("pulse_missing", "pulse_doubled", "pulse_last", "loose_speed", "loose_shift")
    return {"pulse_angle": -c.mark, "start_angle": v["start_angle"], **{key: d[key] for key in keys}}
