"""What lift-off draws: where the end is over gamma with the prediction, and the currents that turn with it."""

from __future__ import annotations

import numpy as np

from bench.figures import Figure, Series
from bench.uncertainty import interval
from procedures.lift_off.estimates import Analysis
from procedures.lift_off.steps import Ramped

EVERY_S = 0.02  # between the points of a line
AFTER_S = 0.15  # that are drawn after a lift


def all_figures(a: Analysis) -> list[Figure]:
    """In the order of the report; none where gamma was never turned."""
    if not a.ramps:
        return []
    shown = [_shown(r, k) for r, k in zip(a.ramps, a.lifted, strict=True)]
    labelled = list(zip(a.ramps, shown, strict=True))
    first = [next(((r, use) for r, use in labelled if r.labels.way == way), None) for way in (-1, 1)]
    whole = [one for one in first if one is not None]
    return [_position(a, labelled), _currents(whole)]


def _shown(r: Ramped, lifted: int | None) -> np.ndarray:
    """Samples that are drawn: every so many, and all about the lift."""
    every = max(1, round(EVERY_S / max(float(np.median(np.diff(r.t))), 1e-9)))
    use = np.zeros(len(r.t), bool)
    use[::every] = True
    if lifted is not None:
        use[max(0, lifted - 60) : lifted + 40] = True
        use &= r.t <= r.t[lifted] + AFTER_S
    return use


def _position(a: Analysis, labelled: list[tuple[Ramped, np.ndarray]]) -> Figure:
    series: list[Series] = []
    for r, use in labelled:
        name = (
            f"γ {'above' if r.labels.way > 0 else 'below'} 0" if r.labels.repeat == labelled[0][0].labels.repeat else ""
        )
        series.append(Series(name, np.degrees(r.gamma[use]), 1e6 * r.y[use], "line"))
    gamma = np.concatenate([np.degrees(r.gamma[use & r.touches]) for r, use in labelled])
    y = np.concatenate([1e6 * r.y[use & r.touches] for r, use in labelled])
    series.append(Series("contact told", gamma, y, "points"))
    caption = "Outboard vertical probe while γ is turned at the motor's limit of current, every lift."
    predicted, zero = a.estimates.get("gamma_predicted"), a.estimates.get("zero_predicted")
    if predicted is not None and zero is not None:
        i = interval(predicted)
        top = max(0.0, max(float(1e6 * r.y[use].max()) for r, use in labelled))
        for way in (-1, 1):
            ends = np.degrees([zero.value + way * x for x in (max(i.low, 0.0), i.high)])
            series.append(Series("predicted" if way < 0 else "", ends, np.array([top, top]), "both"))
        caption += " The bars at the top are where the motor's constants say that it lifts, with their 95 % interval."
    return Figure(
        "position", "Lift-off over the phase angle", caption, "phase angle (°)", "position (µm)", tuple(series)
    )


def _currents(ramps: list[tuple[Ramped, np.ndarray]]) -> Figure:
    series = []
    for r, use in ramps:
        for name, i in (("i_y", r.i_y), ("i_x", r.i_x)):
            label = f"{name}, γ {'above' if r.labels.way > 0 else 'below'} 0"
            series.append(Series(label, np.degrees(r.gamma[use]), i[use], "line"))
    return Figure("currents", "Motor currents over the phase angle",
                  "On its ring i_y is at its limit, and i_x goes with γ so that nothing is left sideways; where the end "
                  "comes up both become what carries the shaft.", "phase angle (°)", "current (A)", tuple(series))  # fmt: skip
