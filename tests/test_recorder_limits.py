"""The recorder at its limits: killed at any moment, a disk that does not keep up, blocks that do not fit."""

from __future__ import annotations

import dataclasses
import inspect
import json
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from recordings import HEADER, PERIOD_NS, START_NS, STREAM, SetClock, block, frames_of
from test_recorder import messages_of

from bench.clock import PumpedClock
from bench.errors import RecordingError
from bench.recording import Recording
from bench.recording import recorder as recorder_module
from bench.recording.mcapwriter import FLUSH_NS, McapWriter
from bench.recording.recorder import Recorder
from bench.samples import ChannelInfo, SampleBlock, StreamLayout

ROOT = Path(__file__).resolve().parent.parent
SECOND = 1_000_000_000


def open_recorder(path: Path, **options: Any) -> Recorder:
    return Recorder(path, clock=SetClock(), streams=[STREAM], header=HEADER, **options)


@pytest.mark.parametrize("lead_ms", [0, 1, 130, 250, 450, 499])
@pytest.mark.parametrize("rows", [1, 37, 100])
def test_what_is_on_disk_at_any_moment_holds_all_but_the_last_second(tmp_path: Path, lead_ms: int, rows: int) -> None:
    """Telemetry begins at any phase of the half-second flush; the bytes are read after each batch, before any close."""
    path = tmp_path / "a.mcap"
    worst = 0
    with path.open("wb") as file:
        writer = McapWriter(file, {"telemetry": STREAM}, HEADER.metadata, HEADER.attachments, START_NS)
        for n, first in enumerate(range(lead_ms, lead_ms + 2600, rows)):
            part = block(first, rows)
            now = int(part.t_ns[-1]) + PERIOD_NS
            writer.frames("controller", 0, frames_of(part))
            seen = len(path.read_bytes())  # a kill between frames and samples
            writer.samples(part)
            writer.event(now, b'{"kind":"x","t_ns":0}')
            if n % max(1, 100 // rows) == 0 or seen != path.stat().st_size:
                worst = max(worst, now - last_sample(path, lead_ms))
    assert worst <= 0.75 * SECOND


def last_sample(path: Path, lead_ms: int) -> int:
    recording: Recording[Any] = Recording.open(path)
    assert recording.truncated
    assert recording.attachment("rig.toml") == "schema = 1\n"
    blocks = list(recording.blocks("telemetry")) if recording.streams else []
    return int(blocks[-1].t_ns[-1]) if blocks else START_NS + lead_ms * PERIOD_NS


KILLED = """
import sys
sys.path[:0] = [{root!r}, {tests!r}]
from pathlib import Path
from bench.recording.recorder import Recorder
from recordings import HEADER, PERIOD_NS, STREAM, SetClock, block, frames_of
clock = SetClock()
recorder = Recorder(Path({path!r}), clock=clock, streams=[STREAM], header=HEADER)
for n in range(0, 10**9, 100):
    part = block(n, 100)
    clock.now = int(part.t_ns[-1]) + PERIOD_NS
    recorder.frames("controller", frames_of(part))
    recorder.samples(part)
    print(clock.now, flush=True)
"""


def test_a_killed_process_loses_less_than_the_last_second(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    code = KILLED.format(root=str(ROOT), tests=str(ROOT / "tests"), path=str(path))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        lines = [child.stdout.readline() for _ in range(47)]
        child.kill()
    said = int(lines[-1])
    recording: Recording[Any] = Recording.open(path)
    assert recording.truncated
    assert recording.integrity is None
    read = recording.channel("pos_yi")
    assert read["t_ns"][-1] >= said - SECOND
    assert np.array_equal(read["index"], np.arange(len(read["index"])))
    assert np.array_equal(read["pos_yi"], block(0, len(read["index"])).columns["pos_yi"].astype(np.float32))


def flood(recorder: Recorder) -> None:
    """More and more samples, until it raises: the thread that writes them is slower than the one that makes them."""
    for first in range(0, 10**6, 1000):
        recorder.samples(block(first, 1000))


def insist(recorder: Recorder, name: str) -> None:
    """An event, as often as it takes until there is room in the queue."""
    while True:
        try:
            return recorder.event("command", name=name)
        except RecordingError:
            continue


def test_a_live_overflow_is_an_error_at_once_and_at_the_end_and_stands_in_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "LIVE_ITEMS", 1)
    path = tmp_path / "a.mcap"
    recorder = open_recorder(path, live=True)
    with pytest.raises(
        RecordingError, match=r"a\.mcap: the disk did not keep up with the live link; samples were lost"
    ):
        flood(recorder)
    insist(recorder, "LAND")  # make-safe is still recorded
    overflows = recorder.integrity.overflows
    with pytest.raises(RecordingError, match=f"{overflows} batches are missing"):
        recorder.close()
    with pytest.raises(RecordingError, match="batches are missing"):
        recorder.close()
    integrity = Recording.open(path).integrity
    assert integrity is not None
    assert (integrity["complete"], integrity["overflows"]) == (False, overflows)
    found = messages_of(path)
    assert sum(m.count for _, m in found["/telemetry/block"]) == integrity["samples"]["telemetry"] > 0
    assert [e["name"] for _, e in found["/events"]] == ["LAND"]
    assert integrity["events"] == 1


def test_a_waiting_queue_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_module, "WAITING_ITEMS", 1)
    with open_recorder(tmp_path / "a.mcap") as recorder:
        for first in range(0, 20_000, 100):
            recorder.samples(block(first, 100))
    found = messages_of(tmp_path / "a.mcap")["/telemetry/block"]
    assert sum(m.count for _, m in found) == 20_000
    assert recorder.integrity.blocks == {"telemetry": len(found)}
    assert recorder.integrity.complete
    assert recorder.wall["queue_high_water"] == "1"


def test_a_waiting_queue_is_short_enough_for_the_last_second() -> None:
    """A slice of the simulated clock gives two items at least, frames and samples."""
    slice_s = inspect.signature(PumpedClock).parameters["slice_s"].default
    waiting_s = (recorder_module.WAITING_ITEMS + 1) / 2 * slice_s  # the one being written counts too
    assert FLUSH_NS / SECOND + waiting_s < 1


def overflow_and_fail(path: Path) -> None:
    with open_recorder(path, live=True) as recorder, suppress(RecordingError):
        flood(recorder)
    raise AssertionError("closing raises")


def fail_during_overflow(path: Path) -> None:
    with open_recorder(path, live=True) as recorder:
        with suppress(RecordingError):
            flood(recorder)
        raise ZeroDivisionError


def test_an_overflow_that_was_swallowed_is_raised_at_the_end_or_noted_on_what_ended_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "LIVE_ITEMS", 1)
    with pytest.raises(RecordingError, match="did not keep up"):
        overflow_and_fail(tmp_path / "a.mcap")
    with pytest.raises(ZeroDivisionError) as caught:
        fail_during_overflow(tmp_path / "b.mcap")
    assert "did not keep up" in caught.value.__notes__[0]


SHORT = {"pos_yi": np.zeros(9), "i_yi_p": np.zeros(10), "state": np.zeros(10)}


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (dataclasses.replace(block(0, 10), stream="fast"), "found samples of stream 'fast'; expected telemetry"),
        (dataclasses.replace(block(0, 10), columns=SHORT), "found 9 samples of pos_yi; expected 10"),
        (dataclasses.replace(block(0, 10), columns={}), "found 0 samples of pos_yi; expected 10"),
        (dataclasses.replace(block(0, 10), t_ns=np.zeros(11, np.int64)), "found 11 samples of t_ns; expected 10"),
    ],
)
def test_a_block_that_does_not_fit_is_refused_and_the_file_stays_good(
    tmp_path: Path, wrong: SampleBlock, text: str
) -> None:
    with open_recorder(tmp_path / "a.mcap") as recorder:
        recorder.samples(block(0, 10))
        with pytest.raises(RecordingError, match=text):
            recorder.samples(wrong)
        recorder.samples(block(10, 10))
    assert [m.count for _, m in messages_of(tmp_path / "a.mcap")["/telemetry/block"]] == [20]
    assert recorder.integrity.samples == {"telemetry": 20}


def test_small_blocks_are_merged_and_large_ones_split(tmp_path: Path) -> None:
    with open_recorder(tmp_path / "a.mcap") as recorder:
        for first in range(0, 300, 3):
            recorder.samples(block(first, 3))
        recorder.samples(block(300, 3100))
    found = [m for _, m in messages_of(tmp_path / "a.mcap")["/telemetry/block"]]
    assert [(m.first_sample_index, m.count) for m in found] == [(0, 1000), (1000, 1000), (2000, 1000), (3000, 400)]
    assert [m.t_ns[0] for m in found] == [START_NS + m.first_sample_index * PERIOD_NS for m in found]


def test_a_block_is_never_longer_than_a_second(tmp_path: Path) -> None:
    slow = StreamLayout("slow", SECOND // 5, (ChannelInfo("temp_i", "K"),))
    index = np.arange(40)
    part = SampleBlock("slow", 0, index.astype(np.uint64), START_NS + index * slow.period_ns, 0, 0,
                       {"temp_i": 300 + index})  # fmt: skip
    with Recorder(tmp_path / "a.mcap", clock=SetClock(), streams=[slow], header=HEADER) as recorder:
        recorder.samples(part)
    assert [m.count for _, m in messages_of(tmp_path / "a.mcap")["/slow/block"]] == [5] * 8
    read = Recording.open(tmp_path / "a.mcap").read(("temp_i",), START_NS + 3 * SECOND, START_NS + 4 * SECOND)
    assert read["temp_i"].tolist() == [315, 316, 317, 318, 319]


def test_a_restarted_sample_clock_begins_a_new_block(tmp_path: Path) -> None:
    later = dataclasses.replace(block(10, 10), t_ns=block(10, 10).t_ns + 777)
    with open_recorder(tmp_path / "a.mcap") as recorder:
        recorder.samples(block(0, 10))
        recorder.samples(later)
    found = [m for _, m in messages_of(tmp_path / "a.mcap")["/telemetry/block"]]
    assert [(m.first_sample_index, m.lost_before, m.t_ns[0] - START_NS) for m in found] == [
        (0, 0, 0),
        (10, 0, 10 * PERIOD_NS + 777),
    ]


def test_a_loss_is_kept_even_where_the_index_does_not_show_it(tmp_path: Path) -> None:
    with open_recorder(tmp_path / "a.mcap") as recorder:
        recorder.samples(block(0, 10))
        recorder.samples(block(10, 10, lost=3))
    assert [m.lost_before for _, m in messages_of(tmp_path / "a.mcap")["/telemetry/block"]] == [0, 3]


def test_the_queue_figures_are_wall_and_not_integrity(tmp_path: Path) -> None:
    with open_recorder(tmp_path / "a.mcap") as recorder:
        recorder.samples(block(0, 10))
    with (tmp_path / "a.mcap").open("rb") as file:
        records = {r.name: r.metadata for r in make_reader(file).iter_metadata()}
    assert int(records["wall"]["queue_high_water"]) >= 0
    assert {k: json.loads(v) for k, v in records["integrity"].items()} == {
        "frames": {}, "samples": {"telemetry": 10}, "lost": {"telemetry": 0}, "blocks": {"telemetry": 1},
        "events": 0, "steps": 0, "overflows": 0, "complete": True,
    }  # fmt: skip
