"""A recording begins with what an earlier one holds: messages byte by byte, counted as if they were its own."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from bench.recording.earlier import CONTINUED, Earlier
from bench.recording.recorder import Recorder

AT_ONCE = 500  # messages; some milliseconds of work


def taking_over(recorder: Recorder, earlier: Earlier) -> Iterator[None]:
    """Write it piece by piece, with the caller's work between them; the event `continued` marks the seam.

    Raises:
        RecordingError: the earlier recording is damaged, or this one cannot be written.
    """
    for stream in earlier.recording.capture_streams.values():
        recorder.stream(stream)
    left = earlier.messages()
    while messages := tuple(islice(left, AT_ONCE)):
        recorder.take(messages)
        yield
    recorder.go_on(earlier.begun, tuple((s.kind, s.labels) for s in earlier.steps))
    recorder.event(CONTINUED, **earlier.told)
