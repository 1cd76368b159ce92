"""How long a step rises, from means over a telemetry period, and what these leave of it.

The curve is the derivative of a spline through the running sum. From SMOOTH samples in a rise on it is told by that alone. With
fewer the foot of the step, where the curve bends most, lies within a sample or two, and the spline swings through it: a rise is
up to 0.06 of a period too long at 2.4 samples, and alike in all steps that begin at one phase of their period. How much depends
on how sharp the foot is: on the AMB stand, lightly damped, it is 0.01.

It is known besides that the shaft rested until the step acted. A spline whose sum and slope are none there, and which leaves
out a reading nearer than half a period behind it, is off by half as much, and how far the two lie apart says how sharp the foot
is. Noise-free it leaves no more than HELD_SHARE of a period and that distance (0.0143 at 3.6 samples, 0.0145 at 3.3, 0.0115 at
2.7, 0.009 at 2.44), and from FEW samples downwards what grows as their seventh power (0.027 at 2.2, 0.033 at 2.0). Where it is
not known when the step acted, the spline alone leaves no more than LOOSE_SHARE of a period at SMOOTH samples, and below that
what grows as their inverse cube (0.036 at 3.0 samples, 0.057 at 2.44, 0.088 at 2.0).

All at 25 phases, of second-order steps of damping 0.2 to 0.7, as they are and behind a lag of an eighth of their rise and less,
and of the AMB stand's and an overhung rotor's own. Beyond HELD_SHARE are undelayed steps damped by 0.6 and more alone, from
2.44 samples downwards (0.034 for 0.0145 at 2.44).
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import replace
from functools import partial

from bench.errors import AnalysisError
from procedures.step import response
from procedures.step.oscillation import Array, One
from procedures.step.scatter import Seen, repeated
from procedures.step.steps import Case

# Of a period: what the spline leaves of a crossing, over all phases of the step in its period; from SMOOTH samples in a rise
# on it falls as their cube, since the spline is one of third order (0.004 at 5.1 samples without noise, 0.006 at 4.4).
RISE_SHARE, SMOOTH = 0.012, 3.6
HELD_SHARE, FEW, LOOSE_SHARE = 0.0145, 2.44, 0.021
EARLY_S = 0.05


def rises(ones: Mapping[Case, Sequence[One]], unclear: Container[str] = ()) -> tuple[Seen, dict[Case, float]]:
    """Of every case, and the half width in s of what sampling leaves of it; `unclear`: groups of which it is not known when
    their steps acted. Steps of a setting, an axis and a speed are read alike: their scatter is taken together.

    Raises:
        AnalysisError: a step does not get to nine tenths of its size.
    """
    plain = repeated("s", 1, ones, partial(_rise, response.curve))
    periods = {case: float(o[0].t[1] - o[0].t[0]) for case, o in ones.items()}
    left = {case: spline_left(rise, periods[case], case.group in unclear) for case, rise in plain.values.items()}
    few = {
        case.group for case, rise in plain.values.items() if rise < SMOOTH * periods[case] and case.group not in unclear
    }
    if not few:
        return plain, left
    held = repeated("s", 1, {c: o for c, o in ones.items() if c.group in few}, partial(_rise, response.curve_from_rest))
    left |= {c: held_left(abs(rise - plain.values[c]), rise, periods[c]) for c, rise in held.values.items()}
    return replace(plain, values=plain.values | held.values, variances=plain.variances | held.variances), left


def spline_left(rise: float, period: float, unclear: bool = False) -> float:
    """Half width of what the spline leaves of a rise in s, from means over `period` s."""
    cube = (SMOOTH * period / rise) ** 3
    return period * (LOOSE_SHARE * cube if unclear and cube > 1 else RISE_SHARE * min(1.0, cube))


def held_left(apart: float, rise: float, period: float) -> float:
    """Half width of what the spline from rest leaves of a rise that lies `apart` from that of the other one, s."""
    return HELD_SHARE * period * max(1.0, (FEW * period / rise) ** 7) + apart


def _rise(curve: Callable[[Array, Array], tuple[Array, Array]], case: Case, o: One) -> float:
    early = o.t < EARLY_S
    try:
        return response.rise_time(*curve(o.t[early], o.both[0, early]))
    except AnalysisError as error:
        raise AnalysisError(f"{case.where}: {error}") from error
