"""The messages of captures byte by byte, by hand from docs/reference/captures.md; the table `capture`; buffers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.errors import BenchError
from bench.link.codec import Decoder, encode
from bench.rigfile import RigFile, load_rig
from bench.rigfile.capture import Layout
from bench.rigfile.check import problems_of

RIG = load_rig("amb5dof")
assert RIG.capture is not None
SPEC = RIG.capture
Signals = list[tuple[str, float, str]]
GOLDEN: dict[str, tuple[int, Signals]] = {
    "CaptureArm": (0x15, [
        ("session", 305419896, "78 56 34 12"),  # 0x12345678
        ("token", 7, "07"), ("trigger", 1, "01"), ("source", 28, "1C"), ("spare", 0, "00"),
        ("channels0", 268435459, "03 00 00 10"),  # bits 0, 1 and 28
        ("channels1", 1, "01 00 00 00"), ("divider", 2, "02 00"), ("spare1", 0, "00 00"),
        ("length", 20000, "20 4E 00 00"), ("before", 1000, "E8 03 00 00"),
        ("level", -1.5, "00 00 C0 BF"),
    ]),
    "CaptureAsk": (0x16, [("session", 1, "01 00 00 00"), ("code", 1, "01"), ("token", 255, "FF"), ("spare", 0, "00 00")]),
    "CaptureRead": (0x17, [("number", 3, "03 00"), ("form", 1, "01"), ("token", 9, "09"), ("offset", 65536, "00 00 01 00"),
                           ("length", 4096, "00 10 00 00")]),
    "CaptureFlow": (0x18, [("flow", 48, "30"), ("block_size", 0, "00"), ("st_min", 0, "00")]),
    "CaptureStatus": (0x25, [
        ("token", 9, "09"), ("status", 5, "05"), ("state", 3, "03"), ("spare", 0, "00"), ("number", 258, "02 01"),
        ("divider", 1, "01 00"), ("memory", 1048576, "00 00 10 00"), ("size", 160000, "00 71 02 00"),
        ("samples", 20000, "20 4E 00 00"), ("trigger", 1000, "E8 03 00 00"), ("tick", 4294967295, "FF FF FF FF"),
        ("crc", 2645232558, "AE 0B AB 9D"),
    ]),
}  # fmt: skip


@pytest.mark.parametrize("name", GOLDEN)
def test_golden(name: str) -> None:
    identifier, signals = GOLDEN[name]
    message = RIG.messages[name]
    payload = bytes.fromhex(" ".join(text for _, _, text in signals))
    values = {signal: value for signal, value, _ in signals}
    assert [s.name for s in sorted(message.signals, key=lambda s: s.start)] == list(values)
    assert (message.identifier, message.length, message.fd) == (identifier, len(payload), True)
    assert encode(message, values) == payload
    assert Decoder(message).decode_one(payload) == values


def test_blocks_yield_to_telemetry() -> None:
    telemetry = RIG.messages["Telemetry"].identifier
    assert RIG.messages["CaptureBlock"].identifier == 0x200 > telemetry
    assert RIG.messages["CaptureData"].identifier == 0x201
    assert RIG.messages["CaptureFlow"].length == 3


def test_a_buffer_golden() -> None:
    layout = Layout.of(SPEC, ("pulse_age", "pulses", "pos_zi"))  # in any order
    assert layout.mask == 1 << 1 | 1 << 30 | 1 << 31
    assert layout.sample.itemsize == 8
    columns = [np.array([1e-6, -1.0]), np.array([3.0, 70000.0]), np.array([0.5, -2.0])]
    buffer = bytes.fromhex("64 00 03 00 00 00 00 3F" + "00 80 FF FF 00 00 00 C0")  # 100 x 1e-8; both ends; floats
    assert layout.encoded(columns) == buffer
    read = layout.decoded(buffer)
    assert list(read) == ["pos_zi", "pulses", "pulse_age"]
    assert read["pos_zi"].tolist() == pytest.approx([1e-6, -32768e-8], rel=1e-12)
    assert (read["pulses"].tolist(), read["pulse_age"].tolist()) == ([3.0, 65535.0], [0.5, -2.0])


@given(st.sets(st.sampled_from(sorted(SPEC.channels)), min_size=1), st.binary(max_size=400))
def test_any_bytes_are_samples_or_refused(names: set[str], buffer: bytes) -> None:
    layout = Layout.of(SPEC, sorted(names))
    if len(buffer) % layout.sample.itemsize:
        with pytest.raises(BenchError, match="expected whole samples of"):
            layout.decoded(buffer)
        return
    columns = layout.decoded(buffer)
    assert set(columns) == names
    if all(np.isfinite(x).all() for x in columns.values()):
        back = layout.decoded(layout.encoded(list(columns.values())))
        for name, x in columns.items():
            assert back[name].tolist() == x.tolist(), name


def test_a_signalling_nan_is_a_nan() -> None:
    layout = Layout.of(SPEC, ("pulse_age",))
    (value,) = layout.decoded(bytes.fromhex("00 00 81 7F"))["pulse_age"].tolist()
    assert math.isnan(value)


def test_a_choice_that_cannot_be() -> None:
    with pytest.raises(BenchError, match="cannot record pos_w; it can record pos_yi, pos_zi"):
        Layout.of(SPEC, ("pos_yi", "pos_w"))
    with pytest.raises(BenchError, match="no channel is chosen"):
        Layout.of(SPEC, ())


def changed(**channels: dict[str, Any]) -> list[str]:
    data = RIG.model_dump(by_alias=True)
    data["capture"]["channels"] |= channels
    data["simulation"] = {}
    rig = RigFile.model_validate({**data, "toml_text": RIG.toml_text, "dbc_text": RIG.dbc_text})
    return [f"{p.key}: {p.found}" for p in problems_of(rig)]


def test_the_table_is_checked() -> None:
    assert changed() == []
    assert changed(w={"index": 0, "unit": "m", "type": "i16"}) == ["capture.channels.w.index: 0"]
    assert changed(w={"index": 60, "unit": "um", "type": "i16"}) == ["capture.channels.w.unit: 'um'"]
    plain = RigFile.parse(RIG.toml_text, RIG.dbc_text.replace("CaptureArm", "Other"))
    assert any(p.key == "capture" and "CaptureArm" in p.found for p in problems_of(plain))


def test_every_type_has_its_range() -> None:
    assert {c.type for c in SPEC.channels.values()} == {"i16", "u16", "f32"}
    assert math.isclose(32767 * SPEC.channels["u_yi_p"].scale, 65.534)  # over the supply of 48 V
