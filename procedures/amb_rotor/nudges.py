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
from procedures.amb_rotor.conventions import AmbRotor, conventions
from procedures.amb_rotor.geometry import Facts, centre, nominal

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


def _coils(nudges: Sequence[Nudge], machine: AmbRotor, facts: Facts) -> Iterator[Finding]:
    """A shaft that is held nearer to a magnet is pulled more by it, so that its coil carries less: by about the bias over the
    gap, K_x/K_i of a magnet of two like coils. That tells the coils of an axis apart even where the mean currents do not: where
    the magnetic offset carries the weight they are nearly alike. Nothing where the rig file has no gap."""
    to_axes = machine.stations.pulls
    for nudge in nudges:
        if (machine.moved_by(nudge.name) or nudge.name) != "y":
            continue
        change = (to_axes @ (centre(_read(nudge.after, machine), facts) - centre(_read(nudge.before, machine), facts)))[
            :, 0
        ]
        for k, axis in enumerate(machine.axes):
            (p, n), along = machine.pair(axis), to_axes[k, 0]
            if abs(along) < ALONG or axis not in machine.gaps or not {p, n} <= nudge.after.keys():
                continue
            by = {c: nudge.after[c] - nudge.before[c] for c in (p, n)}
            moved, answer = float(change[k]) * math.copysign(1, along), (by[p] - by[n]) / 2 * math.copysign(1, along)
            bias = (nudge.before[p] + nudge.before[n]) / 2
            if moved > OWN * abs(along) * nudge.wanted and answer > ANSWERS * bias / machine.gaps[axis] * moved:
                text = (
                    f"nearer by {moved * 1e6:.1f} µm to the magnet of {p if along > 0 else n} on {axis}, the shaft asks "
                    f"{answer * 1e3:+.1f} mA of it, as if it pulled the other way: suspect the two coils or their current "
                    "sensors exchanged."
                )
                yield Finding("coils-exchanged", text, axis, Effect.ERROR)
