"""Following a slow sine of the angle's reference: when it began, the tracking error, and what catches the rotor.

r(t) = A sin(2 pi f (t - t_0)); t_0 is not in the telemetry. The torque current shows it: the reference's slope jumps from
nothing to 2 pi f A, which the proportional and the derivative part of the controller answer at once.

At slow speed the motor's torque balances what resists: inertia (as theta), friction (a constant for each way), viscous drag,
and the detent, which goes with the angle:

    alpha_tau i_theta = c_0 + c_1 theta + c_2 theta' + c_3 theta^2 + a cos(n theta) + b sin(n theta)

fitted to each pass from one reversal to the other, n = 16 per turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from procedures.shared.leastsquares import linear
from procedures.shared.sines import known_frequency

Array = npt.NDArray[np.float64]
ONSET_S = 6e-3  # of the torque current that the start is read from: the rotor has hardly moved by then
ONSET_STEP_S = 5e-5
MOVING = 0.2  # share of the greatest speed; below it, near a reversal, friction changes sign
PASS_TERMS = 6


@dataclass(frozen=True)
class Swing:
    """One frequency: `hz`, `amplitude` rad of the reference, and samples from before its start: `t` (n,) s, `angle` (n,) rad,
    `torque` (n,) A. `earliest` and `latest` s bracket the start, `periods` are whole ones after the first; the reference's
    middle moves to `shifts` (m,) rad at `shifted` (m,) s."""

    hz: float
    amplitude: float
    t: Array
    angle: Array
    torque: Array
    earliest: float
    latest: float
    periods: int
    shifted: Array
    shifts: Array


def shifts(periods: int, count_rad: float) -> list[float]:
    """Where the middle of the reference lies in each period, the first included: parts of a count, evenly spread however
    many there are (multiples of the golden ratio)."""
    return [count_rad * ((k * 0.6180339887) % 1.0) for k in range(periods + 1)]


@dataclass(frozen=True)
class Gains:
    """Of the angle's controller: A/rad, A s/rad on the error, and the derivative's filter in Hz."""

    kp: float
    kd: float
    filter_hz: float


def start(s: Swing, gains: Gains) -> float:
    """When the reference began to move, s, within the bracket: the start whose onset fits the torque current best.

    i = i_0 + 2 pi f A (k_p u + k_d (1 - exp(-u / T))), u = t - t_0, T = 1 / (2 pi f_filter). A sample is a mean over its
    period, which ends at its time. An encoder count that flips meanwhile disturbs it: slow swings tell less.
    """
    period = float(np.median(np.diff(s.t)))
    slope, lag = 2 * math.pi * s.hz * s.amplitude, 1 / (2 * math.pi * gains.filter_hz)
    best = (math.inf, s.earliest)
    for t_0 in np.arange(s.earliest, s.latest + ONSET_STEP_S, ONSET_STEP_S):
        near = (s.t > s.earliest - 0.05) & (s.t <= t_0 + ONSET_S)
        u = np.maximum(s.t[near] - period / 2 - t_0, 0.0)
        model = slope * (gains.kp * u + gains.kd * (1 - np.exp(-u / lag)))
        misfit = float((s.torque[near] - model).var())
        if misfit < best[0]:
            best = (misfit, float(t_0))
    return best[1]


def starts(swings: Sequence[Swing], gains: Gains) -> tuple[list[float], float]:
    """When each reference began, s, and a half width for all: the delay after the write is that of the fastest swing, whose
    onset is the steepest; the half width is half a sample, or half the spread of the three fastest if that is more (not of
    those slower than a quarter of the fastest: their onset tells less than the link's delay varies)."""
    fastest = sorted(swings, key=lambda s: s.hz, reverse=True)[:3]
    fastest = [s for s in fastest if s.hz >= fastest[0].hz / 4]
    delays = [start(s, gains) - s.earliest for s in fastest]
    period = float(np.median(np.diff(fastest[0].t)))
    return [s.earliest + delays[0] for s in swings], max(period, float(np.ptp(delays))) / 2


def reference(s: Swing, t_0: float) -> Array:
    """The reference at every sample, from the start on."""
    at = np.searchsorted(s.shifted, s.t, side="right") - 1
    middle = np.where(at >= 0, s.shifts[np.maximum(at, 0)], 0.0) if len(s.shifts) else 0.0
    out: Array = middle + s.amplitude * np.sin(2 * math.pi * s.hz * np.maximum(s.t - t_0, 0.0))
    return out


def steady(s: Swing, t_0: float) -> list[npt.NDArray[np.bool_]]:
    """Which samples belong to each whole period after the first one."""
    out = [(s.t > t_0 + k / s.hz) & (s.t <= t_0 + (k + 1) / s.hz) for k in range(1, s.periods + 1)]
    if not out or min(m.sum() for m in out) < 20 or s.t[-1] < t_0 + (s.periods + 1) / s.hz - 0.01 / s.hz:
        raise AnalysisError(
            f"{s.hz:g} Hz: found {s.t[-1] - t_0:.2f} s after the start; expected {s.periods + 1} periods"
        )
    return out


@dataclass(frozen=True)
class Tracking:
    """Per period (p,): `rms` and `peak` rad of the error (reference less angle), `ratio` of the amplitudes, `lag` s."""

    rms: Array
    peak: Array
    ratio: Array
    lag: Array


def tracking(s: Swing, t_0: float, count_rad: float) -> Tracking:
    """The error of each period. Encoder counts add count^2/12 to its square, which is taken off; a peak is a mean of five
    samples, for the same reason.

    Raises:
        AnalysisError: the record is too short.
    """
    error = reference(s, t_0) - s.angle
    five = np.convolve(error, np.ones(5) / 5, mode="same")
    rms, peak, ratio, lag = [], [], [], []
    for period in steady(s, t_0):
        rms.append(math.sqrt(max(float((error[period] ** 2).mean()) - count_rad**2 / 12, 0.0)))
        peak.append(float(np.abs(five[period]).max()))
        fitted = known_frequency(s.t[period] - t_0, s.angle[period], s.hz)
        ratio.append(fitted.amplitude / s.amplitude)
        lag.append(-math.remainder(fitted.phase, 2 * math.pi) / (2 * math.pi * s.hz))
    return Tracking(np.array(rms), np.array(peak), np.array(ratio), np.array(lag))


def smooth(s: Swing, t_0: float) -> Array:
    """The angle without its counts, (n,): the sine that fits it best. The counts themselves must not be a regressor: the
    controller answers each of them with current (k_p + k_d / T of it), which would look like torque over angle."""
    use = np.logical_or.reduce(steady(s, t_0))
    return known_frequency(s.t[use], s.angle[use], s.hz).at(s.t)


def answered(s: Swing, t_0: float) -> float:
    """Amplitude of the torque current at the swing's frequency, A."""
    use = np.logical_or.reduce(steady(s, t_0))
    return known_frequency(s.t[use], s.torque[use], s.hz).amplitude


@dataclass(frozen=True)
class Passes:
    """Per period (p,): `cosine`, `sine` A of the torque current's part that goes with n times the angle, both ways
    together; `friction` A, half of the difference between the two ways."""

    cosine: Array
    sine: Array
    friction: Array


def passes(s: Swing, t_0: float, order: int) -> Passes:
    """Fit the torque current of every pass from reversal to reversal; both ways of a period count together, so that what
    lags by its own delay, in current or angle, cancels.

    Raises:
        AnalysisError: the swing covers less than a period of the detent.
    """
    if 2 * s.amplitude * order < 2 * math.pi:
        raise AnalysisError(f"the swing of +-{s.amplitude:.3f} rad covers less than one of {order} periods of the turn")
    angle = smooth(s, t_0)
    out = []
    for k in range(1, s.periods + 1):
        both = [_one_pass(s, angle, t_0 + (k + at) / s.hz, t_0, order) for at in (-0.25, 0.25)]
        out.append([*((both[0] + both[1]) / 2)[:2], (both[0] - both[1])[2] / 2])
    found = np.array(out)
    return Passes(found[:, 0], found[:, 1], found[:, 2])


def _one_pass(s: Swing, angle: Array, begin: float, t_0: float, order: int) -> Array:
    """Cosine and sine of the order, and the mean torque current, of half a period that begins at a reversal."""
    omega = 2 * math.pi * s.hz
    m = (s.t > begin) & (s.t <= begin + math.pi / omega)
    speed = np.cos(omega * (s.t - t_0))
    m &= np.abs(speed) > MOVING
    if m.sum() < 10 * PASS_TERMS:
        raise AnalysisError(f"{s.hz:g} Hz: found {int(m.sum())} samples in a pass; expected {10 * PASS_TERMS} or more")
    theta = angle[m]
    design = np.column_stack(
        [np.cos(order * theta), np.sin(order * theta), np.ones_like(theta), theta, theta**2, speed[m]]
    )
    fitted = linear(design, s.torque[m]).terms
    return np.array([fitted[0], fitted[1], float(s.torque[m].mean())])


def orders(s: Swing, t_0: float, values: Array, highest: int) -> tuple[Array, Array]:
    """Amplitude of `values` over the number of periods per turn, 1 .. highest, each fitted alone beside a parabola in the
    angle, both ways averaged. The swing is less than a turn, so that neighbouring orders are not independent."""
    use = np.logical_or.reduce(steady(s, t_0)) & (np.abs(np.cos(2 * math.pi * s.hz * (s.t - t_0))) > MOVING)
    forward = np.cos(2 * math.pi * s.hz * (s.t - t_0)) > 0
    numbers = np.arange(1, highest + 1)
    amplitude = np.zeros(highest)
    angle = smooth(s, t_0)
    for k, n in enumerate(numbers):
        both = np.zeros(2)
        for way in (use & forward, use & ~forward):
            theta = angle[way]
            design = np.column_stack([np.cos(n * theta), np.sin(n * theta), np.ones_like(theta), theta, theta**2])
            both += np.linalg.lstsq(design, values[way], rcond=None)[0][:2] / 2
        amplitude[k] = math.hypot(*both)
    return numbers.astype(np.float64), amplitude
