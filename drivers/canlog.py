"""Frames as the log files of other CAN tools, by python-can's own writers: Vector BLF and ASC, and SocketCAN's candump."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import can

from bench.link.frames import FrameBatch
from drivers.canframes import messages_of

SUFFIXES: Final = {"blf": ".blf", "asc": ".asc", "candump": ".log"}
_WRITERS: Final[dict[str, Any]] = {"blf": can.BLFWriter, "asc": can.ASCWriter, "candump": can.CanutilsLogWriter}


def write_log(path: Path, to: str, batches: Iterable[FrameBatch]) -> int:
    """Write frames, in the order in which they were recorded, each at its host time; those of the host are marked as sent.

    Args:
        path: of the file, which is replaced.
        to: a key of SUFFIXES.
        batches: frames; remote frames are none.

    Returns:
        how many frames there were.

    Raises:
        OSError: it cannot be written.
    """
    count = 0
    with _WRITERS[to](path) as writer:
        for batch in batches:
            for message in messages_of(batch):
                writer.on_message_received(message)
            count += len(batch)
    return count
