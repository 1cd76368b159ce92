"""How long a step of the set point is recorded where the plan does not say, until the integrator of the law has arrived; and
how long after it the next may begin, when what it leaves is nothing beside the band of the next.

With the PID a step of r is first one of r K_i k_p/(K_i k_p - K_s), since the magnets' negative stiffness K_s helps the new
place along; what is beyond r the integrator takes away with the time constant (k_p - K_s/K_i)/k_I. By the bearings' law
F = beta (i_p²/(kappa - o)² - i_n²/(kappa + o)²) at the bias i_b, K_s/K_i is
i_b ((kappa - o)^-3 + (kappa + o)^-3)/((kappa - o)^-2 + (kappa + o)^-2): beta does not matter, nor does what carries the weight.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from procedures.amb_rotor.machine import AmbRotor

LEAST_S = 1.5  # the flatness laws know the negative stiffness: little is left to their integrators
MOST_S = 10.0  # a slower integrator is for `warm`, or for `record_s`
LEFT = 1 / 3  # of the band that may be left at the end
NOTHING = 1e-3  # of the band: with a third of it the next step's level is 0.4 % off, and its settling time by 50 ms
ROUNDED_S = 0.5


def enough_s(machine: AmbRotor, settings: Iterable[Mapping[str, float]], axes: Iterable[str], band: float) -> float:
    """For the slowest of `settings`, each with all parameters of the controller; s."""
    slowest = max((_left_s(machine, s, axis, LEFT * band) for axis in axes for s in settings), default=LEAST_S)
    return math.ceil(min(max(slowest, LEAST_S), MOST_S) / ROUNDED_S - 1e-9) * ROUNDED_S


def faded_s(machine: AmbRotor, settings: Mapping[str, float], axis: str, band: float) -> float:
    """From a step to where the next may begin, s: 0 where the law has no slow integrator."""
    ki = machine.gain("ki", machine.along(axis)[0])
    return min(_left_s(machine, settings, axis, NOTHING * band), 2 * MOST_S) if settings.get(ki) else 0.0


def _left_s(machine: AmbRotor, of: Mapping[str, float], axis: str, share: float) -> float:
    """Until what the integrator has still to do is that share of the step; 0 where there is nothing to do for it."""
    along = machine.along(axis)
    kp, ki = machine.gain("kp", along[0]), machine.gain("ki", along[0])
    biased = all(machine.biases.get(one) in of for one in along)
    plain = all(of.get(name) == value for name, value in machine.select(machine.plain_law).items())
    if not plain or not {kp, ki} <= of.keys() or not biased:
        return 0.0
    softer = max(of[machine.biases[one]] * _stiffness(machine, of, one) for one in along)
    if not 0 < softer < of[kp]:
        return 0.0
    beyond, constant = softer / (of[kp] - softer), (of[kp] - softer) / of[ki] if of[ki] else math.inf
    return constant * max(math.log(beyond / share), 0.0)


def _stiffness(machine: AmbRotor, of: Mapping[str, float], axis: str) -> float:
    """K_s/K_i of an axis' magnets over their bias, 1/m."""
    known = machine.can.model.get("gap_x" if axis == machine.axial else "gap", "")
    gap = of.get(known, machine.gaps.get(axis, math.inf))
    near, far = (gap - sign * of.get(machine.model_offset(axis), 0.0) for sign in (1, -1))
    return (near**-3 + far**-3) / (near**-2 + far**-2) if min(near, far) > 0 and math.isfinite(gap) else 0.0
