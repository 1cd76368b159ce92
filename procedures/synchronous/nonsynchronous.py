"""What the captures show beside the vectors of order 1: motion that does not turn with the shaft, and orders that the telemetry
takes for order 1. Neither scatters where it matters, so that both enter the budgets by their size."""

from __future__ import annotations

import math

import numpy as np

from bench.analysis.orders import synchronous
from bench.analysis.sampling import Sampling
from procedures.synchronous.dwells import DWELL, Array, Dwell

FITTED = 8  # orders that turn with the shaft
QUIET = 6.0  # standard deviations of a probe's noise that a peak of it reaches
FOLDING, HIGHEST = 12, 0.4  # orders that may fold; share of the capture's rate up to which they are looked at
LEAKS = 0.02  # share of an order that shows as order 1, below which it is nothing


def beside_orders(d: Dwell) -> Array:
    """Of both planes (2,) m: the greatest motion in the capture that does not turn with the shaft, its mean and drift apart,
    beyond what the probes' noise makes of a peak; nothing without a capture."""
    if d.full is None:
        return np.zeros(2)
    angle = d.full.tacho.angle(d.full.t)
    inside = np.isfinite(angle)
    theta, data = angle[inside], d.full.positions[:, inside]
    turning = [f(n * theta) for n in range(1, FITTED + 1) for f in (np.cos, np.sin)]
    steady = np.array([np.ones_like(theta), *turning])
    design = np.concatenate([steady, steady * np.linspace(-1, 1, theta.size)])  # amplitudes that change evenly
    # By the normal equations: waves over whole turns are nearly orthogonal, and LAPACK's many small steps on a long matrix take
    # a second where its threads wait for each other.
    rest = data - np.linalg.solve(design @ design.T, design @ data.T).T @ design
    noise = np.diff(data, 3).std(axis=1) / math.sqrt(20)
    far = [np.hypot(rest[k], rest[k + 1]).max() - QUIET * noise[k : k + 2].max() for k in (0, 2)]
    return np.asarray(np.maximum(far, 0.0), np.float64)


def folds(d: Dwell) -> tuple[int, Array]:
    """By how much an order that the telemetry is too slow for may be off in the vectors of order 1 of the four probes, (4,) m,
    and that order: where the speed is a whole share of the telemetry's rate, it comes out as order 1 in every sample, and
    nothing scatters. Its amplitude is that of the capture."""
    turn = d.speed / (2 * math.pi)
    rate, worst, most = 1 / (d.sampling.ticks * d.sampling.tick), 0, np.zeros(4)
    if d.full is None or d.kind != DWELL:  # a passage stands at no speed
        return worst, most
    for n in range(2, int(min(FOLDING, HIGHEST * d.full.rate / turn)) + 1):
        away = abs(abs(n * turn - rate * round(n * turn / rate)) - turn) * d.track.turns / turn  # in lines of the dwell
        share = abs(float(d.sampling.gain(n * d.speed) / d.sampling.gain(d.speed))) / max(math.pi * away, 1.0)
        if share < LEAKS:
            continue
        seen = synchronous(d.full.t, d.full.positions, d.full.tacho, Sampling(1 / d.full.rate), orders=(1.0, float(n)))
        off = share * np.abs(seen.vectors(0, range(4), float(n)).values)
        if off.max() > most.max():
            worst, most = n, off
    return worst, most
