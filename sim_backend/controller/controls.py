"""Which controls of the simulated plant, and of its controller, the parameters of a rig file are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from bench.rigfile import RigFile
from sim_backend.machine import Machine

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
    plant: `ref.AXIS`, `ref.x` to `ref.theta`, `slew`, `bias.BEARING`, `kp.AXIS`, `inject.axis`, `path.on` and the like. Any
    other parameter is the control of its own name: with the machines `tsbs` and `amb5dof` that is each.
    """
    bound: dict[str, list[Control]] = {}
    for name, control in (*_own(rig), *(_of_plant(rig) if machine.columns is not None else ())):
        if name in rig.parameters:
            bound.setdefault(name, []).append(control)
    return {name: tuple(bound.get(name, (Control(name),))) for name in rig.parameters}


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
    for table in (c.set_points.axes, c.set_points.shaft):
        yield from ((name, Control(f"ref.{where}")) for where, name in table.items())
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
