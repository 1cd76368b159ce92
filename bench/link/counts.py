"""What a link delivered, as the record counts it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from pydantic import ConfigDict

from bench.schema import STRICT


@dataclass(frozen=True)
class LinkCounts:
    """What the controller's link delivered: frames, gaps in the telemetry, everything that a clean link does not do.

    `counts` has it all by name (docs/reference/record.md). `drift_ppm` is host clock against device clock with its
    expanded uncertainty; `latest_ms` the greatest lateness of a sample, `round_trip_ms` the least time from a
    request to its answer; None where it was not measured.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    frames: int = 0
    gaps: int = 0
    errors: int = 0
    counts: Mapping[str, int] = dataclasses.field(default_factory=dict)
    drift_ppm: float | None = None
    drift_expanded_ppm: float | None = None
    latest_ms: float | None = None
    round_trip_ms: float | None = None
