"""Recordings read back: whole, cut off at any byte, damaged at any byte, foreign and newer."""

from __future__ import annotations

import io
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from recordings import HEADER, PERIOD_NS, START_NS, STREAM, block, frames_of, gapped, record

from bench.errors import AnalysisError, RecordingError
from bench.recording import Recording, layout
from bench.recording.recorder import RunHeader


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    record(path, gapped())
    return path


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Little data and several chunks, so that a byte picked anywhere often matters."""
    path = tmp_path_factory.mktemp("small") / "a.mcap"
    record(path, [block(n, 25) for n in (0, 600, 1200)])
    return path


def content(path: Path) -> dict[str, Any]:
    """Everything a reader can get from a file, as plain comparable values."""
    r: Recording[Any] = Recording.open(path)
    data: dict[str, list[Any]] = {"t_ns": [], "index": [], "pos_yi": [], "i_yi_p": [], "state": []}
    if "telemetry" in r.streams:
        data = {n: x.tolist() for n, x in r.read(("pos_yi", "i_yi_p", "state"), 0, 1 << 62).items()}
    return {
        "samples": list(zip(*(data[n] for n in sorted(data)), strict=True)),
        "events": [json.dumps(e, sort_keys=True) for e in r.events()],
        "frames": [f.tobytes() for f in r.frames("controller")],
        "layouts": [repr(s) for s in r.streams.values()],
        "attachments": sorted(r._file.attachments.items()),
        "metadata": sorted((n, sorted(m.items())) for n, m in r._file.metadata.items()),
        "truncated": r.truncated,
    }


def test_samples_come_back_bit_for_bit_with_the_gap_where_it_was(whole: Path) -> None:
    r: Recording[Any] = Recording.open(whole)
    read = r.read(("i_yi_p", "pos_yi", "state"), 0, 1 << 62)
    index = np.r_[0:1200, 1205:2305]
    assert np.array_equal(read["index"], index)
    assert np.array_equal(read["t_ns"], START_NS + index * PERIOD_NS)
    for name in ("i_yi_p", "pos_yi", "state"):
        expected = np.concatenate([b.columns[name] for b in gapped()]).astype(np.float32)
        assert np.array_equal(read[name], expected.astype(np.float64)), name
    assert not r.truncated
    assert r.integrity is not None
    assert r.integrity["lost"] == {"telemetry": 5}


@pytest.mark.parametrize(("a", "b"), [(0, 1), (499, 501), (1100, 1300), (1199, 1205), (1201, 1204), (2300, 9000)])
def test_an_interval_holds_its_start_and_not_its_end(whole: Path, a: int, b: int) -> None:
    read = Recording.open(whole).read(("pos_yi",), START_NS + a * PERIOD_NS, START_NS + b * PERIOD_NS)
    expected = [n for n in range(a, min(b, 2305)) if not 1200 <= n < 1205]
    assert read["index"].tolist() == expected


def test_steps_give_their_samples_labels_and_means(whole: Path) -> None:
    r: Recording[Any] = Recording.open(whole)
    steps = r.steps("dwell")
    assert [s.labels["block"] for s in steps] == list(range(23))
    for step, part in zip(steps, gapped(), strict=True):
        read = step.read("pos_yi", "i_yi_p")
        assert np.array_equal(read["t_ns"], part.t_ns)
        assert step.mean("i_yi_p") == pytest.approx(
            float(np.mean(part.columns["i_yi_p"].astype(np.float32), dtype=np.float64)), rel=1e-12
        )
        assert step.expected() == 100
    assert [(label, len(group)) for label, group in steps.by("odd")] == [(False, 12), (True, 11)]
    assert len(r.steps("spin")) == 0


def test_events_header_and_frames_come_back(whole: Path) -> None:
    r: Recording[Any] = Recording.open(whole)
    assert [e["now"] for e in r.events("state")] == ["LEVITATED", "READY"]
    assert len(r.events()) == 2 + 2 * 23
    assert (r.procedure, r.seed, r.versions) == ("amb-calibration", 7, {"levbench": "0"})
    assert r.wall["started"] == "2026-01-01"
    assert r.plan_dict == {"angles": 8}
    assert r.streams == {"telemetry": STREAM}
    batches = list(r.frames("controller"))
    assert len(batches) == 24
    assert batches[3].tobytes() == frames_of(gapped()[3]).tobytes()


def test_what_was_not_recorded_is_said(whole: Path) -> None:
    r: Recording[Any] = Recording.open(whole)
    with pytest.raises(AnalysisError, match=r"channels pos_yi, speed: not all recorded in one stream of a\.mcap"):
        r.read(("pos_yi", "speed"), 0, 1)
    with pytest.raises(RecordingError, match=r"attachment 'rig\.dbc' is missing"):
        r.attachment("rig.dbc")
    with pytest.raises(AnalysisError, match="without a plan type"):
        _ = r.plan


def same_or_prefix(damaged: Path, good: dict[str, Any]) -> str:
    """What became of a file: refused, the same, or a truncated prefix of what was written. Anything else fails."""
    try:
        got = content(damaged)
    except RecordingError:
        return "refused"
    if not got["truncated"]:
        assert got == good
        return "same"
    for kind in ("samples", "events", "frames"):
        assert got[kind] == good[kind][: len(got[kind])], kind
    for kind in ("layouts", "attachments", "metadata"):
        assert set(map(repr, got[kind])) <= set(map(repr, good[kind])), kind
    return "prefix"


def test_a_file_cut_off_at_any_byte_is_a_truncated_prefix_or_refused(small: Path, tmp_path: Path) -> None:
    good, data = content(small), small.read_bytes()
    outcomes, samples = [], []
    for length in [*range(0, len(data), 37), *range(len(data) - 20, len(data))]:
        cut = tmp_path / "cut.mcap"
        cut.write_bytes(data[:length])
        outcomes.append(same_or_prefix(cut, good))
        if outcomes[-1] == "prefix":
            samples.append(len(content(cut)["samples"]))
    assert "same" not in outcomes
    assert outcomes.index("prefix") < len(outcomes) / 2
    assert "refused" not in outcomes[outcomes.index("prefix") :]
    assert samples == sorted(samples)
    assert samples[-1] == 75


def test_a_flipped_byte_anywhere_never_gives_other_data(small: Path, tmp_path: Path) -> None:
    good, data = content(small), small.read_bytes()
    generator = np.random.default_rng(1)
    places = generator.choice(len(data), 400, replace=False)
    outcomes = []
    for place, mask in zip(places.tolist(), generator.integers(1, 256, 400).tolist(), strict=True):
        flipped = tmp_path / "flipped.mcap"
        flipped.write_bytes(data[:place] + bytes([data[place] ^ mask]) + data[place + 1 :])
        outcomes.append(same_or_prefix(flipped, good))
    assert outcomes.count("refused") > 350


def test_a_flipped_byte_in_the_samples_is_called_damage(whole: Path, tmp_path: Path) -> None:
    data = bytearray(whole.read_bytes())
    data[len(data) // 3] ^= 0x10
    (tmp_path / "a.mcap").write_bytes(data)
    with pytest.raises(RecordingError, match="CRC; the file was damaged after it was written"):
        content(tmp_path / "a.mcap")


def test_a_flipped_byte_in_the_summary_is_found(small: Path, tmp_path: Path) -> None:
    data = bytearray(small.read_bytes())
    data[data.rindex(b"i_yi_p")] ^= 0x01  # the name of a channel, as the summary repeats it
    (tmp_path / "a.mcap").write_bytes(data)
    with pytest.raises(RecordingError, match="summary fails its CRC"):
        Recording.open(tmp_path / "a.mcap")


def test_a_damaged_length_in_a_whole_file_is_damage_and_not_a_cut(small: Path, tmp_path: Path) -> None:
    data = bytearray(small.read_bytes())
    data[8 + 1 + 4] ^= 0x01  # bit 32 of the header's length: it now reaches far past the end
    (tmp_path / "a.mcap").write_bytes(data)
    with pytest.raises(RecordingError):
        Recording.open(tmp_path / "a.mcap")
    data = bytearray(small.read_bytes())
    data[data.index(b"\x0c", 40) + 1 + 4] ^= 0x01  # the first metadata record, behind a good header
    (tmp_path / "a.mcap").write_bytes(data)
    with pytest.raises(RecordingError, match="records do not lead to its end; the file was damaged"):
        Recording.open(tmp_path / "a.mcap")


@pytest.mark.parametrize("text", [b"", b"x", b"t,pos\n0,1\n" * 50, b"\x89MCAP0\r\n"])
def test_a_file_that_is_no_mcap_is_refused(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "a.mcap").write_bytes(text)
    with pytest.raises(RecordingError, match=r"a\.mcap is not an MCAP recording"):
        Recording.open(tmp_path / "a.mcap")


def test_a_missing_file_and_a_directory_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot be read: No such file or directory"):
        Recording.open(tmp_path / "a.mcap")
    with pytest.raises(RecordingError, match="cannot be read: Is a directory"):
        Recording.open(tmp_path)


@pytest.mark.parametrize("profile", ["ros2", "", "levbench"])
def test_mcap_of_another_maker_is_refused(tmp_path: Path, profile: str) -> None:
    out = io.BytesIO()
    writer = Writer(out)
    writer.start(profile=profile, library="other")
    channel = writer.register_channel("/t", "json", writer.register_schema("s", "jsonschema", b"{}"))
    writer.add_message(channel, 1, b"{}", 1)
    writer.finish()  # type: ignore[no-untyped-call]
    (tmp_path / "a.mcap").write_bytes(out.getvalue())
    with pytest.raises(RecordingError, match="MCAP but no Levbench recording"):
        Recording.open(tmp_path / "a.mcap")


def test_a_newer_layout_is_refused_and_an_older_reader_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as newer:
        newer.setattr(layout, "VERSION", 3)
        record(tmp_path / "a.mcap", [block(0, 10)])
    with pytest.raises(RecordingError, match=r"layout version: found 3; expected at most 2\. .* newer Levbench"):
        Recording.open(tmp_path / "a.mcap")


def test_a_run_killed_before_its_end_is_truncated_even_if_its_file_is_whole(tmp_path: Path, small: Path) -> None:
    out = io.BytesIO()
    writer = Writer(out)
    writer.start(profile="levbench")
    writer.add_metadata("layout", {"version": "1"})
    writer.finish()  # type: ignore[no-untyped-call]
    (tmp_path / "a.mcap").write_bytes(out.getvalue())
    assert Recording.open(tmp_path / "a.mcap").truncated
    assert not Recording.open(small).truncated


def test_opening_changes_nothing_and_the_digest_is_of_the_bytes(whole: Path, tmp_path: Path) -> None:
    copy = tmp_path / "b.mcap"
    shutil.copy(whole, copy)
    before = copy.read_bytes()
    first: Recording[Any] = Recording.open(copy)
    content(copy)
    assert copy.read_bytes() == before
    assert first.digest() == Recording.open(whole).digest()
    record(tmp_path / "c.mcap", gapped(), header=RunHeader({**HEADER.metadata, "run": {"seed": "8"}}, {}))
    assert first.digest() != Recording.open(tmp_path / "c.mcap").digest()
