"""What the slewing test draws, after T Fig. 8.1: following, the error over time and angle, its growth with frequency."""

from __future__ import annotations

import numpy as np

from bench.figures import Figure, Series
from bench.uncertainty import coverage_factor
from procedures.slew.estimates import Result
from procedures.slew.fit import Swing, orders, reference, steady

HIGHEST = 64  # order that is shown


def all_figures(result: Result, order: int) -> list[Figure]:
    """In the order of the report."""
    slowest, t_0 = min(result.swings, key=lambda pair: pair[0].hz)
    return [
        _following(slowest, t_0),
        _over_time(slowest, t_0),
        _over_angle(result),
        _growth(result),
        _torque(slowest, t_0),
        _orders(slowest, t_0, order),
    ]


def _following(s: Swing, t_0: float) -> Figure:
    t = s.t - t_0
    return Figure("following", f"Angle and reference at {s.hz:g} Hz", "From the start of the sine; evaluated is what comes "
                  "after the first period.", "time (s)", "angle (°)",
                  (Series("reference", t, np.degrees(reference(s, t_0))), Series("angle", t, np.degrees(s.angle))))  # fmt: skip


def _over_time(s: Swing, t_0: float) -> Figure:
    use = steady(s, t_0)[0]
    error = np.degrees(reference(s, t_0) - s.angle)
    smooth = np.convolve(error, np.ones(25) / 25, mode="same")
    return Figure("error-time", f"Tracking error over one period at {s.hz:g} Hz",
                  "Reference less angle: single samples show the encoder's counts, the mean of 25 what is behind them.",
                  "time (s)", "error (°)", (Series("samples", s.t[use] - t_0, error[use]),
                                            Series("mean of 25", s.t[use] - t_0, smooth[use])))  # fmt: skip


def _binned(angle: np.ndarray, values: np.ndarray, count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Means of values in equal bins of the angle; bins without samples are left out."""
    edges = np.linspace(angle.min(), angle.max(), count + 1)
    k = np.clip(np.digitize(angle, edges) - 1, 0, count - 1)
    n = np.bincount(k, minlength=count)
    full = n > 0
    mean = np.bincount(k, values, count)[full] / n[full]
    return (edges[:-1] + edges[1:])[full] / 2, mean


def _ways(s: Swing, t_0: float, values: np.ndarray, scale: float) -> tuple[Series, Series]:
    use = np.logical_or.reduce(steady(s, t_0))
    forward = np.cos(2 * np.pi * s.hz * (s.t - t_0)) > 0
    out = []
    for label, way in ((f"{s.hz:g} Hz, forward", use & forward), (f"{s.hz:g} Hz, back", use & ~forward)):
        x, y = _binned(s.angle[way], values[way])
        out.append(Series(label, np.degrees(x), scale * y))
    return out[0], out[1]


def _over_angle(result: Result) -> Figure:
    slow = sorted(result.swings, key=lambda pair: pair[0].hz)[:2]
    series = [line for s, t_0 in slow for line in _ways(s, t_0, np.degrees(reference(s, t_0) - s.angle), 1.0)]
    return Figure("error-angle", "Tracking error over the angle", "Means over all periods in sixty bins, for the two slowest "
                  "frequencies: what catches the rotor does so at the same angles.", "angle (°)", "error (°)",
                  tuple(series))  # fmt: skip


def _growth(result: Result) -> Figure:
    hz = np.array(sorted(result.tracking))
    periods = len(result.passes.cosine)
    series = []
    for name, label in (("error_rms", "rms"), ("error_peak", "peak")):
        found = [result.tracking[f][name] for f in hz]
        values = np.array([e.value for e in found])
        k = coverage_factor(periods - 1)
        u = np.minimum([k * e.u for e in found], 0.9 * values)  # a logarithmic axis has no room below zero
        series.append(Series(label, hz, np.degrees(values), "both", np.degrees(u)))
    return Figure("growth", "Tracking error over frequency", "With 95 % intervals (as T Fig. 8.1c); those that reach below "
                  "zero are cut.", "frequency (Hz)", "error (°)", tuple(series), log_x=True, log_y=True)  # fmt: skip


def _torque(s: Swing, t_0: float) -> Figure:
    return Figure("torque-angle", f"Torque current over the angle at {s.hz:g} Hz",
                  "Means over all periods in sixty bins. The distance between the two ways is friction, what they share is the "
                  "detent.", "angle (°)", "torque current (mA)", _ways(s, t_0, s.torque, 1e3))  # fmt: skip


def _orders(s: Swing, t_0: float, order: int) -> Figure:
    numbers, error = orders(s, t_0, reference(s, t_0) - s.angle, HIGHEST)
    _, torque = orders(s, t_0, s.torque, HIGHEST)
    low = int(1.5 * np.pi / s.amplitude)  # below, a parabola does much the same
    shown = slice(low, None)
    return Figure("orders", f"Orders of the angle at {s.hz:g} Hz", "Amplitude of each order fitted alone beside a parabola, "
                  f"both ways averaged; the swing resolves {np.pi / s.amplitude:.0f} orders. The detent's is {order}.",
                  "periods per turn", "amplitude",
                  (Series("error (mrad)", numbers[shown], 1e3 * error[shown]),
                   Series("torque current (10 mA)", numbers[shown], 1e2 * torque[shown])))  # fmt: skip
