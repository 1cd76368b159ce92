"""Recordings that a stranger made: bounded time and memory, and one kind of error, with the file's name in it."""

from __future__ import annotations

import json
import resource
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hostile import chunk, events_channel, message, record_of, rewritten, whole, with_chunks
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from recordings import HEADER, block, record
from test_recording import content

from bench.errors import ConfigError, RecordingError
from bench.recording import Recording
from bench.recording.kept import Kept
from bench.recording.recorder import RunHeader

READ = """
import resource, sys
from pathlib import Path
from bench.errors import BenchError
from bench.recording import Recording
try:
    r = Recording.open(Path(sys.argv[1]))
    print(len(r.events()), sum(b.count for b in r.blocks("telemetry")), len(r.all_steps()))
    list(r.frames("controller"))
except BenchError as error:
    print(type(error).__name__, error)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
CPU_S = 40


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sound") / "a.mcap"
    record(path, [block(n, 25) for n in (0, 600, 1200)], captured=1)
    return path


def read(path: Path) -> tuple[str, int]:
    """What a process that reads everything says, and its memory in MB. More than CPU_S of processor time kills it."""

    def bounded() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))

    done = subprocess.run([sys.executable, "-c", READ, str(path)], capture_output=True, text=True, check=True,
                          preexec_fn=bounded)  # fmt: skip
    *said, memory = done.stdout.splitlines()
    return "\n".join(said), int(memory) // 1000


def everything(path: Path) -> None:
    """All that a reader gives, also what few ask for."""
    found: Recording[Any] = Recording.open(path)
    content(path)
    for step in found.all_steps():
        step.lost()
    for one in found.captures():
        one.arrays()
    assert found.seed is None or found.procedure is not None


def replaced(old: bytes, new: bytes) -> Callable[[bytes], bytes]:
    assert len(old) == len(new)
    return lambda records: records.replace(old, new)


@pytest.mark.parametrize(
    "change",
    [
        lambda r: record_of(0x05, b"\1") + r,
        lambda r: record_of(0x05, b"") + r,
        lambda r: record_of(0x04, b"\1\0") + r,
        lambda r: record_of(0x04, struct.pack("<HHI", 9, 9, 3) + b"\xff\xfe\xfd" + bytes(12)) + r,
        replaced(b'"kind"', b'"kine"'),
        replaced(b'"t_ns"', b'"t_nz"'),
        replaced(b'"step":', b'"stop":'),
        replaced(b'{"kind"', b'["kind"'),
        replaced(b'"period_ns": 1000000', b'"period_ns": -100000'),
        replaced(b'"period_ns": 1000000', b'"period_ns": 0      '),
        replaced(b'"f4"', b'"f5"'),
        replaced(b'"channels"', b'"chanells"'),
        replaced(b"/raw/controller", b"/raw/\xff\xfe\xfdtroller"),
        lambda r: r + b"\0" * 9,
        lambda r: r + b"\0",
    ],
)  # fmt: skip
def test_what_is_wrong_inside_a_chunk_names_the_file(
    sound: Path, tmp_path: Path, change: Callable[[bytes], bytes]
) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(rewritten(sound, change))
    assert path.read_bytes() != rewritten(sound, lambda r: r)
    with pytest.raises(RecordingError, match=r"a\.mcap"):
        everything(path)


@given(place=st.integers(0, 1 << 20), put=st.binary(min_size=1, max_size=12), cut=st.integers(0, 30))
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_inside_a_chunk_are_read_or_refused_as_a_recording(
    sound: Path, tmp_path: Path, place: int, put: bytes, cut: int
) -> None:
    def change(records: bytes) -> bytes:
        at = place % (len(records) + 1)
        return records[:at] + put + records[at + cut :]

    path = tmp_path / "a.mcap"
    path.write_bytes(rewritten(sound, change))
    said = "a.mcap"
    try:
        everything(path)
    except RecordingError as error:
        said = str(error)
    assert "a.mcap" in said


@given(st.binary(max_size=60))
@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_event_is_read_or_refused_as_a_recording(sound: Path, tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(with_chunks(sound, [chunk(message(events_channel(sound), 5, data))]))
    with pytest.raises(RecordingError, match=r"a\.mcap"):
        everything(path)


@pytest.mark.parametrize("version", ["9" * 6000, "\u0662", "2\n"])
def test_a_layout_version_that_is_no_version(tmp_path: Path, version: str) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="levbench")
        writer.add_metadata("layout", {"version": version})
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(RecordingError, match="no Levbench recording") as caught:
        Recording.open(tmp_path / "a.mcap")
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("name", ["rig.toml", "plan.json", "spec.json", "calibrations.json"])
@pytest.mark.parametrize("text", ["[" * 20_000 + "]" * 20_000, ".".join(["a"] * 50_000) + " = 1", "9" * 6000, "\xff"])
def test_a_deep_or_odd_attachment_is_refused_with_the_file(tmp_path: Path, name: str, text: str) -> None:
    path = tmp_path / "a.mcap"
    record(path, [block(0, 10)], header=RunHeader(HEADER.metadata, {name: text.encode("latin-1"), "rig.dbc": b""}))
    found: Recording[Any] = Recording.open(path)
    ask = {"rig.toml": lambda: found.rig, "plan.json": lambda: found.plan_dict, "spec.json": lambda: found.spec,
           "calibrations.json": lambda: found.calibrations}[name]  # fmt: skip
    with pytest.raises(RecordingError, match=r"a\.mcap") as caught:
        ask()
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize("field", ["lost", "samples"])
@pytest.mark.parametrize("text", ["[1]", "3", '{"telemetry": "x"}', "[" * 20_000, "9" * 6000])
def test_an_integrity_record_of_another_shape_is_refused(tmp_path: Path, sound: Path, field: str, text: str) -> None:
    data = record_of(0x0C, _strings("integrity") + _map({field: text}))
    path = tmp_path / "a.mcap"
    path.write_bytes(with_chunks(sound, [data]))
    with pytest.raises(RecordingError, match=r"a\.mcap: its integrity record"):
        Recording.open(path)


def _strings(*texts: str) -> bytes:
    return b"".join(struct.pack("<I", len(t.encode())) + t.encode() for t in texts)


def _map(values: dict[str, str]) -> bytes:
    inner = b"".join(_strings(k, v) for k, v in values.items())
    return struct.pack("<I", len(inner)) + inner


# Bombs


def bomb(kind: str, sound: Path) -> bytes:
    number = events_channel(sound)
    match kind:
        case "zeros":  # 2.4 GB in 10 MB
            return with_chunks(sound, [chunk(bytes(60_000_000))] * 40)
        case "few zeros":
            return with_chunks(sound, [chunk(bytes(60_000_000))])
        case "empty chunks":
            return with_chunks(sound, [chunk(b"")] * 200_001)
        case "empty messages":  # 31 bytes each
            return with_chunks(sound, [chunk(message(number, 5, b"") * 2_000_000)])
        case "large events":
            text = json.dumps({"kind": "log", "t_ns": 5, "text": "x" * 50_000_000}).encode()
            return with_chunks(sound, [chunk(message(number, 5, text))] * 60)
        case "some large events":
            text = json.dumps({"kind": "log", "t_ns": 5, "text": "x" * 5_000_000}).encode()
            return with_chunks(sound, [chunk(message(number, 5, text))] * 4)
        case "many events":
            text = json.dumps({"kind": "log", "t_ns": 5}).encode()
            return with_chunks(sound, [chunk(message(number, k, text) * 10_000) for k in range(21)])
        case "blocks of zeros":  # one field of 40 million bytes in each
            data = b"\x82\x01" + b"\x80\xda\xc4\x09" + bytes(20_000_000)
            return with_chunks(sound, [chunk(message(1, 5, data))] * 3)
    raise LookupError(kind)


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("zeros", "LEVBENCH_MAX_INFLATION=N raises the limit"),
        ("few zeros", "a chunk holds a record of kind 0x00"),
        ("empty chunks", "found 200,001 chunks; expected at most 200,000. Next: if the file can be trusted, LEVBENCH_MAX"),
        ("empty messages", "a chunk of more than 262144 records"),
        ("large events", "LEVBENCH_MAX_INFLATION=N raises the limit"),
        ("some large events", "found 20 MB of events; expected at most 16. Next: if the file can be trusted, LEVBENCH_MAX"),
        ("many events", "LEVBENCH_MAX_EVENTS=N raises the limit"),
        ("blocks of zeros", "RecordingError"),
    ],
)  # fmt: skip
def test_a_bomb_is_refused_in_little_time_and_memory(tmp_path: Path, sound: Path, kind: str, said: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(bomb(kind, sound))
    text, memory_mb = read(path)
    assert said in text
    assert text.startswith("RecordingError")
    assert str(path) in text
    assert memory_mb < 1000


def test_a_limit_is_raised_by_its_variable(tmp_path: Path, sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(with_chunks(sound, []))
    events = len(Recording.open(path).events())
    monkeypatch.setenv("LEVBENCH_MAX_EVENTS", str(events - 1))
    with pytest.raises(RecordingError, match=rf"found {events} events; expected at most {events - 1}"):
        Recording.open(path).events()
    monkeypatch.setenv("LEVBENCH_MAX_EVENTS", str(events))
    assert len(Recording.open(path).events()) == events
    monkeypatch.setenv("LEVBENCH_MAX_SAMPLES", "100")
    with pytest.raises(RecordingError, match="numbers to read at once; expected at most 100"):
        Recording.open(path).channel("pos_yi")
    for wrong in ("0", "-1", "many", "9" * 40):
        monkeypatch.setenv("LEVBENCH_MAX_CHUNKS", wrong)
        with pytest.raises(ConfigError, match=r"LEVBENCH_MAX_CHUNKS: found .*; expected a positive whole number"):
            Recording.open(path)


def test_the_page_states_every_limit() -> None:
    from dataclasses import fields

    from bench.recording.readlimits import ReadLimits, variable

    page = (Path(__file__).resolve().parent.parent / "docs" / "reference" / "recording.md").read_text(encoding="utf-8")
    for f in fields(ReadLimits):
        assert f"| `{variable(f.name)}` | {f.default:,} |".replace(",", " ") in page, f.name


def test_a_channel_described_twice_and_not_alike_is_refused(tmp_path: Path, sound: Path) -> None:
    again = record_of(0x04, struct.pack("<HH", 1, 1) + _strings("/other", "json") + _map({}))
    path = tmp_path / "a.mcap"
    path.write_bytes(with_chunks(sound, [again]))
    with pytest.raises(RecordingError, match="channel 1 is described twice, and not alike"):
        everything(path)


def test_a_header_of_many_attachments_is_refused(tmp_path: Path) -> None:
    data = bytes(12_000_000)
    parts = [record_of(0x01, _strings("levbench", "levbench"))]
    for k in range(5):
        body = bytes(16) + _strings(f"a{k}", "text/plain") + struct.pack("<Q", len(data)) + data
        parts.append(record_of(0x09, body + bytes(4)))
    (tmp_path / "a.mcap").write_bytes(whole(parts))
    with pytest.raises(RecordingError, match="bytes of attachments, metadata and channels; expected fewer"):
        Recording.open(tmp_path / "a.mcap")


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 40)), max_size=60))
def test_what_is_kept_stays_within_its_count_and_size(items: list[tuple[int, int]]) -> None:
    kept: Kept[int] = Kept(5, 100)
    sizes: dict[int, int] = {}
    for key, size in items:
        kept.put(key, size, size)
        sizes[key] = size
        there = [k for k in sizes if kept._items.get(k) is not None]
        assert len(there) <= 5
        assert sum(sizes[k] for k in there) <= 100
        assert kept.get(key) == size
