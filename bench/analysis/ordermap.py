"""Order map of a run-up: the record resampled to equal angles, so that what turns with the shaft stays on its line."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.analysis.sampling import Array, Sampling, increasing, rows
from bench.analysis.tachometer import TURN, Tachometer
from bench.analysis.windows import get_window
from bench.errors import AnalysisError

BAND = 0.4  # of the sampling rate: above, splines between samples are not to be trusted


@dataclass(frozen=True)
class OrderMap:
    """Amplitudes 0-pk `values` (b, m) of `orders` (m,) in b blocks, at `t` (b,) s and `speed` (b,) rad/s; NaN where an order
    lies above what the sampling rate can show."""

    t: Array
    speed: Array
    orders: Array
    values: Array
    window: str


def order_map(
    t: npt.ArrayLike,
    x: npt.ArrayLike,
    tacho: Tachometer,
    sampling: Sampling,
    *,
    turns: int = 16,
    highest: float = 8.0,
    window: str = "hann",
    blocks: int = 400,
) -> OrderMap:
    """Computed order tracking of one channel (n,): lines every 1/`turns` order up to `highest`, at most `blocks` blocks.

    Each block has as many points per turn as keep all of the record's band, so that nothing folds back (Fyfe and Munck,
    Mech. Syst. Signal Process. 11, 187 (1997)). Means of readings are put right as in `orders`.

    Raises:
        AnalysisError: the record is shorter than a block.
    """
    from scipy import fft
    from scipy.interpolate import CubicSpline

    at, data = increasing(t, "order map"), rows(x, np.size(t))[0]
    read = at - sampling.late
    first = max(float(tacho.angle(max(read[0], tacho.times[0]))), TURN * float(tacho.turns[0]))
    last = float(tacho.angle(min(read[-1], tacho.times[-1])))
    count = int((last - first) / TURN / turns)
    if count < 1:
        raise AnalysisError(f"order map: found {(last - first) / TURN:.1f} turns; expected {turns} or more")
    rate = (at.size - 1) / float(at[-1] - at[0])
    starts = first + TURN * turns * np.unique(np.linspace(0, count - 1, min(count, blocks)).astype(np.intp))
    orders = np.arange(0, round(highest * turns) + 1) / turns
    spline = CubicSpline(read, data)
    times, speeds, values = np.empty(starts.size), np.empty(starts.size), np.empty((starts.size, orders.size))
    for k, start in enumerate(starts):
        ends = tacho.time([start, start + TURN * turns])
        speeds[k] = TURN * turns / (ends[1] - ends[0])
        times[k] = ends.mean()
        points = fft.next_fast_len(max(math.ceil(1.2 * rate * (ends[1] - ends[0])), 2 * orders.size), real=True)
        w = get_window(window, points)
        piece = spline(tacho.time(start + TURN * turns * np.arange(points) / points))
        lines = np.abs(fft.rfft((piece - piece.mean()) * w))[: orders.size] * 2 / w.sum()
        shown = orders * speeds[k] < TURN * BAND * rate
        values[k] = np.where(shown, lines / np.where(shown, sampling.gain(orders * speeds[k]), 1.0), np.nan)
    return OrderMap(times, speeds, orders, values, window)
