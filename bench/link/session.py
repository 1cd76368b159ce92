"""A session: what a host calls itself towards a controller, so that the controller can refuse a second host by name."""

from __future__ import annotations

import getpass
import os
import secrets
import socket
import time
from dataclasses import dataclass
from datetime import UTC, datetime

PARTS, PART_BYTES = 9, 6


@dataclass(frozen=True, slots=True)
class Session:
    """A number that the controller compares (u32, low byte not zero), the start in UNIX seconds, and a name."""

    number: int
    since: int
    name: str

    @property
    def low_byte(self) -> int:
        """What a parameter write carries."""
        return self.number & 0xFF

    def fields(self) -> dict[str, int]:
        """As the message Claim carries it; the name is cut at 54 bytes, never within a character."""
        room = PARTS * PART_BYTES
        raw = self.name.encode(errors="replace")[:room].decode(errors="ignore").encode().ljust(room, b"\0")
        parts = {f"name{k}": int.from_bytes(raw[k * PART_BYTES : (k + 1) * PART_BYTES], "little") for k in range(PARTS)}
        return {"session": self.number, "since": self.since, **parts}

    @classmethod
    def of(cls, fields: dict[str, float]) -> Session:
        """From a message Owner; bytes that are no UTF-8, and what a terminal would obey instead of show, are replaced."""
        raw = b"".join(int(fields[f"name{k}"]).to_bytes(PART_BYTES, "little") for k in range(PARTS))
        text = raw.rstrip(b"\0").decode(errors="replace")
        name = "".join(c if c.isprintable() else "\ufffd" for c in text)
        return cls(int(fields["session"]), int(fields["since"]), name)

    def __str__(self) -> str:
        since = datetime.fromtimestamp(self.since, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
        return f"{self.name or 'a host that gave no name'}, session {self.number:#010x}, since {since}"


def who() -> str:
    """User, host and process: the name of this bench in locks and sessions."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # no name for this user id
        user = "unknown user"
    return f"{user}@{socket.gethostname()} process {os.getpid()}"


def new_session() -> Session:
    """A session of this process, with a random number."""
    return Session(secrets.randbits(24) << 8 | (secrets.randbelow(255) + 1), int(time.time()), who())
