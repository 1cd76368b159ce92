"""What the angle step draws: the orbits as in T Fig. 6.7b, the angle, the segment currents, and the peaks of every case."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from bench.figures import Figure, Series
from bench.rigfile import RigFile
from bench.uncertainty import coverage_factor
from procedures.angle_step.estimates import Result
from procedures.angle_step.steps import Case, Done
from procedures.servomotor.parameters import stated

FIRST = ("torque-priority", "radius", "orbit")
SHOWN_S = 0.25  # after the step: the angle has swung by then, and the rotor is back


def all_figures(moves: Sequence[Done], results: Mapping[Case, Result], rig: RigFile) -> list[Figure]:
    """In the order of the report: where captures show the torque current in its bound, that and the excursion first."""
    first = {done.case: done for done in reversed(moves)}  # the first move of each case
    cases = [c for c in results if c.filter_hz == next(iter(results)).filter_hz]
    sizes = {a: max(c.size for c in cases if c.allocation == a) for a in dict.fromkeys(c.allocation for c in cases)}
    largest = [c for c in cases if c.size == sizes[c.allocation]]
    limit = stated(rig, "motor.segment_limit").high
    drawn = [
        _orbits([first[c] for c in largest], rig.geometry["clearance"].value),
        *(_angles([first[c] for c in cases if c.size == size]) for size in sorted({c.size for c in cases})),
        _radii([first[c] for c in largest]),
        *(figure for c in largest for figure in _currents(first[c], limit)),
        *_peaks(results),
    ]
    if moves[0].swing is None or not (moves[0].swing.asked and moves[0].swing.whole):
        return drawn
    return sorted(drawn, key=lambda f: FIRST.index(f.key) if f.key in FIRST else len(FIRST))


def _called(done: Done, moves: Sequence[Done]) -> str:
    """By its allocation, and by its size where the moves beside it have another."""
    alike = all(d.case.size == done.case.size for d in moves)
    return done.case.allocation if alike else f"{done.case.allocation}, {_deg(done)}"


def _sizes(moves: Sequence[Done]) -> str:
    return f"step of {' and of '.join(dict.fromkeys(_deg(d) for d in moves))}"


def _orbits(moves: Sequence[Done], clearance: float) -> Figure:
    turn = np.linspace(0, 2 * np.pi, 181)
    circle = Series("clearance", 1e6 * clearance * np.cos(turn), 1e6 * clearance * np.sin(turn))
    series = [Series(_called(d, moves), 1e6 * d.move.orbit[0], 1e6 * d.move.orbit[1]) for d in moves]
    return Figure("orbit", f"Orbit at the outboard sensor, {_sizes(moves)}",
                  "Path of the shaft off the sensors' zero after one step, within the circle at which it would touch (as T "
                  "Fig. 6.7b).", "x (µm)", "y (µm)", (*series, circle), kind="plane")  # fmt: skip


def _angles(moves: Sequence[Done]) -> Figure:
    size = moves[0].case.size
    series = tuple(
        Series(d.case.allocation, 1e3 * d.move.t[_shown(d)], np.degrees(d.move.angle[_shown(d)])) for d in moves
    )
    return Figure(f"angle-{np.degrees(size):g}".replace(".", "-"), f"Angle after a step of {_deg(moves[0])}",
                  f"Encoder angle from where the reference stood; derivative on the error, at {moves[0].case.filter_hz:g} Hz. "
                  "Time runs from the answer of the torque current.", "time (ms)", "angle (°)", series,
                  lines=(("reference", float(np.degrees(moves[0].move.step))),))  # fmt: skip


def _radii(moves: Sequence[Done]) -> Figure:
    series = tuple(
        Series(_called(d, moves), 1e3 * d.move.t[_shown(d)], 1e6 * np.hypot(*d.move.orbit[:, _shown(d)])) for d in moves
    )
    rest = float(1e6 * max(np.hypot(*d.move.rest_orbit).max() for d in moves))
    return Figure("radius", f"Distance off centre, {_sizes(moves)}",
                  "At the outboard sensor, over the time since the step; the line is the greatest at standstill before it.",
                  "time (ms)", "off centre (µm)", series, lines=(("standstill", rest),))  # fmt: skip


def _currents(done: Done, limit: float) -> Iterator[Figure]:
    """The segments' amplitudes; where a capture has them as vectors, the torque current within its bound and their sizes."""
    swing, name = done.swing, done.case.allocation
    if swing is None or not (swing.asked and swing.whole):
        yield _segments(done, limit)
        return
    shown, most = swing.t <= SHOWN_S, 2 * swing.limit
    t, bound, torque = (x[shown] for x in (1e3 * swing.t, swing.bound, swing.asked["torque"]))
    cut = "" if name == "priority" else ", shown up to twice the limit"
    yield Figure(f"torque-{name}", f"Torque current and its bound, {name}, step of {_deg(done)}",
                 f"What the law asks for{cut}, and what i_x, i_y leave of the limit by T (7.18) put right, at the controller's "
                 "full rate.", "time (ms)", "current (A)",
                 (Series("i_θ", t, np.clip(torque, -most, most)), Series("bound", t, bound),
                  Series("bound, negative", t, -bound)))  # fmt: skip
    sizes = np.hypot(swing.vectors[:, 0], swing.vectors[:, 1])[:, shown]
    yield Figure(f"amplitudes-{name}", f"Amplitudes of the segments, {name}, step of {_deg(done)}",
                 "Measured, √(q² + d²), at the controller's full rate.", "time (ms)", "current (A)",
                 tuple(Series(f"segment {k + 1}", t, size) for k, size in enumerate(sizes)),
                 lines=(("limit", swing.limit),))  # fmt: skip


def _segments(done: Done, limit: float) -> Figure:
    shown = _shown(done)
    series = tuple(Series(f"segment {k + 1}", 1e3 * done.move.t[shown], done.move.segments[k, shown]) for k in range(4))
    return Figure(f"segments-{done.case.allocation}", f"Segment currents, {done.case.allocation}, step of {_deg(done)}",
                  "Measured currents of the motor's four segments (as T Fig. 6.7c, d); at a limit force and torque compete.",
                  "time (ms)", "current (A)", series, lines=(("limit", limit), ("limit, negative", -limit)))  # fmt: skip


def _peaks(results: Mapping[Case, Result]) -> Iterator[Figure]:
    """Excess over the size of the step, and over the filter where there are several."""
    filters = sorted({c.filter_hz for c in results})
    sizes = sorted({c.size for c in results})
    each: dict[str, list[Result]] = {}
    for case, result in results.items():
        each.setdefault(case.allocation, []).append(result)
    if len(sizes) > 1:
        yield Figure("excess-size", "Excursion over the size of the step",
                     f"Peak at the outboard sensor above that at standstill, mean of the repeats with its 95 % interval; "
                     f"derivative filtered at {filters[0]:g} Hz.", "step (°)", "excess (µm)",
                     tuple(_excess(a, [r for r in by if r.case.filter_hz == filters[0]], lambda case: np.degrees(case.size))
                           for a, by in each.items()))  # fmt: skip
    if len(filters) > 1:
        yield Figure("excess-filter", f"Excursion over the derivative's filter, step of {np.degrees(sizes[0]):g}°",
                     "Peak at the outboard sensor above that at standstill, mean of the repeats with its 95 % interval.",
                     "log10 of the filter's frequency (Hz)", "excess (µm)",
                     tuple(_excess(a, [r for r in by if r.case.size == sizes[0]], lambda case: np.log10(case.filter_hz))
                           for a, by in each.items()))  # fmt: skip


def _excess(label: str, results: Sequence[Result], of: Callable[[Case], float]) -> Series:
    found = [r.estimates["excess"] for r in results]
    u = np.array([coverage_factor(len(r.responses) - 1) * e.u for r, e in zip(results, found, strict=True)])
    return Series(
        label, np.array([float(of(r.case)) for r in results]), np.array([1e6 * e.value for e in found]), "both", 1e6 * u
    )


def _shown(done: Done) -> slice:
    return slice(0, int(np.searchsorted(done.move.t, SHOWN_S)))


def _deg(done: Done) -> str:
    return f"{np.degrees(done.case.size):.3g}°"
