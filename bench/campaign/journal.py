"""The journal of a campaign: one JSON line for each thing that is done, on the disk before the next one is noted.

A process that is killed leaves at most half a line at the end, which the next one takes away.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from bench.errors import ConfigError


class Journal:
    """`journal.jsonl` of a campaign directory."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def entries(self) -> Iterator[dict[str, Any]]:
        """The whole lines, oldest first; none if there is no file yet.

        Raises:
            ConfigError: a line other than the last cannot be read.
        """
        if not self.path.is_file():
            return
        with self.path.open("rb") as file:
            for number, line in enumerate(file, 1):
                if not line.endswith(b"\n"):
                    return  # cut off when its process was killed
                yield self._entry(number, line)

    def append(self, entry: Mapping[str, Any]) -> None:
        """Add a line; it is on the disk when this returns.

        Raises:
            ValueError: NaN or infinite numbers in it.
            OSError: it cannot be written.
        """
        line = json.dumps(entry, ensure_ascii=False, allow_nan=False).encode() + b"\n"
        with self.path.open("ab") as file:
            file.write(line)
            file.flush()
            os.fsync(file.fileno())

    def repair(self) -> None:
        """Take away half a line at the end, so that the next one starts a line of its own."""
        if not self.path.is_file():
            return
        content = self.path.read_bytes()
        if not content.endswith(b"\n"):
            with self.path.open("r+b") as file:
                file.truncate(content.rfind(b"\n") + 1)

    def _entry(self, number: int, line: bytes) -> dict[str, Any]:
        try:
            found = json.loads(line)
        except ValueError:
            found = None
        if not isinstance(found, dict):
            raise ConfigError(
                f"{self.path}: line {number}: found {line[:40]!r}; expected a JSON object. "
                "Next: delete that line, and its rig or step is done again"
            )
        return found
