"""CAN over a byte stream in Lawicel ASCII (SLCAN), with the CANable 2.0 dialect for CAN FD. Bytes only.

Source: Lawicel CANUSB manual 1.0D (t, T, r, R, S, O, L, C, F, V, N, Z) and the CANable 2.0 firmware's command list
(d, D, b, B, Y, M). Every line ends with CR; BEL alone is the adapter's refusal.

    tIIIL..   TIIIIIIIIL..   classic data frame, 11 and 29 bit identifier    rIIIL  RIIIIIIIIL   remote frames
    dIIIL..   DIIIIIIIIL..   CAN FD without bit-rate switch                  bIIIL..  BIIIIIIIIL..   with it

I is the identifier and L the DLC, both hex; two hex digits follow for each payload byte, then, where the adapter was
told so by Z1, four hex digits of milliseconds that wrap at 60 s.
"""

from __future__ import annotations

from binascii import Error, unhexlify
from typing import Final, NamedTuple

from bench.errors import ConfigError

CR: Final = b"\r"
BEL: Final = b"\a"
EXTENDED: Final = 1 << 31
"""Bit of the identifier: 29 bits. The same as in bench.link.frames, which would bring numpy into the heartbeat process."""
LENGTHS: Final = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Payload bytes for each DLC of a CAN FD frame; the first nine are those of a classic frame."""
LONGEST_LINE: Final = 1 + 8 + 1 + 2 * 64 + 4
"""Characters of the longest frame, with its timestamp and without its CR."""
WRAP_MS: Final = 60_000
"""Adapter timestamps run from 0 to 59 999 ms."""
BITRATES: Final = {
    10_000: "S0",
    20_000: "S1",
    50_000: "S2",
    100_000: "S3",
    125_000: "S4",
    250_000: "S5",
    500_000: "S6",
    800_000: "S7",  # CANable firmware makes 750 kbit/s of it, so 750 000 is not offered: it would mean 800 000 elsewhere
    1_000_000: "S8",
}
DATA_BITRATES: Final = {2_000_000: "Y2", 5_000_000: "Y5"}
OPEN: Final = b"O\r"
LISTEN: Final = b"L\r"
"""Opens it for listening: it acknowledges nothing and sends nothing on the bus (Lawicel CAN232 and CANUSB)."""
SILENT: Final = b"M1\r"
NORMAL: Final = b"M0\r"
"""The same in the CANable firmware, which knows no L: a mode that is set before O, and that stays until M0 or power-off."""
CLOSE: Final = b"C\r"
STATUS: Final = b"F\r"
VERSION: Final = b"V\r"
SERIAL: Final = b"N\r"

FIFO_FULL_IN, FIFO_FULL_OUT, WARNING, OVERRUN = 0x01, 0x02, 0x04, 0x08
PASSIVE, ARBITRATION_LOST, BUS_ERROR = 0x20, 0x40, 0x80
"""Bits of the answer to F (Lawicel manual; 0x10 is not used)."""
LOSSES: Final = FIFO_FULL_IN | FIFO_FULL_OUT | OVERRUN

FRAME_LETTERS: Final = frozenset(b"tTrRdDbB")
_DLC: Final = {length: code for code, length in enumerate(LENGTHS)}
_CLASSIC: Final = (*range(9), *(-1 for _ in range(7)))


class _Kind(NamedTuple):
    prefix: bytes  # makes the number of hex digits even
    head: int  # bytes of prefix, identifier and DLC
    lengths: tuple[int, ...]
    limit: int
    extended: int
    fd: bool
    brs: bool


_KINDS: Final = {
    ord(letter): _Kind(b"0", 5, lengths, 0x1FFF_FFFF, EXTENDED, fd, letter == "B")
    if letter.isupper()
    else _Kind(b"", 2, lengths, 0x7FF, 0, fd, letter == "b")
    for letters, lengths, fd in (("tT", _CLASSIC, False), ("dDbB", LENGTHS, True))
    for letter in letters
}


def line(identifier: int, payload: bytes, *, fd: bool, brs: bool = False) -> bytes:
    """One frame as a line, CR included.

    Args:
        identifier: 11 bits, or 29 bits with EXTENDED.
        payload: 0..8 bytes; for CAN FD one of LENGTHS.
        fd: a CAN FD frame.
        brs: with bit-rate switch; classic frames have none.

    Raises:
        ValueError: no CAN frame has this identifier or length.
    """
    code = _DLC.get(len(payload), 16)
    if code > (15 if fd else 8):
        raise ValueError(f"payload of {len(payload)} bytes; a {'CAN FD' if fd else 'classic CAN'} frame cannot have it")
    return head(identifier, code, fd=fd, brs=brs) + payload.hex().upper().encode() + CR


def head(identifier: int, dlc: int, *, fd: bool, brs: bool = False) -> bytes:
    """What stands before the payload: letter, identifier and DLC, for a DLC that is known to be right.

    Raises:
        ValueError: the identifier has more than its 11 or 29 bits.
    """
    extended, number = identifier & EXTENDED, identifier & ~EXTENDED
    if not 0 <= number <= (0x1FFF_FFFF if extended else 0x7FF):
        raise ValueError(f"identifier 0x{identifier:X} has more than {29 if extended else 11} bits")
    letter = ("b" if brs else "d") if fd else "t"
    return (f"{letter.upper()}{number:08X}{dlc:X}" if extended else f"{letter}{number:03X}{dlc:X}").encode()


def setup(bitrate: int, data_bitrate: int | None = None, *, timestamp: bool = False) -> bytes:
    """The lines that close the channel, set the rates in bit/s, and open it.

    Raises:
        ConfigError: the protocol has no code for a rate.
    """
    return CLOSE + rates(bitrate, data_bitrate) + (b"Z1\r" if timestamp else b"") + OPEN


def rates(bitrate: int, data_bitrate: int | None = None) -> bytes:
    """The lines that set the rates in bit/s, which only a closed channel takes.

    Raises:
        ConfigError: the protocol has no code for a rate.
    """
    lines = [_rate_code(bitrate, BITRATES, "bit rate")]
    if data_bitrate is not None:
        lines.append(_rate_code(data_bitrate, DATA_BITRATES, "data bit rate"))
    return "".join(f"{text}\r" for text in lines).encode()


def _rate_code(rate: int, codes: dict[int, str], what: str) -> str:
    if rate not in codes:
        known = ", ".join(str(r) for r in codes)
        raise ConfigError(f"SLCAN has no code for a {what} of {rate} bit/s; expected one of {known}")
    return codes[rate]


class Parsed(NamedTuple):
    """A data frame taken from a line. `ms` is the adapter's timestamp, -1 without one; `brs`: the bit rate was switched."""

    identifier: int
    payload: bytes
    fd: bool
    ms: int
    brs: bool = False


def parse(text: bytes, *, timestamp: bool = False) -> Parsed | None:
    """The data frame in a line (without its CR), or None when the line is none: every character must fit.

    Args:
        text: the line.
        timestamp: four digits of milliseconds stand at the end; without it none may.
    """
    kind = _KINDS.get(text[0]) if text else None
    if kind is None or len(text) > LONGEST_LINE:
        return None
    prefix, first, lengths, limit, extended, fd, brs = kind
    try:
        raw = unhexlify(prefix + text[1:])
    except Error:
        return None
    start = int.from_bytes(raw[:first], "big")
    end = first + lengths[start & 15]
    if (start >> 4) > limit or end < first or len(raw) != end + (2 if timestamp else 0):
        return None
    ms = int.from_bytes(raw[end:], "big") if timestamp else -1
    return Parsed((start >> 4) | extended, raw[first:end], fd, ms, brs) if ms < WRAP_MS else None
