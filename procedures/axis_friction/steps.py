"""From recorded passes to means over their windows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from bench.rigfile.stage import StageAxis, axes_of
from procedures.axis_friction.moves import HELIX, PASS
from procedures.axis_friction.plan import Plan
from procedures.axis_friction.sequence import window
from procedures.stages.map_bends import currents, moves
from procedures.stages.recorded import few

Array = npt.NDArray[np.float64]
FEWEST = 20  # samples in a window
AT_LIMIT = 0.98  # of the greatest force


@dataclass(frozen=True)
class Pass:
    """Means over a window, by axis: `force` as the controller gives it, N or N m, and the true `rate` of the readings, m/s or
    rad/s. `way` 1 upwards, -1 downwards, `turned` likewise of the axis around in a helix, 0 without; `wanted` rate, of the axis
    around in a helix; `load` by its source. `uneven`: share by which the rate of the axis differs from one half to the other;
    `limited`: share of samples at the loop's limit, or not given as asked for. `moves`: by axis, how much what truly
    acts is more (k,) where each of `map_bends.doubts` is more by one, N or N m."""

    axis: str
    wanted: float
    repeat: int
    load: str
    way: int
    turned: int
    force: Mapping[str, float]
    rate: Mapping[str, float]
    uneven: float
    limited: float
    moves: Mapping[str, Array]
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        kind = f" and {self.wanted:g} rad/s" if self.turned else f" at {self.wanted:g}"
        under = f", load {self.load}" if self.load else ""
        return f"{self.axis}{kind}, {'up' if self.way > 0 else 'down'}, repeat {self.repeat + 1}{under}"


def read_passes(recording: Recording[Plan]) -> list[Pass]:
    """Every pass, helices last.

    Raises:
        AnalysisError: one with hardly a sample in its window.
    """
    return [_pass(recording, step) for kind in (PASS, HELIX) for step in recording.steps(kind)]


def _pass(recording: Recording[Plan], step: Step) -> Pass:
    axes, plan, labels = axes_of(recording.rig), recording.plan, step.labels
    axis = axes[str(labels["axis"])]
    names = [c for a in axes.values() for c in (a.channel, a.asked, a.given) if c] + list(currents(recording.rig))
    data = step.read(*dict.fromkeys((*names, STATE)))
    low, high = window(axis, plan)
    at = data[axis.channel]
    within = np.flatnonzero((at >= low) & (at <= high))
    if len(within) < FEWEST:
        found = f"{len(within)} samples between {low:.4g} and {high:.4g} {axis.unit}"
        raise few(f"axis {axis.name} at {labels['rate']}", found, FEWEST, step)
    t, forces = data["t_ns"][within] * 1e-9, {a.name: data[a.given or a.asked][within] for a in axes.values()}
    inside = {c: data[c][within] for c in currents(recording.rig)}
    known = recording.rig.choices(STATE)
    return Pass(
        axis=axis.name, wanted=float(labels["rate"]), repeat=int(labels["repeat"]), load=str(labels.get("load", "")),
        way=int(labels["way"]), turned=int(labels.get("turned", 0)),
        force={name: float(f.mean()) for name, f in forces.items()},
        moves={name: moves(recording.rig, inside, f).mean(axis=1) for name, f in forces.items()},
        rate={a.name: slope(t, data[a.channel][within]) for a in axes.values()},
        uneven=_uneven(t, at[within]), limited=max(_limited(recording, a, data, within) for a in axes.values()),
        states=tuple(known.get(int(code), str(int(code))) for code in np.unique(data[STATE])),
        lost=step.lost(), expected=step.expected(),
    )  # fmt: skip


def slope(t: Array, x: Array) -> float:
    """Of a straight line, by least squares."""
    away = t - t.mean()
    return float(away @ (x - x.mean()) / (away @ away))


def _uneven(t: Array, x: Array) -> float:
    half = len(t) // 2
    first, second = slope(t[:half], x[:half]), slope(t[half:], x[half:])
    return abs(second - first) / max(abs(first + second) / 2, 1e-300)


def _limited(
    recording: Recording[Plan], axis: StageAxis, data: Mapping[str, Array], within: npt.NDArray[np.intp]
) -> float:
    asked = data[axis.asked][within]
    most = recording.rig.parameters[axis.limit].default if axis.limit else np.inf
    apart = np.zeros(len(asked), dtype=bool)
    if axis.given and np.isfinite(most):
        apart = np.abs(data[axis.given][within] - asked) > 0.02 * most
    return float(np.mean((np.abs(asked) >= AT_LIMIT * most) | apart))


def those(passes: Sequence[Pass], **wanted: object) -> list[Pass]:
    """That have these labels."""
    return [p for p in passes if all(getattr(p, key) == value for key, value in wanted.items())]
