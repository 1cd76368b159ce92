"""What `benchmarks.fuzz` feeds to the reader of a command line, and its oracle: a whole stream byte by byte, slow and plain."""

from __future__ import annotations

import zlib

from bench.wire.captureblock import Block as Part
from bench.wire.commandline import LONGEST, Line, Splitter, read_line, read_request, request
from bench.wire.commandline import block as part_of
from benchmarks.fuzz_draws import INPUTS, Block, Draw

WORDS = (b"17 ok kp.b=680000 N/m*4A", b"! 28000 state LIFT", b"lira> ", b"5 + x", b"- err 6", b"boot 1.0", b"* * *")


def commandline_block(draw: Draw) -> Block:
    """Lines and blocks of a controller with bytes changed, lost and doubled, and noise between them, in random pieces."""
    stream = bytes(_damaged(draw, b"".join(_said(draw) for _ in range(INPUTS // 8))))
    splitter, found, at = Splitter(), list[Line | Part](), 0
    while at < len(stream):
        step = int(draw.integers(1, 4000))
        found += splitter.feed(stream[at : at + step])
        at += step
    found += splitter.give_up()
    wanted = _oracle(stream)
    findings = [] if found == wanted else [f"{len(found)} pieces, not the {len(wanted)} that there are"]
    if len(splitter._held) or len(splitter._line) > LONGEST:
        findings.append("more is kept than a line")
    for piece in found:
        if isinstance(piece, Line):
            read_line(piece.text, "lira> ")
            read_request(piece.text)
    splitter.feed(b"\n")
    if splitter.feed(b"7 ok\r\n") != [Line("7 ok")]:
        findings.append("a clean line after the others was not read")
    return len(wanted) + splitter.dropped // 16, len(found), findings


def _said(draw: Draw) -> bytes:
    kind = int(draw.integers(0, 10))
    if kind < 5:
        return WORDS[int(draw.integers(0, len(WORDS)))] + b"\r\n"
    if kind < 7:
        return request(int(draw.integers(0, 10_000)), "get", f"p{int(draw.integers(0, 99))}")
    if kind < 9:
        return part_of(
            int(draw.integers(0, 65_536)), int(draw.integers(0, 2**32)), draw.bytes(int(draw.integers(0, 200)))
        )
    return draw.bytes(int(draw.integers(0, 40)))


def _damaged(draw: Draw, clean: bytes) -> bytearray:
    out = bytearray(clean)
    for _ in range(int(draw.integers(0, max(2, len(clean) // 400)))):
        at, kind = int(draw.integers(0, len(out))), int(draw.integers(0, 4))
        if kind == 0:
            out[at] ^= 1 << int(draw.integers(0, 8))
        elif kind == 1:
            del out[at]
        elif kind == 2:
            out.insert(at, out[at])
        else:
            out[at:at] = b"\xa5\x5a"
    return out


def _oracle(stream: bytes) -> list[Line | Part]:
    out: list[Line | Part] = []
    line, spoilt, at = bytearray(), False, 0
    while at < len(stream):
        head = stream[at : at + 10]
        if head[:2] == b"\xa5\x5a" and len(head) == 10:
            number, offset = int.from_bytes(head[2:4], "little"), int.from_bytes(head[4:8], "little")
            end = at + 10 + int.from_bytes(head[8:10], "little")
            told = stream[end : end + 4]
            if (
                end - at - 10 <= 1024
                and len(told) == 4
                and zlib.crc32(stream[at + 2 : end]).to_bytes(4, "little") == told
            ):
                if spoilt:  # a block stands between lines
                    line, spoilt = bytearray(), False
                out.append(Part(number, offset, stream[at + 10 : end]))
                at = end + 4
                continue
        byte = stream[at]
        at += 1
        if byte == 10:
            if not spoilt:
                out.append(Line(line.decode()))
            line, spoilt = bytearray(), False
        elif byte >= 128:
            spoilt = True
        elif 32 <= byte < 127:
            line.append(byte)
            spoilt |= len(line) > LONGEST
    return out
