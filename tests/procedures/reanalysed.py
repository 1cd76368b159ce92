"""One run judged again as if its plan or its calibrations had been others: for what `acquire` does not go by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from bench.calibration import Calibration
from bench.cli.virtual import Simulated
from bench.recording import Recording


def reanalysed(run: Simulated, known: Mapping[str, Calibration] | None = None, **plan: Any) -> Simulated:
    """What `analyse` makes of the closed recording with these calibrations by procedure, and these keys of the plan."""
    recording: Recording[Any] = Recording.open(run.recording.path, run.procedure.plan)
    if known is not None:
        recording.calibrations = tuple(known.values())
    recording.plan = run.procedure.plan.model_validate({**run.recording.plan_dict, **plan})
    return replace(run, recording=recording, results=list(run.procedure.analyse(recording)))
