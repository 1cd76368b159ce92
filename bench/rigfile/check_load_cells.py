"""Load cells that lead somewhere: axes that there are, channels in their unit, arms that are lengths."""

from __future__ import annotations

from collections.abc import Iterator

from bench import units
from bench.rigfile.capabilities_of_cells import LoadCell
from bench.rigfile.check_current_steps import Line, near
from bench.rigfile.model import RigFile

LENGTHS = "geometry/"
CROSS = {("N", "N"): "1", ("N m", "N m"): "1", ("N", "N m"): "1/m", ("N m", "N"): "m"}
"""Unit of what a cell reads of another one's load, by the units of both."""


def problems_of(rig: RigFile) -> Iterator[Line]:
    """Each with its key, what was found and what is expected."""
    cells = rig.capabilities.load_cells
    for name, cell in cells.items():
        encoder = rig.encoders.get(name)
        if encoder is None:
            yield f"load_cells.{name}", name, f"an axis: one of [encoders]{near(name, rig.encoders)}"
            continue
        for key, found, expected in (*_one(rig, cell, _turns(rig, name)), *_cross(rig, name, cell)):
            yield f"load_cells.{name}.{key}", found, expected


def _turns(rig: RigFile, axis: str) -> bool:
    return axis in rig.encoders and rig.encoders[axis].measures == "angle"


def reads(cell: LoadCell, turns: bool) -> str:
    """The SI unit of what it shows: N m of a transducer around."""
    return "N m" if turns and not cell.arm else "N"


def _one(rig: RigFile, cell: LoadCell, turns: bool) -> Iterator[Line]:
    si = reads(cell, turns)
    if cell.channel and cell.channel not in rig.channels:
        yield "channel", repr(cell.channel), f"a channel of this file{near(cell.channel, rig.channels)}"
    elif cell.channel and units.UNITS[rig.channels[cell.channel].unit].si != si:
        yield "channel", f"{cell.channel}, in {rig.channels[cell.channel].unit}", f"a channel in {si}"
    if cell.unit and (cell.unit not in units.UNITS or units.UNITS[cell.unit].si != si):
        yield "unit", cell.unit, f"a unit of {si}"
    if cell.arm and not turns:
        yield "arm", cell.arm, "none: the axis goes along"
    elif cell.arm and cell.arm.removeprefix(LENGTHS) not in rig.geometry:
        yield (
            "arm",
            cell.arm,
            f"a length of this file, {LENGTHS}NAME{near(cell.arm.removeprefix(LENGTHS), rig.geometry)}",
        )
    if cell.gain.unit != "1" or cell.gain.value <= 0:
        yield (
            "gain",
            f"{cell.gain.value:g} {cell.gain.unit}",
            "a positive number without unit; sign = -1 turns it round",
        )
    if cell.noise is not None and (cell.noise.unit != si or cell.noise.value != 0):
        yield "noise", f"{cell.noise.value:g} {cell.noise.unit}", f"a value of 0 in {si}, with how far it may be off"
    give = "rad/(N m)" if turns else "m/N"
    if cell.give.unit != give or cell.give.value < 0:
        yield "give", f"{cell.give.value:g} {cell.give.unit}", f"0 or more, in {give}"


def _cross(rig: RigFile, name: str, cell: LoadCell) -> Iterator[Line]:
    others = {n: c for n, c in rig.capabilities.load_cells.items() if n != name}
    for other, number in cell.cross.items():
        if other not in others:
            yield f"cross.{other}", other, f"another axis with a load cell{near(other, others)}"
            continue
        expected = CROSS[reads(cell, _turns(rig, name)), reads(others[other], _turns(rig, other))]
        if number.unit != expected:
            yield f"cross.{other}", f"{number.value:g} {number.unit}", f"a number in {expected}"
