"""What is asked of a simulated mover that levitates and is sent along and around: missions, and what its gate has to spare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

Numbers = Mapping[str, float]


@dataclass(frozen=True)
class MissionAsked:
    """A mission: `settings` as those of steps. Times from the firmware's start on, s: when it is switched on, `on_s`, and
    lifts, `lift_s`, from where it is `lying`, m by channel, as probes read it; `commands` (when, "z" or "angle", to where, rate
    and rise) until `end_s`; `repeats` (begin, end), and `rests` (begin, end, which place). `places` are what both are called,
    `sent` where the mover is sent, m and rad. The gate, m, and its time, s."""

    settings: Numbers
    on_s: float
    lift_s: float
    lying: Numbers
    commands: Sequence[tuple[float, str, float, float, float]]
    end_s: float
    repeats: Sequence[tuple[float, float]]
    rests: Sequence[tuple[float, float, int]]
    places: Sequence[str]
    sent: Sequence[tuple[float, float]]
    gate_m: float
    gate_s: float


@dataclass(frozen=True)
class GateAsked:
    """A levitated mover at rest, looked at for `windows` times the gate's time `gate_s` at each of the `places`, by name m and
    rad; `settings` as those of steps, the parameters of the set points `place` and `angle`; the gate, m. `limits`: by probe
    whose catch margin is asked for, the controller's greatest force, N."""

    settings: Numbers
    places: Mapping[str, tuple[float, float]]
    place: str
    angle: str
    gate_m: float
    gate_s: float
    windows: int
    limits: Numbers
