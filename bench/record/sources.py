"""Which recordings a record was made from: its own, and those of the stopped runs that it goes on with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pydantic import ConfigDict

from bench.schema import STRICT


@dataclass(frozen=True)
class RecordingFile:
    """The recording's file name in the run directory and its digest, None if it was not taken."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    file: str
    sha256: str | None


@dataclass(frozen=True)
class ContinuedRun:
    """A stopped run whose completed steps this one's recording took over: its name, recording and digest of that, how many
    steps, when it was started (ISO 8601, UTC), and by what it was `stopped`, a code of a finding or `killed`."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    run_id: str
    file: str
    sha256: str
    steps: int
    started: str
    stopped: str
