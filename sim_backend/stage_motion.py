"""What is asked of a simulated stage: what its axes truly do that are sent to and fro, or follow sines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Numbers = Mapping[str, float]
Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class StageWindow:
    """Rows of telemetry in which an axis of a positioned stage is looked at, counted from the search of its zeros on, and what
    the result is called; of a step where it is sent from and to, m or rad."""

    axis: str
    where: str
    begin: int
    end: int
    places: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class StepsFollowed:
    """Axes of a positioned stage that are sent to and fro: `settings` as those of steps; `commands` as (tick, command or
    parameter, value) from the search of the zeros on, `windows` from the row before a set point starts until the step's end.
    How many rows are to rest at its end; the band of settling, share of the step."""

    settings: Numbers
    commands: Sequence[tuple[int, str, float]]
    windows: Sequence[StageWindow]
    rest_rows: int
    band: float


@dataclass(frozen=True)
class SinesFollowed:
    """Axes of a positioned stage that follow sines: `settings` and `commands` as those of steps that are followed; `windows` of
    whole periods, and the rows of a period."""

    settings: Numbers
    commands: Sequence[tuple[int, str, float]]
    windows: Sequence[StageWindow]
    period_rows: int


@dataclass(frozen=True)
class DecouplingAsked:
    """An axis of a stage that is `moved` through a sine while another one is `held` at its zero: `settings` as those of steps,
    `amplitude` m or rad, how many `periods` are looked at after one, above which share of its greatest speed it counts as
    `sliding`, and the frequency, Hz, at which the smoothed force has half of what it was."""

    settings: Numbers
    moved: str
    held: str
    amplitude: float
    period_s: float
    periods: int
    sliding: float
    smooth_hz: float


@dataclass(frozen=True)
class StaticsAsked:
    """Loads of single phases on cells that hold a shaft: where encoders read `x` m and `angle` rad, the `phase` (a number) and
    its true `current` A, each (n,); the `greatest` current. `beside`: the other map's force N and torque N m of each; none."""

    x: Array
    angle: Array
    phase: Sequence[int]
    current: Array
    greatest: float
    beside: tuple[Array, Array] | None
