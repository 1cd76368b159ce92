"""Labels of what is recorded, and from a recording to tracks cut into periods."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis
from procedures.sine_following.plan import Plan
from procedures.stages.tracks import Mode, Track, modes, tracks_of

SINE = "sine"


@dataclass(frozen=True)
class Ride:
    """One axis that follows a sine in one mode."""

    mode: Mode
    track: Track

    def periods(self, plan: Plan) -> list[slice]:
        """Samples of each whole period that was asked for."""
        t = self.track.t
        if len(t) < 3:
            return []
        step = float(np.median(np.diff(t)))
        whole = [k for k in range(plan.periods) if t[-1] + 1.5 * step >= (k + 1) * plan.period_s]
        ends = np.searchsorted(t, plan.period_s * np.arange(len(whole) + 1) - step / 2)
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def amplitude(axis: StageAxis, plan: Plan) -> float:
    """Of an axis, m or rad."""
    return plan.amplitude_m if axis.unit == "m" else plan.amplitude_rad


def modes_of(rig: RigFile, plan: Plan) -> tuple[Mode, ...]:
    """What is done, in order."""
    return modes(rig, plan.moved, together=plan.together)


def read(recording: Recording[Plan]) -> list[Ride]:
    """Every axis of every mode, in time order."""
    known = {m.name: m for m in modes_of(recording.rig, recording.plan)}
    out = []
    for step in recording.steps(SINE):
        mode = known[str(step.labels["mode"])]
        out += [Ride(mode, track) for track in tracks_of(recording, step, mode.axes).values()]
    return out
