"""What is asked of the truth of a stage that known loads pull at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class LoadedAxis:
    """An axis that known loads pull at, around (`turns`) or along: a count of its encoder, how far it is moved past and how
    slowly back, its rate and rise otherwise; `loads` in their order and `changes`, each a source, a label and a sign."""

    name: str
    turns: bool
    pitch: float
    lead: float
    slow: float
    rate: float
    rise: float
    loads: Sequence[tuple[str, str, int]] = ()
    changes: Sequence[tuple[str, str, int]] = ()


@dataclass(frozen=True)
class LoadsAsked:
    """Known loads on `axes` of a stage that has `all_axes`: `settings` as those of steps, and what they are `without`
    integrators; whether loads are looked at at rest, and put on and taken off; so many set points within a count; times, s:
    without load after all of them, until an axis is taken to rest, over which it is averaged then, that it rests before a
    load, after a load and over which it is looked at."""

    settings: Mapping[str, float]
    without: Mapping[str, float]
    axes: Sequence[LoadedAxis]
    all_axes: Sequence[LoadedAxis]
    static: bool
    disturbed: bool
    phases: int
    cool_s: float
    settle_s: float
    average_s: float
    rest_s: float
    after_s: float
    look_s: float
