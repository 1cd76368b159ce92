"""Findings of a run whose results rest on certificates that did not hold on its day."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from datetime import date
from typing import Any

from bench.findings import CERTIFICATE_OVERDUE, Finding
from bench.quantity import Measured
from bench.recording import Recording
from bench.rigfile.certificates import out_of_date


def overdue(recording: Recording[Any], measured: Iterable[Measured]) -> Iterator[Finding]:
    """A note for each that was overdue, or of a later date, on the day on which the run began."""
    identities = {influence.id for m in measured for influence in m.estimate.sensitivities}
    with suppress(ValueError):  # a recording that was cut off does not say when it began
        day = date.fromisoformat(recording.wall.get("started", "")[:10])
        for found in out_of_date(recording.rig, day, identities):
            code = "certificate-ahead" if found.ahead else CERTIFICATE_OVERDUE
            yield Finding(code, found.told, f"certificates.{found.name}")
