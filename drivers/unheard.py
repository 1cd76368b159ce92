"""What comes over a link that brings no telemetry: nothing, bytes that are no messages, or other messages."""

from __future__ import annotations

from typing import NamedTuple

from bench.errors import BytesUnreadable, LinkError
from bench.link import Link

FEW = 3  # bytes: a delimiter, and what opening a port may stir up


class Heard(NamedTuple):
    """What has come over a link so far: bytes where it has some, frames, what is no packet or line, wrong CRCs."""

    octets: int
    frames: int
    malformed: int
    corrupt: int

    @classmethod
    def of(cls, link: Link) -> Heard:
        """Of a link, now."""
        s = link.stats
        return cls(s.octets, s.received, s.malformed, s.crc_errors)


def error(link: Link, before: Heard, seconds: float, text: str) -> LinkError:
    """Why there is no telemetry: `text`, and what has come in the `seconds` since `before`."""
    octets, frames, malformed, corrupt = (now - then for now, then in zip(Heard.of(link), before, strict=True))
    if frames:
        return LinkError(f"link {link.name}: {text}. {frames} other messages came meanwhile")
    if octets <= FEW:
        return LinkError(f"link {link.name}: {text}")
    wrong = [f"{malformed} pieces that are no message"] * bool(malformed) + [f"{corrupt} with a wrong CRC"] * bool(
        corrupt
    )
    return BytesUnreadable(
        f"link {link.name}: {octets} bytes came in {seconds:.2g} s ({octets / max(seconds, 1e-3) * 1e-3:.1f} kB/s), but no "
        f"message can be made of them{': ' * bool(wrong)}{', '.join(wrong)}. Next: compare the kind of the link (packets or "
        "SLCAN) and its baud rate in the rig file with the controller's, and see that nothing else sends on this port"
    )
