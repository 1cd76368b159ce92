"""What a simulated machine truly does under a plan: the truths of motion that a machine has, and how each is asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.loads_motion import LoadsAsked
from sim_backend.mission_motion import GateAsked, MissionAsked
from sim_backend.stage_motion import DecouplingAsked, SinesFollowed, StaticsAsked, StepsFollowed

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
    how long it follows before it is looked at, s. Where set points are written one after the other: how many `points` to a
    revolution, and the set points, by parameter, `at` y and z m."""

    settings: Numbers
    hz: float
    y: float
    z: float
    ratio: float
    speed: float
    settle_s: float
    points: int = 0
    at: Callable[[float, float], Numbers] | None = None


@dataclass(frozen=True)
class Whirl:
    """What the shaft does at a speed: vectors of order 1 from the once-per-turn mark of its centre at each radial axis' probe,
    m, the greatest distance `d_max` of its centre from the rings' in each plane of them, m, and the `clearance` there, m."""

    shaft: Complex
    d_max: tuple[float, ...]
    clearance: tuple[float, ...]


@dataclass(frozen=True)
class BandAsked:
    """What is asked of the estimator that a controller lets watch: `settings` as those of steps, `lines` Hz, the error at the
    edges of the band, and another frequency `at` Hz."""

    settings: Numbers
    lines: Sequence[float]
    limit: float
    at: float


@dataclass(frozen=True)
class CompareAsked:
    """Estimators that close the loop in turn: `settings` as those of steps; the parameters that choose each, by its name, of
    those that are `engaged` while their compensation is switched on, and of those that are `loaded` with the mass `load`; how
    long each is looked at before, and how long one that compensates is left alone, s."""

    settings: Numbers
    engaged: Mapping[str, Numbers]
    loaded: Mapping[str, Numbers]
    load: str
    lead_s: float
    calm_s: float


@dataclass(frozen=True)
class CircleAsked:
    """A motor that carries one end of the shaft along a circle, `radius` m at `hz` (negative: the other way round), reached in
    `ramp_s`, and balances its load from the phase `engage_rad` on. `settings` as those of steps; what is written on top when
    it begins to carry, to go around and to balance; `slew` rad/s and `balanced_limit` rad of the phase angle. `branches`: of
    each repeat, the sign of i_x as against that of i_y. `turned`: what was written before it carried, and how long it stood, s:
    where the rotor rests within its encoder's count is a matter of that, and by the force's ripple the load as it is seen."""

    settings: Numbers
    carried: Numbers
    circled: Numbers
    balanced: Numbers
    radius: float
    hz: float
    ramp_s: float
    engage_rad: float
    slew: float
    balanced_limit: float
    branches: Sequence[int]
    turned: Sequence[tuple[Numbers, float]] = ()


@dataclass(frozen=True)
class AngleCase:
    """Steps of one size, rad: the `settings` written before them, the band of settling, rad, and if the law has a bound."""

    settings: Numbers
    size: float
    band: float
    bounded: bool


@dataclass(frozen=True)
class AngleAsked:
    """Steps of the angle while the motor carries: `settings` as those of steps, by which the shaft is lifted with its angle
    released; by what it is `turned` a little and then `holds` its angle, the `gains` of the steps, what the motor `carries` by,
    the parameter of the `reference`, the limit of a segment, A, cases by how they are named, how often each way, and the times
    before, between and after, s. `idle`: how long nothing was recorded before each step, s, in their order: the angle's
    integrator goes on learning."""

    settings: Numbers
    turned: Numbers
    holds: Numbers
    gains: Numbers
    carries: Numbers
    reference: str
    limit: float
    cases: Mapping[str, AngleCase]
    repeats: int
    settle_s: float
    standstill_s: float
    record_s: float
    idle: Sequence[float] = ()


@dataclass(frozen=True)
class DragAsked:
    """How a shaft coasts: two bias currents of its radial AMBs, A, and whether a motor carries one end of it meanwhile, whose
    AMB is idle then."""

    bias_A: float
    bias_high_A: float
    motor_carries: bool


@dataclass(frozen=True)
class SpeedsAsked:
    """Runs at the torque limit: `settings` as those of steps; what is written `before` them, one after the other, once the
    shaft is held; the parameters that choose each of the `sharings`, by its name; the speed reference that guards them, rad/s;
    for how long each is watched in each direction, s, and by direction, 1 and -1, how long the current sensors have drifted by
    then, s."""

    settings: Numbers
    before: Sequence[Numbers]
    sharings: Mapping[str, Numbers]
    guard: float
    seconds: float
    at_s: Mapping[int, float]


@dataclass(frozen=True)
class CurrentAsked:
    """Steps of currents that the controller regulates, of the machine at rest: by place the current, as the machine calls it,
    and the proportional gain of its loop, V/A; the `size` of a large step and of a `small` one, A; what of the response counts,
    s; the `angle` at which the mover was held, rad: it creeps before, and a limit of the half-bridges goes with it."""

    steps: Mapping[str, str]
    gains: Mapping[str, float]
    size: float
    small: float
    response_s: float
    angle: float = 0.0


@dataclass(frozen=True)
class LoopsAsked:
    """Sines into position loops: `settings` as those of steps, the set `points` among them; the loops by the names of the
    machine's line, each with how long a sine goes on before it is looked at, s; those whose sensitivity is asked for; the range
    of frequencies, Hz."""

    settings: Numbers
    points: Numbers
    axes: Numbers
    sensitive: Sequence[str]
    low_hz: float
    high_hz: float


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
        loops: bandwidth and greatest sensitivity of position loops, by quantity and loop.
        loop: of settings, the linear loop at rest, as the axes of these names have it, in their order.
        band: what the watched estimator does, by name and line (an empty text where it is none's).
        compare: what estimators do in the loop, by quantity and name, and ratios of two.
        peak: of settings, an axis' number and a speed, the greatest sensitivity and where, Hz, of the shaft that turns.
        circle: balancing of loads on a circle, by quantity and place.
        angle: what steps of the angle show, by quantity and case.
        drag: what stops the shaft that coasts, by the names of a spindown: B and B_high N m s/rad, T_c N m, J_z kg m^2.
        mission: largest readings, levels, errors at rest and times of a mission, by quantity and place.
        currents: what stepped currents do, by quantity and place.
        constants: of motors along and around, by quantity, where and place, of places by loop.
        gates: what the gate and the catch have to spare, by quantity and where.
        pulls: of where a channel along and one around read, what holds a shaft that magnets pull, by quantity and where.
        cogging: harmonics of it along and around, by quantity and where, of a shaft turned at rad/s at a place, m.
        following: what axes do that are sent to and fro or follow sines, by quantity and where.
        runout: what turns with the shaft, vectors by quantity, plane and place along, m.
        loads: compliance, friction, scale of the force and answers to loads, by quantity and where.
        inductances: constants of a map of inductances, as encoders read places, by quantity and where.
        statics: force and torque of phases by load cells, and beside another map, by quantity and where.
        stators: where phases draw the shaft, by quantity and where.
        decoupling: of an axis that is held, its largest `excursion` and the moved one's `swing`, effective value `cross`,
            `peak` and `slope` of what crosses over.
        speeds: at the torque limit, by sharing: `speed` rad/s, `bound` A of the torque current, `ripple` rad/s.
    """

    steps: Callable[[RigFile, Any, StepsAsked], tuple[Any, Mapping[tuple[float, int], Any]]] | None = None
    orbit: Callable[[RigFile, Any, OrbitAsked], Mapping[str, float]] | None = None
    whirl: Callable[[RigFile, Any, Numbers, float, Sequence[str]], Whirl] | None = None
    left: Callable[[RigFile, Any, Sequence[Mapping[str, Any]], Sequence[str]], Sequence[Any]] | None = None
    passage: Callable[[RigFile, Any, Numbers, float, float, Sequence[str]], Any] | None = None
    loop: Callable[[RigFile, Any, Numbers, Sequence[str]], Any] | None = None
    loops: Callable[[RigFile, Any, LoopsAsked], Mapping[tuple[str, str], float]] | None = None
    peak: Callable[[RigFile, Any, Numbers, int, float], tuple[float, float]] | None = None
    compare: Callable[[RigFile, Any, CompareAsked], Mapping[tuple[str, str], float]] | None = None
    circle: Callable[[RigFile, Any, CircleAsked], Mapping[tuple[str, str], float]] | None = None
    angle: Callable[[RigFile, Any, AngleAsked], Mapping[tuple[str, str], float]] | None = None
    drag: Callable[[Any, DragAsked], Mapping[str, float]] | None = None
    band: Callable[[RigFile, Any, BandAsked], Mapping[tuple[str, float | None], float]] | None = None
    speeds: Callable[[RigFile, Any, SpeedsAsked], Mapping[str, Mapping[str, float]]] | None = None
    gates: Callable[[RigFile, Any, GateAsked], Mapping[tuple[str, str], float]] | None = None
    mission: Callable[[RigFile, Any, MissionAsked], Mapping[tuple[str, str], float]] | None = None
    currents: Callable[[RigFile, Any, CurrentAsked], Mapping[tuple[str, str], float]] | None = None
    constants: (
        Callable[[RigFile, Any, Mapping[str, Sequence[float]]], Mapping[tuple[str, str, float], float]] | None
    ) = None
    pulls: Callable[[RigFile, Any, float, float], Mapping[tuple[str, str], float]] | None = None
    cogging: Callable[[RigFile, Any, float, float], Mapping[tuple[str, str], float]] | None = None
    loads: Callable[[RigFile, Any, LoadsAsked], Mapping[tuple[str, str], float]] | None = None
    inductances: Callable[[RigFile, Any], Mapping[tuple[str, str], float]] | None = None
    statics: Callable[[RigFile, Any, StaticsAsked], Mapping[tuple[str, str], float]] | None = None
    stators: Callable[[RigFile, Any], Mapping[tuple[str, str], float]] | None = None
    following: Callable[[RigFile, Any, StepsFollowed | SinesFollowed], Mapping[tuple[str, str], float]] | None = None
    runout: Callable[[RigFile, Any, Sequence[float]], Mapping[tuple[str, str, float], complex]] | None = None
    decoupling: Callable[[RigFile, Any, DecouplingAsked], Mapping[str, float]] | None = None


NONE = Motions()


def drag(drawn: Any, asked: DragAsked) -> Mapping[str, float]:
    """Of a plant that nothing but `viscous` and `coulomb` drag stops: J_z w' = -B w - T_c."""
    del asked
    p = drawn.plant
    return {"B": p.viscous, "T_c": p.coulomb, "J_z": p.polar_inertia}
