"""What a rig file leaves open of its twin, by documented rules (docs/reference/twin.md), and what `[simulation]` sets of it.

A key of `[simulation]` is a toleranced number, which is drawn for each machine, or a plain one, which is taken. One that holds
for several axes, probes or planes is drawn for each by itself, as `beta.u1`; a table, or a key such as `beta_u1`, states one
of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

from bench.rigfile import RigFile
from bench.rigfile.places import Places
from bench.rigfile.supports import once_per_rig
from bench.rigfile.toleranced import Toleranced
from sim_backend.machines.twin.layout import drawn_as, layout_of
from sim_backend.machines.twin.nominal import Nominal, nominal_of, polar, set_in, transverse

BY_RULE = "docs/reference/twin.md, what a rig file leaves open"
GRADE_M_S = 2.5e-3  # balancing grade G 2.5 of ISO 21940-11
RUNOUT_M = (2e-6, 1e-6, 5e-7, 3e-7)
RUNOUT_RMS = math.sqrt(sum(a * a for a in RUNOUT_M) / 2)
ORDERS = (1, 2, 3, 4)


def rectangular(value: float, unit: str, half_width: float = 0.0) -> Toleranced:
    """A number by rule."""
    return _toleranced(value, unit, half_width, BY_RULE)


def _toleranced(value: float, unit: str, half_width: float, source: str) -> Toleranced:
    stated = {
        "value": value,
        "unit": unit,
        "half_width": abs(half_width),
        "distribution": "rectangular",
        "source": source,
    }
    return Toleranced.model_validate(stated)


def _beta(n: Nominal, k: int) -> Toleranced:
    return rectangular(n.beta(k), "N m^2/A^2", 0.05 * n.beta(k))


def _inductance(n: Nominal, k: int) -> Toleranced:
    """What the force constant implies: 2 beta / gap."""
    value = 2 * n.beta(k) / n.gap(n.layout.axes[k].bearing)
    return rectangular(value, "H", 0.05 * value)


def _offset(n: Nominal, k: int) -> Toleranced:
    axis = n.layout.axes[k]
    return rectangular(0.0, "m", 0.02 * n.gap(axis.bearing) if axis is not n.layout.axial else 0.0)


def _unbalance(n: Nominal, _: int) -> Toleranced:
    """Of grade G 2.5 at the envelope's speed, an equal part in each plane; of 3 um where there is none."""
    speed = n.rig.envelope.max_speed_rad_s
    away = min(GRADE_M_S / speed, 1e-5) if math.isfinite(speed) else 3e-6
    value = n.mass * away / len(n.layout.planes)
    return rectangular(0.75 * value, "kg m", 0.25 * value)


def _drive_limit(n: Nominal) -> float:
    """300 rad/s^2 of the polar inertia; less where the envelope lets a drive give less."""
    most = n.rig.envelope.max_drive_torque_Nm
    return min(300.0 * polar(n), math.inf if most is None else 0.85 * most)


def _amplifier(n: Nominal, _: int) -> Toleranced:
    """To within what the rig file states of its loop delay: d(1/T) = -dT/T^2."""
    told = n.rig.capabilities.loop_delay
    if told is None:
        return rectangular(n.amplifier_hz, "Hz", 0.05 * n.amplifier_hz)
    share = n.amplifier_hz / (told.value - n.tick_s)
    spread = {
        key: None if was is None else was * share for key, was in (("u", told.u), ("half_width", told.half_width))
    }
    return told.model_copy(update={"value": n.amplifier_hz, "unit": "Hz", "id": "", **spread})


def _runout(order: int) -> Callable[[Nominal, int], Toleranced]:
    def of(n: Nominal, _: int) -> Toleranced:
        """As large in all as `[shaft] runout` says, rms."""
        shaft, scale = n.rig.shaft, 1.0
        if shaft is not None and shaft.runout is not None:
            stated = n.geometry.places.number(shaft.runout, "shaft.runout").number
            scale = (abs(stated.value) or stated.standard_uncertainty) / RUNOUT_RMS
        value = scale * RUNOUT_M[order - 1]
        return rectangular(value, "m", value / 2)

    return of


def _by_hand(n: Nominal) -> Toleranced:
    """As `[shaft] hand_angle` says, else within a degree."""
    shaft = n.rig.shaft
    if shaft is not None and shaft.hand_angle is not None:
        return n.geometry.places.number(shaft.hand_angle, "shaft.hand_angle").number
    return rectangular(0.0, "rad", math.radians(1.0))


def _any(_: Nominal, __: int) -> Toleranced:
    return rectangular(0.0, "rad", math.pi)


def _constant(value: float, unit: str, share: float = 0.0) -> Callable[[Nominal, int], Toleranced]:
    return lambda n, k: rectangular(value, unit, share * value)


def _of(make: Callable[[Nominal], float], unit: str, share: float = 0.0) -> Callable[[Nominal, int], Toleranced]:
    return lambda n, k: rectangular(make(n), unit, share * make(n))


Rule = Callable[[Nominal, int], Toleranced]
BY_AXIS: Mapping[str, Rule] = {"beta": _beta, "magnetic_offset": _offset, "inductance": _inductance}
BY_PLANE: Mapping[str, Rule] = {"unbalance": _unbalance, "unbalance_phase": _any}
BY_JOURNAL: Mapping[str, Rule] = {
    **{f"runout_{n}": _runout(n) for n in ORDERS},
    **{f"runout_phase_{n}": _any for n in ORDERS},
}
ONCE: Mapping[str, Rule] = {
    "resistance": _constant(1.0, "Ohm", 0.05),
    "amplifier_hz": _amplifier,
    "viscous": _of(lambda n: polar(n) / 100.0, "N m s/rad", 0.2),
    "coulomb": _of(lambda n: 0.2 * polar(n), "N m", 0.2),
    "drive_gain": _of(lambda n: 20.0 * polar(n), "N m s/rad", 0.1),
    "drive_limit": _of(lambda n: _drive_limit(n), "N m", 0.05),
    "drive_ramp": _of(lambda n: _drive_limit(n) / polar(n) / 1.5, "rad/s^2", 0.02),
    "pulse_angle": _any,
    "start_angle": _any,
    "hand_angle": lambda n, k: _by_hand(n),
    "ring_stiffness": _of(lambda n: 5e6 * n.mass, "N/m"),
    "ring_damping": _of(lambda n: 500.0 * n.mass, "N s/m"),
    "ring_friction": _constant(0.1, "1"),
    "ring_radius": _of(lambda n: math.sqrt(2 * polar(n) / n.mass), "m"),
    "mode_1": _of(lambda n: n.set("mode_1", 1.0), "Hz"),
    "mode_2": _of(lambda n: n.set("mode_2", 1.0), "Hz"),
    "mode_damping": _constant(2e-3, "1", 0.5),
    "current_noise": _of(lambda n: n.current_limit / 1500, "A"),
    "position_range": _of(lambda n: 2.5 * n.reach, "m"),
    "supply_V": _of(lambda n: 48.0, "V"),
}
"""Each is a key of `[simulation]` too. Toleranced by rule, drawn by the key's name, for axes, planes and journals with a
dot and theirs."""


@once_per_rig
def drawn(rig: RigFile) -> dict[str, Toleranced]:
    """Every number of the twin that is drawn, by its name: the rig file's by identity ("/" as "."), its sensors' by channel,
    and those of the tables above."""
    out = {
        drawn_as(name): t for name, t in Places(rig).known.items() if not name.startswith(("sensors/", "capabilities/"))
    }
    n = nominal_of(rig)
    out |= dict(_sensors(n)) | dict(_shaft(n)) | dict(_open(n))
    return out


def _shaft(n: Nominal) -> Iterator[tuple[str, Toleranced]]:
    """What of the shaft is by rule, or set."""
    shaft = n.rig.shaft
    assert shaft is not None
    for name, make, unit in (("transverse_inertia", transverse, "kg m^2"), ("polar_inertia", polar, "kg m^2"),
                             ("mass", lambda n: n.mass, "kg")):  # fmt: skip
        if getattr(shaft, name) is None:
            yield name, _stated(n, name, "", rectangular(make(n), unit))


def _sensors(n: Nominal) -> Iterator[tuple[str, Toleranced]]:
    """Gain and offset of each channel: by its certificate, else of a plain sensor of its kind."""
    kinds = [(n.rig.probes[p].channel, "m", 0.02, 1e-5) for p in n.layout.probes]
    kinds += [(coil, "A", 0.005, n.current_limit / 600) for a in n.layout.axes for coil in a.coils]
    kinds += [(volt, "V", 0.01, 0.05) for a in n.layout.axes for volt in a.voltages]
    for channel, unit, gain, offset in kinds:
        sensor = n.rig.sensors.get(channel)
        yield f"{channel}.gain", rectangular(1.0, "1", gain) if sensor is None else sensor.gain
        yield f"{channel}.offset", rectangular(0.0, unit, offset) if sensor is None else sensor.offset


def _open(n: Nominal) -> Iterator[tuple[str, Toleranced]]:
    layout = layout_of(n.rig)
    for key, rule in BY_AXIS.items():
        for k, axis in enumerate(layout.axes):
            exempt = key == "magnetic_offset" and axis is layout.axial and not n.own(key, axis.name)
            yield f"{key}.{axis.name}", rule(n, k) if exempt else _stated(n, key, axis.name, rule(n, k))
    for key, rule in BY_PLANE.items():
        for k, part in enumerate(layout.planes):
            yield f"{key}.{short(part)}", _stated(n, key, short(part), rule(n, k))
    for key, rule in BY_JOURNAL.items():
        shared = "runout_phase" if key.startswith("runout_phase") and key not in n.rig.simulation else key
        for k, probe in enumerate(layout.journals):
            yield f"{key}.{probe}", _stated(n, shared, probe, rule(n, k))
    for key, rule in ONCE.items():
        yield key, _stated(n, key, "", rule(n, 0))


def short(part: str) -> str:
    """A part's name without its table."""
    return part.rpartition("/")[2]


def _stated(n: Nominal, key: str, where: str, rule: Toleranced) -> Toleranced:
    """As `[simulation]` has it, else by rule."""
    found = set_in(n.rig, key, where)
    if isinstance(found, Toleranced):
        return found
    if found is None:
        return rule
    return _toleranced(found, rule.unit, 0.0, "[simulation]")
