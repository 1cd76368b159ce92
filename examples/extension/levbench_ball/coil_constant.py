"""Coil constant of a ball that hangs under its magnet: what pulls at which current and which distance.

Measurand: C in F = C (i / x)^2, x counted from where the pull would be infinite. A ball at rest has F = m g, so that

    i = sqrt(m g / C) x,    C = m g / (di/dx)^2                                                            (1)

and a line through the currents at several heights gives C, whatever the zeros of current, height and gap are. Iron that
saturates pulls with (i / (1 + k i / A))^2, and C = m g (1 + k i / A)^4 / (di/dx)^2: k has a tolerance in the rig file, and more
bends the line.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydantic import Field

from bench.figures import Figure, Series
from bench.findings import Effect, Finding, Findings
from bench.procedure import BenchPlan, Measured, Procedure, Quantity, read_method
from bench.procedure.requires import Requires
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.shared.certificates import certified

Array = npt.NDArray[np.float64]
C = Quantity("C", "N m^2/A^2", "force of the coil times distance squared over current squared")
CURVED = 4.0  # standard deviations of the quadratic term: 1 in 250 sound runs has more, by t of 8 degrees of freedom


class Plan(BenchPlan):
    """Settings, SI."""

    span_m: float = Field(6e-4, gt=0)  # heights lie between - and + this
    heights: int = Field(11, ge=6)
    settle_s: float = Field(0.8, gt=0)
    average_s: float = Field(1.0, ge=0.1)

    def places(self) -> Array:
        """The heights (heights,), m: up and down by turns, so that a drift makes no slope."""
        up = np.linspace(-self.span_m, self.span_m, self.heights)
        return np.concatenate([up[::2], up[1::2][::-1]])


def requires(_: RigFile) -> Requires:
    """What a rig must have, whatever the plan."""
    return Requires(
        channels=("pos_y", "i"), sensors=("pos_y", "i"), parameters=("ref",), machine=("mass", "own_saturation")
    )


def check(rig: RigFile, plan: Plan) -> Iterable[str]:
    """What cannot work before anything starts."""
    room = rig.geometry["clearance"].value if "clearance" in rig.geometry else math.inf
    if plan.span_m > 0.8 * room:
        yield f"span_m: found {plan.span_m:g} m; expected at most {0.8 * room:g} m, 0.8 of the clearance"


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """Go to each height, wait, average."""
    for height in plan.places():
        rig.levitation.set("ref", float(height))
        rig.clock.sleep(plan.settle_s)
        with record.step("hold", height=float(height)):
            rig.clock.sleep(plan.average_s)


@dataclass(frozen=True)
class Analysis:
    """`heights`, `currents` and what the line leaves of them (holds,) as the sensors read them, m and A; `constant` is C."""

    heights: Array
    currents: Array
    residuals: Array
    constant: Estimate


def evaluate(recording: Recording[Plan], findings: Findings) -> Analysis:
    """The line through currents and heights, and C of its slope."""
    steps = list(recording.steps("hold"))
    if len(steps) < 6:
        findings.end(Finding("too-few-heights", f"found {len(steps)} heights; expected 6 or more", "", Effect.ERROR))
    heights = np.array([step.mean("pos_y") for step in steps])
    currents = np.array([step.mean("i") for step in steps])
    findings.add(of_curve(heights, currents, recording.rig.machine["own_saturation"].standard_uncertainty))
    slope, u, residuals = line(heights, currents)
    return Analysis(heights, currents, residuals, constant(recording.rig, slope, u, currents))


def line(x: Array, y: Array) -> tuple[float, float, Array]:
    """Slope of y over x by least squares, its standard uncertainty from the scatter, and the residuals."""
    around = x - x.mean()
    slope = float(around @ y / (around @ around))
    residuals = y - y.mean() - slope * around
    u = math.sqrt(float(residuals @ residuals) / (len(x) - 2) / float(around @ around))
    return slope, u, residuals


def of_curve(heights: Array, currents: Array, u_saturation: float) -> Iterator[Finding]:
    """Whether (1) holds: the quadratic term of a parabola, k (range of the current)^2 by the iron, against its own scatter and
    what the tolerance of k allows, a rectangular one."""
    x = (heights - heights.mean()) / np.ptp(heights)
    model = np.stack([np.ones_like(x), x, x * x], axis=1)
    terms, *_ = np.linalg.lstsq(model, currents)
    rest = currents - model @ terms
    u = math.sqrt(float(rest @ rest) / (len(x) - 3) * float(np.linalg.inv(model.T @ model)[2, 2]))
    allowed = CURVED * u + math.sqrt(3) * u_saturation * float(np.ptp(currents)) ** 2
    if abs(terms[2]) > allowed:
        text = (f"the current is no line over the height: over their range it bends by {1e3 * abs(terms[2]) / 4:.3g} mA, "
                f"{1e3 * allowed / 4:.3g} mA allowed. The iron saturates, or a sensor bends.")  # fmt: skip
        yield Finding("line-curved", text, "pos_y", Effect.INDETERMINATE)


def constant(rig: RigFile, slope: float, u: float, currents: Array) -> Estimate:
    """C by (1), from the slope di/dy of the readings, A/m, over `currents` (holds,) A."""
    scatter = Influence(id="scatter/heights", name="scatter about the line", u=u, unit="A/m", kind="A", distribution="normal",
                        dof=len(currents) - 2)  # fmt: skip
    current = certified("sensors/i/gain", rig.sensors["i"].gain, "gain of i")  # reading = gain * value + offset
    height = certified("sensors/pos_y/gain", rig.sensors["pos_y"].gain, "gain of pos_y")
    true = Estimate.of(slope, scatter) * height / current
    weight = certified("machine/mass", rig.machine["mass"]) * certified("site/gravity", rig.site.gravity)
    bent = 1 + certified("machine/own_saturation", rig.machine["own_saturation"], "saturation of the iron") * float(
        currents.mean()
    )
    return weight * bent**4 / true**2


def measured(a: Analysis) -> Iterator[Measured]:
    """The one quantity."""
    yield C.measured(a.constant)


def figures(a: Analysis, recording: Recording[Plan]) -> Iterable[Figure]:
    """The line, and what it leaves."""
    order = np.argsort(a.heights)
    mm, fit = 1e3 * a.heights[order], 1e3 * (a.currents - a.residuals)[order]
    yield Figure("line", "Current over height", "Each point is a hold; its slope gives C.", "height / mm", "current / mA",
                 (Series("holds", mm, 1e3 * a.currents[order], "points"), Series("line", mm, fit)))  # fmt: skip
    yield Figure("residuals", "What the line leaves", "A bend would be a pull that is not as the model has it.", "height / mm",
                 "residual / mA", (Series("holds", mm, 1e3 * a.residuals[order], "points"),))  # fmt: skip


procedure = Procedure(
    name="coil-constant",
    title="Coil constant of a levitated ball",
    measures=(C,),
    state=RigState.LEVITATED,
    plan=Plan,
    acquire=acquire,
    evaluate=evaluate,
    measured=measured,
    figures=figures,
    requires=requires,
    check=check,
    step_count=lambda plan: plan.heights,
    method=read_method(__file__),
    reached=("machine/own_saturation",),
)
