"""What is looked at: readings from the gate on, a repeat in detail, place and angle, the bearings' currents."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from bench.rigfile import RigFile
from procedures.mission.estimates import Told, gate_of
from procedures.mission.fit import smoothed
from procedures.mission.plan import Plan
from procedures.mission.steps import Flight, Piece
from procedures.position_loops.movers import motion, radial

Array = npt.NDArray[np.float64]
UM = 1e6
POINTS = 3000  # of a curve: least and largest of as many stretches


def all_figures(flight: Flight, told: Told, rig: RigFile, plan: Plan) -> Iterable[Figure]:
    """In the order in which they are looked at."""
    yield _readings(flight, rig)
    yield _moved(flight, rig, plan)
    yield _lift(flight, rig, plan)
    if plan.currents and motion(rig).currents:
        yield _currents(flight, rig)
    yield _repeat(flight, rig, plan)


def _shown(piece: Piece, channel: str, factor: float) -> tuple[Array, Array]:
    """Least and largest reading of stretches, so that no peak is lost."""
    t, x = piece.t, piece.columns[channel] * factor
    size = max(2 * len(t) // POINTS, 1)
    count = len(t) // size
    parts = x[: count * size].reshape(count, size)
    times = np.repeat(t[: count * size : size], 2)
    return times, np.column_stack([parts.min(axis=1), parts.max(axis=1)]).ravel()


def _joined(pieces: Sequence[Piece], channel: str, factor: float) -> tuple[Array, Array]:
    """Of several captures, with gaps between them."""
    times, values = [], []
    for piece in pieces:
        t, x = _shown(piece, channel, factor)
        times += [t, t[-1:]]
        values += [x, np.array([math.nan])]
    return np.concatenate(times), np.concatenate(values)


def _readings(flight: Flight, rig: RigFile) -> Figure:
    series = tuple(Series(probe, *_joined(flight.pieces, c, UM)) for probe, c in radial(rig).items())
    caption = ("Radial readings during the moves, noise included, at full rate (least and largest of each stretch). "
               "Integrators bring them back to zero at either place.")  # fmt: skip
    gate, _ = gate_of(rig)
    lines = (("gate", gate * UM), ("gate, below", -gate * UM))
    return Figure("readings", "Readings during the moves", caption, "time / s", "reading / µm", series, lines=lines)


def _moved(flight: Flight, rig: RigFile, plan: Plan) -> Figure:
    at = motion(rig)
    place = Series("along", *_joined(flight.pieces, at.place_channel, 1e3))
    angle = Series("around", *_joined(flight.pieces, at.angle_channel, 180 / math.pi))
    sent = tuple((f"sent {p * 1e3:g} mm", p * 1e3) for p in plan.places_m)
    turned = tuple((f"sent {math.degrees(a):.4g}°", math.degrees(a)) for a in plan.angles_rad)
    below = Figure("moves-angle", "", "", "time / s", "angle / °", (angle,), lines=turned)
    caption = "Place along the shaft and angle as they were captured; lines are where the mover was sent."
    return Figure("moves", "Place and angle", caption, "time / s", "place / mm", (place,), lines=sent, below=below)


def _lift(flight: Flight, rig: RigFile, plan: Plan) -> Figure:
    gate, seconds = gate_of(rig)
    assert flight.lift is not None
    series: tuple[Series, ...] = tuple(Series(p, *_shown(flight.lift, c, UM)) for p, c in radial(rig).items())
    passed = flight.since("LEVITATED")
    reach = max(float(np.abs(s.y).max()) for s in series)
    if passed is not None:
        for name, t in (("gate's time begins", passed - seconds), ("it ends", passed)):
            series += (Series(name, np.array([t, t]), np.array([-reach, reach]), "guide"),)
    at = motion(rig)
    along = Series("along", *_shown(flight.lift, at.place_channel, 1e3))
    below = Figure("lift-place", "", "", "time / s", "place / mm", (along,))
    caption = ("Radial readings during the lift; all have to stay within the gate between the dashed lines. Before, the mover "
               "lies in its rings.")  # fmt: skip
    lines = (("gate", gate * UM), ("gate, below", -gate * UM))
    return Figure("lift", "Lift and gate", caption, "time / s", "reading / µm", series, lines=lines, below=below)


def _currents(flight: Flight, rig: RigFile) -> Figure:
    series = tuple(Series(c, *_joined(flight.pieces, c, 1.0)) for c in motion(rig).currents)
    limit = rig.envelope.max_current_A
    caption = "Currents of the bearings as the firmware has them; the lines are what the envelope allows a coil."
    lines = (("envelope", limit), ("envelope, below", -limit))
    return Figure("currents", "Bearing currents", caption, "time / s", "current / A", series, lines=lines)


def _repeat(flight: Flight, rig: RigFile, plan: Plan) -> Figure:
    """The first repeat, averaged as it was evaluated."""
    there, back = flight.moves[:2]
    piece = flight.pieces[0]
    cut = piece.cut(there.begin, back.end)
    series = []
    for probe, channel in radial(rig).items():
        x = smoothed(piece.columns[channel][cut], plan.smooth_s * plan.rate_hz) * UM
        series.append(Series(probe, piece.t[cut][::8] - there.begin, x[::8]))
    caption = "The first repeat, there and back, with readings averaged as they were evaluated."
    return Figure("repeat", "One repeat", caption, "time since the command / s", "reading / µm", tuple(series))
