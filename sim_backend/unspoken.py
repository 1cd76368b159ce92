"""What of a rig file and its DBC no simulated machine can speak, so that `bench check` and a run say it before the start."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from bench import units
from bench.errors import ConfigError, Problem
from bench.rigfile import RigFile
from bench.rigfile.messages import MessageMap, load_messages
from sim_backend.controller.controls import without_control
from sim_backend.controller.meanings import FAULTS
from sim_backend.machine import Machine
from sim_backend.spoken import own_words, stated_readings, tellable, told_as


def unspoken(rig: RigFile, machine: Machine) -> Iterator[Problem]:
    """Keys that the machine does not know, channels that it has no reading for, a tick or period that is not its own, faults
    that nobody knows. A binding that leads nowhere is told by `bench.rigfile.check`."""
    yield from machine.unknown(rig)
    try:
        messages = load_messages(rig.dbc_text, classic=rig.link.classic)
    except ConfigError:  # told by whoever reads the rig file
        return
    if own_words(messages, machine, rig.binding):
        return
    known = tellable(rig, machine)
    lacking = [name for name in rig.channels if told_as(rig, name, known) is None]
    free = ", ".join(sorted(known - {told_as(rig, n, known) for n in rig.channels}))
    stated = stated_readings(rig)
    for name in lacking:
        if name in stated:
            expected = f"a reading of the simulated {machine.name}, one of {free}"
            yield Problem(rig.path, f"simulation.readings.{name}", repr(stated[name]), expected)
            continue
        found = f"what the simulated {machine.name} has no reading for"
        expected = f'`{name} = "READING"` under [simulation.readings], with one of {free}; or a run with --backend live'
        if _unread(rig, name):
            found += ": no entry of [probes] has this channel"
            expected = f'[probes] with channel = "{name}", where it reads the shaft; {expected}'
        yield Problem(rig.path, f"channels.{name}", found, expected)
    if machine.columns is None:
        yield from _of_time(rig, messages, machine)
        yield from _of_controls(rig, machine)
    yield from _of_faults(rig)


def _unread(rig: RigFile, channel: str) -> bool:
    """Whether a channel is of a position, and no part of the machine is said to read it."""
    unit = units.UNITS.get(rig.channels[channel].unit)
    read = {probe.channel for probe in rig.probes.values()} | {encoder.channel for encoder in rig.encoders.values()}
    return unit is not None and unit.si == "m" and channel not in read


def _of_time(rig: RigFile, messages: MessageMap, machine: Machine) -> Iterator[Problem]:
    tick_s, first = rig.devices["controller"].tick_s, messages.messages.get(rig.binding.telemetry[0])
    if abs(tick_s / machine.tick_s - 1) > 1e-5:
        expected = f"{machine.tick_s:g} s, that of {machine.name}"
        yield Problem(rig.path, "devices.controller.tick_s", f"{tick_s:g} s", expected)
    if first is not None and abs(first.period_s - machine.period_s) > 1e-9:
        expected = f"{machine.period_s:g} s, that of {machine.name}"
        yield Problem(rig.link.dbc, f'BA_ "GenMsgCycleTime" of {first.name}', f"{first.period_s:g} s", expected)


def _of_controls(rig: RigFile, machine: Machine) -> Iterator[Problem]:
    for key, name in without_control(rig, machine):
        expected = "bearings, axes and settings by the names of the shipped rig file, or a twin (`machine` left out)"
        yield Problem(
            rig.path, f"capabilities.{key}", f"{name}, which the simulated {machine.name} would not hear", expected
        )


def _of_faults(rig: RigFile) -> Iterator[Problem]:
    stated = rig.simulation.get("faults", {})
    names = set[str]()
    with suppress(KeyError):  # told by bench.rigfile.check
        names = set(rig.choices("fault").values())
    for fault, name in stated.items() if isinstance(stated, dict) else ():
        if fault not in FAULTS:
            yield Problem(
                rig.path, f"simulation.faults.{fault}", "no fault of the simulation", f"one of {', '.join(FAULTS)}"
            )
        elif name not in names:
            expected = f"a name of the value table of the channel fault: {', '.join(sorted(names)) or 'it has none'}"
            yield Problem(rig.path, f"simulation.faults.{fault}", repr(name), expected)
