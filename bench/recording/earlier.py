"""What a run that was stopped left of its work: the steps that it completed, and the messages of its recording up to there.

A run that continues it takes these messages over as they stand, byte by byte, so that its own recording holds all of its
steps and needs no other file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

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
    """The completed `steps` of a `recording`; make it with `left_in`, which reads all that takes long.

    Attributes:
        end_ns: end of the last of them.
        last_ns: time of the last event or sample.
        begun: how many steps were begun till then; the numbers of later ones go on from there.
        kept: which of the events are taken over, by their number in the file: those to the end of the last completed step.
        later: what a person said of these steps after that.
        told: what the event that marks the seam says of it, JSON values.
    """

    recording: Recording[Any]
    steps: tuple[Step, ...]
    end_ns: int
    last_ns: int
    begun: int
    kept: int
    later: tuple[Message, ...]
    told: Mapping[str, Any] = field(default_factory=dict)

    @property
    def stretch(self) -> int:
        """Number of what goes on with it: 1, 2, ..."""
        return 1 + len(self.recording.events(CONTINUED))

    def messages(self) -> Iterator[Message]:
        """Topic, time and data of what is taken over, in the order of the file: samples, views and frames to the end of the
        last completed step, events to there, and what a person said later of those steps."""
        events, raw = 0, layout.raw_topic("")
        for topic, t_ns, data in self.recording.everything(self.end_ns + LATER_NS):
            if topic == layout.EVENTS:
                events += 1
                if events <= self.kept:
                    yield topic, t_ns, data
            elif t_ns <= self.end_ns + (LATER_NS if topic.startswith(raw) else 0):
                yield topic, t_ns, data
        yield from self.later


def left_in(recording: Recording[Any], kind: str = "", whole: int = 1) -> Earlier:
    """What was completed in a recording: steps that ended, and whose samples are there to their end. What a killed process
    had not written is not done. `whole` are the steps of a `kind` that are worth something together alone: of the last ones,
    fewer than these are not done either, nor is what came after.

    Raises:
        RecordingError: it is damaged.
    """
    steps, events = _together(_completed(recording), kind, whole), recording.events()
    end_ns = steps[-1].end_ns if steps else 0
    kept = 1 + max((k for k, e in enumerate(events) if e["kind"] == "step-end" and e["t_ns"] <= end_ns), default=-1)
    ended = {e["step"] for e in events[:kept] if e["kind"] == "step-end"}
    later = {k for k, e in enumerate(events) if k >= kept and e["kind"] == "step-corrected" and e["step"] in ended}
    stored = enumerate(recording.stored_events()) if later else ()
    return Earlier(
        recording, steps, end_ns, _last(recording, end_ns),
        1 + max((int(e["step"]) for e in events[:kept] if e["kind"] == "step-begin"), default=-1), kept,
        tuple((layout.EVENTS, t_ns, data) for k, (t_ns, data) in stored if k in later),
    )  # fmt: skip


def _completed(recording: Recording[Any]) -> tuple[Step, ...]:
    steps = recording.all_steps().items
    if not steps:
        return ()
    reached = _reached(recording, steps[-1].start_ns) + 2 * recording.streams["telemetry"].period_ns
    return tuple(s for s in steps if s.end_ns <= reached)


def _together(steps: tuple[Step, ...], kind: str, whole: int) -> tuple[Step, ...]:
    numbers = [k for k, s in enumerate(steps) if s.kind == kind]
    beyond = len(numbers) % whole
    return steps[: numbers[-beyond]] if beyond else steps


def _reached(recording: Recording[Any], after_ns: int) -> int:
    """Time of the last sample of the telemetry, which comes after this one, 0 where none does."""
    return max((int(b.t_ns[-1]) for b in recording.blocks("telemetry", after_ns)), default=0)


def _last(recording: Recording[Any], end_ns: int) -> int:
    return max((end_ns, _reached(recording, end_ns), *(int(e["t_ns"]) for e in recording.events())))
