"""What the recorder writes, read by the mcap and protobuf libraries rather than by our reader, and how it fails."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from recordings import HEADER, PERIOD_NS, START_NS, STREAM, SetClock, block, frames_of, gapped, record

from bench.errors import RecordingError
from bench.recording.recorder import Recorder, RunHeader

ROOT = Path(__file__).resolve().parent.parent


def messages_of(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Log time and content by topic, protobuf parsed by its own runtime from the schema in the file."""
    out: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    kinds: dict[str, Any] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            assert schema is not None
            if schema.encoding == "jsonschema":
                out[channel.topic].append((message.log_time, json.loads(message.data)))
                continue
            if schema.name not in kinds:
                pool = descriptor_pool.DescriptorPool()
                for described in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
                    pool.Add(described)
                kinds[schema.name] = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
            out[channel.topic].append((message.log_time, kinds[schema.name].FromString(message.data)))
    return out


def test_blocks_hold_every_sample_and_say_where_samples_are_missing(tmp_path: Path) -> None:
    blocks = gapped()
    record(tmp_path / "a.mcap", blocks)
    found = [m for _, m in messages_of(tmp_path / "a.mcap")["/telemetry/block"]]
    assert [m.first_sample_index for m in found] == [0, 500, 1000, 1205, 1405, 1905]
    assert [m.lost_before for m in found] == [0, 0, 0, 5, 0, 0]
    assert {m.sample_period_ns for m in found} == {PERIOD_NS}
    assert [m.count for m in found] == [500, 500, 200, 200, 500, 400]
    for name in ("pos_yi", "i_yi_p", "state"):
        written = np.concatenate([b.columns[name] for b in blocks]).astype(np.float32)
        read = np.concatenate([np.asarray(getattr(m, name), np.float32) for m in found])
        assert np.array_equal(read, written), name
    assert [t for m in found for t in m.t_ns] == [int(t) for b in blocks for t in b.t_ns]
    assert [t for m in found for t in m.device_ticks] == [int(t) for b in blocks for t in b.ticks]


def test_a_plain_recording_has_the_same_blocks_frames_and_events_without_the_view(tmp_path: Path) -> None:
    for name, plain in (("a.mcap", False), ("b.mcap", True)):
        with Recorder(tmp_path / name, clock=SetClock(), streams=[STREAM], header=HEADER, plain=plain) as recorder:
            for part in gapped():
                recorder.samples(part)
                recorder.frames("can", frames_of(part))
            recorder.event("note", text="here")
    full, plain_one = messages_of(tmp_path / "a.mcap"), messages_of(tmp_path / "b.mcap")
    assert full.keys() - plain_one.keys() == {"/telemetry/view"}
    for topic in plain_one:
        assert [str(m) for m in full[topic]] == [str(m) for m in plain_one[topic]], topic


def test_the_view_is_mean_minimum_maximum_and_last_code_of_ten_milliseconds(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", [block(n, 125) for n in range(0, 1000, 125)])
    view = messages_of(tmp_path / "a.mcap")["/telemetry/view"]
    whole = block(0, 1000).columns
    assert [t for t, _ in view] == [START_NS + n * 10 * PERIOD_NS for n in range(100)]
    for n, (_, m) in enumerate(view):
        for name in ("pos_yi", "i_yi_p"):
            x = whole[name][10 * n : 10 * n + 10]
            assert getattr(m, name) == pytest.approx(float(np.mean(x)), rel=1e-6, abs=1e-13)
            assert getattr(m, f"{name}_min") == np.float32(min(x))
            assert getattr(m, f"{name}_max") == np.float32(max(x))
        assert m.state == whole["state"][10 * n + 9]


def test_samples_are_kept_while_they_are_watched(tmp_path: Path) -> None:
    """What comes before and after, and what comes of other channels, is not in it; nothing comes of nothing."""
    with Recorder(tmp_path / "a.mcap", clock=SetClock(), streams=[STREAM], header=HEADER, plain=True) as recorder:
        recorder.samples(block(0, 100))
        with recorder.watching(("pos_yi", "i_yi_p")) as seen:
            recorder.samples(block(100, 30))
            recorder.samples(block(130, 70))
            assert seen == {}
        recorder.samples(block(200, 100))
        with recorder.watching(("pos_yi",)) as none:
            pass
        with recorder.watching(("pos_zi",)) as unknown:
            recorder.samples(block(300, 10))
    whole = block(0, 300).columns
    assert {n: list(x) for n, x in seen.items()} == {n: list(whole[n][100:200]) for n in ("pos_yi", "i_yi_p")}
    assert none == unknown == {}


def test_raw_frames_are_written_as_they_came(tmp_path: Path) -> None:
    blocks = gapped()
    record(tmp_path / "a.mcap", blocks)
    raw = [m for _, m in messages_of(tmp_path / "a.mcap")["/raw/controller"]]
    assert [m.count for m in raw] == [100] * len(blocks) + [1]
    assert b"".join(m.frames for m in raw[:-1]) == b"".join(frames_of(b).tobytes() for b in blocks)


def test_events_and_steps_carry_their_times_and_labels(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", [block(0, 100), block(100, 100)])
    events = [e for _, e in messages_of(tmp_path / "a.mcap")["/events"]]
    end = START_NS + 200 * PERIOD_NS
    assert events == [
        {"kind": "state", "t_ns": START_NS, "now": "LEVITATED", "note": ""},
        {"kind": "step-begin", "t_ns": START_NS, "step": 0, "name": "dwell", "labels": {"block": 0, "odd": False}},
        {"kind": "step-end", "t_ns": START_NS + 100 * PERIOD_NS, "step": 0, "name": "dwell"},
        {"kind": "step-begin", "t_ns": START_NS + 100 * PERIOD_NS, "step": 1, "name": "dwell",
         "labels": {"block": 1, "odd": True}},
        {"kind": "step-end", "t_ns": end, "step": 1, "name": "dwell"},
        {"kind": "state", "t_ns": end, "now": "READY"},
    ]  # fmt: skip


def test_integrity_counts_what_was_recorded(tmp_path: Path) -> None:
    integrity = record(tmp_path / "a.mcap", gapped())
    assert integrity.frames == {"controller": 2301}
    assert integrity.samples == {"telemetry": 2300}
    assert integrity.lost == {"telemetry": 5}
    assert (integrity.events, integrity.steps, integrity.overflows, integrity.complete) == (2 + 2 * 23, 23, 0, True)


def test_equal_runs_give_equal_bytes_but_for_the_wall_record(tmp_path: Path) -> None:
    for name, note in (("a", ""), ("b", ""), ("c", "other")):
        record(tmp_path / name, gapped(), note=note)
    a, b, c = ((tmp_path / name).read_bytes() for name in "abc")
    cut = a.index(b"queue_high_water")  # depends on the scheduling of two threads, as all in `wall` may
    assert a[: cut - 40] == b[: cut - 40]
    assert a[: cut - 40] != c[: cut - 40]
    with (tmp_path / "a").open("rb") as first, (tmp_path / "b").open("rb") as second:
        records = [[r for r in StreamReader(f, emit_chunks=True).records if getattr(r, "name", "") != "wall"]
                   for f in (first, second)]  # fmt: skip
    kinds = [Counter(type(r).__name__ for r in found) for found in records]
    assert kinds[0] == kinds[1]
    assert [r for r in records[0] if type(r).__name__ in ("Chunk", "Metadata", "Attachment")] == [
        r for r in records[1] if type(r).__name__ in ("Chunk", "Metadata", "Attachment")
    ]


def test_an_existing_file_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_text("precious")
    with pytest.raises(RecordingError, match=r"a\.mcap: cannot be written: File exists"):
        record(tmp_path / "a.mcap", [])
    assert (tmp_path / "a.mcap").read_text() == "precious"


def test_an_unwritable_path_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"gone/a\.mcap: cannot be written: No such file or directory"):
        record(tmp_path / "gone" / "a.mcap", [])


def test_closing_twice_is_harmless_and_recording_afterwards_is_an_error(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", clock=SetClock(), streams=[STREAM], header=HEADER)
    recorder.samples(block(0, 10))
    assert recorder.close() is recorder.close()
    with pytest.raises(RecordingError, match="is closed"):
        recorder.samples(block(10, 10))


def test_a_value_that_json_cannot_say_is_refused_where_it_is_made(tmp_path: Path) -> None:
    with (
        Recorder(tmp_path / "a.mcap", clock=SetClock(), streams=[STREAM], header=HEADER) as recorder,
        pytest.raises(ValueError, match="not JSON compliant"),
    ):
        recorder.event("state", value=float("nan"))


def test_a_step_that_raises_stays_open(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", clock=SetClock(), streams=[STREAM], header=HEADER) as recorder:
        with pytest.raises(ZeroDivisionError), recorder.step("dwell", mass="M1"):
            raise ZeroDivisionError
    kinds = [e["kind"] for _, e in messages_of(tmp_path / "a.mcap")["/events"]]
    assert kinds == ["step-begin"]


FULL_DISK = """
import resource, signal, sys
sys.path[:0] = [{root!r}, {tests!r}]
from pathlib import Path
from bench.errors import RecordingError
from recordings import block, record
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
try:
    record(Path({path!r}), [block(n, 100) for n in range(0, 6000, 100)])
except RecordingError as error:
    print(error)
    sys.exit(3)
"""


@pytest.mark.parametrize("limit", [100, 20_000, 120_000])
def test_a_full_disk_is_one_clear_error_and_what_was_written_stays(tmp_path: Path, limit: int) -> None:
    path = tmp_path / "a.mcap"
    code = FULL_DISK.format(root=str(ROOT), tests=str(ROOT / "tests"), limit=limit, path=str(path))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 3, done.stderr
    why = "File too large. Next: free space there, or give another --out"
    assert done.stdout == f"recording {path}: cannot be written: {why}\n"
    assert done.stderr == ""
    assert path.stat().st_size <= limit


def test_a_header_with_no_stream_still_makes_a_whole_file(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", clock=SetClock(), streams=[], header=RunHeader({}, {})):
        pass
    with (tmp_path / "a.mcap").open("rb") as file:
        assert [r.name for r in make_reader(file).iter_metadata()] == ["layout", "integrity", "wall"]
