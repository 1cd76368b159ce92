"""Register maps: words worked out by hand, coding there and back, grouping of reads."""

from __future__ import annotations

import itertools
import math
import random
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from bench.rigfile.registers import EXCEPTIONS, RANGES, Block, Register, RegisterRefused, grouped, values_of

Kind = Literal["u16", "i16", "u32", "i32", "f32"]
WORD = st.integers(0, 0xFFFF)
KINDS: st.SearchStrategy[Kind] = st.sampled_from(["u16", "i16", "u32", "i32", "f32"])
ORDERS: st.SearchStrategy[Literal["big", "little"]] = st.sampled_from(["big", "little"])


@pytest.mark.parametrize(
    ("kind", "raw", "big"),
    [
        ("u16", 0x1234, (0x1234,)),
        ("i16", -1, (0xFFFF,)),
        ("i16", -32768, (0x8000,)),
        ("u32", 0x12345678, (0x1234, 0x5678)),
        ("i32", -2, (0xFFFF, 0xFFFE)),
        ("i32", 70000, (0x0001, 0x1170)),  # 65536 + 4464
        ("f32", 1.0, (0x3F80, 0x0000)),  # sign 0, exponent 127, mantissa 0
        ("f32", -2.5, (0xC020, 0x0000)),  # 1, 128, 1.25
        ("f32", 0.1, (0x3DCC, 0xCCCD)),
    ],
)
def test_words_by_hand(kind: Kind, raw: float, big: tuple[int, ...]) -> None:
    r = Register(address=0, type=kind)
    assert r.raw_words(raw) == big
    assert r.raw_words(raw, "little") == big[::-1]  # words swap, bytes do not
    assert r.raw(big) == pytest.approx(raw, rel=1e-7)
    assert r.raw(big[::-1], "little") == pytest.approx(raw, rel=1e-7)


def test_scale_offset_and_unit_by_hand() -> None:
    """-12.5 degC in steps of 0.1 K above -40 degC is 275; 955 r/min in hundredths is 95500 = 0x1_750C."""
    temperature = Register(address=3, type="i16", scale=0.1, offset=-40, unit="degC")
    assert temperature.words(260.65) == (275,)
    assert temperature.value((275,)) == pytest.approx(260.65)
    speed = Register(address=1, type="i32", scale=0.01, unit="r/min")
    assert speed.words(955 * 2 * math.pi / 60, "little") == (0x750C, 0x0001)
    assert speed.value((0x750C, 0x0001), "little") == pytest.approx(955 * 2 * math.pi / 60)


@given(KINDS, ORDERS, st.floats(1e-3, 1e3), st.floats(-1e3, 1e3), st.lists(WORD, min_size=2, max_size=2))
def test_every_word_comes_back(
    kind: Kind, order: Literal["big", "little"], scale: float, offset: float, two: list[int]
) -> None:
    """Words to value and back, unless they are no finite number; then the error says so and nothing is made up."""
    r = Register(address=0, type=kind, scale=scale, offset=offset)
    words = tuple(two[: r.count])
    try:
        value = r.value(words, order)
    except ValueError:
        assert kind == "f32"
        assert not math.isfinite(r.raw(words, order))
        return
    assert math.isfinite(value)
    if kind != "f32":
        assert r.words(value, order) == words
    assert value == pytest.approx(r.raw(words, order) * scale + offset)


@given(KINDS, ORDERS, st.floats(allow_nan=True, allow_infinity=True))
def test_a_value_fits_or_is_refused(kind: Kind, order: Literal["big", "little"], value: float) -> None:
    r = Register(address=0, type=kind)
    low, high = RANGES[kind]
    try:
        words = r.words(value, order)
    except ValueError:
        too_big = abs(value) > 3.4028235e38
        assert not math.isfinite(value) or too_big or not low <= round(value) <= high
        return
    assert len(words) == r.count
    assert all(0 <= w <= 0xFFFF for w in words)
    assert r.value(words, order) == pytest.approx(value, rel=1e-6, abs=1e-40 if kind == "f32" else 0.5)


def test_a_raw_value_that_is_no_whole_number_does_not_fit() -> None:
    with pytest.raises(ValueError, match=r"raw value 1\.5 does not fit u16"):
        Register(address=0).raw_words(1.5)


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"unit": "furlong"}, "unknown unit 'furlong'"),
        ({"scale": 0}, "scale that is not zero"),
        ({"table": "input", "writable": True}, "input registers cannot be written"),
        ({"address": 65535, "type": "f32"}, "room for two registers"),
        ({"type": "u8"}, "'u16', 'i16', 'u32', 'i32' or 'f32'"),
        ({"address": 65536}, "less than or equal to 65535"),
        ({"scale": math.inf}, "finite"),
        ({"skale": 1}, "Extra inputs"),
    ],
)
def test_a_register_that_cannot_be(keys: dict[str, object], text: str) -> None:
    with pytest.raises(ValidationError, match=text):
        Register.model_validate({"address": 0, **keys})


def test_grouping_by_hand() -> None:
    registers = {
        "a": Register(address=0),
        "b": Register(address=2, type="i32"),
        "far": Register(address=12),
        "other": Register(address=1, table="input"),
        "near": Register(address=11),
    }
    assert grouped(registers, gap=8) == (
        Block("holding", 0, 13, ("a", "b", "near", "far")),
        Block("input", 1, 1, ("other",)),
    )
    assert [b.names for b in grouped(registers, gap=1)] == [("a", "b"), ("near", "far"), ("other",)]
    assert [b.names for b in grouped(registers, gap=0)] == [("a",), ("b",), ("near", "far"), ("other",)]
    assert [b.names for b in grouped(registers, gap=-1)] == [("a",), ("b",), ("near",), ("far",), ("other",)]
    assert [b.names for b in grouped(registers, gap=8, longest=4)] == [("a", "b"), ("near", "far"), ("other",)]


MAPS = st.dictionaries(
    st.text("abcdefgh", min_size=1, max_size=4),
    st.builds(
        Register,
        address=st.integers(0, 400),
        type=KINDS,
        table=st.sampled_from(["holding", "input"]),
    ),
    max_size=12,
)


@given(MAPS, st.integers(-1, 20), st.integers(2, 125))
def test_grouping_covers_every_register_once(registers: dict[str, Register], gap: int, longest: int) -> None:
    blocks = grouped(registers, gap, longest)
    assert sorted(name for b in blocks for name in b.names) == sorted(registers)
    for b in blocks:
        assert b.count <= longest
        used = set()
        for name in b.names:
            r = registers[name]
            assert r.table == b.table
            assert b.address <= r.address
            assert r.address + r.count <= b.address + b.count
            used |= set(range(r.address, r.address + r.count))
        spare = [a for a in range(b.address, b.address + b.count) if a not in used]
        assert not spare or gap > 0
    if gap >= 0:  # neighbours could not have been joined
        for one, two in itertools.pairwise(blocks):
            apart = one.table != two.table or two.address > one.address + one.count + gap
            assert apart or two.address + registers[two.names[0]].count - one.address > longest


@given(MAPS, st.integers(0, 99))
def test_a_block_s_words_reach_their_registers(registers: dict[str, Register], seed: int) -> None:
    """Through a memory of words: what a group read brings equals what each register's own words say."""
    draw = random.Random(seed)
    memory = [draw.randrange(0x4000) for _ in range(410)]  # no NaN, no infinity
    for block in grouped(registers):
        values = values_of(block, memory[block.address : block.address + block.count], registers, "big")
        assert values == {n: registers[n].value(memory[(a := registers[n].address) : a + registers[n].count])
                          for n in block.names}  # fmt: skip


def test_a_register_that_holds_no_number_is_named() -> None:
    registers = {"speed": Register(address=0, type="f32")}
    with pytest.raises(ValueError, match="register speed: registers 7fc0 0000 hold no finite number"):
        values_of(grouped(registers)[0], (0x7FC0, 0), registers, "big")


def test_refusals_name_the_code() -> None:
    assert "exception 2 (illegal data address)" in str(RegisterRefused(2, "unit 1"))
    assert "exception 99 (not in the protocol)" in str(RegisterRefused(99, "unit 1"))
    assert set(EXCEPTIONS) == {1, 2, 3, 4, 5, 6, 8, 10, 11}
