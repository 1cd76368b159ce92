"""Small nudges of the lifted shaft by its set points: do the readings, and the coils' currents, answer as they should?

`lift` makes them and judges them at once by its readings, the analysis judges them again by the recorded steps.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import AmbRotor, conventions
from procedures.amb_rotor.geometry import centre, nominal

PROBE = "probe"
OWN, OTHER = 0.5, 0.3  # shares of a nudge
ANSWERS_A = 5e-3  # a nudge of 10 µm takes some 20 mA, and noise leaves 0.2 mA in a step


@dataclass(frozen=True)
class Nudge:
    """A set point's `name`, to where it was moved from zero (m or rad), and mean readings before and after, SI by channel."""

    name: str
    wanted: float
    before: Mapping[str, float]
    after: Mapping[str, float]


def watched(machine: AmbRotor, known: Sequence[str]) -> tuple[str, ...]:
    """Channels that are looked at: positions, and the coils' currents as far as they are `known`."""
    return (*machine.positions, *(c for c in machine.currents if c in known))


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
    yield from _coils(nudges, machine)


def _readings(nudges: Sequence[Nudge], machine: AmbRotor, rig: RigFile) -> Iterator[Finding]:
    facts = nominal(rig, 0.0)
    for nudge in nudges:
        wanted, name = nudge.wanted, nudge.name
        means = [np.array([[read[p]] for p in machine.positions]) for read in (nudge.before, nudge.after)]
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


def _coils(nudges: Sequence[Nudge], machine: AmbRotor) -> Iterator[Finding]:
    """A shaft that is held nearer to a magnet is pulled more by it, so that its coil carries less. That tells the coils of an
    axis apart even where the mean currents do not: where the magnetic offset carries the weight they are nearly alike."""
    for nudge in nudges:
        if (machine.moved_by(nudge.name) or nudge.name) != "y":
            continue
        for axis in machine.along("y"):
            (p, n), place = machine.pair(axis), machine.position(axis)
            if not {p, n} <= nudge.after.keys():
                continue
            by = {c: nudge.after[c] - nudge.before[c] for c in (p, n, place)}
            moved, answer = by[place], (by[p] - by[n]) / 2
            if moved > OWN * nudge.wanted and answer > ANSWERS_A:
                text = (
                    f"nearer by {moved * 1e6:.1f} µm to the upper magnet of {axis}, the shaft asks {answer * 1e3:+.1f} mA of "
                    "it, as if it pulled the other way: suspect the two coils or their current sensors exchanged."
                )
                yield Finding("coils-exchanged", text, axis, Effect.ERROR)
