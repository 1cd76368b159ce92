"""The codec against cantools on random message maps, and what it refuses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cantools
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench.errors import ConfigError
from bench.link.codec import Decoder, encode
from bench.link.frames import FD, frame
from bench.rigfile.messages import Message, load_messages

LENGTHS = (1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
SCALES = ("1", "2", "0.5", "0.1", "2E-008", "-0.25", "9.587379924285257E-005", "1000", "3.7")
OFFSETS = ("0", "1", "-40", "273.15", "-0.1")


@dataclass(frozen=True)
class Placed:
    """A signal as a DBC writes it."""

    start: int
    length: int
    little: bool
    signed: bool
    floating: bool
    scale: str
    offset: str

    def bits(self) -> list[int]:
        """Its bits, counted by walking as the DBC numbering says: up, or down through the bytes."""
        out, bit = [], self.start
        for _ in range(self.length):
            out.append(bit)
            if self.little:
                bit += 1
            else:
                bit = bit - 1 if bit % 8 else bit + 15
        return out


@st.composite
def placed_signals(draw: st.DrawFn, size: int) -> list[Placed]:
    """Signals that do not overlap and lie inside a message of `size` bytes."""
    taken: set[int] = set()
    out: list[Placed] = []
    for _ in range(draw(st.integers(1, 8))):
        floating = draw(st.integers(0, 4)) == 0
        length = draw(st.sampled_from((32, 64)) if floating else st.integers(1, 64) | st.sampled_from((8, 16, 32)))
        aligned = draw(st.booleans())
        start = draw(st.integers(0, size - 1)) * 8 if aligned else draw(st.integers(0, size * 8 - 1))
        s = Placed(start, length, draw(st.booleans()), draw(st.booleans()) or floating, floating,
                   draw(st.sampled_from(SCALES)), draw(st.sampled_from(OFFSETS)))  # fmt: skip
        bits = s.bits()
        if max(bits) < size * 8 and taken.isdisjoint(bits):
            taken.update(bits)
            out.append(s)
    return out or [Placed(0, 8, True, False, False, "1", "0")]


def dbc_of(size: int, signals: list[Placed]) -> str:
    """A message map with one message `M` of signals s0, s1, ..."""
    lines = ['VERSION ""', "", "NS_ :", "", "BS_:", "", "BU_: A", "", f"BO_ 291 M: {size} A"]
    for k, s in enumerate(signals):
        order, sign = (1 if s.little else 0), ("-" if s.signed else "+")
        lines.append(f' SG_ s{k} : {s.start}|{s.length}@{order}{sign} ({s.scale},{s.offset}) [0|0] "" A')
    lines += [
        "",
        *(f"SIG_VALTYPE_ 291 s{k} : {1 if s.length == 32 else 2};" for k, s in enumerate(signals) if s.floating),
    ]
    return "\n".join(lines) + "\n"


@st.composite
def cases(draw: st.DrawFn) -> tuple[str, list[bytes]]:
    size = draw(st.sampled_from(LENGTHS))
    signals = draw(placed_signals(size))
    return dbc_of(size, signals), draw(st.lists(st.binary(min_size=size, max_size=size), min_size=1, max_size=4))


def both(dbc: str) -> tuple[Message, Any]:
    """The message as we read it, and as cantools does."""
    theirs: Any = cantools.database.load_string(dbc, database_format="dbc")
    return load_messages(dbc)["M"], theirs.get_message_by_name("M")


def within_an_ulp(ours: float, theirs: float) -> bool:
    if np.isnan(theirs):
        return bool(np.isnan(ours))
    return ours == theirs or abs(ours - theirs) <= np.spacing(abs(theirs))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(cases())
def test_decoding_equals_cantools_to_one_ulp(case: tuple[str, list[bytes]]) -> None:
    dbc, payloads = case
    message, theirs = both(dbc)
    batch = np.concatenate([frame(291, p, flags=FD) for p in payloads])
    with np.errstate(all="ignore"):  # random bytes make signalling and overflowing floats
        values, wrong = Decoder(message).decode(batch)
    assert wrong == 0
    assert values.keys() == {s.name for s in message.signals}
    for k, payload in enumerate(payloads):
        for name, expected in theirs.decode(payload).items():
            assert within_an_ulp(values[name][k], float(expected)), (name, values[name][k], expected)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(cases())
def test_a_payload_by_itself_has_the_values_it_has_in_a_batch(case: tuple[str, list[bytes]]) -> None:
    dbc, payloads = case
    message, _ = both(dbc)
    decoder = Decoder(message)
    with np.errstate(all="ignore"):
        values, _ = decoder.decode(np.concatenate([frame(291, p, flags=FD) for p in payloads]))
    for k, payload in enumerate(payloads):
        one = decoder.decode_one(payload)
        assert list(one) == list(values)
        assert np.array_equal([*one.values()], [v[k] for v in values.values()], equal_nan=True)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(LENGTHS).flatmap(lambda n: st.tuples(st.just(n), placed_signals(n))), st.data())
def test_encoding_gives_the_bytes_of_cantools(placed: tuple[int, list[Placed]], data: st.DataObject) -> None:
    size, signals = placed
    message, theirs = both(dbc_of(size, signals))
    values = {}
    for k, s in enumerate(signals):
        scale, offset = float(s.scale), float(s.offset)
        if s.floating:
            values[f"s{k}"] = data.draw(st.floats(-1e6, 1e6, width=32)) * scale + offset
        else:
            bits = min(s.length, 50)  # beyond that a float64 cannot hold what cantools would keep as an integer
            low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if s.signed else (0, (1 << bits) - 1)
            values[f"s{k}"] = data.draw(st.integers(low, high)) * scale + offset
    ours = encode(message, values)
    assert ours == theirs.encode(values, scaling=True, strict=False)


@pytest.mark.parametrize(
    ("start", "length", "order", "payload", "value"),
    [
        (0, 16, 1, "3412", 0x1234),  # little endian: low byte first
        (7, 16, 0, "1234", 0x1234),  # big endian from the top bit of byte 0
        (4, 8, 1, "A00B", 0xBA),  # straddles: high nibble of byte 0 is low, low nibble of byte 1 is high
        (3, 8, 0, "0AB0", 0xAB),  # straddles: low nibble of byte 0 is high, high nibble of byte 1 is low
        (6, 1, 1, "4000", 1),
    ],
)
def test_bits_lie_where_the_dbc_numbering_says(start: int, length: int, order: int, payload: str, value: int) -> None:
    message, _ = both(dbc_of(2, [Placed(start, length, order == 1, False, False, "1", "0")]))
    data = bytes.fromhex(payload)
    values, _ = Decoder(message).decode(frame(291, data))
    assert values["s0"].tolist() == [value]
    assert encode(message, {"s0": value}) == data


def test_frames_of_the_wrong_length_are_counted_and_never_read() -> None:
    message, _ = both(dbc_of(8, [Placed(0, 16, True, False, False, "1", "0")]))
    batch = np.concatenate([frame(291, bytes([n + 1] + [0] * (size - 1))) for n, size in enumerate((8, 7, 8, 12))])
    other = frame(292, bytes(8))
    values, wrong = Decoder(message).decode(np.concatenate([batch, other]))
    assert values["s0"].tolist() == [1.0, 3.0]
    assert wrong == 2


def test_an_empty_batch_decodes_to_empty_columns() -> None:
    message, _ = both(
        dbc_of(8, [Placed(0, 16, True, True, False, "0.5", "0"), Placed(21, 7, True, True, False, "1", "0")])
    )
    values, wrong = Decoder(message).decode(frame(291, bytes(8))[:0])
    assert wrong == 0
    assert {n: x.shape for n, x in values.items()} == {"s0": (0,), "s1": (0,)}


def test_what_does_not_fit_is_refused_with_its_limits() -> None:
    message, _ = both(
        dbc_of(8, [Placed(0, 8, True, True, False, "0.5", "10"), Placed(32, 32, True, True, True, "1", "0")])
    )
    assert encode(message, {"s0": 10 - 64.0})[0] == 0x80
    assert encode(message, {"s0": 10 + 63.5})[0] == 0x7F
    for value in (10 - 64.5, 10 + 64.0, float("nan"), float("inf")):
        with pytest.raises(ConfigError, match=r"M\.s0: .* does not fit; expected -54 to 73\.5"):
            encode(message, {"s0": value})
    with pytest.raises(ConfigError, match=r"M\.s1: 1e\+40"):
        encode(message, {"s1": 1e40})


def test_an_unknown_signal_is_refused_with_the_known_ones() -> None:
    message, _ = both(dbc_of(8, [Placed(0, 8, True, True, False, "1", "0")]))
    with pytest.raises(ConfigError, match="no signal 'speed'; expected one of s0"):
        encode(message, {"speed": 1.0})


@pytest.mark.parametrize("text", ['BO_ 1 M: 8 A\n SG_ a : 60|8@1+ (1,0) [0|0] "" A\n', "hello", "BO_ 1"])
def test_a_dbc_that_is_none_is_refused_with_its_name(text: str) -> None:
    with pytest.raises(ConfigError, match=r"^x\.dbc: not a usable DBC"):
        load_messages(text, "x.dbc")
