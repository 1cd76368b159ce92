"""What a run to the maximum speed draws: speed over time as in T Fig. 6.8a, torque over speed, bound and currents in a turn."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from bench.recording import Recording
from bench.rigfile.roles import SPEED
from bench.uncertainty import interval
from bench.units import RPM
from procedures.maximum_speed import fit
from procedures.maximum_speed.estimates import Result
from procedures.maximum_speed.plan import HALF, NAMES, OP, WORDS, Plan
from procedures.maximum_speed.requires import DEMANDS
from procedures.maximum_speed.steps import RUN, SHARED
from procedures.servomotor.conventions import conventions

Array = npt.NDArray[np.float64]
SHOWN = 4  # changes of the sharing: to a half from rest, by (6.24), the same again, a half
LEAST_S, CONSTANTS = 1.5, 8.0  # how long each is shown, in s and in J/B
MEAN_S = 0.02  # of the curves over time
TICKS = 10  # of the curves within a turn: means over a millisecond


def all_figures(result: Result, recording: Recording[Plan], limit_A: float) -> Iterator[Figure]:
    """In the order of the report."""
    yield from _over_time(result, recording)
    yield _balance(result)
    yield from _within_turn(recording, limit_A)


def _over_time(result: Result, recording: Recording[Plan]) -> Iterator[Figure]:
    """Speed and torque current after each of the first changes of the sharing, forward, the first of them from rest."""
    changes = [e for e in recording.events(SHARED) if e["direction"] > 0][:SHOWN]
    if len(changes) < SHOWN:
        return
    shown_ns = round(max(LEAST_S, CONSTANTS * result.time_constant_s) * 1e9)
    speeds, currents = [], []
    for event, label in (
        (changes[0], "from rest"),
        (changes[1], f"after {WORDS[HALF]}"),
        (changes[3], f"after {WORDS[OP]}"),
    ):
        t, speed, current = _read(recording, event["t_ns"], event["t_ns"] + shown_ns)
        name = f"{WORDS[event['sharing']]}, {label}"
        speeds.append(Series(name, t, RPM * speed))
        currents.append(Series(name, t, current))
    expected = tuple(
        (f"expected, {WORDS[s]}", RPM * result.estimates[f"predicted_{n}"].value) for s, n in NAMES.items()
    )
    bounds = tuple((f"bound, {WORDS[s]}", result.of[s].bound) for s in NAMES)
    below = Figure(
        "torque-current", "Torque current", "", "time (s)", "torque current (A)", tuple(currents), lines=bounds
    )
    yield Figure("speed", "Speed at the torque limit, two ways of sharing the segments",
                 "As T Fig. 6.8a: forward, from when the segments are shared so, means over 20 ms. Lines: the speeds "
                 "that torque constant and drag expect; below, what the segments' limit leaves for torque on average.",
                 "time (s)", "speed (r/min)", tuple(speeds), lines=expected, below=below)  # fmt: skip


def _read(recording: Recording[Plan], start: int, end: int) -> tuple[Array, Array, Array]:
    segments = conventions(recording.rig).segments
    data = recording.read((SPEED, *segments), start, end)
    n = max(1, round(MEAN_S * 1e9 / max(float(np.median(np.diff(data["t_ns"]))), 1.0)))
    whole = len(data["t_ns"]) // n * n

    def means(x: Array) -> Array:
        out: Array = x[:whole].reshape(-1, n).mean(axis=1)
        return out

    torque = np.mean([data[c] for c in segments], axis=0)
    return means((data["t_ns"] - start) * 1e-9), means(data[SPEED]), means(torque)


def _balance(result: Result) -> Figure:
    """Torque over speed of every run, and the line of the spindown."""
    top = 1.1 * max(x.speed for x in result.of.values())
    w = np.array([0.0, top])
    drag, constant = result.drag.value, result.constant.value
    series = [Series("B ω + T_c of the spindown", RPM * w, drag * w + constant, "guide")]
    for s, x in result.of.items():
        found = result.estimates[f"apart_{NAMES[s]}"]
        speeds = np.array([run.speed for run in x.windows])
        torques = np.array([result.per_A.value * run.direction * run.segments.mean() for run in x.windows])
        series.append(Series(WORDS[s], RPM * speeds, torques, "points"))
        u = drag * interval(found).U
        series.append(Series(f"{WORDS[s]}, mean and U", np.array([RPM * x.speed]),
                             np.array([result.per_A.value * x.current]), "points", np.array([u])))  # fmt: skip
    return Figure("balance", "Torque over speed",
                  "α_τ cos(M γ_0t) times the mean current of the segments. What drives the rotor one way, such as unequal "
                  "segments that carry the shaft, parts the directions and drops out of their mean. Bars: U of the balance.",
                  "speed (r/min)", "torque (N m)", tuple(series))  # fmt: skip


def _within_turn(recording: Recording[Plan], limit_A: float) -> Iterator[Figure]:
    """Bound and force currents of the first captured turn of each sharing."""
    steps = {str(s.labels["sharing"]): s for s in reversed(list(recording.steps(RUN)))}
    bounds, forces = [], []
    for s in (HALF, OP):
        if s not in steps:
            return
        captured = recording.captures(number=steps[s].labels["number"])[0]
        data = captured.arrays(*DEMANDS)
        speed = abs(float(steps[s].mean(SPEED)))
        n = min(int(2 * math.pi / speed * captured.rate_hz), captured.samples) // TICKS * TICKS
        x, y = (data[name][:n] for name in DEMANDS)
        turn = np.degrees(speed * np.arange(n) / captured.rate_hz)
        bounds.append(Series(f"bound, {WORDS[s]}", _short(turn), _short(fit.bound(limit_A, x, y, s))))
        forces += [Series(f"|i_x|, {WORDS[s]}", _short(turn), _short(np.abs(x))),
                   Series(f"|i_y|, {WORDS[s]}", _short(turn), _short(np.abs(y)))]  # fmt: skip
    below = Figure("force-currents", "Force currents", "", "angle (°)", "size (A)", tuple(forces))
    yield Figure("turn", "What the segments' limit leaves for torque within a turn",
                 f"Captured at the controller's full rate, means over a millisecond. Of {limit_A:g} A the law takes i_x and "
                 "i_y first: the greater of both with λ = 1/2, half their sum with λ by (6.24).",
                 "angle (°)", "torque current (A)", tuple(bounds), below=below)  # fmt: skip


def _short(x: Array) -> Array:
    out: Array = x[: len(x) // TICKS * TICKS].reshape(-1, TICKS).mean(axis=1)
    return out
