"""The figures of ISO 230-2 of each axis, with what its reference instrument leaves open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import Deviations, Sampler
from procedures.positioning import fit
from procedures.positioning.fit import GAIN, READINGS, SCALE, WANDER, Array, Spread
from procedures.positioning.standard import FIGURES, figures
from procedures.positioning.steps import Taken
from procedures.positioning.way import errors
from procedures.shared.certificates import certified

WORDS = {SCALE: "scale of the reference instrument", WANDER: "zero of the reference instrument"}


@dataclass(frozen=True)
class Result:
    """Of an axis: deviations x_ij (2, m, n), read less target, about their mean; estimates by figure; U by figure as the
    technical report sums it."""

    taken: Taken
    deviations: Array
    estimates: Mapping[str, Estimate]
    reported: Mapping[str, float]

    @property
    def name(self) -> str:
        """Of the axis."""
        return self.taken.tested.axis.name

    @property
    def unit(self) -> str:
        """Of its place."""
        return self.taken.tested.axis.unit


def results(taken: Sequence[Taken]) -> list[Result]:
    """Of each axis."""
    return [_result(t) for t in taken]


def _result(t: Taken) -> Result:
    one = t.tested
    deviations = t.read - one.at[None, :, None]
    deviations = deviations - deviations.mean()
    known = errors(one.by)
    spread = fit.spread(deviations, one.at, t.times, known)
    values = figures(deviations)
    estimates = {name: _estimate(t, k, float(values[k]), spread) for k, name in enumerate(FIGURES)}
    travel, seconds = float(np.ptp(one.at)), float(np.ptp(t.times))
    return Result(t, deviations, estimates, fit.by_report(known, travel, seconds, deviations.shape[-1]))


def _estimate(t: Taken, k: int, value: float, spread: Spread) -> Estimate:
    """Draws are those of all errors together; influences say what each has of them."""
    unit, by = t.tested.axis.unit, t.tested.by
    stem = f"capabilities/reference/{t.tested.axis.name}"
    shares: dict[Influence, float] = {}
    if by.gain.standard_uncertainty:
        gain = certified(f"{stem}/gain", by.gain, f"gain of {by.instrument}").sensitivities
        shares |= {i: -float(spread.slope[k]) / by.gain.value for i in gain}
    for group, number in ((SCALE, by.error), (WANDER, by.drift)):
        if number is not None and number.standard_uncertainty:
            shares[_stated(f"{stem}/{group}", number, WORDS[group])] = (
                float(spread.alone[group][k]) / number.standard_uncertainty
            )
    u = errors(by).reading
    if u:
        name = "noise and rounding of the reference instrument"
        readings = Influence(f"{stem}/{READINGS}", name, u, unit, "B", "normal", source="the rig file")
        shares[readings] = float(spread.alone[READINGS][k]) / u
    return Estimate(value, unit, shares, _sampler(value - spread.added[::-1, k], shares))


def _stated(identity: str, number: Toleranced, name: str) -> Influence:
    return next(iter(certified(identity, number, name).sensitivities))


def _sampler(draws: Array, shares: Mapping[Influence, float]) -> Sampler:
    """Values in order, `draws`, for deviations by the order of their sum."""
    at = (np.arange(len(draws)) + 0.5) / len(draws)

    def sampled(deviations: Deviations) -> Array:
        total = sum((c * deviations[i.id] for i, c in shares.items()), np.zeros(1))
        place = np.empty(len(total))
        place[np.argsort(total, kind="stable")] = (np.arange(len(total)) + 0.5) / len(total)
        return np.interp(place, at, draws)

    return sampled


assert {GAIN, SCALE, READINGS, WANDER} == set(fit.GROUPS)
