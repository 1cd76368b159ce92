"""Machines that a rig file can almost describe, and that nothing here measures: `bench check` refuses each by its name, so that
nobody fills in a file that no procedure can take (docs/reference/rig-file.md, "What a rig file cannot say").

Such a file can be read all the same: `bench listen` hears its controller, and recordings with it open.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress

from bench.errors import ConfigError, Problem
from bench.rigfile.check_capabilities import SPEED_ALONE
from bench.rigfile.elements import Bearing
from bench.rigfile.model import RigFile

ONE_WAY = 0.1  # of its greatest current: a signal that reaches farther below zero is no current of a single coil


def beyond(rig: RigFile) -> Iterator[Problem]:
    """Each with its key, what was found and what is expected; none of a file of schema 1, which knows two machines."""
    if rig.written_in > 1:
        for key, found, expected in (*_bearings(rig), *_coils(rig), *_turned_by_speed(rig)):
            yield Problem(rig.path, key, found, expected)


Line = tuple[str, str, str]


def _radial(rig: RigFile) -> dict[str, Bearing]:
    return {name: b for name, b in rig.bearings.items() if b.kind == "radial"}


def _bearings(rig: RigFile) -> Iterator[Line]:
    """A shaft floats in two radial bearings of two axes each; what has one axis in all is no shaft."""
    radial = _radial(rig)
    if not radial or [len(b.axes) for b in radial.values()] == [1]:
        return
    if len(radial) == 1:
        (name,) = radial
        yield ("bearings", f"one radial bearing, {name}",
               "two: a shaft whose other end runs in a mechanical bearing, or is held by its coupling, is not measured (a "
               "machine of one axis in all is)")  # fmt: skip
    elif len(radial) > 2:
        yield "bearings", f"{len(radial)} radial bearings, {', '.join(radial)}", "two: no shaft in more is measured"
    for name, b in radial.items():
        if len(radial) == 2 and len(b.axes) != 2:
            yield (f"bearings.{name}.axes", _listed(list(b.axes)),
                   "two axes: a bearing of three poles, or one that pulls one way, is not measured")  # fmt: skip


def _coils(rig: RigFile) -> Iterator[Line]:
    """A current that goes both ways is what the law asks for, or what one amplifier drives through both coils; each coil's own
    is asked for."""
    shafts = len(_radial(rig)) > 1 or any(len(b.axes) > 1 for b in _radial(rig).values())
    for b, bearing in rig.bearings.items():
        for a, axis in bearing.axes.items():
            if len(axis.coils) != 1:
                continue
            key, (channel,) = f"bearings.{b}.axes.{a}.coils", axis.coils
            both = "two channels, the current of the coil that pulls to the positive side and that of the other"
            if shafts and bearing.kind == "radial":
                yield key, f"{channel} alone", f"{both}: a control current, one channel with a sign, is not taken"
            elif _both_ways(rig, channel):
                yield (key, f"{channel} alone, which its DBC lets go below zero",
                       f"{both}, or that of a single coil, which has no sign: a control current is not taken")  # fmt: skip


def _both_ways(rig: RigFile, channel: str) -> bool:
    """Whether the DBC states a range of a channel that reaches below zero as a control current does."""
    with suppress(ConfigError, KeyError):
        message, _, signal = rig.channels[channel].signal.partition(".")
        s = rig.messages[message].signal(signal)
        return s.low is not None and s.high is not None and s.low < -ONE_WAY * s.high
    return False


def _turned_by_speed(rig: RigFile) -> Iterator[Line]:
    """The controller's own motor is turned by its angle; who sets a speed alone is a drive."""
    controller = rig.devices.get("controller")
    if controller is None or rig.capabilities.angle is not None:
        return
    said: Sequence[tuple[str, str, bool]] = (
        ("devices.controller.roles", "rotation", "rotation" in controller.roles),
        ("devices.controller.binding.commands.SPIN", "a command", "SPIN" in controller.binding.commands),
    )
    for key, found, there in said:
        if there:
            ref = "`ref` in [capabilities.angle], the parameter of the angle that the motor holds"
            yield key, f"{found}, and no [capabilities.angle]", f"{ref}: {SPEED_ALONE}"
            return


def _listed(names: Sequence[str]) -> str:
    return f"{len(names)}, {', '.join(names)}"
