"""Capabilities that lead somewhere: parameters, channels, axes, bearings and rings that a rig file has, values in range."""

from __future__ import annotations

import re
from collections.abc import Iterator

from bench import units
from bench.errors import Problem
from bench.rigfile.bit import Bit
from bench.rigfile.capabilities import parameters_named
from bench.rigfile.check_coil_map import problems_of as problems_of_coil_map
from bench.rigfile.check_current_steps import near
from bench.rigfile.check_current_steps import problems_of as problems_of_current_steps
from bench.rigfile.check_dc_link import problems_of as problems_of_dc_link
from bench.rigfile.check_force_currents import problems_of as problems_of_force_currents
from bench.rigfile.check_hold import problems_of as problems_of_hold
from bench.rigfile.check_load_cells import problems_of as problems_of_cells
from bench.rigfile.check_reference import problems_of as problems_of_reference
from bench.rigfile.check_stages import problems_of as problems_of_stages
from bench.rigfile.model import RigFile
from bench.rigfile.places import Places

CODES = ("state", "fault")
"""Channels whose numbers are names, no bits."""


def problems_of(rig: RigFile) -> Iterator[Problem]:
    """Each with its key, what was found and what is expected."""
    for key, found, expected in (
        *_parameters(rig),
        *_shared(rig),
        *_names(rig),
        *_values(rig),
        *_motion(rig),
        *_loops(rig),
        *_status(rig),
        *_units(rig),
        *_delay(rig),
        *_angle(rig),
        *problems_of_current_steps(rig),
        *problems_of_hold(rig),
        *problems_of_force_currents(rig),
        *problems_of_coil_map(rig),
        *problems_of_dc_link(rig),
        *problems_of_reference(rig),
        *problems_of_cells(rig),
        *problems_of_stages(rig),
    ):
        yield Problem(rig.path, f"capabilities.{key}", found, expected)


Line = tuple[str, str, str]
SPEED_ALONE = (
    "a motor that takes a speed alone is not turned. Leave this out, and turn the shaft by a device in the role drive"
)
KINDS = {"set_points.axes": "m", "set_points.slew": "m/s", "set_points.slew_tilt": "rad/s", "path.y": "m", "path.z": "m",
         "path.hz": "Hz", "path.phase": "rad", "path.ramp_s": "s", "injection.amplitude": "A", "injection.hz": "Hz",
         "injection.step": "Hz", "loop_injection.hz": "Hz",
         "bias": "A", "angle.ref": "rad", "angle.slew": "rad/s", "angle.speed": "rad/s",
         "motion.place": "m", "motion.place_rate": "m/s", "motion.place_rise": "m/s^2", "motion.angle": "rad",
         "motion.angle_rate": "rad/s", "motion.angle_rise": "rad/s^2", "motion.gate": "m", "motion.gate_time": "s",
         "motion.radial": "m",
         "hold.begin": "s", "hold.push": "A", "hold.bound": "m", "hold.limit": "N",
         "motor.phase_slew": "rad/s", "motor.phase_limit": "rad", "motor.circle": "m", "motor.circle_hz": "Hz",
         "current_limit": "A", "landing_speed": "rad/s", "lift_time": "s", "watchdog": "s"}  # fmt: skip
OWN = {group: re.compile(pattern) for group, pattern in {
    "axes": r"set_points\.axes\..+", "shaft": r"set_points\.shaft\.[xyz]", "tilts": r"set_points\.shaft\.(psi|theta)",
    "probes": r"motion\.radial\..+",
    "loops": r"loop_injection\.loops\..+\.set_point", "targets": r"positioning\.axes\..+\.target",
    "forces": r"force_currents\..+\.added", "motor": r"motor\.(along|across)", "held": r"motor\.ref_(along|across)",
}.items()}  # fmt: skip
"""Capabilities of which each entry has a parameter of its own, in groups that say one thing of a place each. Those of
`current_steps` and `coil_map` are looked at with the rest of theirs."""
COORDINATES = {"x": "m", "y": "m", "z": "m", "psi": "rad", "theta": "rad"}


def _parameters(rig: RigFile) -> Iterator[Line]:
    for key, parameter in parameters_named(rig.capabilities):
        if parameter not in rig.parameters:
            yield key, repr(parameter), f"a parameter of this file{near(parameter, rig.parameters)}"


def _shared(rig: RigFile) -> Iterator[Line]:
    """Two axes that one parameter would move. Gains, limits, rates and a bias may be those of several."""
    taken: dict[tuple[str, str], str] = {}
    for key, parameter in parameters_named(rig.capabilities):
        for group, pattern in OWN.items():
            if pattern.fullmatch(key) and (first := taken.setdefault((group, parameter), key)) != key:
                yield key, parameter, f"a parameter of its own: it is that of {first}"


def _units(rig: RigFile) -> Iterator[Line]:
    """A set point in another unit than its kind's would be taken for it."""
    for key, name in parameters_named(rig.capabilities):
        table, _, last = key.rpartition(".")
        si = COORDINATES.get(last) if table == "set_points.shaft" else KINDS.get(key, KINDS.get(table, ""))
        parameter = rig.parameters.get(name)
        if si and parameter is not None and parameter.unit in units.UNITS and units.UNITS[parameter.unit].si != si:
            yield key, f"{name}, in {parameter.unit}", f"a parameter in {si}"


def _delay(rig: RigFile) -> Iterator[Line]:
    delay, controller = rig.capabilities.loop_delay, rig.devices.get("controller")
    if delay is None:
        return
    if delay.unit != "s":
        yield "loop_delay.unit", delay.unit, "a time"
    elif controller is not None and delay.value <= controller.tick_s:
        longer = f"more than a tick, {controller.tick_s * 1e3:g} ms: it holds computing and the amplifier's lag"
        yield "loop_delay", f"{delay.value * 1e3:g} ms", longer


def _angle(rig: RigFile) -> Iterator[Line]:
    """A motor is turned by its angle; who sets a speed alone is a drive."""
    if rig.capabilities.angle is not None and not rig.capabilities.angle.ref:
        yield "angle.ref", "nothing", f"the parameter of the angle that the motor holds: {SPEED_ALONE}"


def _names(rig: RigFile) -> Iterator[Line]:
    c = rig.capabilities
    axes = [axis for bearing in rig.bearings.values() for axis in bearing.axes]
    injected = () if c.injection is None else c.injection.axes
    gains = [(f"gains.{key}", table) for key, table in c.gains if not isinstance(table, str)]
    for key, named, known in (("set_points.axes", c.set_points.axes, axes), ("injection.axes", injected, axes),
                              *((key, table, axes) for key, table in gains), ("bias", c.bias, rig.bearings),
                              ("status.contact", c.status.contact, _stops(rig))):  # fmt: skip
        for name in named:
            if name not in known:
                what = "an axis" if known is axes else "a bearing" if known is rig.bearings else "a ring"
                yield f"{key}.{name}", name, f"{what} of this file: {', '.join(known) or '(there is none)'}"


def _motion(rig: RigFile) -> Iterator[Line]:
    """Channels that show where the mover is, and what its bearings carry."""
    motion = rig.capabilities.motion
    if motion is None:
        return
    captured = {} if rig.capture is None else rig.capture.channels
    for key, name, si in (
        ("place_channel", motion.place_channel, "m"),
        ("angle_channel", motion.angle_channel, "rad"),
    ):
        if name not in rig.channels:
            yield f"motion.{key}", repr(name), f"a channel of this file{near(name, rig.channels)}"
        elif units.UNITS.get(unit := rig.channels[name].unit, units.UNITS["1"]).si != si:
            yield f"motion.{key}", f"{name}, in {unit}", f"a channel in {si}"
    for name in motion.radial:
        if name not in rig.probes:
            yield f"motion.radial.{name}", repr(name), f"a probe of this file{near(name, rig.probes)}"
    for name in motion.currents:
        if name not in captured:
            yield "motion.currents", repr(name), f"a channel of [capture.channels]{near(name, captured)}"


def _stops(rig: RigFile) -> tuple[str, ...]:
    """What the shaft can touch: the rings, and the axial bearing's stop by the bearing's name."""
    return (*rig.rings, *(name for name, b in rig.bearings.items() if b.kind == "axial" and name not in rig.rings))


def _values(rig: RigFile) -> Iterator[Line]:
    c = rig.capabilities
    for kind, names in c.settings.items():
        if not names:
            yield (
                f"settings.{kind}",
                "no names",
                "what can be chosen, each with the parameters that choose it, or no such table",
            )
        chosen: dict[tuple[tuple[str, float], ...], str] = {}
        for name, values in names.items():
            same = chosen.setdefault(tuple(sorted(values.items())), name)
            if values and same != name:
                yield (
                    f"settings.{kind}.{name}",
                    f"the values of settings.{kind}.{same}",
                    "values of its own: both choose the same",
                )
            if not values:
                yield f"settings.{kind}.{name}", "no values", "the parameters that choose it, with their values"
            for parameter, value in values.items():
                yield from _ranged(rig, f"settings.{kind}.{name}.{parameter}", parameter, value)
    if c.injection is not None:
        for axis, value in (*c.injection.axes.items(), ("off", c.injection.off)):
            key = "injection.off" if axis == "off" else f"injection.axes.{axis}"
            yield from _ranged(rig, key, c.injection.axis, value)
        taken: dict[float, str] = {}
        for axis, value in (("off", c.injection.off), *c.injection.axes.items()):
            if (first := taken.setdefault(value, axis)) != axis:
                yield f"injection.axes.{axis}", f"{value:g}", f"a value of its own: it is that of {first}"


def _loops(rig: RigFile) -> Iterator[Line]:
    """What is injected into position loops, and each of these."""
    can = rig.capabilities.loop_injection
    if can is None:
        return
    yield from _ranged(rig, "loop_injection.off", can.axis, can.off)
    for place, value in can.places.items():
        yield from _ranged(rig, f"loop_injection.places.{place}", can.place, value)
    captured = rig.capture.channels if rig.capture is not None else {}
    if can.wave and can.wave not in captured:
        yield "loop_injection.wave", repr(can.wave), f"a channel of captures{near(can.wave, captured)}"
    taken: dict[float, str] = {can.off: "off"}
    numbers = Places(rig).known
    for name, one in can.loops.items():
        key = f"loop_injection.loops.{name}"
        yield from _ranged(rig, f"{key}.value", can.axis, one.value)
        if (first := taken.setdefault(one.value, name)) != name:
            yield f"{key}.value", f"{one.value:g}", f"a value of its own: it is that of {first}"
        for told in (rig.channels, captured):
            if one.channel not in told:
                yield (
                    f"{key}.channel",
                    repr(one.channel),
                    f"a channel of this file, and of captures{near(one.channel, told)}",
                )
        for part in ("inertia", "stiffness"):
            if (at := getattr(one, part)) and at not in numbers:
                yield f"{key}.{part}", repr(at), f"the place of a number of this file{near(at, numbers)}"
        if one.limited is not None and one.limited.channel not in rig.channels:
            where = one.limited.channel
            yield f"{key}.limited.channel", repr(where), f"a channel of this file{near(where, rig.channels)}"


def _ranged(rig: RigFile, key: str, parameter: str, value: float) -> Iterator[Line]:
    p = rig.parameters.get(parameter)
    if p is not None and not p.low <= value <= p.high:
        yield key, f"{value:g}", f"{p.low:g} to {p.high:g}, the range of {parameter}"


def _status(rig: RigFile) -> Iterator[Line]:
    status = rig.capabilities.status
    bits: list[tuple[str, Bit]] = [(f"status.contact.{ring}", bit) for ring, bit in status.contact.items()]
    bits += [(f"status.{key}", bit) for key, bit in status if isinstance(bit, Bit)]
    taken: dict[tuple[str, int | None], str] = {}
    for key, bit in bits:
        if bit.channel not in rig.channels:
            yield f"{key}.channel", repr(bit.channel), f"a channel of this file{near(bit.channel, rig.channels)}"
        elif bit.channel in CODES or units.UNITS.get(rig.channels[bit.channel].unit, units.UNITS["1"]).si != "1":
            yield f"{key}.channel", f"{bit.channel}, in {rig.channels[bit.channel].unit}", "a channel of bits, in 1"
        if (first := taken.setdefault((bit.channel, bit.mask), key)) != key:
            yield key, f"{bit.channel}, mask {bit.mask}", f"a bit of its own: it is that of {first}"
