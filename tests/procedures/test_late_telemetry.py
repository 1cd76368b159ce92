"""A stage that a served machine told of too late: what is missing, why, and what to do."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recordings import PERIOD_NS, START_NS, SetClock

from bench.catalogue import shipped
from bench.findings import Ended, Findings
from bench.procedure import Procedure
from bench.recording import Recording
from bench.recording.recorder import Recorder, RunHeader
from bench.rigfile import load_rig
from bench.samples import ChannelInfo, SampleBlock, StreamLayout
from procedures.axis_friction.procedure import procedure as friction
from procedures.axis_inertia.procedure import procedure as inertia

RIG = load_rig("rlsrm")
STREAM = StreamLayout("telemetry", PERIOD_NS, tuple(ChannelInfo(name, c.unit) for name, c in RIG.channels.items()))
PASS = {"axis": "x", "rate": 0.035, "repeat": 0, "way": 1}
SINE = {"axis": "x", "tone": 0, "hz": 1.8, "amplitude": 7e-3, "repeat": 0, "part": ""}
SAMPLES = 1000


def block(first: int, count: int, late_s: float) -> SampleBlock:
    """An axis that stands at one end of its travel, told so much too late."""
    index = np.arange(first, first + count)
    columns = {c.name: np.full(count, 13e-3 if c.name == "x" else 0.0) for c in STREAM.channels}
    t_ns = START_NS + index * PERIOD_NS
    return SampleBlock(
        "telemetry", first, (index * 20).astype(np.uint64), t_ns, int(t_ns[-1] + late_s * 1e9), 0, columns
    )


def recorded(path: Path, kind: str, labels: Mapping[str, Any], ended_s: float, *late_s: float) -> Path:
    """Samples in blocks of a second that came so late; a step around all but the first, or its first part."""
    attached = {f"rig.{end}": (shipped("rigs") / f"rlsrm.{end}").read_bytes() for end in ("toml", "dbc")}
    header = RunHeader({"run": {"procedure": "stage"}, "versions": {"levbench": "0"}}, {**attached, "plan.json": b"{}"})
    clock = SetClock()
    with Recorder(path, clock=clock, streams=[STREAM], header=header) as recorder:
        blocks = [block(k * SAMPLES, SAMPLES, late) for k, late in enumerate(late_s)]
        recorder.samples(blocks[0])
        clock.now = START_NS + SAMPLES * PERIOD_NS
        with recorder.step(kind, **labels):
            for part in blocks[1:]:
                recorder.samples(part)
            clock.now += round(ended_s * 1e9)
        recorder.close()
    return path


def said(procedure: Procedure[Any, Any], path: Path) -> str:
    """The finding with which an evaluation ends."""
    findings = Findings()
    with pytest.raises(Ended):
        procedure.evaluate(Recording.open(path, procedure.plan), findings)
    (found,) = findings.told
    return f"{found.code}: {found.text}"


def test_a_pass_that_lay_before_its_step(tmp_path: Path) -> None:
    """6.5 s behind the clock: the axis had arrived by its own time before the step began."""
    path = recorded(tmp_path / "late.mcap", "pass", PASS, 2.0, 0.0, 6.1, 6.5)
    text = said(friction, path)
    assert text.startswith(
        "passes-missing: axis x at 0.035: found 0 samples between -0.005 and 0.005 m; expected 20 or more. "
    )
    assert "Telemetry came late: 2000 of the step's 2000 samples, up to 6.5 s. " in text
    assert text.endswith("Free the computer that serves it (a real controller: look at its link), and run again.")


def test_how_many_of_a_step_came_late(tmp_path: Path) -> None:
    """Those of the blocks that did, inside the step alone."""
    path = recorded(tmp_path / "half.mcap", "pass", PASS, 1.5, 0.0, 0.1, 3.0)
    (step,) = Recording.open(path).steps("pass")
    assert step.late() == (500, pytest.approx(3.0))
    assert "late: 500 of the step's 1500 samples, up to 3.0 s" in said(friction, path)


def test_a_sine_of_a_few_late_samples(tmp_path: Path) -> None:
    text = said(inertia, recorded(tmp_path / "short.mcap", "tone", SINE, 0.1, 0.0, 2.0))
    assert text.startswith("sines-missing: axis x at 1.8 Hz: found 100 samples; expected 200 or more. ")
    assert "late: 100 of the step's 100 samples, up to 2.0 s" in text


def test_what_came_in_time_is_not_called_late(tmp_path: Path) -> None:
    path = recorded(tmp_path / "timely.mcap", "pass", PASS, 2.0, 0.0, 0.1, 0.3)
    assert said(friction, path) == (
        "passes-missing: axis x at 0.035: found 0 samples between -0.005 and 0.005 m; expected 20 or more."
    )
