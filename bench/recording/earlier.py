"""What a run that was stopped left of its work: the steps that it completed, and the messages of its recording up to there.

A run that continues it takes these messages over as they stand, byte by byte, so that its own recording holds all of its
steps and needs no other file.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

from bench.errors import RecordingError
from bench.recording import layout
from bench.recording.recording import Recording
from bench.recording.steps import Step

CONTINUED: Final = "continued"
"""Event where a recording goes on that another one began: what that one was, and what was taken over of it."""
AGAIN: Final = "-again"
"""End of the kind of a step that repeats the last one of a stopped run."""
LATER_NS: Final = 1_000_000_000  # frames are written later than the samples in them are dated, by less
Message = tuple[str, int, bytes]


@dataclass(frozen=True)
class Earlier:
    """The completed steps of a `recording`. `told` is what the event that marks the seam says of it, JSON values."""

    recording: Recording[Any]
    told: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def steps(self) -> tuple[Step, ...]:
        """Those that ended, and whose samples are there to their end: what a killed process had not written is not done."""
        steps = self.recording.all_steps().items
        if not steps:
            return ()
        period = self.recording.streams["telemetry"].period_ns
        reached = max((int(b.t_ns[-1]) for b in self.recording.blocks("telemetry", steps[-1].start_ns)), default=0)
        return tuple(s for s in steps if s.end_ns <= reached + 2 * period)

    @property
    def end_ns(self) -> int:
        """End of the last of them.

        Raises:
            RecordingError: there is none.
        """
        if not self.steps:
            raise RecordingError(f"recording {self.recording.path}: no step was completed")
        return self.steps[-1].end_ns

    @property
    def stretch(self) -> int:
        """Number of what goes on with it: 1, 2, ..."""
        return 1 + len(self.recording.events(CONTINUED))

    @cached_property
    def last_ns(self) -> int:
        """Time of the last event or sample."""
        blocks = self.recording.blocks("telemetry", self.end_ns)
        return max(*(e["t_ns"] for e in self.recording.events()), *(int(b.t_ns[-1]) for b in blocks), self.end_ns)

    @property
    def begun(self) -> int:
        """How many steps were begun, completed or not: the numbers of later ones go on from there."""
        return 1 + max((int(e["step"]) for e in self._kept_events() if e["kind"] == "step-begin"), default=-1)

    def messages(self) -> Iterator[Message]:
        """Topic, time and data of what is taken over, in the order of the file: samples, views and frames to the end of the
        last completed step, events to there, and what a person said later of those steps."""
        kept = iter([event["data"] for event in self._kept(self._events())])
        following = next(kept, None)
        for topic, t_ns, data in self.recording.everything():
            if topic == layout.EVENTS:
                if data == following:
                    yield topic, t_ns, data
                    following = next(kept, None)
            elif t_ns <= self.end_ns + (LATER_NS if topic.startswith(layout.raw_topic("")) else 0):
                yield topic, t_ns, data

    def _events(self) -> list[dict[str, Any]]:
        found = (data for topic, _, data in self.recording.everything() if topic == layout.EVENTS)
        return [{**json.loads(data), "data": data} for data in found]

    def _kept_events(self) -> list[dict[str, Any]]:
        return self._kept(self.recording.events())

    def _kept(self, events: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Events to the end of the last completed step, and later corrections of steps."""
        last = max(
            (k for k, e in enumerate(events) if e["kind"] == "step-end" and e["t_ns"] <= self.end_ns), default=-1
        )
        ended = {e["step"] for e in events[: last + 1] if e["kind"] == "step-end"}
        later = (e for e in events[last + 1 :] if e["kind"] == "step-corrected" and e["step"] in ended)
        return [*events[: last + 1], *later]
