"""What each rig of a campaign goes through, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Keep = Literal["all", "missed", "none"]


@dataclass(frozen=True)
class StepTask:
    """One step: the procedure's name, its whole plan (SI), which quantities are judged, whether it is adopted, and the
    procedures whose calibrations it needs."""

    procedure: str
    plan: Mapping[str, Any]
    judged: tuple[str, ...]
    adopt: bool
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class RigTask:
    """What every rig of a campaign goes through, and on which visit. `folder` takes recordings while they are needed, and
    kept ones."""

    rig: str
    rig_sha256: str
    steps: tuple[StepTask, ...]
    truth: Mapping[str, float]
    keep: Keep
    folder: str
    visit: int = 0
