"""What a simulated machine truly does under a plan: the truths of motion that a machine has, and how each is asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile

Numbers = Mapping[str, float]
Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class StepsAsked:
    """Set-point steps along one axis of the shaft (y, z or x), up, back, down and back. `settings`: every parameter of the
    controller, SI; `points`: the set points, by parameter, that hold the shaft at so many m; `sizes` m, `speed` rad/s; `wait_s`
    and `rest_s` before each step, `record_s` after it."""

    settings: Numbers
    axis: str
    points: Callable[[float], Numbers]
    sizes: Sequence[float]
    speed: float
    rest_s: float
    record_s: float
    wait_s: float


@dataclass(frozen=True)
class OrbitAsked:
    """A path that the shaft follows: y sin(a), z cos(ratio a) m, a with `hz`; `settings` as those of steps, `speed` rad/s, and
    how long it follows before it is looked at, s."""

    settings: Numbers
    hz: float
    y: float
    z: float
    ratio: float
    speed: float
    settle_s: float


@dataclass(frozen=True)
class Whirl:
    """What the shaft does at a speed: vectors of order 1 from the once-per-turn mark of its centre at each radial axis' probe,
    m, the greatest distance `d_max` of its centre from the rings' in each plane of them, m, and the `clearance` there, m."""

    shaft: Complex
    d_max: tuple[float, ...]
    clearance: tuple[float, ...]


@dataclass(frozen=True)
class Motions:
    """The truths of motion of one machine; None: it has none of that kind. Each takes the rig and what was drawn for it (a
    `Truth`) first.

    Attributes:
        steps: `Small` motions along an axis, and by size and way what is `Shown` (`sim_backend.machines.stepping`).
        orbit: every quantity of a tracking test by its name.
        whirl: of the controller's settings, a speed in rad/s and the channels of probes, two for each plane.
        left: unbalance kg m of balancing planes by name, as vectors on their scales, before and after what the operator did.
        passage: of settings, two speeds and channels, curves that know what is `critical` near a speed.
        loop: of settings, the linear loop at rest, as the axes of these names have it, in their order.
        peak: of settings, an axis' number and a speed, the greatest sensitivity and where, Hz, of the shaft that turns.
    """

    steps: Callable[[RigFile, Any, StepsAsked], tuple[Any, Mapping[tuple[float, int], Any]]] | None = None
    orbit: Callable[[RigFile, Any, OrbitAsked], Mapping[str, float]] | None = None
    whirl: Callable[[RigFile, Any, Numbers, float, Sequence[str]], Whirl] | None = None
    left: Callable[[RigFile, Any, Sequence[Mapping[str, Any]], Sequence[str]], Sequence[Any]] | None = None
    passage: Callable[[RigFile, Any, Numbers, float, float, Sequence[str]], Any] | None = None
    loop: Callable[[RigFile, Any, Numbers, Sequence[str]], Any] | None = None
    peak: Callable[[RigFile, Any, Numbers, int, float], tuple[float, float]] | None = None


NONE = Motions()
