"""The command line's wire format: bytes by hand, any cut, any damage, any bytes."""

from __future__ import annotations

import zlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.wire.captureblock import Block
from bench.wire.commandline import (
    LARGEST,
    LONGEST,
    Event,
    Line,
    Reply,
    Request,
    Splitter,
    block,
    checksum,
    read_line,
    read_request,
    request,
    with_checksum,
)

GOLDEN_BLOCK = bytes.fromhex("A55A 0300 00100000 0800 0100FEFF2C010080 635F6B4D")
WORD = st.text(st.characters(min_codepoint=0x21, max_codepoint=0x7E, exclude_characters="*"), min_size=1, max_size=12)
TEXT = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=60)


def test_golden_lines() -> None:
    """Exclusive or by hand: 17 get kp.b gives 27, its reply 4A, the refusal 06."""
    assert request(17, "get", "kp.b") == b"17 get kp.b*27\n"
    assert read_line("17 ok kp.b=680000 N/m*4A") == Reply(17, "ok", "kp.b=680000 N/m", checked=True)
    assert read_line("18 err 3 range kp.b 0..2e6*06") == Reply(18, "err", "3 range kp.b 0..2e6", checked=True)
    assert read_line("18 err 3 range kp.b 0..2e6*07") is None
    assert read_line("- ok") == Reply(None, "ok", "", checked=False)
    assert read_line("5 + kp.b N/m f32 1 0 2e6") == Reply(5, "more", "kp.b N/m f32 1 0 2e6", checked=False)
    assert read_line("! 28000 state LEVITATED") == Event(28000, "state", "LEVITATED")


def test_a_golden_block() -> None:
    """Capture 3, offset 4096, four samples 1, -2, 300, -32768."""
    data = bytes.fromhex("0100FEFF2C010080")
    assert block(3, 4096, data) == GOLDEN_BLOCK
    assert zlib.crc32(GOLDEN_BLOCK[2:-4]).to_bytes(4, "little") == GOLDEN_BLOCK[-4:]
    assert Splitter().feed(GOLDEN_BLOCK) == [Block(3, 4096, data)]


@pytest.mark.parametrize(
    "text", ["17 get kp.b*27", "lira boot 1.2", "", "+ more", "99999 ok", "7 okay", "! x state", "! 5"]
)
def test_what_is_neither_reply_nor_event(text: str) -> None:
    assert read_line(text) is None


def test_a_prompt_before_a_reply_is_left_out() -> None:
    assert read_line("lira> lira> 3 ok", "lira> ") == Reply(3, "ok", "", checked=False)
    assert read_line("lira>", "lira> ") is None


@given(st.integers(0, 9999), st.lists(WORD, min_size=1, max_size=5))
def test_a_request_is_read_as_it_was_asked(tag: int, words: list[str]) -> None:
    assert read_request(request(tag, *words).decode().rstrip("\n")) == Request(tag, tuple(words), checked=True)


@given(st.integers(0, 9999), st.lists(WORD, min_size=1, max_size=5), st.data())
def test_a_changed_character_is_noticed(tag: int, words: list[str], data: st.DataObject) -> None:
    line = request(tag, *words)[:-1]
    at = data.draw(st.integers(0, len(line) - 4))
    other = data.draw(st.integers(0x21, 0x7E).filter(lambda c: c not in (line[at], ord("*"))))
    assert read_request((line[:at] + bytes([other]) + line[at + 1 :]).decode()) is None


NO_REQUESTS = [(-1, ["id"]), (10_000, ["id"]), (1, []), (1, ["two words"]), (1, ["a*b"]), (1, ["\n"]), (1, [""])]


@pytest.mark.parametrize(("tag", "words"), NO_REQUESTS)
def test_what_is_no_request_is_refused(tag: int, words: list[str]) -> None:
    with pytest.raises(ValueError, match="expected"):
        request(tag, *words)


def test_too_much_for_a_block_is_refused() -> None:
    with pytest.raises(ValueError, match="at most 1024"):
        block(1, 0, bytes(LARGEST + 1))


PIECES = st.lists(
    st.one_of(
        TEXT.map(Line), st.builds(Block, st.integers(0, 65535), st.integers(0, 2**32 - 1), st.binary(max_size=LARGEST))
    ),
    max_size=8,
)


def sent(pieces: list[Line | Block]) -> bytes:
    return b"".join(
        p.text.encode() + b"\r\n" if isinstance(p, Line) else block(p.number, p.offset, p.data) for p in pieces
    )


@given(PIECES, st.lists(st.integers(0, 9000), max_size=6))
def test_any_cut_of_a_stream_gives_the_same_pieces(pieces: list[Line | Block], cuts: list[int]) -> None:
    stream = sent(pieces)
    splitter, found, last = Splitter(), [], 0
    for cut in (*sorted(min(c, len(stream)) for c in cuts), len(stream)):
        found += splitter.feed(stream[last:cut])
        last = cut
    assert found == pieces
    assert (splitter.dropped, splitter.wrong) == (0, 0)


@given(PIECES, st.binary(max_size=200), PIECES)
def test_garbage_costs_what_it_hits_and_nothing_behind_the_next_line(
    before: list[Line | Block], garbage: bytes, after: list[Line | Block]
) -> None:
    splitter = Splitter()
    found = splitter.feed(sent(before) + garbage + b"\n") + splitter.give_up()
    assert found[: len(before)] == before
    assert splitter.feed(sent(after)) == after


@given(st.binary(min_size=1, max_size=LARGEST), st.data())
def test_a_flipped_bit_loses_its_block_alone(data: bytes, draw: st.DataObject) -> None:
    one, other = block(1, 0, data), block(1, len(data), data)
    at = draw.draw(st.integers(2, len(one) - 1))
    spoilt = bytearray(one)
    spoilt[at] ^= 1 << draw.draw(st.integers(0, 7))
    splitter = Splitter()
    found = splitter.feed(bytes(spoilt) + other + b"\n7 ok\n")
    found += splitter.give_up()
    blocks = [p for p in found if isinstance(p, Block)]
    assert Block(1, len(data), data) in blocks
    assert Block(1, 0, data) not in blocks or spoilt == one
    assert Line("7 ok") in found


def test_a_block_that_looks_like_one_holds_nothing_up_for_ever() -> None:
    """Header of 1024 bytes in noise; then lines: they come when the host gives the block up."""
    splitter = Splitter()
    assert splitter.feed(b"\xa5\x5a\x01\x00\x00\x00\x00\x00\x00\x04\n7 ok\n") == []
    assert splitter.give_up() == [Line("7 ok")]


def test_an_endless_line_costs_no_memory() -> None:
    splitter = Splitter()
    for _ in range(100):
        assert splitter.feed(b"x" * 10_000) == []
    assert len(splitter._line) <= LONGEST
    assert splitter.feed(b"\n7 ok\n") == [Line("7 ok")]
    assert splitter.dropped == 1_000_000


@settings(max_examples=300)
@given(st.lists(st.binary(max_size=80), max_size=20))
def test_arbitrary_bytes_never_crash(parts: list[bytes]) -> None:
    splitter = Splitter()
    for part in parts:
        for piece in splitter.feed(part):
            if isinstance(piece, Line):
                read_line(piece.text, "lira> ")
                read_request(piece.text)
    splitter.give_up()


def test_a_checksum_is_that_of_the_bytes() -> None:
    assert checksum("AB") == 0x41 ^ 0x42
    assert with_checksum("AB") == "AB*03"


def test_a_damaged_block_spoils_no_line_after_a_good_one() -> None:
    """Its bytes have no end of a line: they would hold the next line, however many good blocks come between."""
    damaged = block(0xFFFF, 1, b"\x81" * 40)[:-1]
    splitter = Splitter()
    found = splitter.feed(damaged + block(0xFFFF, 2, bytes(40)) + block(0xFFFF, 3, bytes(40)) + b"4 ok\r\n")
    assert [type(piece).__name__ for piece in found] == ["Block", "Block", "Line"]
    assert found[-1] == Line("4 ok")
