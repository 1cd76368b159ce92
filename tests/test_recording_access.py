"""What analysis asks of a recording: lost samples of a step, plans, limits, and long files in little memory."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from recordings import HEADER, PERIOD_NS, START_NS, STREAM, SetClock, block, frames_of, gapped, record

from bench.errors import AnalysisError, RecordingError
from bench.procedure import BenchPlan
from bench.recording import Recording
from bench.recording.mcapfile import KEPT, index
from bench.recording.recorder import Recorder, RunHeader


class Angles(BenchPlan):
    angles: int


class Masses(BenchPlan):
    masses: tuple[str, ...]


def opened(
    path: Path, attachments: dict[str, bytes], metadata: dict[str, dict[str, str]] | None = None
) -> Recording[Any]:
    record(path, [block(0, 10)], header=RunHeader(metadata or {}, attachments))
    return Recording.open(path)


PRESENT = np.r_[0:300, 320:321, 350:1200, 1205:2300]


@pytest.fixture(scope="module")
def holed(tmp_path_factory: pytest.TempPathFactory) -> Recording[Any]:
    """Samples 300-319, 321-349 and 1200-1204 are missing, and it was cut off after 2299."""
    path = tmp_path_factory.mktemp("holed") / "a.mcap"
    blocks = [block(0, 300), block(320, 1, lost=20), block(350, 850, lost=29), block(1205, 1095, lost=5)]
    with Recorder(path, clock=SetClock(), streams=[STREAM], header=RunHeader({}, {})) as recorder:
        for part in blocks:
            recorder.samples(part)
    return Recording.open(path)


@pytest.mark.parametrize(
    ("start", "end"),
    [(0, 300), (0, 301), (299, 321), (305, 310), (310, 345), (300, 350), (320, 321), (321, 322), (349, 350), (350, 1200),
     (0, 2300), (1199, 1206), (1204, 1205), (1205, 2300), (1202, 1203), (1000, 1203), (2290, 2350), (2300, 2310), (0, 2400)],
)  # fmt: skip
def test_lost_samples_of_any_interval(holed: Recording[Any], start: int, end: int) -> None:
    """Against a plain count of the indexes that are not there."""
    expected = len(set(range(start, end)) - set(PRESENT.tolist()))
    for early in (0, PERIOD_NS // 3):  # a step that begins and ends between samples
        found = holed.lost("telemetry", START_NS + start * PERIOD_NS - early, START_NS + end * PERIOD_NS - early)
        assert found == expected


def test_a_step_knows_what_it_lost(tmp_path: Path) -> None:
    clock = SetClock()
    with Recorder(tmp_path / "a.mcap", clock=clock, streams=[STREAM], header=RunHeader({}, {})) as recorder:
        for first, lost in ((0, 0), (110, 10), (210, 0)):
            clock.now = START_NS + (first - lost) * PERIOD_NS
            with recorder.step("dwell"):
                recorder.samples(block(first, 100, lost))
                clock.now = START_NS + (first + 100) * PERIOD_NS
    steps = list(Recording.open(tmp_path / "a.mcap").steps("dwell"))
    assert [(s.lost(), s.expected(), len(s.read("state")["t_ns"])) for s in steps] == [
        (0, 100, 100),
        (10, 110, 100),
        (0, 100, 100),
    ]


def test_one_channel_of_an_interval_and_of_the_whole(holed: Recording[Any]) -> None:
    whole = holed.channel("i_yi_p")
    assert np.array_equal(whole["index"], PRESENT)
    part = holed.channel("i_yi_p", START_NS + 100 * PERIOD_NS, START_NS + 330 * PERIOD_NS)
    assert part["index"].tolist() == [*range(100, 300), 320]
    assert np.array_equal(part["i_yi_p"], whole["i_yi_p"][100:301])
    assert holed.channel("state", 0, 1)["t_ns"].dtype == np.int64


def test_the_plan_as_a_type(tmp_path: Path) -> None:
    recording = opened(tmp_path / "a.mcap", {"plan.json": b'{"angles": 8}'})
    assert recording.plan_as(Angles).angles == 8
    assert Recording.open(tmp_path / "a.mcap", Angles).plan.angles == 8
    with pytest.raises(RecordingError, match="its plan is no Masses"):
        recording.plan_as(Masses)


def test_limits_and_calibrations(tmp_path: Path) -> None:
    recording = opened(tmp_path / "a.mcap", {"spec.json": b'{"K_i": {"low": 1.0}}', "calibrations.json": b"[]"})
    assert recording.spec == {"K_i": {"low": 1.0}}
    assert recording.calibrations == ()


def test_a_damaged_attachment_is_found_even_where_the_file_was_cut_off_too(tmp_path: Path) -> None:
    """The CRC of the data section stands at the end, which such a file has not."""
    path = tmp_path / "a.mcap"
    opened(path, {"rig.toml": b"span = 0.125"})
    data = bytearray(path.read_bytes()[:-500])
    path.write_bytes(data)
    assert Recording.open(path).truncated
    data[data.index(b"0.125") + 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="an attachment fails its CRC"):
        Recording.open(path)


@pytest.mark.parametrize("text", [b"{", b"[1]", b"\xff"])
def test_an_attachment_that_is_not_what_it_should_be(tmp_path: Path, text: bytes) -> None:
    with pytest.raises(RecordingError, match=r"a\.mcap: attachment 'spec.json'"):
        _ = opened(tmp_path / "a.mcap", {"spec.json": text}).spec


def test_a_seed_that_is_no_number(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"a\.mcap: seed: found 'seven'; expected an integer"):
        _ = opened(tmp_path / "a.mcap", {}, {"run": {"seed": "seven"}}).seed


@pytest.mark.parametrize(("run", "visit"), [({}, None), ({"seed": "0"}, 0), ({"seed": "0", "visit": "3"}, 3)])
def test_the_visit_of_a_virtual_rig(tmp_path: Path, run: dict[str, str], visit: int | None) -> None:
    """Recordings that say nothing are of visit 0; a real rig has none."""
    assert opened(tmp_path / "a.mcap", {}, {"run": run}).visit == visit


@pytest.mark.parametrize("version", ["", "one", "-1", "1.5", "\u00b2"])
def test_a_layout_version_that_is_no_number(tmp_path: Path, version: str) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="levbench")
        writer.add_metadata("layout", {"version": version})
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.raises(RecordingError, match="no Levbench recording"):
        Recording.open(tmp_path / "a.mcap")


def test_a_long_file_is_read_step_by_step_in_little_memory(tmp_path: Path) -> None:
    """200 s: 16 MB of frames and 5 MB of samples, of which the samples of the last 160 s are kept. An hour at 29 channels
    follows by proportion, as nothing else that is kept grows with the length but the places of the chunks and the events."""
    clock, seconds = SetClock(), 200
    with Recorder(tmp_path / "a.mcap", clock=clock, streams=[STREAM], header=RunHeader({}, {})) as recorder:
        template = frames_of(block(0, 1000))
        noise = np.random.default_rng(0).integers(0, 256, (1000, 56), np.uint8)
        template["data"][:, 8:] = noise
        for n in range(seconds):
            part = block(n * 1000, 1000)
            template["t_ns"] = part.t_ns
            with recorder.step("dwell", number=n):
                recorder.frames("controller", template)
                recorder.samples(part)
                clock.now += 1000 * PERIOD_NS
    tracemalloc.start()
    recording: Recording[Any] = Recording.open(tmp_path / "a.mcap")
    means = [step.mean("i_yi_p") for step in recording.steps("dwell")]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(means) == seconds
    assert (tmp_path / "a.mcap").stat().st_size > 10e6
    assert peak < 11e6


def test_captures_are_no_streams_of_the_whole_run(tmp_path: Path) -> None:
    record(tmp_path / "r.mcap", gapped(), captured=2)
    recording = Recording.open(tmp_path / "r.mcap")
    assert list(recording.streams) == ["telemetry"]
    one, two = recording.captures()
    assert recording.captures(n=2) == (two,)
    x = one.arrays()
    assert x["inject"].tolist() == list(range(1500))
    assert x["t_s"][[0, -1]].tolist() == pytest.approx([0.1, 0.2499])
    assert x["tick"][0] == 1000
    assert one.trigger_ns == START_NS + 100 * PERIOD_NS
    assert list(two.frame("inject").index) == x["t_s"].tolist()
    with pytest.raises(AnalysisError, match="inject: not all recorded in one stream"):
        recording.channel("inject")


def test_a_capture_that_was_cut_off_is_no_capture(tmp_path: Path) -> None:
    record(tmp_path / "r.mcap", gapped(), captured=1)
    recording = Recording.open(tmp_path / "r.mcap")
    (one,) = recording.captures()
    with pytest.raises(AnalysisError, match="capture/1: found 1500 samples; expected 1501"):
        replace(one, samples=1501).arrays()


def test_a_stream_is_added_once(tmp_path: Path) -> None:
    with Recorder(tmp_path / "r.mcap", clock=SetClock(), streams=[STREAM], header=HEADER) as recorder:
        with pytest.raises(RecordingError, match="stream telemetry is there already"):
            recorder.stream(STREAM)


def test_a_topic_is_looked_for_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Seventy captures of a run are seventy topics of one or two chunks each: all of them take little more than one pass."""
    many, reads = 2 * KEPT, Counter[int]()
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file, chunk_size=1, compression=CompressionType.LZ4)  # a chunk for each message
        writer.start(profile="levbench")
        topics = [writer.register_channel(f"capture/{n % 80}", "", 0) for n in range(80)]
        for n in range(many):
            writer.add_message(topics[n % 80], n + 1, bytes(8), n + 1)
        writer.finish()  # type: ignore[no-untyped-call]
    found = index(tmp_path / "a.mcap")
    assert len(found.chunks) == many
    read = found._read

    def counted(number: int) -> Any:
        reads[number] += 1
        return read(number)

    monkeypatch.setattr(found, "_read", counted)
    for n in range(80):
        assert [t for t, _ in found.messages(f"capture/{n}")] == list(range(n + 1, many + 1, 80))
    assert reads.total() <= 2 * many
