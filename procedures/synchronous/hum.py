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

from bench.analysis.tachometer import Tachometer
from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.uncertainty import interval
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.nudges import PROBE
from procedures.synchronous.checks import its_own
from procedures.synchronous.dwells import SLOW, Array, Complex, Dwell
from procedures.synchronous.estimates import Result

FINER = 8  # points of the spectrum within a line of the slow roll, at least
CLEAR = 7.0  # standard deviations of a component of the noise: exp(-7^2/2) for each of some thousand points, 1e-7 a run
ABOUT_HZ = 5.0  # to either side: where the noise is looked at; over more it is not the same
MEDIAN = math.sqrt(2 * math.log(2))  # of the amplitude of noise, over that standard deviation
REACH = 2.0  # lines of a dwell: what is farther off scatters from batch to batch, and is in the interval
ORDERLY = 3.0  # lines of the slow roll, by which its orders are as wide (Hann's window: 2, and a speed that wanders)
STANDS = 1 / 3  # of a line: if the standing shaft, which the PID holds, shows as much, all of it is taken for hum
SURE = 5.0  # of the standing shaft's noise: hum beside an order that is greater
BESIDE_HZ = (7.0, 10.0, 13.0, 16.0, 19.0)  # where that noise is looked at


@dataclass(frozen=True)
class Line:
    """A line at `hz`: its amplitude `size` m as the `probe`-th reads it, that of `axis`, over `noise` m of its surroundings."""

    probe: int
    axis: str
    hz: float
    size: float
    noise: float


@dataclass(frozen=True)
class Heard:
    """The slow roll's spectrum: `hz` (n,), amplitudes `values` (4, n) m, complex; the width of a line, its speed in
    Hz and by how much that wandered; the standing shaft: of each step times (m,) s and readings (4, m) m; the probes' axes."""

    hz: Array
    values: Complex
    width: float
    speed: float
    wandered: float
    standing: tuple[tuple[Array, Array], ...]
    axes: tuple[str, ...]

    def lines(self, low: float, high: float) -> Iterator[Line]:
        """What stands out of the noise between two frequencies in Hz, and is no order of the slow roll."""
        first, last = np.searchsorted(self.hz, [low, high])
        beside = round(ABOUT_HZ / float(self.hz[1]))
        for k, row in enumerate(np.abs(self.values)):
            part = row[first - 1 : last + 1]
            for i in first + np.flatnonzero((part[1:-1] > part[:-2]) & (part[1:-1] >= part[2:])):
                noise = float(np.median(row[max(i - beside, 0) : i + beside])) / MEDIAN
                size = self._less_order(k, float(self.hz[i]), float(row[i])) if row[i] > CLEAR * noise else 0.0
                if size:
                    yield Line(k, self.axes[k], float(self.hz[i]), size, noise)

    def at(self, hz: float) -> Complex:
        """What the four probes read at a frequency, (4,) m, 0-pk; their phases against each other hold at any time."""
        return np.asarray(self.values[:, int(np.argmin(np.abs(self.hz - hz)))])

    def _less_order(self, probe: int, hz: float, size: float) -> float:
        """What is left of a line if an order of the slow roll cannot be told from it, by the standing shaft; m."""
        n = round(hz / self.speed)
        if abs(hz - n * self.speed) > ORDERLY * self.width + n * self.wandered or not self.standing:
            return size
        stood = self._stood(probe, hz)
        if stood > STANDS * size:
            return size
        noise = (
            float(np.median([self._stood(probe, hz + side * off) for side in (-1, 1) for off in BESIDE_HZ])) / MEDIAN
        )
        return stood if stood > SURE * noise else 0.0

    def _stood(self, probe: int, hz: float) -> float:
        """Amplitude at a frequency before the shaft turned, in steps that have a constant and a drift each; m."""
        waves, read = [], []
        for t, x in self.standing:
            wave = np.exp(-2j * math.pi * hz * (t - self.standing[0][0][0]))
            trend = np.linalg.qr(np.array([np.ones_like(t), t - t[0]]).T)[0]
            one = np.array([wave.real, wave.imag, x[probe]]).T
            one -= trend @ (trend.T @ one)
            waves.append(one[:, :2])
            read.append(one[:, 2])
        return float(np.hypot(*np.linalg.lstsq(np.concatenate(waves), np.concatenate(read), rcond=None)[0]))


def listen(recording: Recording[Any], slow: Dwell | None) -> Heard | None:
    """What the slow roll of a recording and the shaft before it let hear; None without a slow roll."""
    if slow is None:
        return None
    machine = conventions(recording.rig)

    def read(step: Any) -> tuple[Array, Array]:
        data = step.read(*machine.positions)
        return (data["t_ns"] - recording.start_ns) * 1e-9, np.array([data[name] for name in machine.positions])

    t, x = read(next(iter(recording.steps(SLOW))))
    period = float(np.median(np.diff(t)))
    place = np.rint((t - t[0]) / period).astype(int)  # lost samples leave holes
    window = np.hanning(place[-1] + 3)[1:-1][place]
    count = 1 << math.ceil(math.log2(FINER * (place[-1] + 1)))
    spread = np.zeros((4, place[-1] + 1))
    spread[:, place] = window * (x - x.mean(axis=1, keepdims=True))
    values: Complex = 2 * np.fft.rfft(spread, count) / window.sum()
    speeds = slow.tacho.speed(t)
    wandered = float(np.nanmax(speeds) - np.nanmin(speeds)) / (4 * math.pi)
    standing = tuple(read(step) for step in recording.steps(PROBE))
    hz = np.arange(values.shape[1]) / (count * period)
    return Heard(hz, values, 1 / float(t[-1] - t[0]), slow.speed / (2 * math.pi), wandered, standing, machine.axes)


def leak(d: Dwell, hz: float) -> float:
    """The share of a line's amplitude that is in a dwell's vectors of order 1."""
    lasts = duration(d)
    return leak_over(d.tacho, float(d.track.t[0]) - lasts / 2, lasts, hz)


def leak_over(tacho: Tachometer, begin: float, lasts: float, hz: float) -> float:
    """The mean of exp(j (2 pi f t - theta)) over the turns from `begin` on: 1 where a line cannot be told from the speed. The
    speed of a passage goes on meanwhile: then it is less."""
    t = begin + lasts * (np.arange(4096) + 0.5) / 4096
    turned: Complex = np.exp(1j * (2 * math.pi * hz * t - tacho.angle(t)))
    return float(np.abs(np.nanmean(turned)))


def duration(d: Dwell) -> float:
    """Of the whole turns that its vectors are of, s."""
    return 2 * math.pi * d.track.turns / d.speed


def describe(line: Line) -> str:
    """What was heard, for the reader."""
    return (f"at slow roll {line.axis} reads a line of {line.size * 1e6:.3f} µm at {line.hz:.2f} Hz, over "
            f"{line.noise * 1e6:.3f} µm of noise, that does not turn with the shaft: suspect mains hum in probes or "
            "cables.")  # fmt: skip


def of_dwells(found: Heard | None, results: Sequence[Result]) -> Iterator[Finding]:
    """Dwells whose vectors a line may move by more than their expanded uncertainty."""
    if found is None:
        return
    for r in results:
        d = r.dwell
        reach = REACH / duration(d)
        turns = d.speed / (2 * math.pi)
        known = [min(interval(r.estimates[name, a]).U for name in ("vector_cos", "vector_sin")) for a in d.machine.axes]
        off = [(x.size * leak(d, x.hz), x) for x in found.lines(turns - reach, turns + reach)]
        worst = max(off, key=lambda o: o[0] / known[o[1].probe], default=None)
        if worst is None or worst[0] <= known[worst[1].probe]:
            continue
        size, line = worst
        low, high = (60 * (line.hz + side * reach) for side in (-1, 1))
        text = (f"{describe(line)} Here, at {turns:.2f} Hz, the vector may be off by {size * 1e6:.3f} µm, "
                f"{size / known[line.probe]:.1f} times its U. Below {low:.0f} and above {high:.0f} r/min it is told "
                "apart.")  # fmt: skip
        yield Finding("hum", text, d.where, Effect.INDETERMINATE, its_own(d))
