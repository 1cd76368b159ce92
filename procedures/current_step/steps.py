"""From the recorded captures to arrays: the current along and across, half-bridges, the supply, positions under a held step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError, Lacking
from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import CurrentStep
from procedures.current_step.plan import Plan

Array = npt.NDArray[np.float64]
LARGE, SMALL, PUSH = "large", "small", "push"
WHOLE = 4  # small steps whose half-bridges are captured
SLOWER = 8  # times: captures of positions, which are read every so many ticks
WORTH_S = 5e-4  # what positions are means over


@dataclass(frozen=True)
class Taken:
    """One capture of a step and the step back. `size` A as told; columns (n,) SI: the current `along` and `across`; of the
    half-bridges `voltages` and `currents` (m, n), of the DC link `supply`: empty where they were not captured."""

    kind: str
    place: str
    size: float
    tick_s: float
    along: Array
    across: Array
    voltages: Array
    currents: Array
    supply: Array
    lost: int
    expected: int


@dataclass(frozen=True)
class Pushed:
    """Positions and angles under a held step: how much farther each went than it did before, m and rad."""

    place: str
    moved: Mapping[str, float]
    turned: Mapping[str, float]


def place_of(rig: RigFile, name: str) -> CurrentStep:
    """What the rig's controller steps there.

    Raises:
        Lacking: it has no such place.
    """
    known = rig.capabilities.current_steps
    if name not in known:
        raise Lacking(f"capabilities.current_steps: found no {name}; it has {', '.join(known) or 'none'}")
    return known[name]


def channels(place: CurrentStep, kind: str, repeat: int) -> tuple[str, ...]:
    """What is captured at a place: of the first `WHOLE` small steps the half-bridges too, whose limits they must not touch."""
    if kind == PUSH:
        return place.still
    return place.captured if kind == LARGE or repeat < WHOLE else (place.along, place.across)


def read_taken(recording: Recording[Plan]) -> list[Taken]:
    """All captures of large and small steps, in time order; of what was taken again the last.

    Raises:
        AnalysisError: there are none, or one is missing.
    """
    found = [(kind, step) for kind in (LARGE, SMALL) for step in recording.steps(kind)]
    if not found:
        raise AnalysisError("found no steps; expected those of the plan (was the run stopped early?)")
    last = {step.labels["number"]: (kind, step) for kind, step in sorted(found, key=lambda one: one[1].start_ns)}
    return [_read(recording, *one) for one in last.values()]


def _read(recording: Recording[Plan], kind: str, step: Step) -> Taken:
    labels = step.labels
    place = place_of(recording.rig, str(labels["place"]))
    data, tick_s = _captured(recording, step, channels(place, kind, int(labels["repeat"])))

    def rows(names: tuple[str, ...]) -> Array:
        return np.array([data[n] for n in names if n in data]).reshape(-1, len(data[place.along]))

    supply = data.get(place.supply, np.empty(0))
    return Taken(
        kind, str(labels["place"]), float(labels["size_A"]), tick_s, data[place.along], data[place.across],
        rows(place.voltages), rows(place.currents), supply, step.lost(), step.expected(),
    )  # fmt: skip


def read_pushed(recording: Recording[Plan]) -> list[Pushed]:
    """How far positions and angles moved under each held step, in time order."""
    out = []
    for step in recording.steps(PUSH):
        place = place_of(recording.rig, str(step.labels["place"]))
        data, tick_s = _captured(recording, step, place.still)
        count = max(round(WORTH_S / tick_s), 1)
        before = round(recording.plan.push_s / tick_s)
        angles = {name for name in place.still if angular(recording.rig, name)}
        far = {n: moved(np.unwrap(data[n]) if n in angles else data[n], count, before) for n in place.still}
        out.append(Pushed(str(step.labels["place"]), {n: m for n, m in far.items() if n not in angles},
                          {n: m for n, m in far.items() if n in angles}))  # fmt: skip
    return out


def angular(rig: RigFile, channel: str) -> bool:
    """Whether a channel of captures tells an angle."""
    return rig.capture is not None and rig.capture.channels[channel].unit == "rad"


def moved(x: Array, count: int, before: int) -> float:
    """How much farther a position or an angle (n,) goes from its mean over the samples `before` than it went among those: a
    mover in its rings may rock. By means of `count` samples, so that noise is no motion."""
    each = x[: len(x) // count * count].reshape(-1, count).mean(axis=1)
    first = each[: max(before // count, 1)]
    away = np.abs(each - first.mean())
    return float(away.max() - away[: len(first)].max())


def _captured(recording: Recording[Plan], step: Step, names: tuple[str, ...]) -> tuple[dict[str, Array], float]:
    attempt = {k: step.labels[k] for k in ("number", "attempt") if k in step.labels}
    found = recording.captures(**attempt)
    if not found:
        raise AnalysisError(f"step {dict(step.labels)}: found no capture")
    return found[0].arrays(*names), 1 / found[0].rate_hz
