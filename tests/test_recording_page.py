"""A reader made from `docs/reference/recording.md` alone: the plain MCAP library and `struct`, nothing of ours."""

from __future__ import annotations

import json
import re
import struct
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from recordings import HEADER, START_NS, STREAM, SetClock, frames_of, gapped, record

from bench.link.frames import EXTENDED, FD, SENT, SWITCHED, batch_of, packed
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import load_rig

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reference" / "recording.md"
FRAME = struct.Struct("<qqIBB64s")


def fields(data: bytes) -> dict[int, Any]:
    """Protobuf: a tag is number * 8 + wire type; 1 and 5 are 8 and 4 bytes, 2 is a length and so many bytes."""
    out: dict[int, Any] = {}
    at = 0

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte, at = data[at], at + 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    while at < len(data):
        number, wire = divmod(varint(), 8)
        size = {1: 8, 5: 4}.get(wire) or varint()
        out[number], at = (
            data[at : at + size] if wire == 2 else int.from_bytes(data[at : at + size], "little"),
            at + size,
        )
    return out


def read(path: Path) -> tuple[dict[str, list[Any]], dict[str, list[tuple[Any, ...]]], list[dict[str, Any]]]:
    """Samples by channel and stream, frames by link, and events."""
    samples: dict[str, list[Any]] = defaultdict(list)
    frames: dict[str, list[tuple[Any, ...]]] = defaultdict(list)
    events = []
    with path.open("rb") as file:
        for _, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            root, last = channel.topic.split("/")[1], channel.topic.split("/")[-1]
            if channel.topic == "/events":
                events.append(json.loads(message.data))
            elif root == "raw":
                found = fields(message.data)
                records = list(FRAME.iter_unpack(found[3]))
                assert len(records) == found[2]
                assert records[-1][0] == found[1]
                frames[last] += [(*r[:4], r[5][: r[4]]) for r in records]
            elif last == "block":
                found, stream = fields(message.data), channel.topic.removesuffix("/block")
                described = json.loads(channel.metadata["layout"])
                samples[f"{stream} t_ns"] += [t for (t,) in struct.iter_unpack("<Q", found[7])]
                samples[f"{stream} tick"] += [t for (t,) in struct.iter_unpack("<Q", found[6])]
                samples[f"{stream} index"] += range(found.get(1, 0), found.get(1, 0) + found[2])
                assert found[5] == described["period_ns"]
                for k, (name, _, kind) in enumerate(described["channels"]):
                    form = {"f4": "<f", "u2": "<I"}[kind]
                    samples[f"{stream} {name}"] += [x for (x,) in struct.iter_unpack(form, found[16 + k])]
    return samples, frames, events


@pytest.fixture
def made(tmp_path: Path) -> Path:
    record(tmp_path / "a.mcap", gapped(), captured=1)
    return tmp_path / "a.mcap"


def test_samples_events_and_frames_are_read_as_the_page_says(made: Path) -> None:
    samples, frames, events = read(made)
    index = np.r_[0:1200, 1205:2305]
    assert samples["/telemetry index"] == index.tolist()
    assert samples["/telemetry t_ns"] == (START_NS + index * 1_000_000).tolist()
    assert samples["/telemetry tick"] == (index * 10).tolist()
    for name in ("pos_yi", "i_yi_p", "state"):
        written = np.concatenate([b.columns[name] for b in gapped()]).astype(np.float32)
        assert np.array_equal(np.array(samples[f"/telemetry {name}"], np.float32), written), name
    assert samples["/capture/1 inject"] == list(range(1500))
    sent = [(int(f["t_ns"]), 0, 0x100, FD, f["data"][:8].tobytes()) for b in gapped() for f in frames_of(b)]
    assert frames["controller"][:-1] == sent
    assert frames["controller"][-1][2:] == (0x11, SENT | FD, b"\1\0\0\0\4\0\0\0")
    assert events == Recording.open(made).events()


def test_every_bit_of_a_frame_is_where_the_page_has_it(tmp_path: Path) -> None:
    parts = [packed(0x1ABCDEF0 | EXTENDED, bytes(range(64)), t_ns=5, flags=FD | SWITCHED), packed(0x7FF, b"", t_ns=-6)]
    batch = batch_of(parts)
    batch["hw_ns"] = [77, -1]
    with Recorder(tmp_path / "a.mcap", clock=SetClock(), streams=[STREAM], header=HEADER) as recorder:
        recorder.frames("bus", batch[:1])
    assert read(tmp_path / "a.mcap")[1] == {"bus": [(5, 77, 0x1ABCDEF0 | 1 << 31, 2 | 8, bytes(range(64)))]}
    assert FRAME.unpack(parts[1]) == (-6, 0, 0x7FF, 0, 0, bytes(64))


def test_the_page_states_the_record_byte_by_byte() -> None:
    text = PAGE.read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| (\d+) \| (signed|unsigned|bytes) \|", text, re.M)
    code = {("8", "signed"): "q", ("4", "unsigned"): "I", ("1", "unsigned"): "B", ("64", "bytes"): "64s"}
    assert "<" + "".join(code[size, kind] for _, size, kind in rows) == FRAME.format
    offsets = [int(at) for at, _, _ in rows]
    sizes = [int(size) for _, size, _ in rows]
    assert offsets == [sum(sizes[:k]) for k in range(len(sizes))]
    assert f"records of {FRAME.size} bytes" in text


def test_every_topic_of_a_run_is_on_the_page() -> None:
    """Of a whole rig with its drive, supply and monitor, as a simulated run records them."""
    rig = load_rig("tsbs12")
    text = PAGE.read_text(encoding="utf-8")
    devices = [name for name, device in rig.devices.items() if device.registers]
    assert devices == ["drive", "supply", "thermal"]
    for name in (*devices, "telemetry/block", "events", "raw/controller"):
        assert f"`/{name}`" in text, name
