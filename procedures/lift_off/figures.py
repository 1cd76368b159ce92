"""What lift-off draws: where the end is over gamma with its prediction, each lift beside it, and the currents that turn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from bench.uncertainty import Estimate, interval
from procedures.lift_off.estimates import Analysis
from procedures.lift_off.steps import Ramped

Array = npt.NDArray[np.float64]
Drawn = tuple[Ramped, npt.NDArray[np.bool_], int | None]
EVERY_S, CONTACT_S = 0.02, 0.5  # between the points of a line, and between those that say contact
ABOUT, AFTER_S = 60, 0.15  # samples about a lift that are all drawn, and how long after it


def all_figures(a: Analysis) -> list[Figure]:
    """In the order of the report; none where gamma was never turned."""
    if not a.ramps:
        return []
    drawn = [(r, _shown(r, k), k) for r, k in zip(a.ramps, a.lifted, strict=True)]
    first = [
        one for way in (-1, 1) for one in [next((d for d in drawn if d[0].labels.way == way), None)] if one is not None
    ]
    return [_position(a, drawn, first), *_lifts(a), _currents(first)]


def _side(r: Ramped) -> str:
    return f"γ {'above' if r.labels.way > 0 else 'below'} 0"


def _shown(r: Ramped, lifted: int | None) -> npt.NDArray[np.bool_]:
    """Samples that are drawn: every so many, and all about the lift."""
    use = np.zeros(len(r.t), bool)
    use[:: _every(r, EVERY_S)] = True
    if lifted is not None:
        use[max(0, lifted - ABOUT) : lifted + ABOUT] = True
        use &= r.t <= r.t[lifted] + AFTER_S
    return use


def _every(r: Ramped, seconds: float) -> int:
    return max(1, round(seconds / max(float(np.median(np.diff(r.t))), 1e-9)))


def _position(a: Analysis, drawn: list[Drawn], first: list[Drawn]) -> Figure:
    series = [Series(f"first, {_side(r)}", np.degrees(r.gamma[use]), 1e6 * r.y[use], "line") for r, use, _ in first]
    touching = [slice(0, None, _every(r, CONTACT_S)) for r, _, _ in first]
    gamma, y = (np.concatenate([x[part][r.touches[part]] for (r, _, _), part, x in zip(first, touching, xs, strict=True)])
                for xs in ([np.degrees(r.gamma) for r, _, _ in first], [1e6 * r.y for r, _, _ in first]))  # fmt: skip
    series.append(Series("contact told", gamma, y, "points"))
    lifts = [(np.degrees(r.gamma[k]), 1e6 * r.y[k]) for r, _, k in drawn if k is not None]
    if lifts:
        at, height = np.array(lifts).T
        series.append(Series("every lift", at, height, "points"))
    caption = "Outboard vertical probe while γ is turned, i_y at its limit."
    if "gamma_predicted" in a.estimates and lifts:
        i, zero = interval(a.estimates["gamma_predicted"]), a.estimates["zero_predicted"].value
        middle = np.full(2, float(np.mean([y for _, y in lifts])))
        for way, side in ((-1, "below"), (1, "above")):
            ends = np.degrees([zero + way * x for x in (max(i.low, 0.0), i.high)])
            series.append(Series(f"predicted, γ {side} 0", ends, middle, "both"))
        caption += " Pairs of marks beside the lifts: where the motor's constants say that it goes, 95 %."
    return Figure(
        "position", "Lift-off over the phase angle", caption, "phase angle (°)", "position (µm)", tuple(series)
    )


def _lifts(a: Analysis) -> Iterator[Figure]:
    """Half the difference of each pair of lifts, and what is predicted of it."""
    if not len(a.gammas):
        return
    half, found = np.degrees((a.gammas[:, 1] - a.gammas[:, 0]) / 2), a.estimates["gamma_lift"]
    last = len(half) + 1.0
    series = [Series("as read", np.arange(1.0, last), half, "points"), _interval("mean, corrected", last, found)]
    ticks = [(str(k + 1), k + 1.0) for k in range(len(half))] + [("mean", last)]
    if "gamma_predicted" in a.estimates:
        series.append(_interval("predicted", last + 1, a.estimates["gamma_predicted"]))
        ticks.append(("predicted", last + 1))
    yield Figure("lifts", "Each pair of lifts and the prediction",
                 "Half the difference of the phase angles, above and below, at which the end went, with 95 % intervals. It "
                 "goes a little early: the mean is corrected for that.", "pair of lifts", "(γ₊ - γ₋)/2 (°)",
                 tuple(series), ticks=tuple(ticks))  # fmt: skip


def _interval(label: str, x: float, e: Estimate) -> Series:
    i = interval(e)
    middle, half = np.degrees((i.low + i.high) / 2), np.degrees((i.high - i.low) / 2)
    return Series(label, np.array([x]), np.array([middle]), "points", np.array([half]))


def _currents(first: list[Drawn]) -> Figure:
    series = [Series(f"{name}, {_side(r)}", np.degrees(r.gamma[use]), i[use], "line")
              for r, use, _ in first for name, i in (("i_y", r.i_y), ("i_x", r.i_x))]  # fmt: skip
    return Figure("currents", "Motor currents over the phase angle",
                  "On its ring i_y is at its limit, and i_x goes with γ so that nothing is left sideways; where the end comes "
                  "up both become what carries the shaft.", "phase angle (°)", "current (A)", tuple(series))  # fmt: skip
