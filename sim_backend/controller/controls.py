"""Which controls of the simulated plant, and of its controller, the parameters of a rig file are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from bench import catalogue
from bench.rigfile import RigFile, load_rig
from bench.rigfile.capabilities import Capabilities
from bench.rigfile.former_parameters import capabilities_by_name
from sim_backend.machine import Machine
from sim_backend.spoken import channels_by_reading

Place = tuple[str, ...]

OWN: Final = {"watchdog_s": 0.08, "landing_speed": 5.0, "speed_ref": 0.0, "lift_time_s": 1.0}
"""Controls of the controller itself, SI, with what they are where no parameter of the rig sets them and `[simulation]` says
nothing else; of these the plant takes `lift_time_s` too. `speed_ref` acts on SPIN."""


@dataclass(frozen=True, slots=True)
class Control:
    """A control by its name. `values`: what it is set to for each value of the parameter, where that is another number;
    -1 for any that is not among them."""

    name: str
    values: Mapping[int, float] | None = None

    def of(self, value: float) -> float:
        """What the control is set to for a value of the parameter."""
        return value if self.values is None else self.values.get(round(value), -1.0)


def controls(rig: RigFile, machine: Machine) -> Mapping[str, tuple[Control, ...]]:
    """The controls that each parameter sets, by the parameter's name.

    What `[capabilities]` bind are the controller's own (OWN) and, for a machine that is made of the rig file, those of its
    plant: `ref.AXIS`, `ref.x` to `ref.theta`, `slew`, `bias.BEARING`, `kp.AXIS`, `inject.axis`, `path.on` and the like. With
    the machines `tsbs` and `amb5dof` they are those that the protocol's names mean. Any other parameter is the control of its
    own name.
    """
    bound: dict[str, list[Control]] = {}
    of_plant = _of_plant(rig) if machine.columns is not None else _by_meaning(rig, machine)
    for name, control in (*_own(rig), *of_plant):
        if name in rig.parameters and control not in bound.get(name, ()):
            bound.setdefault(name, []).append(control)
    return {name: tuple(bound.get(name, (Control(name),))) for name in rig.parameters}


def in_force(rig: RigFile, machine: Machine, settings: Mapping[str, float]) -> dict[str, float]:
    """Parameters' values by the machine's own names beside the rig's: the file's defaults, then `settings`."""
    used = {**{name: p.default for name, p in rig.parameters.items()}, **settings}
    chosen = controls(rig, machine)
    return {**used, **{c.name: c.of(value) for name, value in used.items() for c in chosen.get(name, ())}}


def meanings(rig: RigFile, machine: Machine) -> Capabilities:
    """What the controls of a machine with a law of its own, and the bits of its status word `flags`, are."""
    axes = [axis for bearing in rig.bearings.values() for axis in bearing.axes]
    bearings = {name: b.model_dump() for name, b in rig.bearings.items()}
    known = dict.fromkeys((*machine.controls, *OWN))
    return Capabilities.model_validate(capabilities_by_name(known, {"flags": {}}, bearings, dict(rig.rings), axes))


def _by_meaning(rig: RigFile, machine: Machine) -> Iterator[tuple[str, Control]]:
    """Where a rig file binds a capability to a parameter of another name than the machine's own has for it."""
    known = frozenset((*machine.controls, *OWN))
    if others := {place: name for place, name in _bound(rig).items() if name not in known}:
        meant = _meant(rig, machine)
        by_name = {name for place, name in others.items() if place in meant and not place[-1].isdigit()}
        for (
            place,
            name,
        ) in others.items():  # a setting may have its parameters in another order: a name's own place counts
            if place in meant and not (place[-1].isdigit() and name in by_name):
                yield name, Control(meant[place])


def without_control(rig: RigFile, machine: Machine) -> Iterator[tuple[str, str]]:
    """Capabilities that a machine with a law of its own does not have, by their keys, and the parameters that are bound to
    them: of bearings, axes and settings that it knows by other names."""
    known = frozenset((*machine.controls, *OWN, *rig.channels))  # a channel may be called like a parameter
    if others := {place: name for place, name in _bound(rig).items() if name not in known}:
        meant = _meant(rig, machine)
        heard = {name for place, name in others.items() if place in meant}
        yield from ((".".join(place), name) for place, name in others.items() if name not in heard)


def _meant(rig: RigFile, machine: Machine) -> dict[Place, str]:
    """The machine's own parameter of each place in `[capabilities]`: what the protocol's names mean, and what the shipped rig
    file of the machine's name, where there is one, binds."""
    known = frozenset((*machine.controls, *OWN))
    found = {place: name for place, name in _names(meanings(rig, machine).model_dump(), {}) if name in known}
    shipped = machine.name in {entry.name for entry in catalogue.rigs()}
    return found | _bound(load_rig(machine.name)) if shipped else found


def _bound(rig: RigFile) -> dict[Place, str]:
    """Parameters by their place in `[capabilities]`. Where one is a key, as in a setting, its number is its place: there the
    names are the file's own; where a channel is one, its reading is."""
    reading = {channel: name for name, channel in channels_by_reading(rig).items()}
    return {place: name for place, name in _names(rig.capabilities.model_dump(), reading) if name in rig.parameters}


def _names(table: object, reading: Mapping[str, str], place: Place = ()) -> Iterator[tuple[Place, str]]:
    if isinstance(table, str):
        yield place, table
    elif isinstance(table, Mapping):
        for number, (key, value) in enumerate(table.items()):
            if isinstance(value, int | float):
                yield (*place, str(number)), str(key)
            else:
                yield from _names(value, reading, (*place, reading.get(str(key), str(key))))
    elif isinstance(table, list | tuple):
        for number, value in enumerate(table):
            yield from _names(value, reading, (*place, str(number)))


def _own(rig: RigFile) -> Iterator[tuple[str, Control]]:
    c = rig.capabilities
    speed = "" if c.angle is None else c.angle.speed
    for name, own in ((c.watchdog, "watchdog_s"), (c.landing_speed, "landing_speed"), (c.lift_time, "lift_time_s"),
                      (speed, "speed_ref")):  # fmt: skip
        yield name, Control(own)


def _of_plant(rig: RigFile) -> Iterator[tuple[str, Control]]:
    """Names as `[capabilities]` and the machine's tables have them."""
    c = rig.capabilities
    bearings = sorted(
        rig.bearings.values(), key=lambda b: b.kind == "axial"
    )  # as the plant has them: the axial one last
    axes = [axis for bearing in bearings for axis in bearing.axes]
    for way, table in (("axis", c.set_points.axes), ("shaft", c.set_points.shaft)):
        yield from ((name, Control(f"ref.{way}.{where}")) for where, name in table.items())
    yield from ((c.set_points.slew, Control("slew")), (c.set_points.slew_tilt, Control("slew_tilt")))
    yield from ((name, Control(f"bias.{bearing}")) for bearing, name in c.bias.items())
    for gain, stated in c.gains:
        by_axis = dict.fromkeys(axes, stated) if isinstance(stated, str) else stated
        yield from ((name, Control(f"{gain}.{axis}")) for axis, name in by_axis.items())
    if c.path is not None:
        yield from ((name, Control(f"path.{key}")) for key, name in c.path)
    if c.injection is not None:
        chosen = {round(value): float(axes.index(axis)) for axis, value in c.injection.axes.items() if axis in axes}
        yield c.injection.axis, Control("inject.axis", chosen)
        yield from ((name, Control(f"inject.{key}")) for key, name in c.injection if key not in ("axis", "axes", "off"))
