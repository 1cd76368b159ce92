"""What the shaft's own motion is in the current that answers a step, so that what is left tells when the step began.

A law that goes by the distance from its set point and by the rate of the shaft makes i = J (u(t) - y(t)) - d y'(t), y as a
share of the step; and y is read as well. A square of time in the place of y and y' holds until the shaft turns the current
round. That goes with the period of the telemetry over the rise, and with the damping: in the four periods of 0.5 ms that are
looked at, 1.35 rises of a rotor of 60 g, its start was told 0.09 ms early.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.onset import Shaft
from procedures.step import response

Array = npt.NDArray[np.float64]
# Of a controller's ticks, by which a current begins to follow a reading: computed until the next one, and held for one. A rate
# is older: a difference of two readings is that of their middle, and what keeps its noise down takes about a tick more. Without
# noise the start is then 20 us late at most where a tick is a fifth of the telemetry's period or less (40 without that tick).
HELD_TICKS, RATE_TICKS = 1.5, 1.5
# Of how far the shaft goes: noise of a reading, beyond which its rate is told worse than a square of time stands for it. A loop
# of 24 Hz goes a fifth of its step, of which its noise was 7 %, and its start was told 0.3 ms early; a spindle's is 0.4 %.
NOISY, LAST = 0.015, 3  # samples that tell how far


def by_distance(machine: AmbRotor) -> bool:
    """Whether the controller's law goes by the distance from the set point. One that makes forces of a model takes away the
    magnets' negative stiffness too, and its currents go by other shares of position and set point."""
    return not machine.can.flatness


def is_told(t: Array, y: Array, before: float, until: float) -> bool:
    """Whether readings `y` (n,) tell how the shaft moves from `before` until then: not one that hardly does, beside noise."""
    rest, gone = y[t <= before], y[t <= until][-LAST:]
    return len(rest) > LAST and bool(rest.std() < NOISY * gone.mean())


def motion(t: Array, y: Array, *, tick: float, lag_s: float) -> Shaft:
    """Of a shaft whose readings `y` (n,), as shares of its step, are means over the period before `t` (n,)."""
    fine, curve = response.curve(
        t - tick / 2, y
    )  # a reading stands for half a tick either way, and the last is one tick old
    both = [_lagged(x, lag_s, float(fine[1] - fine[0])) for x in (curve, np.gradient(curve, fine))]

    def at(reads: Array) -> Array:
        old = (HELD_TICKS, HELD_TICKS + RATE_TICKS)
        return np.column_stack(
            [np.interp(reads - k * tick, fine, x).mean(axis=1) for k, x in zip(old, both, strict=True)]
        )

    return at


def _lagged(x: Array, lag_s: float, apart: float) -> Array:
    """`x` (n,), `apart` s from each other with straight lines between, as an amplifier of the first order follows it."""
    from scipy import signal

    keep = np.exp(-apart / lag_s)
    share = (1 - keep) * lag_s / apart
    followed, _ = signal.lfilter([1 - share, share - keep], [1.0, -keep], x, zi=[share * x[0]])
    return np.asarray(followed)
