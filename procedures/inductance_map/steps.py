"""Labels of what is recorded, and from a recording to pulses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.roles import STATE
from procedures.inductance_map.model import Rows
from procedures.inductance_map.places import Place, grid
from procedures.inductance_map.plan import Plan
from procedures.inductance_map.pulses import Array, Pulse, read
from procedures.stages.stators import Phase, axis, phases, poles

PLACE = "place"


@dataclass(frozen=True)
class Shot:
    """One capture: times (n,) s, voltage and current of the phase, the greatest mean current of another one while the pulse is
    held, and how far the encoders' readings went meanwhile, m and rad."""

    step_s: float
    voltage: Array
    current: Array
    other: float
    went: tuple[float, float]


@dataclass(frozen=True)
class Taken:
    """A place: what the encoders read there, what was captured of each phase, and what the pulses show (None: nothing);
    `states` of the controller before the pulses, and what currents of the phases (6,) A read then, without one."""

    place: Place
    x: float
    angle: float
    shots: Mapping[str, Shot]
    pulses: Mapping[str, Pulse | None]
    states: tuple[str, ...]
    zeros: tuple[float, ...] = ()


def captured(rig: RigFile, phase: Phase) -> tuple[str, ...]:
    """Channels of a pulse's capture: the phase's voltage, all currents, both encoders as far as they can be captured."""
    wanted = (phase.voltage, *(p.current for p in phases(rig)), *_encoders(rig))
    return tuple(c for c in dict.fromkeys(wanted) if rig.capture is not None and c in rig.capture.channels)


def _encoders(rig: RigFile) -> tuple[str, ...]:
    return tuple(a.channel for a in (axis(rig, "stroke"), axis(rig, "angle")) if a is not None)


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """Every place that was locked, in time order."""
    places = {p.number: p for p in grid(recording.plan)}
    return with_pulses([_taken(recording, step, places[int(step.labels["number"])]) for step in recording.steps(PLACE)])


def _taken(recording: Recording[Plan], step: Step, place: Place) -> Taken:
    rig, names = recording.rig, recording.rig.choices(STATE)
    x, angle = _encoders(rig)
    currents = [p.current for p in phases(rig)]
    data = step.read(x, angle, STATE, *currents)
    states = tuple(names.get(int(code), str(int(code))) for code in np.unique(data[STATE]))
    shots = {}
    for phase in phases(rig):
        found = recording.captures(place=place.number, phase=phase.name)
        if found and found[0].samples > 1:
            shots[phase.name] = _shot(found[0].arrays(*captured(rig, phase)), rig, phase)
    return Taken(place, float(data[x].mean()), float(data[angle].mean()), shots, {}, states,
                 tuple(float(data[c].mean()) for c in currents))  # fmt: skip


def _shot(data: Mapping[str, Array], rig: RigFile, phase: Phase) -> Shot:
    current = data[phase.current]
    held = np.abs(current) > 0.9 * np.abs(current).max()
    others = [p.current for p in phases(rig) if p.current != phase.current and p.current in data]
    other = max((abs(float(data[c][held].mean())) for c in others), default=0.0)
    x, angle = (float(np.ptp(data[c])) if c in data else 0.0 for c in _encoders(rig))
    return Shot(float(np.median(np.diff(data["t_s"]))), data[phase.voltage], current, other, (x, angle))


def with_pulses(taken: Sequence[Taken]) -> list[Taken]:
    """With what the captures show. How fast R grows is one number of all pulses: each by itself has it in noise."""
    first = [{name: read(s.voltage, s.current, s.step_s) for name, s in t.shots.items()} for t in taken]
    rates = [p.warming for each in first for p in each.values() if p is not None]
    rate = float(np.median(rates)) if rates else 0.0
    return [
        replace(t, pulses={name: read(s.voltage, s.current, s.step_s, rate) for name, s in t.shots.items()})
        for t in taken
    ]


def rows(taken: Sequence[Taken], rig: RigFile) -> Rows:
    """Every sample of every flank."""
    parts: dict[str, list[Array]] = {
        n: [] for n in ("phase", "place", "down", "current", "before", "flux", "late", "lean", "lag")
    }
    some, noise = phases(rig), []
    for m, t in enumerate(taken):
        for k, phase in enumerate(some):
            pulse = t.pulses.get(phase.name)
            if pulse is None:
                continue
            noise.append(pulse.noise)
            for down, flank in ((0.0, pulse.up), (1.0, pulse.down)):
                n = len(flank.current)
                for name, value in (("phase", k), ("place", m), ("down", down)):
                    parts[name].append(np.full(n, value))
                for name in ("current", "before", "flux", "late", "lean", "lag"):
                    parts[name].append(getattr(flank, name))
    whole = {name: np.concatenate(values) for name, values in parts.items()}
    return Rows(
        phase=whole.pop("phase").astype(np.intp), place=whole.pop("place").astype(np.intp), **whole,
        x=np.array([t.x for t in taken]), angle=np.array([t.angle for t in taken]),
        side=np.array([float(p.side) for p in some]), stator=np.array([p.stator for p in some]),
        aligned=np.array([p.aligned for p in some]), poles=poles(rig), noise=float(np.mean(noise)),
    )  # fmt: skip
