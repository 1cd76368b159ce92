"""The bare numbers of a sine in a record of whole periods: its phasor, and what a converter's counts may do to it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from procedures.shared.leastsquares import linear

Array = npt.NDArray[np.float64]


def without_trend(values: Array, periods: int) -> tuple[complex, Array]:
    """The phasor of so many periods beside a straight line, and what is left of both (n,). Taken off before, a line would take
    a share of up to 6/(pi p)^2 of the sine with it."""
    turn = 2 * np.pi * periods * np.arange(values.size) / values.size
    fit = linear(
        np.column_stack([np.cos(turn), np.sin(turn), np.ones_like(turn), np.linspace(-1, 1, values.size)]), values
    )
    return complex(fit.terms[0], -fit.terms[1]), fit.residuals


def counted(scale: float, rms: float, swing: float) -> float:
    """Standard uncertainty of the amplitude `swing` of a reading by its counts of `scale`; `rms` of what is not the sine.

    A rounding of step q after noise s adds at most (2 q/pi) exp(-2 pi^2 s^2/q^2) |J1(2 pi Y/q)| to a sine of amplitude Y
    (Widrow and Kollar, Quantization Noise, 2008: the first term of the rounding's series); |J1(x)| < sqrt(2/(pi x)). Its
    sign goes with Y and with where the loop stands between two counts: another for each line, an arcsine.
    """
    noise = max(rms**2 - scale * scale / 12, 0.0)  # without what rounding itself adds
    bessel = min(0.582, math.sqrt(scale / (math.pi**2 * max(swing, 1e-300))))
    return 2 * scale / math.pi * math.exp(-2 * noise * (math.pi / scale) ** 2) * bessel / math.sqrt(2)


def unwound(angle: Array, middle: float) -> Array:
    """An angle within half a turn as it went on, its middle next to `middle`, rad."""
    x = np.unwrap(angle)
    turn = 2 * math.pi
    return np.asarray(x + turn * round((middle - (x.max() + x.min()) / 2) / turn))
