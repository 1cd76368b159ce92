"""What the spindown draws: speed over time with its fit, residuals, deceleration and loss power over speed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from bench.findings import Finding
from procedures.spindown import fit
from procedures.spindown.estimates import Drag
from procedures.spindown.steps import RunDown

Array = npt.NDArray[np.float64]
NAMES = {"low": "", "high": "", "ring": ", with the ring"}
MEAN = 25  # samples of 1 ms
STRETCHES = 14  # a run-down is cut into so many to show its deceleration


def all_figures(runs: Sequence[RunDown], result: Drag, speed_rad_s: float) -> list[Figure]:
    """In the order of the report."""
    firsts = _firsts(runs)
    return [_speeds(firsts), *_deceleration(runs, result, speed_rad_s), *_residuals(firsts)]


def _firsts(runs: Sequence[RunDown]) -> dict[str, RunDown]:
    """The first forward run-down of each kind, by the name it has in a figure."""
    out: dict[str, RunDown] = {}
    for r in runs:
        if r.direction > 0:
            out.setdefault(f"{r.bias_A:g} A{', with the ring' if r.ring else ''}", r)
    return out


def _speeds(firsts: dict[str, RunDown]) -> Figure:
    series = []
    for name, r in firsts.items():
        c, (t, w) = r.of_speed or r.of_angle, _points(r)
        series.append(Series(name, t, w, "points"))
        series.append(Series(f"{name}, fit", r.t, fit.speed(r.t, c.b, c.c, c.speed)))
    return Figure("speed", "Speed after the release", "One run-down at each bias, forward, with the fit of viscous and "
                  "constant drag; a few samples are drawn, of a short run-down the slopes of its angle.",
                  "time (s)", "speed (rad/s)", tuple(series))  # fmt: skip


def _points(run: RunDown) -> tuple[Array, Array]:
    """A few speeds in rad/s and their times in s: of a short run-down by the angle, which no filter delays."""
    if run.of_speed is None:
        return np.array([part.mean() for part in np.array_split(run.t, STRETCHES)]), deceleration(run)[0]
    thin = slice(None, None, max(1, len(run.t) // 18))
    return run.t[thin], run.speed[thin]


def _residuals(firsts: dict[str, RunDown]) -> Iterator[Figure]:
    for key, what, unit in (("angle", "angle", "mrad"), ("speed", "speed", "mrad/s")):
        series = []
        for name, r in firsts.items():
            found = r.of_angle if key == "angle" else r.of_speed
            if found is None:
                continue
            rest = found.fit.residuals
            count = len(rest) // MEAN * MEAN
            t, e = (x[:count].reshape(-1, MEAN).mean(axis=1) for x in (r.t, rest))
            series.append(Series(name, t, 1e3 * e, "both"))
        if not series:
            continue
        yield Figure(f"residuals-{key}", f"Residuals of the {what}", f"Measured {what} less its fit, mean over {MEAN} ms. A "
                     "sound run-down leaves the counts of the encoder; a wave over all of it would be drag of another shape.",
                     "time (s)", f"residual ({unit})", tuple(series), lines=(("zero", 0.0),))  # fmt: skip


def deceleration(run: RunDown) -> tuple[Array, Array]:
    """Mean speed rad/s and deceleration rad/s^2 of the stretches of a run-down: a parabola through the angle of each."""
    speeds, rates = [], []
    for part in np.array_split(np.arange(len(run.t)), STRETCHES):
        t = run.t[part] - run.t[part].mean()
        half, speed, _ = np.polyfit(t, run.angle[part], 2)
        speeds.append(speed)
        rates.append(-2 * half)
    return np.array(speeds), np.array(rates)


def _deceleration(runs: Sequence[RunDown], result: Drag, top: float) -> Iterator[Figure]:
    slow, power = [], []
    estimates = result.estimates
    for group, kind in (("low", "B"), ("high", "B_high")):
        r = result.rates[group]
        bias = next(x.bias_A for x in runs if not x.ring and (x.bias_A == runs[0].bias_A) == (group == "low"))
        chosen = [x for x in runs if not x.ring and x.bias_A == bias]
        points = [deceleration(x) for x in chosen]
        w, a = np.mean([p[0] for p in points], axis=0), np.mean([p[1] for p in points], axis=0)
        grid = np.linspace(0, top, 80)
        slow += [Series(f"{bias:g} A", w, a, "points"),
                 Series(f"{bias:g} A, fit", grid, r.values[0] * grid + r.values[1])]  # fmt: skip
        drag, friction = estimates[kind], estimates["T_c"]
        loss = drag.value * grid**2 + friction.value * grid
        u = np.array([(drag * float(x) ** 2 + friction * float(x)).u for x in grid[8::12]])
        power += [
            Series(f"{bias:g} A", grid, loss),
            Series(f"{bias:g} A, 95 %", grid[8::12], loss[8::12], "points", 2 * u),
        ]
    yield Figure("deceleration", "Deceleration over speed", "From parabolas through stretches of the angle, mean over all "
                 "run-downs at a bias, with b ω + c of the fits.", "speed (rad/s)", "deceleration (rad/s²)",
                 tuple(slow))  # fmt: skip
    yield Figure("loss-power", "Loss power over speed", "B w² + T_c w with its 95 % intervals: what the motor must give to "
                 "hold a speed.", "speed (rad/s)", "power (W)", tuple(power))  # fmt: skip


def stopping(runs: Sequence[RunDown], result: Drag, speed_rad_s: float) -> Finding:
    """How long the rotor takes to stop from the plan's speed, by group; one line for the record."""
    parts = []
    for group, r in result.rates.items():
        b, c = (float(x) for x in r.values)
        bias = next(
            x.bias_A for x in runs if x.ring == (group == "ring") and (x.bias_A == runs[0].bias_A) == (group != "high")
        )
        seconds = fit.stopping_time(b, c, speed_rad_s)
        parts.append(f"{seconds:.2f} s at {bias:g} A{NAMES[group]} (time constant {1 / b:.3f} s)")
    return Finding(
        "stopping-time", f"released at {speed_rad_s:g} rad/s the rotor stands after {', '.join(parts)}", "B, T_c"
    )
