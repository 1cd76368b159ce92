"""A second procedure for tests, which needs the first one's calibration: what an instrument adds to the supply."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tiny_procedures import Plan, acquire

from bench.calibration import Need
from bench.findings import Finding
from bench.procedure import Measured, Procedure, Quantity
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.uncertainty import Estimate, Influence

EXCESS = Quantity("excess", "V", "supply voltage less the calibrated one")


def analyse(recording: Recording[Plan]) -> Iterator[Measured | Finding]:
    """The meter is one that each run invents: that of the calibration is another one than today's."""
    before = recording.calibration("tiny-levitated").values["supply"]
    meter = Influence("meter", "voltmeter", 0.1, "V", "B", "normal")
    now = Estimate.of(next(iter(recording.steps("look"))).mean("supply"), meter)
    yield EXCESS.measured(now - before)


procedure: Any = Procedure(
    name="tiny-chained", title="What differs from the calibrated supply", measures=(EXCESS,), state=RigState.LEVITATED,
    plan=Plan, acquire=acquire, measured=analyse, settings=lambda _, plan: {"bias_i": plan.bias_A},
    needs=lambda plan: (Need("tiny-levitated", {"bias_A": plan.bias_A}),),
)  # fmt: skip
