"""Injection where the controller makes one sine at a time: which frequencies, how long, and the captures of a pass as one.

Lines stand at equal steps of the logarithm of the frequency: a rigid shaft's sensitivity changes over octaves. About a peak
they stand evenly, IN_WIDTH of them in its half-power width, at the full and at half the amplitude. Each is captured by itself,
over whole periods of `Comb.repeat_s`, in which line and samples repeat.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bench.analysis.responses import Response
from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import conventions
from procedures.sensitivity.estimates import FEWEST, FINEST, IN_WIDTH, LEAST, REACH, Candidate, binary
from procedures.sensitivity.injection import Comb
from procedures.sensitivity.plan import Plan
from procedures.sensitivity.steps import HALF, MODE, REFINED, SURVEY, WIRING, Grid, Taken
from procedures.shared.rates import rate_of

OCTAVE = 6  # lines
CYCLES = 1  # of a line in what repeats, at least
SHORTEST_S, REFINED_S = 2.0**-3, 0.25  # of what repeats
FOLLOWED_HZ = 40.0  # where coils follow their references
OF_BIAS = 0.015  # an amplitude at which bearings are linear
UNKNOWN_A = 0.02  # where no bias is told
BELOW = 0.45  # of the rate of a capture
Pass = tuple[str, float, Comb]


def makes_one(rig: RigFile) -> bool:
    """Whether the controller makes no comb, but one sine."""
    can = rig.capabilities.injection
    return can is not None and not (can.lines and can.step)


def rate(rig: RigFile, plan: Plan) -> float:
    """Of a capture, Hz."""
    return rate_of(rig, plan.rate_hz)


def amplitude(rig: RigFile, plan: Plan) -> float:
    """Of a sine, A: the plan's, or a share of the bias."""
    if plan.sine_A is not None:
        return plan.sine_A
    names = conventions(rig).biases.values()
    most = rig.envelope.max_injection_A
    wanted = OF_BIAS * min(rig.parameters[name].default for name in names) if names else UNKNOWN_A
    return min(wanted, most) if most is not None else wanted


def highest(rig: RigFile, plan: Plan) -> float:
    """The highest line, Hz: by the plan, the rate of captures and what the controller takes."""
    can = rig.capabilities.injection
    taken = rig.parameters[can.hz].high if can is not None else math.inf
    return min(plan.high_hz, BELOW * rate(rig, plan), taken)


def sine(hz: float, of_A: float, sampled_hz: float, least_s: float = SHORTEST_S) -> Comb:
    """One line near `hz`: where it repeats after a power of two of a second, and the samples with it."""
    repeats = max(2.0 ** math.ceil(math.log2(CYCLES / hz)), least_s)
    while abs(repeats * sampled_hz - round(repeats * sampled_hz)) > 1e-6 and repeats < 1:
        repeats *= 2
    return Comb(max(round(hz * repeats), 1) / repeats, 0.0, 1, of_A, repeats)


def surveys(rig: RigFile, plan: Plan) -> list[Pass]:
    """The sines of the first pass with their kind and what they are about: all octaves, and finer about modes."""
    of_A, sampled, high = amplitude(rig, plan), rate(rig, plan), highest(rig, plan)
    count = math.floor(OCTAVE * math.log2(high / plan.low_hz)) + 1
    wanted = [plan.low_hz * 2 ** (k / OCTAVE) for k in range(count)]
    out = [(WIRING, 0.0, sine(FOLLOWED_HZ, of_A, sampled, REFINED_S))]
    out += [(SURVEY, 0.0, c) for c in _each([sine(hz, of_A, sampled) for hz in wanted], high)]
    for mode in plan.modes_hz:
        step = binary(plan.mode_damping * mode)
        lines = np.arange(mode - plan.mode_within_hz, mode + plan.mode_within_hz, step)
        out += [(MODE, mode, c) for c in _each([sine(float(hz), of_A, sampled, 1 / step) for hz in lines], high)]
    return out


def refinements(rig: RigFile, plan: Plan, about: Candidate) -> list[Pass]:
    """The second pass about a peak, at the amplitude and at half of it."""
    step = max(binary(about.width / IN_WIDTH), FINEST)
    reach, high = max(REACH * about.width, LEAST * step), highest(rig, plan)
    lines = [hz for hz in np.arange(about.hz - reach, about.hz + reach + step / 2, step).tolist() if hz > plan.low_hz]
    while len(lines) < FEWEST:  # what is cut off below is added above: fewer tell no maximum
        lines.append((lines[-1] if lines else plan.low_hz) + step)
    out = []
    for kind, share in ((REFINED, 1.0), (HALF, 0.5)):
        made = [sine(hz, share * amplitude(rig, plan), rate(rig, plan), max(REFINED_S, 1 / step)) for hz in lines]
        out += [(kind, about.hz, c) for c in _each(made, high)]
    return out


def _each(made: Sequence[Comb], high: float) -> list[Comb]:
    """Each frequency once, up to the highest."""
    return list({c.first: c for c in made if c.first <= high}.values())


def as_one(responses: Sequence[Response]) -> list[Response]:
    """Responses of single lines in order of frequency, as one; nothing of nothing."""
    if not responses:
        return []
    hz, values, covariance, coherence = (
        np.concatenate([getattr(r, name) for r in responses]) for name in ("hz", "values", "covariance", "coherence")
    )
    order = np.argsort(hz, kind="stable")
    return [Response(hz[order], values[order], covariance[order], coherence[order], min(r.dof for r in responses))]


def joined(taken: Sequence[Taken]) -> list[Taken]:
    """Captures of one line each, those of a pass as if they had been one; others as they are."""
    groups: dict[tuple[str, float, str, float], list[Taken]] = {}
    out: list[Taken] = []
    for t in taken:
        if t.grid.hz.size > 1:
            out.append(t)
            continue
        groups.setdefault((t.axis, t.speed, t.kind, t.about), []).append(t)
    return [*out, *(_joined(sorted(some, key=lambda t: float(t.grid.hz[0]))) for some in groups.values())]


def _joined(some: list[Taken]) -> Taken:
    first = some[0]
    flags = 0
    for t in some:
        flags |= t.flags
    grid = Grid(np.concatenate([t.grid.hz for t in some]), first.grid.period, first.grid.amplitude)
    return replace(
        first,
        grid=grid,
        response=as_one([t.response for t in some])[0],
        excluded=np.concatenate([t.excluded for t in some]),
        injected=np.concatenate([t.injected for t in some]),
        peak=max(t.peak for t in some),
        clipped=max(t.clipped for t in some),
        flags=flags,
        clips=max(t.clips for t in some),
        lost=sum(t.lost for t in some),
        expected=sum(t.expected for t in some),
    )
