"""Currents that a controller steps: channels that a capture has, parameters and stated inductances in their units."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterator

from bench import units
from bench.rigfile.capabilities import CurrentStep
from bench.rigfile.model import RigFile

Line = tuple[str, str, str]
PARAMETERS = {"parameter": ("A",), "gain": ("Ohm", "V/A"), "current_limit": ("A",)}
READINGS = {"along": "A", "across": "A", "currents": "A", "voltages": "V", "supply": "V", "still": ""}
STATED = ("inductance", "filter_inductance")


def problems_of(rig: RigFile) -> Iterator[Line]:
    """Each with its key, what was found and what is expected; parameters that there are none of are told elsewhere."""
    taken: dict[str, str] = {}
    for place, step in rig.capabilities.current_steps.items():
        key = f"current_steps.{place}"
        yield from _channels(rig, key, step)
        yield from _parameters(rig, key, step)
        for name in STATED:
            number = getattr(step, name)
            if number and number not in rig.machine:
                yield f"{key}.{name}", repr(number), f"a number of [machine]{near(number, rig.machine)}"
            elif number and rig.machine[number].unit != "H":
                yield f"{key}.{name}", f"{number}, in {rig.machine[number].unit}", "an inductance, in H"
        if (first := taken.setdefault(step.parameter, key)) != key:
            yield f"{key}.parameter", step.parameter, f"one of its own: it is that of {first}"


def _parameters(rig: RigFile, key: str, step: CurrentStep) -> Iterator[Line]:
    for name, fits in PARAMETERS.items():
        parameter = rig.parameters.get(getattr(step, name))
        if parameter is not None and parameter.unit in units.UNITS and units.UNITS[parameter.unit].si not in fits:
            yield f"{key}.{name}", f"{getattr(step, name)}, in {parameter.unit}", f"a parameter in {' or '.join(fits)}"


def _channels(rig: RigFile, key: str, step: CurrentStep) -> Iterator[Line]:
    known = {} if rig.capture is None else rig.capture.channels
    if step.along == step.across:
        yield f"{key}.across", step.across, "another channel than along"
    for name, unit in READINGS.items():
        value = getattr(step, name)
        for channel in (value,) if isinstance(value, str) and value else value:
            if channel not in known:
                yield f"{key}.{name}", repr(channel), f"a channel of [capture]{near(channel, known)}"
            elif unit and known[channel].unit != unit:
                yield f"{key}.{name}", f"{channel}, in {known[channel].unit}", f"a channel in {unit}"


def near(name: str, known: Collection[str]) -> str:
    """The nearest of the names that there are, for a message."""
    close = difflib.get_close_matches(name, known, 1)
    return f", such as {close[0]}" if close else ""
