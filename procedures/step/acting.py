"""When the set point of a step acted, by the coil currents that answer it; which of them push, and which way. A law that
differentiates its error pushes as the set point goes, and its currents answer otherwise than a jump's: `onset` then finds them
early, by about the currents' lag."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bench.recording import Step
from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.onset import Shaft, noise_of, onset, unlike
from procedures.step import capturing, following
from procedures.step.following import Push

Array = npt.NDArray[np.float64]
START_S = 4e-5
"""How well the control currents tell when the set points of a case acted: the mean of its steps, on 12 drawn machines of three
rigs, 38 µs early to 29 µs late (noise, and what `onset.LATE_S` leaves of the rotor's answer)."""
UNLIKE = 0.03
"""Of the jump: on drawn machines of three rigs 0.005 at most; 0.05 to 0.25 where the derivative pushes, and 0.10 to 0.19 on an
overhung rotor whose light end has turned its bearing's current round after two samples (1 kHz)."""
GRID_S = 5e-6  # half of what `onset` goes by
ROUNDS = 3  # of starts, then of the motion from them on
GONE = 0.25  # of the way: until then the currents push
ANSWER = 0.25  # of the greatest change of the control current: where it first gets there, the step began
SURELY_S, PLAIN, FEWEST = 5e-3, 8.0, 25  # before a quarter of the way; standard deviations; samples that tell them
WINDOW_S = 1.5e-3  # of single readings, from the start on: the shaft has hardly moved


class Acted(NamedTuple):
    """When a set point acted, s; how unlike to that of a jump the currents' answer is, over the jump; within what of that
    instant it surely was, s; the `half` width that steps of its case share, and the `noise` of its own, s."""

    began: float
    unlike: float
    within: tuple[float, float]
    half: float = START_S
    noise: float = 0.0


def still_at(t_ns: npt.NDArray[np.int64], position: Array, written_ns: int) -> npt.NDArray[np.bool_]:
    """Which of the samples at `t_ns` (n,) lie before the step, of which `position` (n,) is read: those before the set point was
    written. Where the host's clock and the controller's do not agree, on a host that is late, the shaft goes before that by the
    telemetry's times; then those from SURELY_S before it goes are none."""
    rest: npt.NDArray[np.bool_] = np.asarray(t_ns <= written_ns)
    known = position[rest][: int(rest.sum()) // 2]
    if len(known) < FEWEST:
        return rest
    moved = np.abs(position - known.mean())
    way = float(moved[-(len(moved) // 4) :].mean())
    early = np.flatnonzero(rest & (moved > max(GONE * way, PLAIN * float(known.std()))))
    return rest & (t_ns < t_ns[early[0]] - SURELY_S * 1e9) if len(early) else rest


def kicks(control: Array, ends: Array, rest: npt.NDArray[np.bool_], first: int) -> tuple[float, ...]:
    """Of each bearing's control current (k, n) what pushes at first, A: before the sample in which the shaft has gone a quarter
    of its way in that bearing's own plane (k, n). Where the centre of mass is not between the bearings, one of them is there
    long before the other."""
    still = ends - ends[:, rest].mean(axis=1, keepdims=True)
    until = [min(first + 3, before_it_moves(y, rest) - 1) for y in still]
    return tuple(float(c[first : max(last, first + 1)].sum()) for c, last in zip(control, until, strict=True))


def before_it_moves(position: Array, rest: npt.NDArray[np.bool_]) -> int:
    """The sample at which the shaft has gone a quarter of its way, at least two after the write: until then the currents push
    it there, from then on they brake it, and hold it where the magnets' negative stiffness helps it along."""
    begin = int(np.flatnonzero(~rest)[0])
    way = float(position[-(len(position) - begin) // 4 :].mean())
    gone = np.flatnonzero(position[begin:] > GONE * way) if way > 0 else np.zeros(0, np.int64)
    return begin + max(int(gone[0]) + 1 if gone.size else 40, 2)


def answer(control: Array, rest: npt.NDArray[np.bool_], until: int) -> tuple[int, bool]:
    """The first sample, before `until`, at which a bearing's control current (k, n) shows the step; the one after the write,
    where none does."""
    begin = int(np.flatnonzero(~rest)[0])
    window = np.abs(control[:, begin:until]).max(axis=0)
    noise = float(control[:, rest].std(axis=1).max())
    if window.max() < 8 * noise:
        return begin, False
    return begin + int(np.argmax(window > max(ANSWER * window.max(), 4 * noise))), True


def pushed(
    rig: RigFile, step: Step, t: Array, control: Array, y: Array, first: int, *, origin_ns: int, turning: bool
) -> Push:
    """What of a step tells when its set point changed, s on the time `t` (n,) of samples that counts from `origin_ns`: the
    control currents (n,), of single readings where the step was captured and nothing turns, and the position `y` (n,), as a
    share of the step."""
    machine, tick = conventions(rig), rig.devices["controller"].tick_s
    period = float(np.median(np.diff(t)))
    of = Push(
        t, control, y, t[first] - 1.8 * period, t[first] - 0.5 * period, tick, round(period / tick), machine.lag_s
    )
    if turning:
        return of
    single = capturing.read_control(step, [machine.pair(a) for a in machine.along(str(step.labels["axis"]))])
    if single is None:
        return of
    return of._replace(
        t=np.asarray((single[0] - origin_ns) * 1e-9 + tick, np.float64),
        control=single[1],
        y=None,
        ticks=1,
        window_s=WINDOW_S,
    )


def acted(push: Push, shaft: Shaft | None = None) -> Acted:
    """When the set point changed, finer than the samples' period; by the motion of the `shaft`, where it is known."""
    began, _ = onset(
        push.t, push.control, push.earliest, push.latest,
        tick=push.tick, ticks=push.ticks, lag_s=push.lag_s, window_s=push.window_s, shaft=shaft,
    )  # fmt: skip
    share = unlike(
        push.t,
        push.control,
        began,
        tick=push.tick,
        ticks=push.ticks,
        lag_s=push.lag_s,
        window_s=push.window_s,
        shaft=shaft,
    )
    return Acted(began, share, (push.earliest - began, push.latest - began))


def acted_together(pushes: Sequence[Push], sizes: Sequence[float], *, by_distance: bool) -> list[Acted]:
    """The same of steps of one axis, `sizes` (n,) m long; of a law that goes by the distance from its set point by the shaft's
    motion as all of them show it together, with how well it is known then: as the controller may make its rates."""
    first = [acted(p) for p in pushes]
    if not by_distance or any(p.y is None for p in pushes):
        return first
    begans = np.array([a.began for a in first])
    told = following.motion(pushes, begans, sizes)
    if not following.is_told(told, pushes[0].tick * pushes[0].ticks):
        return first
    for _ in range(ROUNDS):
        found = [acted(*of) for of in zip(pushes, following.shafts(told, pushes, begans), strict=True)]
        begans = np.array([a.began for a in found])
        told = following.motion(pushes, begans, sizes)
    others = [
        np.mean([acted(*of).began for of in zip(pushes, following.shafts(told, pushes, begans, old), strict=True)])
        for old in following.OLD_TICKS
    ]
    half = max(abs(float(other - begans.mean())) for other in others) + GRID_S
    ones = zip(pushes, found, following.shafts(told, pushes, begans), strict=True)
    return [
        a._replace(
            half=half, noise=noise_of(p.t, p.control, a.began, tick=p.tick, ticks=p.ticks, lag_s=p.lag_s, shaft=shaft)
        )
        for p, a, shaft in ones
    ]
