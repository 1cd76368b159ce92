"""Small nudges of the lifted shaft by its set points: do the readings, and the coils' currents, answer as they should?

`lift` makes them and judges them at once by its readings, the analysis judges them again by the recorded steps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.geometry import Facts, centre, nominal
from procedures.amb_rotor.machine import AmbRotor

Array = npt.NDArray[np.float64]
PROBE = "probe"
OWN, OTHER = 0.5, 0.3  # shares of a nudge
ANSWERS = 0.25  # of what a magnet of that gap and bias asks for
ALONG = 0.5  # cosine of an axis that a nudge of y moves


@dataclass(frozen=True)
class Nudge:
    """A set point's `name`, to where it was moved from zero (m or rad), and mean readings before and after, SI by channel."""

    name: str
    wanted: float
    before: Mapping[str, float]
    after: Mapping[str, float]


def watched(machine: AmbRotor, known: Sequence[str]) -> tuple[str, ...]:
    """Channels that are looked at: positions, and the coils' currents as far as they are `known`."""
    return (*machine.stations.channels, *(c for c in machine.currents if c in known))


def recorded(recording: Recording[Any]) -> list[Nudge]:
    """The nudges of the steps."""
    told = [c.name for stream in recording.streams.values() for c in stream.channels]
    names = watched(conventions(recording.rig), told)
    steps = list(recording.steps(PROBE))
    return [
        Nudge(
            str(after.labels["name"]),
            float(after.labels["value"]),
            *({n: s.mean(n) for n in names} for s in (before, after)),
        )
        for before, after in zip(steps[::2], steps[1::2], strict=False)
    ]


def judge(nudges: Sequence[Nudge], rig: RigFile) -> Iterator[Finding]:
    """Exchanged planes, axes or coils."""
    machine = conventions(rig)
    yield from _readings(nudges, machine, rig)
    yield from _coils(nudges, machine, nominal(rig))


def _readings(nudges: Sequence[Nudge], machine: AmbRotor, rig: RigFile) -> Iterator[Finding]:
    facts = nominal(rig, 0.0)
    for nudge in nudges:
        wanted, name = nudge.wanted, nudge.name
        means = [_read(read, machine) for read in (nudge.before, nudge.after)]
        y, z, _, theta = (centre(means[1], facts) - centre(means[0], facts))[:, 0]
        if (coordinate := machine.moved_by(name) or name) == "theta":
            if theta < OWN * wanted:
                text = (
                    f"a tilt about z by {wanted * 1e6:g} µrad shows as {theta * 1e6:+.0f} µrad: suspect the readings of the "
                    "two planes exchanged, or a set point that does not act."
                )
                yield Finding("planes-exchanged", text, name, Effect.ERROR)
        elif coordinate == "y" and (y < OWN * wanted or abs(z) > OTHER * wanted):
            text = (
                f"a nudge of y by {wanted * 1e6:g} µm shows as {y * 1e6:+.1f} µm in y and {z * 1e6:+.1f} µm in z: suspect the "
                "readings of y and z exchanged, or a set point that does not act."
            )
            yield Finding("axes-exchanged", text, name, Effect.ERROR)


def _read(means: Mapping[str, float], machine: AmbRotor) -> Array:
    """Of the radial probes (n, 1) m."""
    return np.array([[means[p]] for p in machine.stations.channels])


@dataclass(frozen=True)
class Answer:
    """Of an `axis`: how far a nudge `moved` it along itself, m, by how much its current rose then, `got` A, and by how much a
    magnet of that gap and bias asks it to fall, `asked` A. `wanted` is the share of the nudge that is along it, m."""

    axis: str
    coils: tuple[str, str]
    wanted: float
    moved: float
    got: float
    asked: float

    @property
    def followed(self) -> bool:
        """Whether the axis went where the nudge wanted it."""
        return self.moved * math.copysign(1.0, self.wanted) > OWN * abs(self.wanted) > 0

    @property
    def towards(self) -> float:
        """The rise along the way of the nudge, A: below zero where the coils are those of this axis."""
        return self.got * math.copysign(1.0, self.wanted)


def _answers(nudge: Nudge, machine: AmbRotor, facts: Facts, coordinate: str) -> list[Answer]:
    """A shaft that is held nearer to a magnet is pulled more by it, so that its coil carries less: by about the bias over the
    gap, K_x/K_i of a magnet of two like coils. That tells coils apart even where the mean currents do not: where the magnetic
    offset carries the weight they are nearly alike. Nothing where the rig file has no gap."""
    to_axes, column = machine.stations.pulls, {"y": 0, "theta": 3}[coordinate]
    at_rest, moved = (centre(_read(of, machine), facts) for of in (nudge.before, nudge.after))
    change = (to_axes @ (moved - at_rest))[:, 0]
    out = []
    for k, axis in enumerate(machine.axes):
        p, n = machine.pair(axis)
        if axis in machine.gaps and {p, n} <= nudge.after.keys():
            by = {c: nudge.after[c] - nudge.before[c] for c in (p, n)}
            wanted = float(to_axes[k, column]) * nudge.wanted
            bias = (nudge.before[p] + nudge.before[n]) / 2
            asked = bias / machine.gaps[axis] * abs(float(change[k]))
            out.append(Answer(axis, (p, n), wanted, float(change[k]), (by[p] - by[n]) / 2, asked))
    return out


def _coils(nudges: Sequence[Nudge], machine: AmbRotor, facts: Facts) -> Iterator[Finding]:
    """Which coils answer: those of the axis that moved, and each of them the way it should."""
    suspects: set[str] = set()
    for nudge in nudges:
        coordinate = machine.moved_by(nudge.name) or nudge.name
        if coordinate not in ("y", "theta"):
            continue
        answers = _answers(nudge, machine, facts, coordinate)
        judged = _of_shift if coordinate == "y" else _of_tilt
        for found in judged(answers, nudge, machine):
            if found.where not in suspects:
                yield found
            suspects.add(found.where)


def _of_shift(answers: Sequence[Answer], nudge: Nudge, machine: AmbRotor) -> Iterator[Finding]:
    """A nudge of y: the coils of an axis exchanged, or those of two axes of a bearing."""
    for a in (a for a in answers if abs(a.wanted) >= ALONG * nudge.wanted):
        if a.followed and a.towards > ANSWERS * a.asked:
            nearer = a.coils[0] if a.wanted > 0 else a.coils[1]
            text = (
                f"nearer by {abs(a.moved) * 1e6:.1f} µm to the magnet of {nearer} on {a.axis}, the shaft asks "
                f"{a.towards * 1e3:+.1f} mA of it, as if it pulled the other way: suspect the two coils or their current "
                "sensors exchanged."
            )
            yield Finding("coils-exchanged", text, a.axis, Effect.ERROR)
    for pair in machine.planes.values():
        of_plane = sorted((a for a in answers if machine.axes.index(a.axis) in pair), key=lambda a: -abs(a.wanted))
        if len(of_plane) < 2:
            continue
        own, other = of_plane
        across = own.followed and abs(other.wanted) < OTHER * abs(own.wanted)
        if across and abs(own.got) < ANSWERS * own.asked < abs(other.got):
            text = (
                f"a nudge along {own.axis} by {own.moved * 1e6:+.1f} µm changes its current by {own.got * 1e3:+.1f} mA and "
                f"that of {other.axis} by {other.got * 1e3:+.1f} mA: suspect the coils of both axes, or their current "
                "sensors, exchanged."
            )
            yield Finding("coils-exchanged", text, own.axis, Effect.ERROR)


def _of_tilt(answers: Sequence[Answer], nudge: Nudge, machine: AmbRotor) -> Iterator[Finding]:
    """A tilt about z moves both bearings' axes opposite ways, and so their currents: not if the planes' coils are exchanged."""
    for a in answers:
        if a.followed and a.towards > ANSWERS * a.asked:
            text = (
                f"a tilt about z by {nudge.wanted * 1e6:g} µrad moves {a.axis} by {a.moved * 1e6:+.1f} µm and changes its "
                f"current by {a.got * 1e3:+.1f} mA, as if that were the other bearing's: suspect the coils of the two "
                "planes, or their current sensors, exchanged."
            )
            yield Finding("coils-exchanged", text, a.axis, Effect.ERROR)
