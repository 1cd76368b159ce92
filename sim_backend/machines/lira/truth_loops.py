"""What the drawn machine's position loops truly do: sines into one loop, all others closed.

Where a response falls through -3 dB and where a sensitivity is greatest is looked for on the same machine without noise,
rounding and ripple. There it is taken with them: the probes' noise drives the inductors' currents to their limit now and then
(16 A of 20 A at rest with the paper's observer), which takes 0.3 to 0.4 % off a radial loop's response and 3 to 4 Hz off its
bandwidth. Two machines with the same noise have the sine upside down from each other; half of their difference is looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from bench.rigfile import RigFile
from sim_backend.core.plant import Array
from sim_backend.machine import Truth
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.plant import AXES, POSITION_TICKS, TICKS_S, TRACE, Plant
from sim_backend.machines.lira.settings import AXES_OF_LINE, BY_NAME
from sim_backend.motion import LoopsAsked

RATE: Final = TICKS_S / POSITION_TICKS
WAVE: Final = TRACE.index("wave")
HALF: Final = math.sqrt(0.5)
BEAT_S: Final = 0.02
AT_MOST_S: Final = 5.0  # until a lift has gone through its gate
SENSOR, REFERENCE = 0.0, 1.0
GRID, SHORT_S = 12, 0.15  # lines of a first look, and how long each goes on before
PERIODS = 10
NEAR: Final = 1e-5  # of a frequency
SMALL: Final = {"x1": 2e-7, "x2": 2e-7, "y1": 2e-7, "y2": 2e-7, "z": 5e-6, "angle": 1e-4}  # m and rad
NOISY: Final = {SENSOR: 10.0, REFERENCE: 4.0}  # times as large is a sine beside noise
NOISY_S: Final = 4.0
BESIDE: Final = 0.01  # of a frequency, where the slope is taken
TOP: Final = 0.12  # between three frequencies about a greatest one, as a share


def quiet(p: PlantParams) -> PlantParams:
    """The same machine, whose sensors have their gains, zeros and lags, but tell less noise, rounding and ripple."""
    silent = {name: value for name, value in p.ideal().items() if name != "filter_lag"}
    return replace(p, **silent)  # type: ignore[arg-type]


def noisy(p: PlantParams) -> PlantParams:
    """The same machine with the noise of its sensors. Where that is less than half of a position's step, rounding is noise
    of q/sqrt(12) here: of a sine it takes another share at each size and place, which is in a run's budget."""
    pairs = zip(p.position_noise, p.position_lsb, strict=True)
    told = [(s, q) if s >= q / 2 else (math.hypot(s, q / math.sqrt(12)), 0.0) for s, q in pairs]
    return replace(p, position_noise=tuple(s for s, _ in told), position_lsb=tuple(q for _, q in told))


class Flying:
    """The drawn machine, lifted, at its place, nothing injected; without noise, or with that of a seed."""

    def __init__(
        self, drawn: Truth, settings: Mapping[str, float], noise: int | None = None, *, whole: bool = False
    ) -> None:
        """`whole`: with rounding, too."""
        built = drawn.plant
        params = built.plant if whole else quiet(built.plant) if noise is None else noisy(built.plant)
        self.plant = Plant(params, noise or 0, control=built.control, reduced=built.reduced, factors=built.factors,
                           unfed=built.unfed)  # fmt: skip
        self.plant.put(angle=built.rest_angle)
        self.wait(BEAT_S)  # the firmware holds what it has read
        for name in ("idle", "on"):
            self.plant.command(name)
        self.wait(0.2)
        for name, value in settings.items():
            if name in BY_NAME:
                self.plant.set(BY_NAME[name].field, value)
        self.plant.command("lift")
        left = AT_MOST_S
        while self.plant.state == "LIFT" and left > 0:
            self.wait(BEAT_S)
            left -= BEAT_S

    def go(self, points: Mapping[str, float], settings: Mapping[str, float]) -> None:
        """Set points by parameter, by what the others say of how fast."""
        for line, axis in AXES_OF_LINE.items():
            if (value := points.get(f"ref_{line}")) is not None:
                self.plant.go(axis, value, settings.get(f"rate_{line}", 0.0), settings.get(f"accel_{line}", 0.0))
        self.wait(1.5)

    def wait(self, seconds: float) -> Array:
        """Let it run, a host that lives beside it; rows at 35 kHz."""
        rows, left = [], round(seconds * RATE)
        while left > 0:
            self.plant.beat()
            n = min(left, round(BEAT_S * RATE))
            rows.append(self.plant.run(n / RATE))
            left -= n
        return np.concatenate(rows)

    def size(self, axis: str, place: float, hz: float, settle_s: float) -> float:
        """|y/r|, or |S| of a sine that is added to the reading."""
        return size_of(self.answer(axis, place, hz, settle_s, SMALL[axis], 0.04), place)

    def answer(self, axis: str, place: float, hz: float, settle_s: float, amplitude: float, least_s: float) -> complex:
        """y/r of a sine of that amplitude, m or rad, in so long and PERIODS at least."""
        periods = max(PERIODS, math.ceil(least_s * hz))
        samples = round(periods * RATE / hz)
        j, exact = AXES.index(axis), periods * RATE / samples
        for name, value in (("place", place), ("amplitude", amplitude), ("hz", exact), ("axis", float(j))):
            self.plant.set(f"inject_{name}", value)
        self.wait(settle_s)
        rows = self.wait(samples / RATE)
        self.plant.set("inject_axis", -1.0)
        turn = np.exp(2j * np.pi * periods * np.arange(samples) / samples)
        columns = (
            turn.real,
            turn.imag,
            np.ones(samples),
            np.linspace(-1, 1, samples),
        )  # a trend is no part of the sine
        (a, e), (b, f) = np.linalg.lstsq(np.column_stack(columns), rows[:, [j, WAVE]], rcond=None)[0][:2]
        return complex(a, -b) / complex(e, -f) / amplitude


def size_of(answer: complex, place: float) -> float:
    """|y/r|, or |S|."""
    return abs(1 + answer) if place == SENSOR else abs(answer)


def loops(rig: RigFile, drawn: Truth, asked: LoopsAsked) -> dict[tuple[str, str], float]:
    """By quantity and loop, by the names of the line."""
    del rig
    flying = Flying(drawn, asked.settings)
    if flying.plant.state != "LEVITATED":
        return {}
    flying.go(asked.points, asked.settings)
    in_noise = partial(_in_noise, drawn, asked)
    out: dict[tuple[str, str], float] = {}
    for name, settle_s in asked.axes.items():
        axis = AXES_OF_LINE[name]
        size = partial(flying.size, axis, REFERENCE)
        at = _fall(size, asked.low_hz, asked.high_hz, settle_s)
        if at is not None:
            slope = math.log(size(at * (1 + BESIDE), settle_s) / HALF) / math.log(1 + BESIDE)
            out["bandwidth", name] = at * (in_noise(axis, REFERENCE, [at], settle_s)[0] / HALF) ** (-1 / slope)
    for name in asked.sensitive:
        axis = AXES_OF_LINE[name]
        size = partial(flying.size, axis, SENSOR)
        _, at = _top(size, asked.low_hz, asked.high_hz, asked.axes[name])
        beside = [at * math.exp(d) for d in (-TOP, 0.0, TOP)]
        still = _vertex([size(hz, asked.axes[name]) for hz in beside])[1]
        out["s_max", name], moved = _vertex(in_noise(axis, SENSOR, beside, asked.axes[name]))
        out["s_max_hz", name] = at * math.exp(moved - still)
    return out


def _vertex(sizes: Sequence[float]) -> tuple[float, float]:
    """Of the parabola through the logarithms of three sizes, TOP apart: its value and where it is, from the middle one."""
    below, middle, above = np.log(sizes)
    c, b = (below - 2 * middle + above) / 2, (above - below) / 2
    return math.exp(middle - b * b / (4 * c)), -b / (2 * c) * TOP


def _in_noise(
    drawn: Truth, asked: LoopsAsked, axis: str, place: float, lines: Sequence[float], settle_s: float
) -> list[float]:
    """Sizes at some frequencies in the noise of the machine's own sensors."""
    halves = []
    for amplitude in (NOISY[place] * SMALL[axis], -NOISY[place] * SMALL[axis]):
        flying = Flying(drawn, asked.settings, noise=1)
        flying.go(asked.points, asked.settings)
        halves.append([flying.answer(axis, place, hz, settle_s, amplitude, NOISY_S) for hz in lines])
    return [size_of((up + down) / 2, place) for up, down in zip(*halves, strict=True)]


Size = Callable[[float, float], float]


def _fall(size: Size, low: float, high: float, settle_s: float) -> float | None:
    """Where a response falls through -3 dB, from the highest line on downwards."""
    hz = np.geomspace(low, high, GRID).tolist()
    above = high if size(high, SHORT_S) < HALF else None
    for below in reversed(hz[:-1]):
        if size(below, SHORT_S) >= HALF:
            break
        above = below
    else:
        return None
    if above is None:
        return None
    ends = [(math.log(f), math.log(size(f, settle_s) / HALF)) for f in (below, above)]
    for _ in range(30):  # Illinois' way of regula falsi
        (a, fa), (b, fb) = ends
        x = b - fb * (b - a) / (fb - fa)
        fx = math.log(size(math.exp(x), settle_s) / HALF)
        if abs(fx) < NEAR or abs(b - a) < NEAR:
            return math.exp(x)
        ends = [(b, fb), (x, fx)] if fx * fb < 0 else [(a, fa / 2), (x, fx)]
    return math.exp(ends[-1][0])


def _top(size: Size, low: float, high: float, settle_s: float) -> tuple[float, float]:
    """The greatest and its frequency: among lines, then by parabolas in the logarithms, each narrower."""
    hz = np.geomspace(low, high, GRID)
    seen = [size(f, SHORT_S) for f in hz]
    at, reach = float(hz[int(np.argmax(seen))]), math.log(hz[1] / hz[0])
    value = max(seen)
    for _ in range(6):
        x = np.array([-reach, 0.0, reach])
        y = np.log([size(at * math.exp(d), settle_s) for d in x])
        c, b, a = np.polyfit(x, y, 2)
        best = float(np.clip(-b / (2 * c), -reach, reach)) if c < 0 else float(x[int(np.argmax(y))])
        at, value = at * math.exp(best), math.exp(a + b * best + c * best * best)
        reach = max(reach / 3, 0.05)
    return value, at
