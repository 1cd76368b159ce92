"""Drift between the halves of a torque calibration that was stopped and continued.

A constant current beside the loads' is no matter: each phase angle has its own, and one that a seam parts has two. What matters
is a scale, torque per current, that changed by a share meanwhile, and an encoder whose zero is another one, by which gamma_0
changed: each by itself one more term c of the fit, what it does to the current after the seam, in place of the drift of the
scale that is even in time and so much alike that both would be known half as well; with the step that was done again among
the others, as in no result.

A term d beyond Student's t at `continued.CHANCE`, shared by both, is told with its 95 % interval. It decides where alpha_tau or
gamma_0t would move by more than `continued.MATTERS` of its U: in the results' fit, which has no such term, it moves all terms
by (J'WJ)^-1 J'W (d c).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bench.findings import Finding
from bench.recording import Recording
from bench.uncertainty import Estimate, interval
from bench.uncertainty.coverage import coverage_factor
from procedures.shared import continued
from procedures.torque_constant import fit, hypotheses
from procedures.torque_constant.fit import Balance, Detent, Extra, Steps
from procedures.torque_constant.plan import Plan
from procedures.torque_constant.steps import read_all

Array = npt.NDArray[np.float64]
TURNED, DRIFT = 1, 3  # numbers of gamma_0 and of the even drift in the fit
RESULTS = ("alpha_tau", "gamma_0t")
SCALE, PEAK = "current per torque", "phase angle of the largest torque"


@dataclass(frozen=True)
class Change:
    """At a seam, of `what`: relative or in rad, with `dof`, and by how much the results would move, N m/A and rad."""

    what: str
    found: Extra
    dof: int
    moved: Array


def findings(
    recording: Recording[Plan], held: Detent, p: Mapping[str, float], pairs: float, estimates: Mapping[str, Estimate]
) -> Iterator[Finding]:
    """Findings for each seam after which the torque per current is another one, or the angle of its peak."""
    s, count = read_all(recording), len(recording.plan.masses)
    seams = range(1, int(s.half.max()) + 1)
    if not seams:
        return
    expanded = np.array([interval(estimates[name]).U for name in RESULTS])
    b = fit.balance(s, p, count, pairs, held, fit.uneven(fit.balance(s, p, count, pairs, held), s))
    for number in seams:
        for one in changes(b, s, number):
            yield from _drift(one, expanded)


def changes(b: Balance, s: Steps, number: int) -> tuple[Change, Change]:
    """What changed at a seam, 1, 2, ...: more current for each load, and gamma_0."""
    after, even = s.half >= number, _undrifted(b)
    each = ((SCALE, hypotheses.loaded(b)), (PEAK, b.fit.jacobian[:, TURNED]))
    out = []
    for what, whole in each:
        found = hypotheses.extra(even, whole * after)
        terms = np.linalg.pinv(b.fit.jacobian / b.u[:, None]) @ (found.value * whole * after / b.u)
        out.append(Change(what, found, b.dof, terms[:2]))
    return out[0], out[1]


def _undrifted(b: Balance) -> Balance:
    """Without the term of a scale that drifts evenly: its column among the others no more, its share among the residuals."""
    jacobian, column = np.delete(b.fit.jacobian, DRIFT, axis=1), b.fit.jacobian[:, DRIFT]
    white = jacobian / b.u[:, None]
    apart = column - jacobian @ np.linalg.lstsq(white, column / b.u, rcond=None)[0]
    residuals = b.fit.residuals + b.drift.value * apart
    return replace(b, fit=replace(b.fit, jacobian=jacobian, residuals=residuals), dof=b.dof + 1)


def _drift(c: Change, expanded: Array) -> Iterator[Finding]:
    from scipy.special import stdtrit

    if not c.found.value or abs(c.found.t) <= float(stdtrit(c.dof, 1 - continued.CHANCE / 4)):
        return
    shares = np.abs(c.moved) / expanded
    value, wide = c.found.value, coverage_factor(c.dof) * c.found.u
    by = f"{value:+.3%} ± {wide:.3%}" if c.what == SCALE else f"{value:+.2g} ± {wide:.2g} rad"
    text = (
        f"after the run went on the {c.what} is {by} another one, by which alpha_tau would move by {shares[0]:.2g} and "
        f"gamma_0t by {shares[1]:.2g} of their U"
    )
    suspects = "the magnets, a current sensor, the encoder, or how the lever sits"
    yield continued.drifted(text, "segments", float(shares.max()), suspects)
