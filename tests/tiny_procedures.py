"""Small procedures that do one thing each: what the tests of the runner and of the command line run."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any, Literal

from bench.errors import OperatorAbort
from bench.findings import Effect, Finding
from bench.procedure import BenchPlan, Measured, Procedure, Quantity
from bench.procedure.rig import Rig
from bench.procedure.roles import NOTHING, RigState
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.uncertainty import Estimate, Influence

SUPPLY = Quantity("supply", "V", "mean supply voltage")


class Plan(BenchPlan):
    """`act` is what happens in the middle of acquire, `then` what analyse does."""

    act: Literal["measure", "raise", "refuse", "stop", "count", "spin", "drive"] = "measure"
    then: Literal["yield", "nothing", "doubt", "raise", "note"] = "yield"
    seconds: float = 0.5
    bias_A: float = 3.0


def acquire(rig: Rig, plan: Plan, record: Recorder) -> None:
    """One step before the act and one after it."""
    for n in range(2):
        rig.operator.hang(NOTHING)
        with record.step("look", number=n):
            rig.clock.sleep(plan.seconds)
        if n == 0:
            _act(rig, plan)


def _act(rig: Rig, plan: Plan) -> None:
    if plan.act == "raise":
        raise ZeroDivisionError("a mistake in the procedure")
    if plan.act == "refuse":
        rig.levitation.set("bias_i", 99.0)
    if plan.act == "stop":
        raise OperatorAbort("the operator said stop")
    if plan.act == "spin":
        rig.rotation.spin(30.0)
    if plan.act == "drive":
        _driven(rig)
    while plan.act in ("count", "spin"):  # until a signal ends it; each second of bench time is a line
        sys.stderr.write(f"at {rig.clock.now_ns()}\n")
        sys.stderr.flush()
        rig.clock.sleep(1.0)


def _driven(rig: Rig) -> None:
    """Turn the shaft by its external drive, with the motor's control of the angle released, and let it coast."""
    assert rig.drive is not None
    gains = {name: rig.levitation.get(name) for name in ("kp_theta", "ki_theta", "kd_theta")}
    for name in gains:
        rig.levitation.set(name, 0.0)
    rig.drive.reach(20.0)
    rig.clock.sleep(1.0)
    rig.drive.coast()
    while abs(rig.rotation.speed_rad_s) > 0.2:
        rig.clock.sleep(0.1)
    for name, value in gains.items():
        rig.levitation.set(name, value)


def analyse(recording: Recording[Plan]) -> Iterator[Measured | Finding]:
    """The mean of the first step's supply voltage."""
    plan = recording.plan
    if plan.then == "raise":
        raise ZeroDivisionError("a mistake in the analysis")
    if plan.then == "nothing":
        return
    if plan.then == "note":
        yield Finding("untold", "nothing is told of the hall", "hall", concerns=("supply@hall",))
    if plan.then == "doubt":
        yield Finding("doubt", "this number is not to be trusted", "supply", Effect.INDETERMINATE)
    step = next(iter(recording.steps("look")))
    meter = Influence("meter", "voltmeter", 0.1, "V", "B", "normal")
    yield SUPPLY.measured(Estimate.of(step.mean("supply"), meter))


def _made(name: str, state: RigState) -> Procedure:
    return Procedure(
        name=name, title=f"A look at the supply, {state}", measures=(SUPPLY,), state=state, plan=Plan, acquire=acquire,
        measured=analyse, settings=lambda _, plan: {"bias_i": plan.bias_A}, step_count=lambda _: 2,
    )  # fmt: skip


resting: Any = _made("tiny-resting", RigState.READY)
levitated: Any = _made("tiny-levitated", RigState.LEVITATED)
procedure = levitated
