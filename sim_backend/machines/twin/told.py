"""What the twin tells and by which names: the rig's channels, and places in the core's tables (`AT_...` in twin.h)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from bench.rigfile import RigFile
from bench.rigfile.turned import turned
from sim_backend.machines.twin.layout import Numbers, layout_of

POSITION, PLUS, MINUS, VOLTS_PLUS, VOLTS_MINUS, PEAK = 0, 16, 32, 48, 64, 80
ANGLE, SPEED, PULSES, EDGE, AGE, INJECT, BEFORE, AFTER, CONTACT, AXIAL_CONTACT = (*range(96, 105), 112)
OF_MARK = (("angle", ANGLE), ("speed", SPEED), ("pulses", PULSES), ("edge", EDGE))
NOTHING = 116  # always 0
LIMITS = {"status.current_limit": 113, "status.voltage_limit": 114, "status.sensor_range": 115}
Column = tuple[str, int]


@dataclass(frozen=True)
class Told:
    """Names of axes and bearings in the core's order; columns of a telemetry period's rows and of a tick's readings, each
    with its place in the core; `marked` says whether the rig has a mark, `timed` whether its controller knows the speed."""

    axes: tuple[str, ...]
    bearings: tuple[str, ...]
    of_bearing: tuple[str, ...]
    rows: tuple[Column, ...]
    ticks: tuple[Column, ...]
    marked: bool
    timed: bool
    radial_columns: int


def told_of(rig: RigFile, defects: Numbers) -> Told:
    """Of a rig; planted defects exchange what is told, and nothing else, of two coils or two probes."""
    layout = layout_of(rig)
    told = [*_positions(rig, defects), *_coils(rig, defects), *_voltages(rig)]
    angle = list(_mark(rig))
    inner = [("inject", INJECT), ("before", BEFORE), ("after", AFTER)]
    captured = (*told, *angle, *_inside(rig, [*told, *angle]), *inner)
    rows = [*told, *_peaks(rig), *angle, *inner, *_status(rig, bool(defects.get("contact_silent")))]
    return Told(
        axes=tuple(a.name for a in layout.axes), bearings=tuple(rig.bearings),
        of_bearing=tuple(a.bearing for a in layout.axes), rows=tuple(rows), ticks=captured,
        marked=rig.mark is not None, timed=turned(rig), radial_columns=len(layout.looking),
    )  # fmt: skip


def _positions(rig: RigFile, defects: Numbers) -> Iterator[Column]:
    probes = list(layout_of(rig).probes)
    at = list(range(len(probes)))
    for k, one in enumerate(probes):
        for j, other in enumerate(probes[k + 1 :], k + 1):
            if defects.get(f"told_probes.{one}.{other}"):
                at[k], at[j] = at[j], at[k]
    yield from ((rig.probes[name].channel, POSITION + k) for name, k in zip(probes, at, strict=True))


def _coils(rig: RigFile, defects: Numbers) -> Iterator[Column]:
    for k, axis in enumerate(layout_of(rig).axes):
        places = (MINUS, PLUS) if defects.get(f"told_coils.{axis.name}") and len(axis.coils) == 2 else (PLUS, MINUS)
        yield from ((channel, place + k) for channel, place in zip(axis.coils, places, strict=False))


def _voltages(rig: RigFile) -> Iterator[Column]:
    for k, axis in enumerate(layout_of(rig).axes):
        yield from ((name, place + k) for name, place in zip(axis.voltages, (VOLTS_PLUS, VOLTS_MINUS), strict=False))


def _peaks(rig: RigFile) -> Iterator[Column]:
    yield from ((b.voltage, PEAK + k) for k, b in enumerate(rig.bearings.values()) if b.voltage)


def _mark(rig: RigFile) -> Iterator[Column]:
    """What the mark tells; the speed by itself too, of a rig whose file says nothing of the mark that gives it."""
    if turned(rig) and (rig.mark is None or not rig.mark.speed):
        yield "speed", SPEED
    if rig.mark is None:
        return
    for name, place in OF_MARK:
        if channel := getattr(rig.mark, name):
            yield channel, place
    yield "pulse_age", AGE


def _inside(rig: RigFile, told: Iterable[Column]) -> Iterator[Column]:
    """What the controller knows of the mark inside, by its own names: a capture has it whatever the telemetry calls it."""
    known = {name for name, _ in told}
    yield from ((name, place) for name, place in OF_MARK if rig.mark is not None and name not in known)


def _status(rig: RigFile, silent: bool) -> Iterator[Column]:
    """One column for each plane where the shaft can touch: a ring without a place has several, which `TwinPlant` puts
    together."""
    layout = layout_of(rig)
    touched = [(f"status.contact.{r.ring}", CONTACT + k) for k, r in enumerate(layout.rings) if r.ring]
    if layout.axial is not None:
        stops = (name for name, ring in rig.rings.items() if ring.kind == "axial")
        touched += [(f"status.contact.{name}", AXIAL_CONTACT) for name in dict.fromkeys((*stops, "axial"))]
    yield from ((name, NOTHING if silent else place) for name, place in touched)
    yield from LIMITS.items()
