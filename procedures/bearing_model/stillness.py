"""Waiting until a lifted shaft no longer turns.

A shaft that nothing holds around its axis leaves its rings turning a little, and stops by its own drag. Meanwhile its runout
goes round, and the coils with it: 2 µm are 0.2 N at a bearing of 0.1 N/µm, which is much beside the load of one that carries
little. Nothing need tell the angle: the currents at a place that is held change as long as it turns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from procedures.shared import first_look

WINDOW_S, WINDOWS = 1.0, 30  # means that are compared; at most so many: a mean that never stands still is noise
CALM = 3.0  # standard deviations of a difference of two means
TWICE = 2  # a current at the turning point of its runout stands still once


def await_still(rig: Rig, record: Recorder, currents: Sequence[str]) -> None:
    """Until the means of all `currents` stay as they are for two windows, or there were enough of them: what turns on then
    shows as a misfit."""
    before: list[tuple[float, float]] = []
    calm = 0
    for _ in range(WINDOWS):
        seen = first_look.samples(rig, record, currents, WINDOW_S)
        now = [(float(x.mean()), float(np.std(x)) / math.sqrt(len(x))) for x in seen.values()]
        same = [abs(a - b) <= CALM * math.hypot(u, v) for (a, u), (b, v) in zip(now, before, strict=False)]
        calm = calm + 1 if same and all(same) else 0
        if calm == TWICE:
            return
        before = now
