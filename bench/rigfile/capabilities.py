"""What a controller can be asked to do, bound to its parameters and signals as commands and states are. Schema 2.

Each is optional: what a controller does not do is left out, and a procedure that needs it says so. Parameters are named as
`[parameters]` has them, channels as `[channels]`, axes, bearings and rings as the machine's tables.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal

from pydantic import Field, model_validator

from bench.rigfile.bit import Bit
from bench.rigfile.capabilities_of_cells import LoadCell
from bench.rigfile.capabilities_of_coils import CoilMap
from bench.rigfile.capabilities_of_loops import CurrentStep, ForceCurrent, Hold, LoopInjection, Motion
from bench.rigfile.capabilities_of_power import DcLink
from bench.rigfile.capabilities_of_reference import ReferenceInstrument
from bench.rigfile.capabilities_of_stages import (
    AXIS_PARAMETERS,
    TEST_PARAMETERS,
    WAVE_PARAMETERS,
    PhaseTest,
    Positioning,
)
from bench.rigfile.elements import Name
from bench.rigfile.part import Part
from bench.rigfile.toleranced import Toleranced

Coordinate = Literal["x", "y", "z", "psi", "theta"]


class SetPoints(Part):
    """Where the rotor is held: `axes` by bearing axis, m at the bearing's plane; `shaft` by coordinate, m of the centre of mass
    and rad about y and z, where y and z are along the axes of the first bearing. `slew` and `slew_tilt`, m/s and rad/s, are
    how fast they are followed (0, or no such parameter: at once)."""

    axes: Mapping[Name, str] = {}
    shaft: Mapping[Coordinate, str] = {}
    slew: str = ""
    slew_tilt: str = ""


class Path(Part):
    """An ellipse on top of the set points: y = `y` sin, z = `z` cos at `hz`, from `phase`, growing in `ramp_s`; `ratio`, turns
    of z in one of y."""

    on: str
    y: str
    z: str
    hz: str
    phase: str = ""
    ramp_s: str = ""
    ratio: str = ""


class Injection(Part):
    """A current that is added to the reference of one axis: parameter `axis` chooses by the value that `axes` has for each,
    `off` none. `amplitude` A of each line, the first at `hz`; `lines` of them, `step` Hz apart; without these, one sine."""

    axis: str
    axes: Mapping[Name, float] = Field(min_length=1)
    off: float = -1.0
    amplitude: str
    hz: str
    lines: str = ""
    step: str = ""


class Holding(Part):
    """A motor that holds an angle: `ref` rad, followed no faster than `slew` rad/s; `speed` rad/s for what turns; `kp` A/rad,
    `ki` A/(rad s), `kd` A s/rad of its PID; `low_pass_hz` of the angle's rate; `derivative_on_error`, 1 where kd acts on it."""

    ref: str = ""  # without one it is refused (`check_capabilities`)
    slew: str = ""
    speed: str = ""
    kp: str = ""
    ki: str = ""
    kd: str = ""
    low_pass_hz: str = ""
    derivative_on_error: str = ""


class Gains(Part):
    """Of the PID that holds each axis: a parameter of all axes, or one by bearing axis. A/m, A/(m s), A s/m."""

    kp: str | Mapping[Name, str] = ""
    ki: str | Mapping[Name, str] = ""
    kd: str | Mapping[Name, str] = ""


class Flatness(Part):
    """A law that inverts the bearings' forces by the controller's model of them: it makes s^3 + k2 s^2 + k1 s + k0 of each
    degree of freedom. Parameters: 1/s^3, 1/s^2, 1/s; `integral`, 1 where k0 acts; `derivative_hz`, low-pass of the rates."""

    k0: str = ""
    k1: str
    k2: str
    integral: str = ""
    derivative_hz: str = ""


class MotorForce(Part):
    """A motor that gives a radial force beside its torque: currents `along` the first axis of the bearings and `across` it, A,
    which follow no faster than `ramp` A/s; `phase` rad by which its field is turned; `ref_along` and `ref_across`, m, where it
    holds its end; `share` of the load that it carries in the
    place of a bearing, which changes no faster than `share_slew` 1/s; `segment_limit`, A; `sine` rad at `sine_hz` on the
    angle. `phase_slew` rad/s, how fast the phase changes (0: at once), and `phase_limit` rad, how far balancing may turn it;
    `circle` m, the radius of a circle about where it holds its end, at `circle_hz`.

    Of such a motor `settings` have the kinds `sharing` (static, priority, half), `lifted_by` (bearing, motor), `torque` (held,
    limit: all that there is until `angle.speed`), `commutation` (late, ahead) and `load_balancing` (off, on)."""

    along: str = ""
    across: str = ""
    ramp: str = ""
    phase: str = ""
    ref_along: str = ""
    ref_across: str = ""
    share: str = ""
    share_slew: str = ""
    segment_limit: str = ""
    allocation: str = ""
    sine: str = ""
    sine_hz: str = ""
    phase_slew: str = ""
    phase_limit: str = ""
    circle: str = ""
    circle_hz: str = ""


class Status(Part):
    """What the controller says of the machine, by its meaning; what it does not say is judged from readings
    (`bench.rigfile.judged`)."""

    contact: Mapping[Name, Bit] = {}
    current_limit: Bit | None = None
    voltage_limit: Bit | None = None
    sensor_range: Bit | None = None
    segment_limit: Bit | None = None


class Capabilities(Part):
    """`bias` is by bearing; `settings` are by kind and name: the parameters that choose it; of kind "law" the first is what a
    lift and a stop go by, unless "lift" says more. `gains` are of the
    laws that are no `flatness`, which is by the name of a law. `model` is what the controller knows of the machine, by meaning.
    `force_currents` are by the motor's name.
    `loop_delay` is from the instant of a reading until the current that answers it has gone 63 % of its way (1 - 1/e): what
    the controller computes, one tick at least, and the amplifier's time constant. `loop_delay_s` is the same in short."""

    set_points: SetPoints = SetPoints()
    path: Path | None = None
    injection: Injection | None = None
    loop_injection: LoopInjection | None = None
    bias: Mapping[Name, str] = {}
    settings: Mapping[Name, Mapping[Name, Mapping[str, float]]] = {}
    angle: Holding | None = None
    motion: Motion | None = None
    hold: Hold | None = None
    motor: MotorForce = MotorForce()
    gains: Gains = Gains()
    flatness: Mapping[Name, Flatness] = {}
    status: Status = Status()
    current_steps: Mapping[Name, CurrentStep] = {}
    force_currents: Mapping[Name, ForceCurrent] = {}
    coil_map: CoilMap | None = None
    dc_link: DcLink | None = None
    reference: Mapping[Name, ReferenceInstrument] = {}
    load_cells: Mapping[Name, LoadCell] = {}
    positioning: Positioning | None = None
    phase_test: PhaseTest | None = None
    model: Mapping[Name, str] = {}
    landing_speed: str = ""
    lift_time: str = ""
    watchdog: str = ""
    current_limit: str = ""
    loop_delay: Toleranced | None = None

    @model_validator(mode="before")
    @classmethod
    def _in_short(cls, data: Any) -> Any:
        """A plain number of seconds, known to a tenth: one that is counted in ticks or read from a data sheet is rounded."""
        value = data.get("loop_delay_s") if isinstance(data, dict) else None
        if not isinstance(value, int | float) or "loop_delay" in data:
            return data
        told = {"value": value, "unit": "s", "half_width": abs(value) / 10, "distribution": "rectangular",
                "source": "capabilities.loop_delay_s, which states no tolerance: a tenth of it"}  # fmt: skip
        return {**{key: of for key, of in data.items() if key != "loop_delay_s"}, "loop_delay": told}


MOVED = ("place", "place_rate", "place_rise", "angle", "angle_rate", "angle_rise", "gate", "gate_time")
"""Keys of a motion that are parameters."""
HELD = ("begin", "across", "push", "bound", "limit")
"""Those of a hold."""
STEP_PARAMETERS = ("parameter", "gain", "current_limit")
FORCE_PARAMETERS = ("added", "zero", "flux", "feedforward")
LOOP_PARAMETERS = ("kp", "ki", "kd", "limit", "set_point")


def parameters_named(c: Capabilities) -> Iterator[tuple[str, str]]:
    """Key and parameter of every one that is bound, in the order of the file's tables."""
    for key, stated in _tables(c):
        if isinstance(stated, str):
            yield from [(key, stated)] if stated else ()
        else:
            yield from ((f"{key}.{name}", parameter) for name, parameter in stated.items())


def _tables(c: Capabilities) -> Iterator[tuple[str, str | Mapping[str, str]]]:
    points, path, injection, angle = c.set_points, c.path, c.injection, c.angle
    yield from (("set_points.axes", points.axes), ("set_points.shaft", {str(k): p for k, p in points.shaft.items()}))
    yield from (("set_points.slew", points.slew), ("set_points.slew_tilt", points.slew_tilt))
    if path is not None:
        yield from ((f"path.{key}", value) for key, value in path)
    if injection is not None:
        yield from ((f"injection.{key}", value) for key, value in injection if key not in ("axes", "off"))
    if c.loop_injection is not None:
        yield from _of_loops(c.loop_injection)
    yield "bias", c.bias
    for kind, names in c.settings.items():
        for name, values in names.items():
            yield f"settings.{kind}.{name}", {parameter: parameter for parameter in values}
    if angle is not None:
        yield from ((f"angle.{key}", value) for key, value in angle)
    if c.motion is not None:
        yield from ((f"motion.{key}", getattr(c.motion, key)) for key in MOVED)
        yield "motion.radial", c.motion.radial
    if c.hold is not None:
        yield from ((f"hold.{key}", getattr(c.hold, key)) for key in HELD)
    yield from ((f"motor.{key}", value) for key, value in c.motor)
    yield from ((f"gains.{key}", value) for key, value in c.gains)
    for law, flat in c.flatness.items():
        yield from ((f"flatness.{law}.{key}", value) for key, value in flat)
    for place, step in c.current_steps.items():
        yield f"current_steps.{place}", {k: v for k in STEP_PARAMETERS if (v := getattr(step, k))}
    for motor, one in c.force_currents.items():
        yield f"force_currents.{motor}", {k: v for k in FORCE_PARAMETERS if (v := getattr(one, k))}
    if c.coil_map is not None:
        yield from _of_coils(c.coil_map)
    if c.positioning is not None:
        yield from _of_axes(c.positioning)
    if c.phase_test is not None:
        yield from ((f"phase_test.{key}", getattr(c.phase_test, key)) for key in TEST_PARAMETERS)
    yield "model", c.model
    for key in ("landing_speed", "lift_time", "watchdog", "current_limit"):
        yield key, getattr(c, key)


def _of_loops(can: LoopInjection) -> Iterator[tuple[str, str | Mapping[str, str]]]:
    yield from ((f"loop_injection.{key}", getattr(can, key)) for key in ("axis", "place", "amplitude", "hz"))
    for name, one in can.loops.items():
        yield from ((f"loop_injection.loops.{name}.{key}", getattr(one, key)) for key in LOOP_PARAMETERS)


def _of_coils(found: CoilMap) -> Iterator[tuple[str, str | Mapping[str, str]]]:
    for name, system in found.systems.items():
        yield from ((f"coil_map.systems.{name}.{key}", getattr(system, key)) for key in ("d", "q", "zero"))
    for axis, values in found.still.items():
        yield f"coil_map.still.{axis}", {name: name for name in values}
    yield "coil_map.lasts", found.lasts


def _of_axes(can: Positioning) -> Iterator[tuple[str, str | Mapping[str, str]]]:
    for name, axis in can.axes.items():
        yield from ((f"positioning.axes.{name}.{key}", getattr(axis, key)) for key in AXIS_PARAMETERS)
        if axis.wave is not None:
            yield from ((f"positioning.axes.{name}.wave.{key}", getattr(axis.wave, key)) for key in WAVE_PARAMETERS)


def is_bound(c: Capabilities, key: str) -> bool:
    """Whether a capability is there, by its key: `set_points`, `injection`, `settings.law`, `model.rate`, `bias`, ..."""
    found: Any = c
    for part in key.split("."):
        found = found.get(part) if isinstance(found, Mapping) else getattr(found, part)
        if found is None:
            return False
    return bool(found.axes or found.shaft) if isinstance(found, SetPoints) else bool(found)
