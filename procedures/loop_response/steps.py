"""From recorded sines to lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.rigfile.roles import STATE
from procedures.loop_response import fit
from procedures.loop_response.fit import Line
from procedures.loop_response.injection import SENSOR, ability

Array = npt.NDArray[np.float64]
STEP = "sine"
SURVEY, REFINED = "survey", "refined"
LIMITED = 0.02  # share of a line's samples of telemetry that may say so, and it is still a sine


@dataclass(frozen=True)
class Taken:
    """One sine: into which loop, where, of which pass; `hz`, `amplitude` m or rad; the `line` (None: not captured); how far
    the reading went, `spread` m or rad from peak to peak; `limited`, share of the telemetry's samples in which the loop was at
    its limit; the `states` that the controller was in; samples `lost` of those `expected`."""

    axis: str
    place: str
    kind: str
    hz: float
    amplitude: float
    periods: int
    line: Line | None
    spread: float
    limited: float
    states: tuple[str, ...]
    lost: int
    expected: int

    @property
    def where(self) -> str:
        """As findings name it."""
        return f"{self.axis}, {self.place}, {self.hz:.4g} Hz"


def line_of(columns: Mapping[str, Array], channel: str, wave: str, labels: Mapping[str, Any]) -> Line:
    """The line of a capture by what it is labelled.

    Raises:
        AnalysisError: the capture does not hold its periods.
    """
    n = int(labels["samples"])
    shown = columns[wave][:n] if wave else None
    return fit.line(columns[channel][:n], int(labels["periods"]), float(labels["amplitude"]), shown,
                    sensed=labels["place"] == SENSOR)  # fmt: skip


def read_taken(recording: Recording[Any]) -> list[Taken]:
    """Every sine, in time order."""
    rig, can, out = recording.rig, ability(recording.rig), []
    names = rig.choices(STATE)
    for step in recording.steps(STEP):
        labels = step.labels
        loop = can.loops[str(labels["axis"])]
        watched = [STATE, *([loop.limited.channel] if loop.limited is not None else [])]
        data = step.read(*watched)
        limited = 0.0
        if loop.limited is not None and len(data[STATE]):
            flags = data[loop.limited.channel].astype(np.int64)
            hit = flags != 0 if loop.limited.mask is None else flags & loop.limited.mask != 0
            limited = float(np.mean(hit))
        captured = recording.captures(number=labels["number"])
        found, spread = None, 0.0
        if captured:
            columns = captured[0].arrays(loop.channel, *([can.wave] if can.wave else []))
            found, spread = line_of(columns, loop.channel, can.wave, labels), float(np.ptp(columns[loop.channel]))
        states = tuple(names.get(int(code), str(int(code))) for code in np.unique(data[STATE]))
        out.append(
            Taken(
                str(labels["axis"]), str(labels["place"]), str(labels["pass"]), float(labels["hz"]), float(labels["amplitude"]),
                int(labels["periods"]), found, spread, limited, states, step.lost(), step.expected(),
            )
        )  # fmt: skip
    return out


def of_loop(taken: Sequence[Taken], axis: str, place: str, kind: str = "") -> list[Taken]:
    """The captured sines of one loop and place by frequency, of one pass or of all."""
    some = [t for t in taken if (t.axis, t.place) == (axis, place) and kind in ("", t.kind) and t.line is not None]
    return sorted(some, key=lambda t: t.hz)
