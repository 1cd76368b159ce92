"""What a controller does not say of its machine, judged from readings: contact by positions against the rings' clearances,
current
limits by currents against what the rig file states, voltage limits by voltages against the supply, sensor ranges by what a
signal
can hold.

Each is judged only where the rig file binds nothing of its kind in `[capabilities.status]`. Telemetry tells means or newest
values:
a touch, or a limit that was reached, for less than its period is not seen. A shaft that lies on its rings touches them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench import units
from bench.rigfile import protection
from bench.rigfile.elements import Ring
from bench.rigfile.model import RigFile
from bench.rigfile.places import PlaceError, Places
from bench.rigfile.toleranced import Toleranced

Array = npt.NDArray[np.float64]
Shown = npt.NDArray[np.bool_]
Samples = Mapping[str, npt.NDArray[Any]]
AT_LIMIT = 0.98  # of a current limit: amplifiers hold it to their own gain
AT_SUPPLY = 0.95  # of the supply's voltage: what an amplifier's stages leave of it
LEAST = 0.5  # of a clearance, below which tolerances make no contact of a position
UNKNOWN_ZERO = 0.05  # of a clearance, by which the zero of a probe without a certificate may be off
COUNTS = 1.5  # of a signal's steps, from the end of what it holds


@dataclass(frozen=True)
class Judged:
    """Of samples (n,) of its `channels`: whether each shows it."""

    channels: tuple[str, ...]
    shows: Callable[[Samples], Shown]


def rings(rig: RigFile) -> Iterator[tuple[str, Judged]]:
    """By ring: whether the shaft is as far from the middle there as the ring's clearance lets it, less how far that, and the
    probes' zeros and gains, may be off."""
    places = Places(rig)
    for name, ring in rig.rings.items():
        with suppress(PlaceError):
            number = places.number(ring.clearance, f"rings.{name}.clearance").number
            found = _along(rig, number) if ring.kind == "axial" else _across(rig, places, name, ring, number)
            if found is not None:
                yield name, found


def currents(rig: RigFile) -> Judged | None:
    """Whether a coil's current is at its limit: the parameter bound as `current_limit`, else what the envelope allows."""
    coils = [coil for b in rig.bearings.values() for axis in b.axes.values() for coil in axis.coils]
    stated = rig.parameters.get(rig.capabilities.current_limit)
    allowed = {p.name: p.high for p in protection.of_channels(rig)}
    limits = {coil: stated.default if stated is not None else allowed.get(coil, math.inf) for coil in coils}
    known = {coil: AT_LIMIT * limit for coil, limit in limits.items() if math.isfinite(limit)}
    if not known:
        return None
    return Judged(tuple(known), lambda x: _any(np.abs(x[coil]) >= limit for coil, limit in known.items()))


def voltages(rig: RigFile) -> Judged | None:
    """Whether a coil's voltage is that of the supply; not judged where either is not told."""
    told = [
        v for b in rig.bearings.values() for v in (b.voltage, *(u for a in b.axes.values() for u in a.voltages)) if v
    ]
    supply = rig.envelope.supply
    if not told or supply not in rig.channels:
        return None
    return Judged((*told, supply), lambda x: _any(np.abs(x[u]) >= AT_SUPPLY * np.abs(x[supply]) for u in told))


def ranges(rig: RigFile) -> Judged | None:
    """Whether a probe reads what its signal can just hold, or what the DBC states as its range."""
    ends = {p.channel: _ends(rig, p.channel) for p in rig.probes.values() if _told(rig, p.channel)}
    if not ends:
        return None
    return Judged(tuple(ends), lambda x: _any((x[c] <= low) | (x[c] >= high) for c, (low, high) in ends.items()))


def _any(of: Iterator[Shown]) -> Shown:
    return np.asarray(np.logical_or.reduce(list(of)), np.bool_)


def _told(rig: RigFile, channel: str) -> bool:
    """Whether a channel is there and its signal too, in a unit that is known: what leads nowhere is told by the check."""
    if channel not in rig.channels:
        return False
    message, _, name = rig.channels[channel].signal.partition(".")
    signals = rig.messages.messages[message].signals if message in rig.messages.messages else ()
    return any(s.name == name and s.unit in units.UNITS for s in signals)


def _ends(rig: RigFile, channel: str) -> tuple[float, float]:
    """Of a signal, SI, less some steps."""
    message, _, name = rig.channels[channel].signal.partition(".")
    s = rig.messages[message].signal(name)
    unit = units.unit(s.unit)
    low, high = (-math.inf, math.inf)
    if not s.is_float:
        raw = (-(1 << s.length - 1), (1 << s.length - 1) - 1) if s.signed else (0, (1 << s.length) - 1)
        low, high = sorted(r * s.scale + s.offset for r in raw)
    if s.low is not None and s.high is not None and s.low < s.high:
        low, high = max(low, s.low), min(high, s.high)
    margin = COUNTS * abs(s.scale) if not s.is_float else 0.0
    ends = sorted(((low + margin) * unit.factor + unit.offset, (high - margin) * unit.factor + unit.offset))
    return ends[0], ends[1]


def _half(t: Toleranced) -> float:
    return t.half_width or 3 * t.standard_uncertainty


def _zero(rig: RigFile, channel: str, clearance: float) -> float:
    """By how much a reading at a clearance may be off, m."""
    sensor = rig.sensors.get(channel)
    return UNKNOWN_ZERO * clearance if sensor is None else _half(sensor.offset) + _half(sensor.gain) * clearance


def _along(rig: RigFile, number: Toleranced) -> Judged | None:
    channels = [p.channel for p in rig.probes.values() if p.direction is None]
    if not channels:
        return None
    one, clearance = channels[0], abs(number.value)
    limit = max(clearance - _half(number) - _zero(rig, one, clearance), LEAST * clearance)
    return Judged((one,), lambda x: np.abs(x[one]) >= limit)


def _across(rig: RigFile, places: Places, name: str, ring: Ring, number: Toleranced) -> Judged | None:
    part = f"rings/{name}" if ring.at is not None else f"bearings/{name}"
    found = _map(rig, places, places.place(part).value)
    if found is None:
        return None
    channels, to_ring = found
    clearance = abs(number.value)
    off = np.array([_zero(rig, c, clearance) for c in channels])
    tolerance = _half(number) + float(np.sqrt(((to_ring * off) ** 2).sum(axis=1).max()))
    limit = max(clearance - tolerance, LEAST * clearance)
    return Judged(channels, lambda x: np.hypot(*(to_ring @ np.array([x[c] for c in channels], np.float64))) >= limit)


def _map(rig: RigFile, places: Places, at: float) -> tuple[tuple[str, ...], Array] | None:
    """From the radial probes' readings to where the shaft stands at a place, (2, n); by those of the nearest plane where
    they do
    not tell a tilt. None where they do not tell two directions."""
    radial = {p.channel: (places.place(f"probes/{n}").value, places.direction(f"probes/{n}").value, p.sign)
              for n, p in rig.probes.items() if p.direction is not None}  # fmt: skip
    if not radial:
        return None
    stand = np.array([place - at for place, *_ in radial.values()])
    cos, sin = (np.array([sign * f(angle) for _, angle, sign in radial.values()]) for f in (math.cos, math.sin))
    length = max(float(np.abs(stand).max()), 1e-3)
    rows = np.column_stack([cos, sin, cos * stand / length, sin * stand / length])
    if np.linalg.matrix_rank(rows, tol=1e-3) == rows.shape[1]:
        return tuple(radial), np.asarray(np.linalg.pinv(rows)[:2])
    near = np.isclose(np.abs(stand), np.abs(stand).min(), atol=1e-3)
    if np.linalg.matrix_rank(rows[near][:, :2], tol=1e-3) < 2:
        return None
    return tuple(c for c, use in zip(radial, near, strict=True) if use), np.asarray(np.linalg.pinv(rows[near][:, :2]))
