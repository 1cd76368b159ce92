"""What the levels of the first angle show of the motor's segments: signs of their sensors, exchanged wires.

By the checks of the analysis, and nothing else of them: what is a matter of size waits for all angles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.force_constant import checks, estimates, fit
from procedures.force_constant.plan import Plan
from procedures.force_constant.steps import AtLevel, RampData, ramps
from procedures.servomotor.conventions import conventions
from procedures.servomotor.facts import of_ends
from procedures.shared import first_look
from procedures.shared.step_table import of_samples

Array = npt.NDArray[np.float64]
CALIBRATION = "amb-calibration"
SIGN, EXCHANGED = "segment-sign", "segments-exchanged"


def passes(rig: Rig, plan: Plan, record: Recorder, seen: Sequence[tuple[AtLevel, Mapping[str, Array], int]]) -> bool:
    """Whether the run goes on after the first angle: each of its levels, what came there, and when in ns."""
    table = of_samples(*zip(*seen, strict=True), shape=(1, -1))
    known = next(c.values for c in record.calibrations if c.procedure == CALIBRATION)
    facts = of_ends(rig.file, known)
    return first_look.passes(rig, record, judge(ramps(table, rig.file), rig.file, facts, plan))


def judge(data: RampData, rig: RigFile, facts: Mapping[str, Estimate], plan: Plan) -> Iterator[Finding]:
    """Wrong signs, else exchanged wires, along y, else along x."""
    found = [f for f in checks.segments(data.table, conventions(rig)) if f.effect is Effect.ERROR]
    if found:
        yield from (f for f in found if f.code == SIGN)
        return
    if list(checks.settled(data.table, conventions(rig), plan)):
        return  # else the wires would be blamed for what moves
    for axis, of_axis in (("y", data.vertical), ("x", data.horizontal)):
        inputs = {**estimates.rig_inputs(rig, axis), **estimates.fact_inputs(facts, len(of_axis.angles))}
        values = {name: e.value for name, e in inputs.items()}
        known = estimates.constants(of_axis, values, plan.bias_A)
        wrong = list(checks.exchanged(axis, fit.fit(of_axis, values, known, plan.bias_A).terms))
        yield from wrong
        if wrong:
            return
