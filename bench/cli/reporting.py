"""The report of a run: the procedure's words and figures, and the measured conditions, handed to `reports`."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from bench.figures import Shown
from bench.procedure import Procedure
from bench.record.records import Record
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.run.evaluation import ANALYSIS_FAILED, Ending

CELSIUS = 273.15


def build(directory: Path, record: Record, procedure: Procedure, recording: Recording[Any] | None) -> None:
    """Write `report.html` and `report.pdf`.

    Raises:
        BenchError: a figure, a page or a file cannot be made.
    """
    import reports

    reports.build(
        directory,
        recording,
        json.loads(json.dumps(dataclasses.asdict(record))),
        figures(record, procedure, recording),
        title=procedure.title,
        method=procedure.method,
        measures=procedure.measures,
        reached=procedure.reached,
        assumes=procedure.assumes,
        conditions={} if recording is None else conditions(recording),
    )


def figures(record: Record, procedure: Procedure, recording: Recording[Any] | None) -> Iterable[Shown]:
    """What the procedure draws of a run that was analysed; nothing of one that was stopped, or whose analysis failed."""
    if recording is None or Ending.read(recording).stopped is not None:
        return ()
    return () if any(f.code == ANALYSIS_FAILED for f in record.findings) else procedure.drawn(recording)


def conditions(recording: Recording[Any]) -> dict[str, str]:
    """Range over the run of every recorded temperature and voltage: the channel's description and a text with unit."""
    found: dict[str, str] = {}
    for stream in recording.streams.values():
        wanted = {c.name: c.unit for c in stream.channels if c.unit in ("K", "V")}
        low, high = dict.fromkeys(wanted, np.inf), dict.fromkeys(wanted, -np.inf)
        for block in recording.blocks(stream.name) if wanted else ():
            for name in wanted:
                low[name] = min(low[name], float(block.columns[name].min()))
                high[name] = max(high[name], float(block.columns[name].max()))
        for name, unit in wanted.items():
            if np.isfinite(low[name]):
                found[_named(recording.rig, name, unit)] = _range(low[name], high[name], unit)
    return found


def _named(rig: RigFile, name: str, unit: str) -> str:
    """What a channel shows, with its kind where the description leaves that out, and its device beside the controller."""
    kind = "temperature" if unit == "K" else "voltage"
    if name in rig.channels:
        about, device = rig.channels[name].about, ""
    else:
        registers = ((r.about, f" ({d})") for d, of in rig.devices.items() for n, r in of.registers.items()
                     if f"{d}_{n}" == name)  # fmt: skip
        about, device = next(registers, ("", ""))
    if not about:
        return name
    return (about if kind in about else f"{kind}, {about}") + device


def _range(low: float, high: float, unit: str) -> str:
    shift, symbol = (CELSIUS, "°C") if unit == "K" else (0.0, unit)
    a, b = f"{low - shift:.1f}", f"{high - shift:.1f}"
    return f"{a} {symbol}" if a == b else f"{a} to {b} {symbol}"
