"""How much of a recording is taken before it is refused: a stranger's file costs bounded time and memory.

The defaults hold an hour of 30 channels at 1 kHz many times over, in less than 1 GB. An environment variable raises each.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from typing import Final

from bench.errors import ConfigError, RecordingError

MB: Final = 1_000_000


@dataclass(frozen=True)
class ReadLimits:
    """At most so much; the names in capitals after LEVBENCH_MAX_ are those of the environment variables.

    Attributes:
        chunks: of a file; one is written for each half second.
        inflation: uncompressed bytes of all chunks for each byte of the file.
        events: of a file.
        event_mb: their JSON, MB.
        samples: numbers that are read at once: samples times channels, their times and indexes included.
    """

    chunks: int = 200_000
    inflation: int = 100
    events: int = 200_000
    event_mb: int = 16
    samples: int = 32_000_000

    def check(self, name: str, found: float, where: str, what: str) -> None:
        """See that `found` of `what` is not above the limit of that name.

        Raises:
            RecordingError: it is; says which variable raises the limit.
        """
        if found > (limit := getattr(self, name)):
            raise RecordingError(
                f"{where}: found {found:,.0f} {what}; expected at most {limit:,}. Next: if the file can be trusted, "
                f"{variable(name)}=N raises the limit"
            )


def variable(name: str) -> str:
    """The environment variable of a limit."""
    return f"LEVBENCH_MAX_{name.upper()}"


def read_limits() -> ReadLimits:
    """The limits, with what the environment says.

    Raises:
        ConfigError: it says something else than a positive whole number.
    """
    return ReadLimits(**{f.name: _stated(variable(f.name), int(f.default)) for f in fields(ReadLimits)})  # type: ignore[arg-type]


def _stated(key: str, default: int) -> int:
    text = os.environ.get(key, "")
    if not text:
        return default
    if not (text.isascii() and text.isdigit() and len(text) < 16 and int(text)):
        raise ConfigError(f"environment: {key}: found {text[:40]!r}; expected a positive whole number")
    return int(text)
