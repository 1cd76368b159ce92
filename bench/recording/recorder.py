"""The recorder: raw frames, decoded blocks, a 100 Hz view and events into one MCAP file, by one writer thread.

Everything but the metadata record `wall` is a function of what was recorded, so equal runs give equal files. Every half
second of bench time what is pending is written and the chunk is closed: what a killed process leaves behind holds all
but the last second.
"""

from __future__ import annotations

import errno
import json
import queue
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bench import lock
from bench.calibration import Calibration
from bench.calibration.file import attached
from bench.clock import Clock
from bench.errors import RecordingError
from bench.link.frames import FRAME, FrameBatch
from bench.recording.integrity import Integrity
from bench.recording.mcapwriter import McapWriter
from bench.recording.tap import Tap
from bench.rigfile import RigFile
from bench.rigfile.aliases import with_full_names
from bench.samples import TICKS, SampleBlock, StreamLayout

LIVE_ITEMS = 400  # a live link hands over at most some tens of batches a second, so this is seconds
WAITING_ITEMS = 8  # where the maker waits; in bench time it runs ahead of the disk by less than half a second


@dataclass(frozen=True)
class RunHeader:
    """What stands first in the file: `metadata` records by name, and `attachments` by name. Nothing from the wall
    clock belongs here; that goes to `wall`."""

    metadata: Mapping[str, Mapping[str, str]]
    attachments: Mapping[str, bytes]


class Recorder:
    """Writes one recording. Use as a context manager; `close` is safe to call twice.

    Args:
        path: must not exist.
        clock: gives the time of events and steps.
        live: a full queue raises instead of blocking, and closing raises again, so the run cannot pass unnoticed.
        plain: written by the caller's own thread and without the 100 Hz view: half the work, for virtual rigs whose
            recordings nobody scrolls through.

    Raises:
        RecordingError: the file cannot be made; later from any call: the writer thread could not write.
    """

    def __init__(
        self,
        path: Path,
        *,
        clock: Clock,
        streams: Sequence[StreamLayout],
        header: RunHeader,
        live: bool = False,
        plain: bool = False,
    ) -> None:
        self.path, self._clock, self._live, self._plain = path, clock, live, plain
        self.integrity = Integrity()
        self._newest: tuple[int, frozenset[str]] = (-1, frozenset())  # step: its number and its labels
        self._completed: tuple[tuple[str, Mapping[str, Any]], ...] = ()  # steps that were taken over
        self._watched: dict[str, list[npt.NDArray[np.float64]]] = {}  # by channel: what came of it
        self._header = header
        self.wall: dict[str, str] = {}
        self.tap: Tap | None = None  # where somebody may look at samples as they come
        self._streams = {s.name: s for s in streams}
        self._failure: BaseException | None = None
        self._closed = False
        self._high_water = 0
        try:
            self._file = path.open("xb")
            lock.hold(self._file.fileno())
        except OSError as error:
            raise RecordingError(f"recording {path}: cannot be written: {error.strerror or error}") from error
        try:
            self._writer = McapWriter(
                self._file, self._streams, header.metadata, header.attachments, clock.now_ns(), view=not plain
            )
        except OSError as error:
            with suppress(OSError):  # closing tries the same bytes again
                self._file.close()
            raise RecordingError(f"recording {path}: cannot be written: {_why(error)}") from error
        self._queue: queue.Queue[tuple[str, tuple[Any, ...]] | None] = queue.Queue(
            LIVE_ITEMS if live else WAITING_ITEMS
        )
        self._thread = threading.Thread(target=self._drain, name="recorder", daemon=True)
        if not plain:
            self._thread.start()

    @property
    def calibrations(self) -> tuple[Calibration, ...]:
        """Those that the run uses, for decisions under way: the same that `Recording.calibrations` gives the analysis."""
        stored = self._header.attachments
        found = attached(stored.get("calibrations.json", b"[]").decode(), f"recording {self.path}")
        if not found:
            return ()
        aliases = RigFile.parse(stored["rig.toml"].decode(), stored["rig.dbc"].decode()).aliases
        return tuple(replace(c, values=with_full_names(aliases, c.values)) for c in found)

    def frames(self, link: str, batch: FrameBatch, lag_ns: int = 0) -> None:
        """Record frames as they came, or as they were sent (flag SENT); host time less `lag_ns` is sample time."""
        if len(batch):
            kept = batch if self._plain else batch.astype(FRAME, copy=True)  # written at once, or by the thread
            self._put("frames", link, lag_ns, kept)
            self.integrity.add("frames", link, len(batch))

    def take(self, messages: Sequence[tuple[str, int, bytes]]) -> None:
        """Take messages of another recording over: topic, time and bytes (`bench.recording.takeover`)."""
        self._put("taken", messages)
        for topic, _, data in messages:
            self.integrity.count(topic, data)

    def go_on(self, begun: int, completed: tuple[tuple[str, Mapping[str, Any]], ...]) -> None:
        """What is recorded next comes after `begun` steps that were taken over, of which these were `completed`."""
        self.integrity.steps, self._completed = begun, completed

    def completed(self, kind: str) -> tuple[Mapping[str, Any], ...]:
        """Labels of the steps of a kind that a stopped run had completed and this one, which continues it, need not record."""
        return tuple(labels for name, labels in self._completed if name == kind)

    @property
    def waiting(self) -> int:
        """How much the writer has yet to do."""
        return self._queue.qsize()

    def stream(self, layout: StreamLayout) -> None:
        """Add a stream, such as a capture, while recording.

        Raises:
            RecordingError: there is one of that name.
        """
        if layout.name in self._streams:
            raise RecordingError(f"recording {self.path}: stream {layout.name} is there already")
        self._streams[layout.name] = layout
        self._put("stream", layout)

    def samples(self, block: SampleBlock) -> None:
        """Record decoded samples; small blocks are merged, large ones split.

        Raises:
            RecordingError: the block does not fit its stream's layout.
        """
        self._check(block)
        if len(block):
            self._put("samples", block)
            if self.tap is not None:
                self.tap.put(block)
            for name in self._watched if self._watched.keys() <= {TICKS, *block.columns} else ():
                self._watched[name].append(np.array(block.ticks if name == TICKS else block.columns[name], np.float64))
            self.integrity.add("samples", block.stream, len(block))
            self.integrity.add("lost", block.stream, block.lost_before)

    def event(self, kind: str, t_ns: int | None = None, **data: Any) -> int:
        """Record something that happened, at `t_ns` or now; `data` are JSON values. The time, ns."""
        at = self._clock.now_ns() if t_ns is None else t_ns
        self._put("event", at, json.dumps({"kind": kind, "t_ns": at, **data}, allow_nan=False).encode())
        self.integrity.events += 1
        return at

    @contextmanager
    def step(self, kind: str, **labels: Any) -> Iterator[None]:
        """A labelled interval of the recording; left open when the block raises."""
        index = self.integrity.steps
        self.integrity.steps += 1
        self._newest = (index, frozenset(labels))
        self.event("step-begin", step=index, name=kind, labels=labels)
        yield
        self.event("step-end", step=index, name=kind)

    @contextmanager
    def watching(self, channels: Sequence[str]) -> Iterator[dict[str, npt.NDArray[np.float64]]]:
        """Within, samples that come are also kept: what is given has those of each of `channels` afterwards, (n,) SI (ticks by
        `bench.samples.TICKS`), or nothing where no sample of them all came. For decisions under way, never for a result."""
        seen: dict[str, npt.NDArray[np.float64]] = {}
        self._watched = {name: [] for name in channels}
        try:
            yield seen
            seen |= {name: np.concatenate(parts) for name, parts in self._watched.items() if parts}
        finally:
            self._watched = {}

    def correct(self, **labels: Any) -> bool:
        """Other labels for the newest step, as a person tells them who was there; False where it has no such labels."""
        index, known = self._newest
        if index < 0 or not known.issuperset(labels):
            return False
        self.event("step-corrected", step=index, labels=labels)
        return True

    def close(self) -> Integrity:
        """Write what is pending, the integrity and the wall record, and close the file.

        Raises:
            RecordingError: something could not be written, now or before, or samples were lost on the way to the disk.
        """
        if not self._closed:
            self._closed = True
            if not self._plain:
                self._queue.put(None)
                self._thread.join()
            try:
                if self._failure is None:
                    self.wall["queue_high_water"] = str(self._high_water)
                    self._writer.write_pending()
                    self.integrity.blocks.update(self._writer.blocks)
                    counts = {k: json.dumps(v, sort_keys=True) for k, v in vars(self.integrity).items()}
                    self._writer.finish(counts, self.wall)
            except Exception as error:
                self._failure = error
            finally:
                try:
                    self._file.close()
                except OSError as error:
                    self._failure = self._failure or error
        self._raise()
        if self.integrity.overflows:
            raise RecordingError(f"{self._too_slow()}; {self.integrity.overflows} batches are missing from it")
        return self.integrity

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: object, cause: BaseException | None, _: object) -> None:
        try:
            self.close()
        except RecordingError as error:
            if cause is None:
                raise
            cause.add_note(str(error))  # what ended the run comes first; this must not get lost either

    def _raise(self) -> None:
        if self._failure is not None:
            raise RecordingError(f"recording {self.path}: cannot be written: {_why(self._failure)}") from self._failure

    def _too_slow(self) -> str:
        return f"recording {self.path}: the disk did not keep up with the live link"

    def _check(self, block: SampleBlock) -> None:
        layout_of = self._streams.get(block.stream)
        if layout_of is None:
            known = ", ".join(self._streams) or "none"
            raise RecordingError(f"recording {self.path}: found samples of stream {block.stream!r}; expected {known}")
        n, columns = len(block), block.columns
        if len(block.t_ns) == n and all(c.name in columns and len(columns[c.name]) == n for c in layout_of.channels):
            return
        for name in ("t_ns", *(c.name for c in layout_of.channels)):
            column = block.t_ns if name == "t_ns" else block.columns.get(name, ())
            if len(column) != len(block):
                raise RecordingError(
                    f"recording {self.path}: stream {block.stream}: found {len(column)} samples of {name}; "
                    f"expected {len(block)}, one for each device tick"
                )

    def _put(self, what: str, *arguments: Any) -> None:
        self._raise()
        if self._closed:
            raise RecordingError(f"recording {self.path} is closed")
        if self._plain:
            self._write(what, arguments)
            self._raise()
            return
        try:
            self._queue.put((what, arguments), block=not self._live)
        except queue.Full:
            self.integrity.overflows += 1
            self.integrity.complete = False
            raise RecordingError(f"{self._too_slow()}; {what} were lost") from None
        self._high_water = max(self._high_water, self._queue.qsize())

    def _drain(self) -> None:
        while (item := self._queue.get()) is not None:
            if self._failure is None:
                self._write(*item)

    def _write(self, what: str, arguments: tuple[Any, ...]) -> None:
        try:
            getattr(self._writer, what)(*arguments)
        except BaseException as error:
            self._failure = error


def _why(failure: BaseException) -> str:
    full = isinstance(failure, OSError) and failure.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    why = getattr(failure, "strerror", None) or repr(failure)
    return f"{why}. Next: free space there, or give another --out" if full else why
