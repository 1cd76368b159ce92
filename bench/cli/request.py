"""A run as it is asked for on the command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Request:
    """A run as it was asked for. Of one that `continues` a stopped one, texts that are empty stand for what that one had."""

    procedure: str
    rig: str
    backend: str = "sim"
    seed: int | None = None
    visit: int | None = None
    plan: tuple[str, ...] = ()
    plan_file: Path | None = None
    truth: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    clear_fault: bool = False
    out: Path = Path("runs")
    operator: str | None = None
    report: bool = True
    calibrations: Path | None = None
    model: Path | None = None
    allow_expired: bool = False
    spec: Path | None = None
    require_verdict: bool = False
    continues: Path | None = None
