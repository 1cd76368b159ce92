"""The fuzz target itself: a short run over every decoder, a longer one (`make fuzz` has three times as many inputs),
and that it finds what it should."""

from __future__ import annotations

import pytest

from bench.link import slcanstream
from bench.rigfile.registers import Register
from bench.wire import isotp, packet, slcan
from benchmarks.fuzz import fuzz
from benchmarks.fuzz_targets import TARGETS


@pytest.mark.parametrize("name", sorted(TARGETS))
def test_short(name: str) -> None:
    result = fuzz(name, 60_000)
    assert result.findings == []
    assert result.inputs >= 60_000
    assert result.frames > 1000  # through the door, not only against it


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", sorted(TARGETS))
def test_long(name: str) -> None:
    assert fuzz(name, 1_000_000, seed=1).findings == []


def test_a_crc_that_is_not_checked_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packet, "check", lambda data: data[:-2])
    assert any(
        "CRC" in text or "counts" in text or "raised" in text for text in fuzz("serial", 100_000, most=1).findings
    )


def test_identifiers_that_are_not_checked_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = {letter: kind._replace(limit=1 << 40) for letter, kind in slcan._KINDS.items()}
    monkeypatch.setattr(slcan, "_KINDS", kinds)
    assert fuzz("slcan", 100_000, most=1).findings


def test_an_unbounded_line_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slcanstream, "LONGEST_LINE", 10_000)
    assert any("bytes kept" in text for text in fuzz("slcan", 300_000, most=1).findings)


def test_sequence_numbers_that_are_not_checked_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def ended_late(self: isotp.Reassembler) -> None:
        self._buffer = bytearray()

    monkeypatch.setattr(isotp.Reassembler, "reset", ended_late)
    assert fuzz("isotp", 50_000, most=1).findings


def test_a_word_order_that_is_not_kept_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = Register.raw
    monkeypatch.setattr(Register, "raw", lambda self, words, order: raw(self, words))
    assert fuzz("registers", 100_000, most=1).findings
