"""From recorded sines to what a force by the map is, per acceleration, and what rubs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording, Step
from bench.rigfile.roles import STATE
from bench.rigfile.stage import axes_of
from procedures.axis_inertia import fit
from procedures.axis_inertia.moves import TONE, recorded_s
from procedures.axis_inertia.plan import Plan
from procedures.stages.map_bends import currents, moves
from procedures.stages.recorded import few

Array = npt.NDArray[np.float64]
FEWEST = 200  # samples of a sine
AT_LIMIT = 0.98  # of the greatest force
APART = 0.02  # of it: force that is asked for and not given


@dataclass(frozen=True)
class Sine:
    """A sine of an axis with a `part` on the shaft ("" for none): what it `went` of its amplitude; for each of `fit.DELAYS` of
    the force, by the map, `per` acceleration (2,) kg or kg m^2 and Coulomb friction `rubs` (2,); `moves` (k, 2): how much more
    the former truly is where each of `map_bends.doubts` is more by one. `limited`: share of samples at the loop's limit, or not
    given as asked for."""

    axis: str
    tone: int
    hz: float
    amplitude: float
    repeat: int
    part: str
    went: float
    per: Array
    rubs: Array
    moves: Array
    limited: float
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        on = f", with the {self.part}" if self.part else ""
        return f"{self.axis} at {self.hz:g} Hz, repeat {self.repeat + 1}{on}"


def read_sines(recording: Recording[Plan]) -> list[Sine]:
    """Every sine, in time order.

    Raises:
        AnalysisError: one that was hardly sampled.
    """
    return [_sine(recording, step) for step in recording.steps(TONE)]


def _sine(recording: Recording[Plan], step: Step) -> Sine:
    rig, labels = recording.rig, step.labels
    axis, hz = axes_of(rig)[str(labels["axis"])], float(labels["hz"])
    names = [c for c in (axis.channel, axis.asked, axis.given) if c]
    data = step.read(*dict.fromkeys((*names, *currents(rig), STATE)))
    t = (data["t_ns"] - data["t_ns"][:1]) * 1e-9
    within = t < recorded_s(recording.plan, hz) - 1e-6
    if np.count_nonzero(within) < FEWEST:
        raise few(f"axis {axis.name} at {hz:g} Hz", f"{np.count_nonzero(within)} samples", FEWEST, step)
    known = rig.choices(STATE)
    inside = {name: values[within] for name, values in data.items()}
    force = inside[axis.given or axis.asked]
    went, per, rubs = fit.operators(t[within], inside[axis.channel], hz, axis.pitch.value if axis.pitch else 0.0)
    most = rig.parameters[axis.limit].default if axis.limit else math.inf
    asked = inside[axis.asked or axis.given]
    limited = (np.abs(asked) >= AT_LIMIT * most) | (np.abs(asked - force) > APART * most)
    return Sine(
        axis=axis.name, tone=int(labels["tone"]), hz=hz, amplitude=float(labels["amplitude"]), repeat=int(labels["repeat"]),
        part=str(labels["part"]), went=went / float(labels["amplitude"]),
        per=per @ force, rubs=rubs @ force, moves=moves(rig, inside, force) @ per.T, limited=float(limited.mean()),
        states=tuple(known.get(int(code), str(int(code))) for code in np.unique(data[STATE])),
        lost=step.lost(), expected=step.expected(),
    )  # fmt: skip
