"""What makes results of steps uncertain beside their scatter: when the set point acted, how currents lag, what is taken for
granted."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from bench.uncertainty.estimate import Deviations
from procedures.amb_rotor import loops
from procedures.shared.certificates import certified
from procedures.step.acting import START_S
from procedures.step.settling import Settling
from procedures.step.steps import Case

Array = npt.NDArray[np.float64]


def settling_estimate(case: Case, settled: Settling, late: float = 0.0, start: float = START_S) -> Estimate:
    """The expected time with all that are possible: a distribution of its own (JCGM 101, 6.5); from `late` s on, give or take
    `start`, when the set point acted."""
    from scipy.special import ndtr

    scatter = Influence(
        id=f"scatter/settling_time/{case.where}",
        name="noise of the mean response",
        u=float(settled.times.std()),
        unit="s",
        kind="A",
        distribution="normal",
        source="noise of the steps, and extremes of the swing that may touch the band",
    )

    def sampled(deviations: Deviations) -> Array:
        share = ndtr(deviations[scatter.id] / scatter.u) * len(settled.times) - 0.5
        times: Array = np.interp(share, np.arange(len(settled.times)), settled.times)
        return times

    made = Estimate(settled.time, "s", {scatter: 1.0}, sampled if scatter.u else None)
    return made + bound(f"start/{case.where}", "start of the step", start, "s") - late


def lag_estimate(rig: RigFile) -> Estimate | None:
    """Zero s, with what is not known of the currents' lag: where it is longer the step began earlier. None where the controller
    knows it."""
    doubt = loops.lag_doubt(rig)
    return None if doubt is None else certified(loops.DELAY, doubt, "loop delay: how the currents lag")


def bound(identity: str, name: str, half: float, unit: str) -> Estimate:
    """Zero, within a half width."""
    influence = Influence(
        id=identity, name=name, u=half / math.sqrt(3), unit=unit, kind="B", distribution="rectangular"
    )
    return Estimate.of(0.0, influence)


def doubted(identity: str, moved: Sequence[float], unit: str) -> Estimate:
    """Zero, with what a result moves by where each thing taken for granted of the second oscillation is off by its standard
    uncertainty."""
    influence = Influence(
        id=identity, name="second oscillation", u=math.hypot(*moved), unit=unit, kind="B", distribution="normal"
    )
    return Estimate.of(0.0, influence)
