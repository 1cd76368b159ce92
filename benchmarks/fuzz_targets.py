"""What `benchmarks.fuzz` feeds to each decoder, and the oracles: written apart from the decoders, slow and plain."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from bench.rigfile import registers
from bench.rigfile.registers import Register, WordOrder
from bench.wire import isotp
from benchmarks.fuzz_commandline import commandline_block
from benchmarks.fuzz_draws import INPUTS, Block, Draw
from benchmarks.fuzz_streams import serial_block, slcan_block

# ISO-TP -----------------------------------------------------------------------------------------------------------


def isotp_block(draw: Draw) -> Block:
    """Transfers with frames changed, dropped, doubled and strange ones in between; after each block, a clean one."""
    limit = int(draw.choice((50, 5000, 100_000)))
    receiver = isotp.Reassembler(limit=limit, block_size=int(draw.integers(0, 4)))
    accepted, findings, parts, announced = 0, list[str](), list[bytes](), 0
    frames = _isotp_frames(draw, limit)
    for frame in frames:
        event = receiver.feed(frame)
        if event.send is not None and event.failure != "too-long" and frame[0] >> 4 == 1:
            wide = frame[0] == 0x10 and frame[1] == 0
            announced = int.from_bytes(frame[2:6], "big") if wide else (frame[0] & 15) << 8 | frame[1]
            parts = [frame[6 if wide else 2 :]]
        elif frame and frame[0] >> 4 == 2 and event.failure is None:
            parts.append(frame[1:])
        if event.received is not None:
            accepted += 1
            single = frame[0] >> 4 == 0
            expected = _single(frame) if single else b"".join(parts)[:announced]
            if event.received != expected or not 0 < len(event.received) <= limit or receiver.receiving:
                findings.append(f"{len(event.received)} bytes received, not the {len(expected)} that were sent")
        if receiver.held > limit:
            findings.append(f"{receiver.held} bytes held, over {limit}")
        if event.failure in ("wrong-sequence", "wrong-length") and receiver.receiving:
            findings.append(f"{event.failure} did not end the transfer")
    payload = draw.bytes(min(limit, 5000))
    if [receiver.feed(f) for f in isotp.segments(payload, 64)][-1].received != payload:
        findings.append("a clean transfer after the others was not received")
    return len(frames), accepted, findings


def _single(frame: bytes) -> bytes:
    return frame[1 : 1 + frame[0]] if len(frame) <= 8 else frame[2 : 2 + frame[1]]


def _isotp_frames(draw: Draw, limit: int) -> list[bytes]:
    frames: list[bytes] = []
    pool = draw.bytes(1 << 14)
    while len(frames) < INPUTS // 2:
        size = int(draw.integers(1, 8 if draw.random() < 0.3 else 6000 if draw.random() < 0.02 else 200))
        start = int(draw.integers(0, 8000))
        frames += isotp.segments(pool[start : start + size], 64 if draw.random() < 0.5 else 8)
    # Mostly frames that belong together, so that transfers come to their end in spite of the changes.
    hit = np.flatnonzero(draw.random(len(frames)) < 0.03).tolist()
    for at, change in zip(hit, draw.integers(0, 4, len(hit)).tolist(), strict=True):
        octets = bytearray(frames[at])
        octets[change % len(octets)] = int(draw.integers(0, 256))
        frames[at] = (bytes(octets), b"", frames[at] * 2, frames[at][:change])[change]
    for at in reversed(hit[::3]):
        del frames[at]
    lengths = draw.choice(np.array((*range(9), 12, 64, 9, 65)), INPUTS // 2).tolist()
    starts, kinds = draw.integers(0, 8000, INPUTS // 2).tolist(), draw.integers(0, 5, INPUTS // 2).tolist()
    strange = [
        (bytes([kind << 4 | pool[at] & 15]) + pool[at + 1 : at + 70])[:length]
        for kind, at, length in zip(kinds, starts, lengths, strict=True)
    ]
    return frames + strange if draw.random() < 0.5 else [f for pair in zip(frames, strange, strict=False) for f in pair]


# Registers --------------------------------------------------------------------------------------------------------

_KELVIN: Final = 273.15
_TYPES: Final = ("u16", "i16", "u32", "i32", "f32")


def registers_block(draw: Draw) -> Block:
    """Random words through a random register map, read in groups, and what fits back into words."""
    table = _register_map(draw)
    order: WordOrder = "big" if draw.random() < 0.5 else "little"
    blocks = registers.grouped(table, int(draw.integers(-1, 20)), int(draw.integers(2, 121)))
    findings = ["grouping loses a register or reads one twice"] * (
        sorted(name for b in blocks for name in b.names) != sorted(table)
    )
    image = draw.choice(np.array((0, 1, 0x7F80, 0x7FC0, 0x8000, 0xFF80, 0xFFFF), np.uint16), 65536)
    random = draw.random(65536) < 0.7
    image[random] = draw.integers(0, 65536, int(random.sum()))
    listed = np.concatenate([image, image[:300]]).tolist()
    accepted, count = 0, 0
    for shift in range(0, 60_000, 60_000 * len(table) // INPUTS):  # the same map over other words each time
        for block in blocks:
            words = tuple(listed[block.address + shift : block.address + shift + block.count])
            count += len(block.names)
            for name in block.names:
                at = table[name].address - block.address
                got, text = _register(table[name], words[at : at + table[name].count], order)
                accepted += got
                findings += [f"{name} {table[name].type} {order}: {text}"] * bool(text)
            try:
                registers.values_of(block, words, table, order)
            except ValueError as error:
                findings += ["an error without the register's name"] * ("register r" not in str(error))
    return count, accepted, findings[:20]


def _register_map(draw: Draw) -> dict[str, Register]:
    """Twelve registers in one corner of the address space, overlapping ones among them."""
    draws = [[int(n) for n in draw.integers(0, 100, 5)] for _ in range(12)]
    return {
        f"r{n}": Register.model_validate(
            {
                "address": a,
                "type": _TYPES[b % 5],
                "table": ("holding", "input")[c % 2],
                "scale": (1.0, 0.1, -0.01, 1e30)[d % 4],
                "offset": (0.0, -40.0)[e % 2],
                "unit": ("1", "degC")[e % 3 == 0],
            }
        )
        for n, (a, b, c, d, e) in enumerate(draws)
    }


def _register(register: Register, words: tuple[int, ...], order: WordOrder) -> tuple[bool, str]:
    """Whether the words hold a finite number, and what is wrong with what the coding makes of them."""
    raw: float = sum(word << 16 * at for at, word in enumerate(words[::-1] if order == "big" else words))
    if register.type == "f32":
        raw = float(np.uint32(raw).view(np.float32))
    elif register.type[0] == "i" and raw >= 1 << 16 * len(words) - 1:
        raw -= 1 << 16 * len(words)
    expected = raw * register.scale + register.offset + (_KELVIN if register.unit == "degC" else 0.0)
    try:
        value = register.value(words, order)
    except ValueError:
        return False, "a finite number is refused" if math.isfinite(expected) else ""
    if not math.isclose(value, expected, rel_tol=1e-12, abs_tol=1e-12):
        return True, f"{value!r}, not {expected!r}"
    if register.type != "f32" and register.words(value, order) != words:
        return True, f"{value!r} is written as {register.words(value, order)}, not {words}"
    return True, ""


TARGETS: Final[dict[str, Callable[[Draw], Block]]] = {
    "slcan": slcan_block,
    "serial": serial_block,
    "isotp": isotp_block,
    "registers": registers_block,
    "terminal": commandline_block,
}
