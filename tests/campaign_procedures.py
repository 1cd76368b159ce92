"""Small procedures for campaigns: the one of the other tests, and one that needs its result."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from bench.calibration import Need
from bench.findings import Finding
from bench.procedure import Measured, Quantity
from bench.recording import Recording
from tests import tiny_procedures
from tests.tiny_procedures import Plan

DOUBLE = Quantity("double", "V", "twice the calibrated supply")


def analyse(recording: Recording[Plan]) -> Iterator[Measured | Finding]:
    """Twice what the calibration says."""
    yield from (item for item in tiny_procedures.analyse(recording) if isinstance(item, Finding))
    if recording.plan.then != "nothing":
        yield DOUBLE.measured(recording.calibration("tiny-levitated").values["supply"] * 2.0)


procedure: Any = dataclasses.replace(
    tiny_procedures.levitated, name="tiny-needing", title="Needs a look at the supply", measures=(DOUBLE,),
    measured=analyse, needs=lambda plan: (Need("tiny-levitated", {"bias_A": plan.bias_A}),),
)  # fmt: skip
