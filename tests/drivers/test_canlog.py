"""Raw frames as logs of other CAN tools: written and read back by python-can, every frame the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.cli.export import export_command
from bench.clock import WallClock
from bench.errors import RecordingError
from bench.link.frames import ERROR, EXTENDED, FD, SENT, SWITCHED, FrameBatch, batch_of, packed
from bench.recording import Recording
from bench.recording.recorder import Recorder, RunHeader
from bench.wire.slcan import LENGTHS
from drivers.canlog import SUFFIXES, write_log

READERS: dict[str, Any] = {"blf": can.BLFReader, "asc": can.ASCReader, "candump": can.CanutilsLogReader}
ALL = pytest.mark.parametrize("to", sorted(SUFFIXES))
START_NS = 1_767_225_600 * 10**9


@st.composite
def frames(draw: st.DrawFn) -> bytes:
    extended, fd = draw(st.booleans()), draw(st.booleans())
    identifier = draw(st.integers(0, 0x1FFF_FFFF)) | EXTENDED if extended else draw(st.integers(0, 0x7FF))
    length = draw(st.sampled_from(LENGTHS if fd else LENGTHS[:9]))
    flags = (FD if fd else 0) | (SWITCHED if fd and draw(st.booleans()) else 0) | (SENT if draw(st.booleans()) else 0)
    return packed(identifier, draw(st.binary(min_size=length, max_size=length)), t_ns=START_NS, flags=flags)


def timed(parts: list[bytes]) -> FrameBatch:
    batch = batch_of(parts)
    batch["t_ns"] = START_NS + 1_000_000 * np.arange(len(batch))
    return batch


def seen(message: can.Message) -> tuple[Any, ...]:
    identifier = message.arbitration_id | (EXTENDED if message.is_extended_id else 0)
    return identifier, message.is_fd, message.bitrate_switch, message.is_rx, bytes(message.data)


def kept(batch: FrameBatch) -> list[tuple[Any, ...]]:
    return [(int(f["id"]), bool(f["flags"] & FD), bool(f["flags"] & SWITCHED), not f["flags"] & SENT,
             f["data"][: f["length"]].tobytes()) for f in batch]  # fmt: skip


@ALL
@given(st.lists(frames(), min_size=1, max_size=20))
@settings(max_examples=40)
def test_every_frame_comes_back(tmp_path_factory: pytest.TempPathFactory, to: str, parts: list[bytes]) -> None:
    path = tmp_path_factory.mktemp("log") / f"a{SUFFIXES[to]}"
    batch = timed(parts)
    assert write_log(path, to, [batch[:3], batch[3:]]) == len(batch)
    with READERS[to](path) as reader:
        found = list(reader)
    assert [seen(m) for m in found] == kept(batch)
    times = np.array([m.timestamp for m in found])
    assert np.abs(times - times[0] - 1e-3 * np.arange(len(batch))).max() < 2e-6


@ALL
def test_a_runs_frames_are_exported_as_they_were_recorded(
    tmp_path: Path, to: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "amb-calibration-20260101T000000Z-0000"
    run.mkdir()
    batch = timed([packed(0x100, bytes(64), flags=FD), packed(0x11, b"\1\2", flags=SENT | FD | SWITCHED)] * 50)
    with Recorder(run / "recording.mcap", clock=WallClock(), streams=[], header=RunHeader({}, {})) as recorder:
        recorder.frames("controller", batch)
    before = (run / "recording.mcap").read_bytes()
    assert export_command(run, to) == 0  # type: ignore[arg-type]
    assert capsys.readouterr().out == f"{run / 'export'}\n"
    assert [p.name for p in (run / "export").iterdir()] == [f"controller{SUFFIXES[to]}"]
    with READERS[to](run / "export" / f"controller{SUFFIXES[to]}") as reader:
        assert [seen(m) for m in reader] == kept(batch)
    assert (run / "recording.mcap").read_bytes() == before


def test_a_recording_without_frames_says_so(tmp_path: Path) -> None:
    run = tmp_path / "amb-calibration-20260101T000000Z-0000"
    run.mkdir()
    with Recorder(run / "recording.mcap", clock=WallClock(), streams=[], header=RunHeader({}, {})):
        pass
    with pytest.raises(RecordingError, match="holds no frames"):
        export_command(run, "blf")
    assert Recording.open(run / "recording.mcap").links == ()


@ALL
def test_an_error_frame_does_not_stop_the_log(tmp_path: Path, to: str) -> None:
    batch = timed([packed(0x100, b"\1"), packed(0, b"", flags=ERROR), packed(0x101, b"\2")])
    write_log(tmp_path / "a", to, [batch])
    with READERS[to](tmp_path / "a") as reader:
        assert [m.arbitration_id for m in reader if not m.is_error_frame] == [0x100, 0x101]
