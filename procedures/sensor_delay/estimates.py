"""Delays of each probe, with influences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.sensor_delay import fit
from procedures.sensor_delay.fit import Delay, Line
from procedures.sensor_delay.plan import Plan
from procedures.sensor_delay.sines import Probe, probes
from procedures.sensor_delay.steps import Taken


@dataclass(frozen=True)
class Result:
    """Of a probe: its number among them, all lines, what fits it."""

    probe: Probe
    k: int
    lines: Sequence[Line]
    delay: Delay
    estimate: Estimate


def results(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> list[Result]:
    """Each probe's; of lines that every loop has."""
    some, lines = probes(rig), []
    for number in range(plan.lines):
        by = {t.loop: t for t in taken if t.line == number and t.positions.size}
        if all(p.loop in by for p in some):
            sines = [by[p.loop] for p in some]
            lines.append(
                fit.line(sines[0].hz, [t.positions for t in sines], [t.currents for t in sines], sines[0].periods)
            )
    return [_result(p, k, lines) for k, p in enumerate(some)] if len(lines) > 1 else []


def _result(probe: Probe, k: int, lines: Sequence[Line]) -> Result:
    found = fit.delay([x.hz for x in lines], [x.phase[k] for x in lines], [x.u[k] for x in lines])
    dof = float(np.sum([x.dof for x in lines]))
    noise = Influence(f"scatter/{probe.channel}", "noise of the readings", found.u, "s", "A", "normal", dof,
                      source="bins beside the lines")  # fmt: skip
    form = Influence(f"form/{probe.channel}", "low-pass or delay", found.bend / math.sqrt(3), "s", "B", "rectangular",
                     source="fit with either")  # fmt: skip
    return Result(probe, k, lines, found, Estimate.of(found.seconds, noise) + Estimate.of(0.0, form))
