"""Axes that are positioned and phases that are tested: encoders, channels and values that lead somewhere."""

from __future__ import annotations

from collections.abc import Iterator

from bench import units
from bench.rigfile.capabilities_of_stages import AXIS_PARAMETERS
from bench.rigfile.check_current_steps import Line, near
from bench.rigfile.model import RigFile
from bench.rigfile.places import PlaceError
from bench.rigfile.stage import is_stage, term_of

CHANNEL_UNITS = {"stroke": {"reference": "m", "asked": "N", "given": "N", "speed": "m/s"},
                 "angle": {"reference": "rad", "asked": "N m", "given": "N m", "speed": "rad/s"}}  # fmt: skip
PARAMETER_UNITS = {
    "stroke": {"target": "m", "rate": "m/s", "rise": "m/s^2", "stiffness": "N/m", "limit": "N"},
    "angle": {"target": "rad", "rate": "rad/s", "rise": "rad/s^2", "stiffness": "N m/rad", "limit": "N m"},
}  # fmt: skip


def problems_of(rig: RigFile) -> Iterator[Line]:
    """Each with its key below `capabilities`, what was found and what is expected; parameters that there are none of are told
    elsewhere."""
    if is_stage(rig) and rig.capabilities.positioning is None:
        yield "positioning", "nothing", "the axes that the device in the role motion positions"
    homed = None if rig.capabilities.positioning is None else rig.capabilities.positioning.homed
    if homed is not None and homed.channel not in rig.channels:
        yield "positioning.homed", repr(homed.channel), f"a channel of this file{near(homed.channel, rig.channels)}"
    yield from _axes(rig)
    yield from _waves(rig)
    yield from _phases(rig)


def encoders_of(rig: RigFile) -> Iterator[Line]:
    """The same of the encoders' own numbers, with keys of the file."""
    for name, encoder in rig.encoders.items():
        unit = "rad" if encoder.measures == "angle" else "m"
        for key, stated in (("pitch", encoder.pitch), ("error", encoder.error)):
            if stated is None:
                continue
            try:
                number = term_of(rig, stated, name, key).number
            except PlaceError as error:
                yield error.key, error.found, error.expected
                continue
            if number.unit != unit:
                yield f"encoders.{name}.{key}", f"a number in {number.unit}", f"a unit of the kind of {unit}"
            elif key == "pitch" and number.value <= 0:
                yield f"encoders.{name}.{key}", f"{number.value:g} {unit}", "a positive number"


def _axes(rig: RigFile) -> Iterator[Line]:
    can = rig.capabilities.positioning
    for name, axis in () if can is None else can.axes.items():
        key = f"positioning.axes.{name}"
        if name not in rig.encoders:
            yield key, name, f"an encoder of this file{near(name, rig.encoders)}"
            continue
        measures = rig.encoders[name].measures
        for what, si in CHANNEL_UNITS[measures].items():
            channel = getattr(axis, what)
            if channel and channel not in rig.channels:
                yield f"{key}.{what}", repr(channel), f"a channel of this file{near(channel, rig.channels)}"
            elif channel and units.UNITS.get(rig.channels[channel].unit, units.UNITS["1"]).si != si:
                yield f"{key}.{what}", f"{channel}, in {rig.channels[channel].unit}", f"a channel in {si}"
        for what, si in PARAMETER_UNITS[measures].items():
            parameter = rig.parameters.get(getattr(axis, what))
            if parameter is not None and parameter.unit != si:
                yield f"{key}.{what}", f"{getattr(axis, what)}, in {parameter.unit}", f"a parameter in {si}"
        used = [p for what in AXIS_PARAMETERS if (p := getattr(axis, what))]
        if twice := next((p for p in used if used.count(p) > 1), ""):
            yield key, f"{twice} twice", "each parameter for one thing"


def _waves(rig: RigFile) -> Iterator[Line]:
    can = rig.capabilities.positioning
    for name, axis in () if can is None else can.axes.items():
        wave = axis.wave
        if wave is None:
            continue
        key = f"positioning.axes.{name}.wave"
        chosen = {"off": wave.off, "sine": wave.sine, "square": wave.square}
        told = {what: value for what, value in chosen.items() if value is not None}
        if len(told) < 2:
            yield key, "off alone", "the value of `sine` or of `square`, or no such table"
        if len({*told.values()}) < len(told):
            yield key, ", ".join(f"{what} = {value:g}" for what, value in told.items()), "a value of its own for each"
        kind = rig.parameters.get(wave.kind)
        for what, value in told.items():
            if kind is not None and not kind.low <= value <= kind.high:
                yield f"{key}.{what}", f"{value:g}", f"{kind.low:g} to {kind.high:g}, the range of {wave.kind}"


def _phases(rig: RigFile) -> Iterator[Line]:
    can = rig.capabilities.phase_test
    if can is None:
        return
    captured = {} if rig.capture is None else rig.capture.channels
    for what, unit in (("voltages", "V"), ("currents", "A")):
        for name, channel in getattr(can, what).items():
            key = f"phase_test.{what}.{name}"
            if name not in can.phases:
                yield key, name, f"a phase of phase_test.phases{near(name, can.phases)}"
            elif channel not in captured:
                yield key, repr(channel), f"a channel of [capture.channels]{near(channel, captured)}"
            elif captured[channel].unit != unit:
                yield key, f"{channel}, in {captured[channel].unit}", f"a channel in {unit}"
    chooses, taken = rig.parameters.get(can.phase), dict[float, str]()
    for name, value in (("off", can.off), *can.phases.items()):
        key = "phase_test.off" if name == "off" else f"phase_test.phases.{name}"
        if chooses is not None and not chooses.low <= value <= chooses.high:
            yield key, f"{value:g}", f"{chooses.low:g} to {chooses.high:g}, the range of {can.phase}"
        if (first := taken.setdefault(value, name)) != name:
            yield key, f"{value:g}", f"a value of its own: it is that of {first}"
