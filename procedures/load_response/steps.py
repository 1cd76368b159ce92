"""From recorded steps to arrays: where an axis came to rest, and what it did when its load changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from bench.rigfile.stage import StageAxis, axes_of
from procedures.load_response.moves import APPROACH, DISTURBED
from procedures.load_response.plan import Plan
from procedures.load_response.sequence import count
from procedures.stages.recorded import few

Array = npt.NDArray[np.float64]
AT_LIMIT = 0.98  # of the greatest force: from here on it is at its limit
FEWEST = 20  # samples of a step


@dataclass(frozen=True)
class Looked:
    """Labels and health of a step. `stiffness` and `limit` as the controller had them; `limited`: share of the samples at the
    limit; states, samples lost and expected."""

    axis: str
    source: str
    load: str
    phase: int
    at: float
    stiffness: float
    limited: float
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def load_name(self) -> str:
        """As findings call it."""
        return f"{self.load} {self.source}" if self.load else "nothing"


@dataclass(frozen=True)
class Rest(Looked):
    """One approach with `side` 1 upwards, -1 downwards. Means at rest of the `reading`, m or rad, of the set point and of the
    force `given`, N or N m; `asked` of the loop; `drift` of the reading at rest, `moved`, how far the approach went."""

    side: int
    reading: float
    reference: float
    given: float
    asked: float
    drift: float
    moved: float

    @property
    def deviation(self) -> float:
        """Of the reading from the set point."""
        return self.reading - self.reference


@dataclass(frozen=True)
class Change(Looked):
    """A load put `on` or taken off: `times` s since it was seen, and the `deviation` (n,) of the reading from the set point,
    m or rad; `seen`: whether the reading answered at all."""

    on: bool
    times: Array
    deviation: Array
    seen: bool


def read_rests(recording: Recording[Plan]) -> list[Rest]:
    """Every approach, in time order.

    Raises:
        AnalysisError: a step with too few samples.
    """
    return [_rest(recording, step) for step in recording.steps(APPROACH)]


def read_changes(recording: Recording[Plan]) -> list[Change]:
    """Every load put on or taken off, in time order.

    Raises:
        AnalysisError: as `read_rests`.
    """
    return [_change(recording, step) for step in recording.steps(DISTURBED)]


def _axis(recording: Recording[Plan], step: Step) -> StageAxis:
    return axes_of(recording.rig)[str(step.labels["axis"])]


def _told(recording: Recording[Plan], step: Step) -> tuple[dict[str, npt.NDArray[Any]], dict[str, Any]]:
    """Samples of the axis' channels, and what is common to all steps."""
    axis, labels = _axis(recording, step), step.labels
    names = dict.fromkeys(c for c in (axis.channel, axis.reference, axis.asked, axis.given, STATE) if c)
    data = step.read(*names)
    if len(data[axis.channel]) < FEWEST:
        raise few(f"step {dict(labels)}", f"{len(data[axis.channel])} samples", FEWEST, step)
    known = recording.rig.choices(STATE)
    states = tuple(known.get(int(code), str(int(code))) for code in np.unique(data[STATE]))
    limit, force = float(labels["limit"]), np.abs(data[axis.asked])
    limited = float(np.mean(force >= AT_LIMIT * limit)) if limit > 0 else 0.0
    common: dict[str, Any] = {key: str(labels[key]) for key in ("axis", "source", "load")}
    common |= {"phase": int(labels["phase"]), "at": float(labels["at"]), "stiffness": float(labels["stiffness"])}
    return data, {**common, "limited": limited, "states": states, "lost": step.lost(), "expected": step.expected()}


def _rest(recording: Recording[Plan], step: Step) -> Rest:
    axis, (data, common) = _axis(recording, step), _told(recording, step)
    t = (data["t_ns"] - data["t_ns"][0]) * 1e-9
    last = t >= t[-1] - recording.plan.average_s
    x = data[axis.channel][last]
    half = len(x) // 2
    return Rest(
        **common, side=int(step.labels["side"]), reading=float(x.mean()), reference=float(data[axis.reference][last].mean()),
        given=float(data[axis.given or axis.asked][last].mean()), asked=float(data[axis.asked][last].mean()),
        drift=abs(float(x[half:].mean() - x[:half].mean())) if half else 0.0,
        moved=float(x.mean()) - float(data[axis.channel][0]),
    )  # fmt: skip


def _change(recording: Recording[Plan], step: Step) -> Change:
    axis, plan, (data, common) = _axis(recording, step), recording.plan, _told(recording, step)
    t = (data["t_ns"] - data["t_ns"][0]) * 1e-9
    x = data[axis.channel]
    before = x[t < plan.before_s]
    away = np.abs(x - before.mean()) - (np.ptp(before) + 1.5 * count(axis))
    out = np.flatnonzero((away > 0) & (t >= plan.before_s))
    begins = float(t[out[0]]) if len(out) else plan.before_s
    return Change(
        **common, on=bool(step.labels["on"]), times=t - begins, deviation=x - data[axis.reference], seen=len(out) > 0
    )  # fmt: skip
