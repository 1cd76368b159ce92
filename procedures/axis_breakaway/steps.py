"""From recorded ramps to the force at which an axis begins to move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from bench.rigfile.stage import StageAxis, axes_of
from procedures.axis_breakaway.fit import broke_away, rise
from procedures.axis_breakaway.moves import HELIX, RAMP
from procedures.axis_breakaway.plan import Plan
from procedures.axis_breakaway.sequence import WAYS, beside, chosen, seen
from procedures.stages import spread
from procedures.stages.map_bends import currents, moves
from procedures.stages.recorded import few

Array = npt.NDArray[np.float64]
FEWEST = 100  # samples of a ramp
BEFORE = 50  # samples: an axis on an edge of its counts throws its loop's force about for some
AT_LIMIT = 0.98  # of the greatest force


@dataclass(frozen=True)
class Ramp:
    """One: by axis the `force` at the first change of a reading, as the controller gives it, N or N m, and how fast it `rises`
    there, N/s or N m/s; `beside`: what the axis beside it that is pulled, to the side `pull`, was given then; `moved`: which
    of the axes that are ramped moves first, "" for none; `after` s from the beginning. `moves` as those of passes at constant
    rates (`axis_friction.steps`)."""

    axis: str
    share: float
    repeat: int
    load: str
    way: int
    turned: int
    pull: int
    moved: str
    after: float
    force: Mapping[str, float]
    beside: float
    rises: Mapping[str, float]
    moves: Mapping[str, Array]
    limited: bool
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        kind = f", helix {self.share:g}" if self.turned else ""
        under = f", load {self.load}" if self.load else ""
        pulled = f", pulled {'up' if self.pull > 0 else 'down'} beside" if self.pull else ""
        return f"{self.axis}{kind}, {'up' if self.way > 0 else 'down'}, repeat {self.repeat + 1}{under}{pulled}"


def read_ramps(recording: Recording[Plan]) -> list[Ramp]:
    """Every ramp, helices last.

    Raises:
        AnalysisError: one that was hardly sampled.
    """
    return [_ramp(recording, step) for kind in (RAMP, HELIX) for step in recording.steps(kind)]


def _ramp(recording: Recording[Plan], step: Step) -> Ramp:
    rig, labels = recording.rig, step.labels
    turned = int(labels["turned"])
    of = {a.name: a for a in chosen(rig, recording.plan)} if turned else {}
    axis = axes_of(rig)[str(labels["axis"])]
    watched = of or {axis.name: axis}
    names = [c for a in axes_of(rig).values() for c in (a.channel, a.asked, a.given) if c] + list(currents(rig))
    data = step.read(*dict.fromkeys((*names, STATE)))
    if len(data[STATE]) < FEWEST:
        raise few(f"axis {axis.name}", f"{len(data[STATE])} samples of a ramp", FEWEST, step)
    t, known = (data["t_ns"] - data["t_ns"][:1]) * 1e-9, rig.choices(STATE)
    sign = {name: turned if turned and spread.turns(a) else int(labels["way"]) for name, a in watched.items()}
    found = {name: broke_away(sign[name] * data[a.channel], seen(a)) for name, a in watched.items()}
    gone = {name: at for name, at in found.items() if at is not None}
    pulled = None if turned else beside(rig, recording.plan, axis)
    both = [] if pulled is None else [broke_away(w * data[pulled.channel], seen(pulled)) for w in WAYS]
    at = min((*gone.values(), *(k for k in both if k is not None)), default=len(t) - 1)
    forces = {name: data[a.given or a.asked] for name, a in watched.items()}
    aside = None if pulled is None else data[pulled.given or pulled.asked][max(at - BEFORE, 0) : max(at, 1)]
    inside = slice(max(at - BEFORE, 0), max(at, 1))
    led = {c: data[c][inside] for c in currents(rig)}
    return Ramp(
        axis=axis.name, share=float(labels["share"]), repeat=int(labels["repeat"]), load=str(labels["load"]),
        way=int(labels["way"]), turned=turned, pull=int(labels.get("pull", 0)),
        moved=min((k, n) for n, k in gone.items())[1] if gone else "", after=float(t[at]),
        force={name: float(f[max(at - 1, 0)]) for name, f in forces.items()},
        beside=0.0 if aside is None else float(np.median(aside)),
        rises={name: rise(t, f, at) for name, f in forces.items()},
        moves={name: moves(rig, led, f[inside]).mean(axis=1) for name, f in forces.items()},
        limited=any(_limited(recording, a, data, at) for a in watched.values()),
        states=tuple(known.get(int(code), str(int(code))) for code in np.unique(data[STATE])),
        lost=step.lost(), expected=step.expected(),
    )  # fmt: skip


def _limited(recording: Recording[Plan], axis: StageAxis, data: Mapping[str, Array], at: int) -> bool:
    most = recording.rig.parameters[axis.limit].default if axis.limit else np.inf
    return bool((np.abs(data[axis.asked][: at + 1]) >= AT_LIMIT * most).any())
