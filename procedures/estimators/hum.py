"""Hum: lines in the probes' readings that are no motion of the shaft, at frequencies at which vectors are taken.

Within a dwell a line of the mains at the speed's own frequency is as steady as the response to unbalance: nothing scatters, and
it is in the vector. The slow roll shows it beside the speed, over seconds, at a few nanometres of noise. What is read there is
S h of a hum h, S the loop's sensitivity, as it is at the speed: S hardly depends on the speed. Its phase against a later mark
is not known, so that a vector may be off by all of it, as far as the dwell's turns tell its frequency from the speed's.

A line that goes with the turns of the slow roll is an order of the runout, which moves with the speed. Where the two lie too
close to be told apart (3000 r/min is order 10 of 300), the shaft that stood before it turned decides: an order is not there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.uncertainty import interval
from procedures.estimators.runup_estimates import Peak
from procedures.estimators.tracking_data import PROBE
from procedures.estimators.unbalance_checks import its_own
from procedures.estimators.unbalance_data import AXES, POSITIONS, SLOW, Array, Complex, Dwell
from procedures.estimators.unbalance_estimates import Result

FINER = 8  # points of the spectrum within a line of the slow roll, at least
CLEAR = (
    7.0  # of the noise's standard deviation per component: exp(-7^2/2) for each of some thousand points, 1e-7 in a run
)
ABOUT_HZ = 8.0  # to either side: where the noise is looked at
MEDIAN = math.sqrt(2 * math.log(2))  # of the amplitude of noise, over that standard deviation
REACH = 2.0  # lines of a dwell: what is farther off scatters from batch to batch, and is in the interval
ORDERLY = 3.0  # lines of the slow roll, by which its orders are as wide (Hann's window: 2, and a speed that wanders)
STANDS = 1 / 3  # of a line: less of it in the standing shaft, which the PID holds, and it was an order


@dataclass(frozen=True)
class Line:
    """A line at `hz`: its amplitude `size` m as the `probe`-th reads it, over `noise` m of its surroundings."""

    probe: int
    hz: float
    size: float
    noise: float


@dataclass(frozen=True)
class Heard:
    """The slow roll's spectrum: `hz` (n,), amplitudes `sizes` (4, n) m; the width of a line, its speed in Hz and by how much
    that wandered; the standing shaft: of each step times (m,) s and readings (4, m) m."""

    hz: Array
    sizes: Array
    width: float
    speed: float
    wandered: float
    standing: tuple[tuple[Array, Array], ...]

    def lines(self, low: float, high: float) -> Iterator[Line]:
        """What stands out of the noise between two frequencies in Hz, and is no order of the slow roll."""
        about = slice(*np.searchsorted(self.hz, [low - ABOUT_HZ, high + ABOUT_HZ]))
        for k, row in enumerate(self.sizes):
            noise = float(np.median(row[about])) / MEDIAN
            top = np.flatnonzero((row[1:-1] > row[:-2]) & (row[1:-1] >= row[2:]) & (row[1:-1] > CLEAR * noise)) + 1
            for i in top[(self.hz[top] >= low) & (self.hz[top] <= high)]:
                line = Line(k, float(self.hz[i]), float(row[i]), noise)
                if not self._is_order(line):
                    yield line

    def _is_order(self, line: Line) -> bool:
        n = round(line.hz / self.speed)
        if abs(line.hz - n * self.speed) > ORDERLY * self.width + n * self.wandered or not self.standing:
            return False
        waves, read = [], []
        for t, x in self.standing:  # each with a constant and a drift of its own
            wave = np.exp(-2j * math.pi * line.hz * (t - self.standing[0][0][0]))
            trend = np.linalg.qr(np.array([np.ones_like(t), t - t[0]]).T)[0]
            one = np.array([wave.real, wave.imag, x[line.probe]]).T
            one -= trend @ (trend.T @ one)
            waves.append(one[:, :2])
            read.append(one[:, 2])
        found = np.linalg.lstsq(np.concatenate(waves), np.concatenate(read), rcond=None)[0]
        return float(np.hypot(*found)) < STANDS * line.size


def heard(recording: Recording[Any], slow: Dwell | None) -> Heard | None:
    """What the slow roll of a recording and the shaft before it let hear; None without a slow roll."""
    if slow is None:
        return None

    def read(step: Any) -> tuple[Array, Array]:
        data = step.read(*POSITIONS)
        return (data["t_ns"] - recording.start_ns) * 1e-9, np.array([data[name] for name in POSITIONS])

    t, x = read(next(iter(recording.steps(SLOW))))
    period = float(np.median(np.diff(t)))
    place = np.rint((t - t[0]) / period).astype(int)  # lost samples leave holes
    window = np.hanning(place[-1] + 3)[1:-1][place]
    count = 1 << math.ceil(math.log2(FINER * (place[-1] + 1)))
    spread = np.zeros((4, place[-1] + 1))
    spread[:, place] = window * (x - x.mean(axis=1, keepdims=True))
    sizes = np.asarray(2 * np.abs(np.fft.rfft(spread, count)) / window.sum(), np.float64)
    speeds = slow.tacho.speed(t)
    wandered = float(np.nanmax(speeds) - np.nanmin(speeds)) / (4 * math.pi)
    standing = tuple(read(step) for step in recording.steps(PROBE))
    hz: Array = np.fft.rfftfreq(count, period)
    return Heard(hz, sizes, 1 / float(t[-1] - t[0]), slow.speed / (2 * math.pi), wandered, standing)


def leak(d: Dwell, hz: float) -> float:
    """The share of a line's amplitude that is in a dwell's vectors of order 1: the mean of exp(j (2 pi f t - theta)) over its
    turns, 1 where it cannot be told from the speed. A passage's speed goes on meanwhile: then it is less."""
    lasts = _lasts(d)
    t = float(d.track.t[0]) + lasts * (np.arange(4096) + 0.5) / 4096 - lasts / 2
    turned: Complex = np.exp(1j * (2 * math.pi * hz * t - d.tacho.angle(t)))
    return float(np.abs(np.nanmean(turned)))


def _lasts(d: Dwell) -> float:
    return 2 * math.pi * d.track.turns / d.speed


def of_dwells(found: Heard | None, results: Sequence[Result]) -> Iterator[Finding]:
    """Dwells whose vectors a line may move by more than their expanded uncertainty."""
    if found is None:
        return
    for r in results:
        d = r.dwell
        reach = REACH / _lasts(d)
        turns = d.speed / (2 * math.pi)
        known = [min(interval(r.estimates[name, a]).U for name in ("vector_cos", "vector_sin")) for a in AXES]
        off = [(x.size * leak(d, x.hz), x) for x in found.lines(turns - reach, turns + reach)]
        worst = max(off, key=lambda o: o[0] / known[o[1].probe], default=None)
        if worst is None or worst[0] <= known[worst[1].probe]:
            continue
        size, line = worst
        low, high = (60 * (line.hz + side * reach) for side in (-1, 1))
        text = (f"{_told(line)} Here, at {turns:.2f} Hz, the vector may be off by {size * 1e6:.3f} µm, "
                f"{size / known[line.probe]:.1f} times its U. Below {low:.0f} and above {high:.0f} r/min it is told "
                "apart.")  # fmt: skip
        yield Finding("hum", text, d.where, Effect.INDETERMINATE, its_own(d))


def of_peaks(found: Heard | None, peaks: Sequence[Peak]) -> Iterator[Finding]:
    """Critical speeds in whose peak, down to half power, a line is larger than the amplitude's expanded uncertainty: a passage
    is too short at any speed to tell it apart."""
    for p in peaks if found is not None else ():
        assert found is not None
        known = interval(p.amplitude).U
        lines = [x for x in found.lines(p.low / (2 * math.pi), p.high / (2 * math.pi)) if AXES[x.probe] == p.axis]
        line = max(lines, key=lambda x: x.size, default=None)
        if line is not None and line.size > known:
            text = (f"{_told(line)} It lies within half power of this critical speed, whose amplitude is known to "
                    f"{known * 1e6:.3f} µm.")  # fmt: skip
            yield Finding("hum", text, p.where, Effect.INDETERMINATE, (f"@{p.where}",))


def _told(line: Line) -> str:
    return (f"at slow roll {AXES[line.probe]} reads a line of {line.size * 1e6:.3f} µm at {line.hz:.2f} Hz, over "
            f"{line.noise * 1e6:.3f} µm of noise, that does not turn with the shaft: suspect mains hum in probes or "
            "cables.")  # fmt: skip
