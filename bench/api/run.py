"""A stored run: its channels, steps, captures, results and findings, and its analysis again."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from bench.api import pages, tables
from bench.api.capture import Capture
from bench.api.channel import Channel
from bench.cli.made_by import procedure_of
from bench.errors import ConfigError, RecordingError
from bench.history.naming import run_named
from bench.procedure import plans
from bench.record.records import Record, read_record
from bench.recording import Recording, Step
from bench.run import columns, reanalysis
from bench.rundir import RunDirectory

if TYPE_CHECKING:
    import pandas as pd


class Recorded(Protocol):
    """What has a record."""

    @property
    def record(self) -> Record: ...


class Judged:
    """What a record says, as tables."""

    @property
    def outcome(self: Recorded) -> str:
        """PASS, DONE, FAIL, INDETERMINATE, ERROR or ABORTED."""
        return self.record.outcome.value

    @property
    def results(self: Recorded) -> pd.DataFrame:
        """The measured quantities by name, in SI: `value`, `U`, `unit` and more."""
        return tables.results_of(self.record)

    @property
    def findings(self: Recorded) -> pd.DataFrame:
        """What was noticed: `code`, `effect`, `text`, `where`, `concerns`."""
        return tables.findings_of(self.record)


@dataclass(frozen=True)
class Analysis(Judged):
    """What an analysis says.

    Attributes:
        record: all of it, as `record.json` has it.
    """

    record: Record

    def _repr_html_(self) -> str:
        return pages.of_record(self.record)


@dataclass(frozen=True)
class Run(Judged):
    """A run in its directory. `run["pos_x"]` is a channel over the whole of it.

    Attributes:
        path: the directory.
    """

    path: Path

    @classmethod
    def open(cls, run: str | os.PathLike[str], folder: str | os.PathLike[str] = "runs") -> Run:
        """See `bench.open_run`."""
        path = Path(run)
        opened = cls(run_named(str(path.parent if path.is_file() else path), Path(folder)).path)
        if RunDirectory(opened.path).recording.is_file():
            opened.recording  # noqa: B018 (one that cannot be read is said now)
        return opened

    @property
    def run_id(self) -> str:
        """Its name, which is its directory's."""
        return self.path.name

    @cached_property
    def record(self) -> Record:
        """Everything that the run says of itself.

        Raises:
            ConfigError: there is no record, as for what `bench listen` recorded, or it cannot be read.
        """
        return read_record(RunDirectory(self.path).record)

    @cached_property
    def recording(self) -> Recording[Any]:
        """What was recorded, for all that this class does not offer.

        Raises:
            RecordingError: there is no recording, or it cannot be read.
        """
        path = RunDirectory(self.path).recording
        if not path.is_file():
            raise RecordingError(
                f"{self.path}: holds no recording.mcap; expected one. The run ended before it could record"
            )
        return Recording.open(path)

    @property
    def channels(self) -> pd.DataFrame:
        """The recorded channels by name: `unit`, `stream`, `rate_hz`."""
        return tables.channels_of(self.recording)

    @property
    def steps(self) -> pd.DataFrame:
        """The completed steps by number: `kind`, `start_s`, `end_s`, and a column for each label."""
        return tables.steps_of(self.recording)

    @property
    def captures(self) -> pd.DataFrame:
        """What was captured at full rate, by number: `rate_hz`, `samples`, `start_s`, `channels`, and each label."""
        return tables.captures_of(self.recording)

    def capture(self, number: int) -> Capture:
        """A capture, by its number in `captures`.

        Raises:
            ConfigError: there is none of that number.
        """
        found = self.recording.captures()
        if not found:
            raise ConfigError(f"{self.run_id}: holds no captures")
        if not 1 <= number <= len(found):
            raise ConfigError(f"{self.run_id}: found no capture {number}; expected one of 1 to {len(found)}")
        return Capture(found[number - 1], self.steps_of, columns.origin_ns(self.recording))

    def __getitem__(self, name: str) -> Channel:
        """A channel over the whole run.

        Raises:
            ConfigError: no such channel was recorded.
        """
        recording = self.recording
        for stream in recording.streams.values():
            for c in stream.channels:
                if c.name == name:
                    read = recording.channel(name)
                    origin = columns.origin_ns(recording)
                    seconds = (read["t_ns"] - origin) / 1e9
                    return Channel(
                        name, c.unit, read[name], seconds, read["index"].astype(np.int64), self.steps_of, origin
                    )
        known = list(self)
        raise ConfigError(pages.unknown(f"{self.run_id}: found no channel {name!r}", name, known))

    def __iter__(self) -> Iterator[str]:
        return (c.name for stream in self.recording.streams.values() for c in stream.channels)

    def __contains__(self, name: object) -> bool:
        return name in list(self)

    def to_pandas(self, *names: str) -> pd.DataFrame:
        """Channels of one stream side by side, by `t_s`; all of the telemetry by default.

        Raises:
            ConfigError: no such channel was recorded.
            AnalysisError: they are of different streams.
        """
        import pandas as pd

        recording = self.recording
        chosen = tuple(dict.fromkeys(names)) or tuple(c.name for c in recording.streams["telemetry"].channels)
        for name in chosen:
            if name not in self:
                self[name]  # says what there is
        read = recording.read(chosen, 0, 1 << 62)
        seconds = (read["t_ns"] - columns.origin_ns(recording)) / 1e9
        return pd.DataFrame({name: read[name] for name in chosen}, pd.Index(seconds, name="t_s"))

    def steps_of(self, kind: str, **labels: Any) -> list[Step]:
        """The completed steps of a kind that have these labels, in order.

        Raises:
            ConfigError: there is none.
        """
        steps = self.recording.all_steps()
        found = [s for s in steps if s.kind == kind and labels.items() <= s.labels.items()]
        if not found:
            asked = ", ".join([kind, *(f"{k}={v!r}" for k, v in labels.items())])
            kinds = sorted({s.kind for s in steps})
            known = dict.fromkeys(label for s in steps if s.kind == kind for label in s.labels)
            has = (
                f"its steps {kind} have the labels {', '.join(known)}"
                if known
                else f"it has steps {', '.join(kinds) or 'of no kind'}"
            )
            raise ConfigError(f"{self.run_id}: found no step {asked}; {has}")
        return found

    def analyse(self, plan: Mapping[str, Any] | None = None, procedure: str | os.PathLike[str] = "") -> Analysis:
        """Analyse the recording with today's Levbench; nothing is written (`bench analyse` writes).

        Args:
            plan: settings of the plan, as a plan file has them, to be other ones in this analysis. Those that say what was
                done (how many angles, how long) contradict the recording when they are changed.
            procedure: the file of the run's procedure, where it was one in a file.

        Raises:
            ConfigError: no such setting or value, or a procedure that this version does not have.
            RecordingError: there is no recording, or it cannot be read.
        """
        found = procedure_of(RunDirectory(self.path), self.recording.procedure, os.fspath(procedure))
        settings: dict[str, Any] = {}
        if plan:
            made = plans.assemble(found.plan, ("plan", {**self.recording.plan_dict, **plan}))
            settings = made.model_dump(mode="json")
        recording = Recording.open(self.recording.path, found.plan, settings)
        try:
            original: Record | None = self.record
        except ConfigError:
            original = None
        return Analysis(reanalysis.reanalysed(RunDirectory(self.path), found, recording, original))

    def __repr__(self) -> str:
        try:
            return f"<Run {self.run_id}: {self.record.procedure} on {self.record.rig}, {self.outcome}>"
        except ConfigError:
            return f"<Run {self.run_id}>"

    def _repr_html_(self) -> str:
        try:
            return pages.of_record(self.record)
        except ConfigError as error:
            return pages.of_text(f"{self.run_id}: {error}")
