"""A small procedure for a machine that does not levitate: sent somewhere, moving to and fro, looked at with a capture."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any, Literal

from bench.findings import Finding
from bench.procedure import BenchPlan, Measured, Procedure, Quantity
from bench.procedure.requires import Requires
from bench.procedure.rig import Rig
from bench.procedure.roles import RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile.stage import axes_of
from bench.uncertainty import Estimate, Influence

OFF = Quantity("off", "m", "set point less reading, in the mean over a wave")
PITCH = Influence("pitch", "half a count", 1e-6, "m", "B", "rectangular")


class Plan(BenchPlan):
    """`act`: what happens while its axes move."""

    act: Literal["measure", "count"] = "measure"
    seconds: float = 2.0


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """To a place, then a sine of the first axis; for ever with `count`."""
    assert rig.motion is not None
    assert rig.capture is not None
    axis = axes_of(rig.file)["x"]
    rig.motion.move({"x": 4e-3, "angle": 1.0})
    assert axis.wave is not None
    rig.motion.write({axis.wave.kind: axis.wave.sine or 0.0, axis.wave.amplitude: 2e-3, axis.wave.period: 2.0})
    rig.motion.play()
    rig.capture.arm(["x", "i_a1"], seconds=0.1)
    with record.step("wave"):
        rig.clock.sleep(plan.seconds)
    while plan.act == "count":  # until a signal ends it; each second of bench time is a line
        sys.stderr.write(f"at {rig.clock.now_ns()}\n")
        sys.stderr.flush()
        rig.clock.sleep(1.0)
    rig.capture.wait(1.0)
    with record.step("capture"):
        rig.capture.upload()
    rig.motion.stop()


def analyse(recording: Recording[Plan]) -> Iterator[Measured | Finding]:
    """The set point's distance, in the mean over whole periods."""
    step = next(iter(recording.steps("wave")))
    yield OFF.measured(Estimate.of(step.mean("x_ref") - step.mean("x"), PITCH))


procedure: Any = Procedure(
    name="tiny-stage", title="A look at an axis", measures=(OFF,), state=RigState.HELD, plan=Plan, acquire=acquire,
    measured=analyse, step_count=lambda _: 2,
    requires=lambda _: Requires(roles=("motion",), capabilities=("positioning",), channels=("x", "x_ref"), uses=("capture",)),
)  # fmt: skip
