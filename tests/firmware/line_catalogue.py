"""The command `bench` with one small procedure that any machine of the C controller with a command line runs."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

from bench import catalogue
from bench.cli.__main__ import main
from bench.findings import Finding
from bench.procedure import BenchPlan, Measured, Procedure, Quantity
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.uncertainty import Estimate, Influence

SUPPLY = Quantity("supply", "V", "mean voltage of the DC link")


class Plan(BenchPlan):
    """How long it is looked at."""

    seconds: float = 0.5


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """One step; that it is held goes to standard error."""
    with record.step("look"):
        sys.stderr.write("held\n")
        sys.stderr.flush()
        rig.clock.sleep(plan.seconds)


def analyse(recording: Recording[Plan]) -> Iterator[Measured | Finding]:
    """The step's mean."""
    mean = next(iter(recording.steps("look"))).mean("u_dc")
    yield SUPPLY.measured(Estimate.of(mean, Influence("meter", "voltmeter", 0.1, "V", "B", "normal")))


procedure: Any = Procedure(
    name="line-look", title="A look at the DC link", measures=(SUPPLY,), state=RigState.LEVITATED, plan=Plan,
    acquire=acquire, measured=analyse, settings=lambda _, plan: {}, step_count=lambda _: 1,
)  # fmt: skip

if __name__ == "__main__":
    catalogue.PROCEDURES = (catalogue.Entry("line-look", "line_catalogue", "A look at the DC link"),)
    sys.exit(main())
