"""A disk that is full: the run ends safely, its record says so, and the messages name the path and what to do."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from test_records import start

from bench.errors import ConfigError
from bench.findings import Effect
from bench.recording.reserve import SIZE, reserved
from bench.run.runner import RunResult, _written
from bench.rundir import RunDirectory
from bench.wholefile import write_whole

ROOT = Path(__file__).resolve().parent.parent
NEXT = "File too large. Next: free space there"


def run(out: Path, limit: int, *words: str) -> subprocess.CompletedProcess[str]:
    """`bench` where no file can grow beyond `limit` bytes."""

    def bounded() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    command = [
        sys.executable,
        "-m",
        "bench.cli",
        "run",
        "amb-calibration",
        "--rig",
        "tsbs12",
        "--no-report",
        "--out",
        out,
    ]
    return subprocess.run([*command, *words], capture_output=True, text=True, cwd=ROOT, timeout=200, preexec_fn=bounded)


def test_a_disk_that_fills_up_ends_the_run_and_is_in_its_record(tmp_path: Path) -> None:
    done = run(tmp_path / "runs", SIZE + 200_000)
    (folder,) = (tmp_path / "runs").glob("amb-calibration-*")
    record = json.loads((folder / "record.json").read_text(encoding="utf-8"))
    assert (done.returncode, record["outcome"], done.stdout.strip()) == (3, "ERROR", str(folder))
    assert "ERROR: amb-calibration on tsbs12" in done.stderr.splitlines()
    found = {f["code"]: f["text"] for f in record["findings"]}
    assert found["recording-failed"].startswith(f"recording {folder / 'recording.mcap'}: cannot be written: {NEXT}")
    assert "Traceback" not in done.stderr
    assert sorted(p.name for p in folder.iterdir()) == [
        "asked.json", "record.json", "recording.mcap", "run.log", "truth.json",
    ]  # fmt: skip


def test_a_disk_that_is_full_starts_nothing(tmp_path: Path) -> None:
    done = run(tmp_path / "runs", 100_000)
    assert done.returncode == 2
    assert (
        "found no room for 2 MB: File too large; nothing was started. Next: free space there, or give another --out"
        in (done.stderr)
    )


def test_a_record_that_cannot_be_written_is_in_what_comes_back(tmp_path: Path) -> None:
    directory = RunDirectory(tmp_path / "gone")
    result = _written(directory, RunResult(directory.path, start()))
    last = result.record.findings[-1]
    assert (last.code, last.effect, result.outcome.value) == ("record-not-written", Effect.ERROR, "ERROR")
    assert last.text.startswith(f"{directory.record}: cannot be written: No such file or directory")
    assert f"bench analyse {directory.path}" in last.text


def test_room_is_taken_and_given_back(tmp_path: Path) -> None:
    with reserved(tmp_path, 1_000_000) as release:
        assert list(tmp_path.iterdir()) == []  # nothing that a killed run would leave
        release()
        release()
    with pytest.raises(ConfigError, match=r"found no room for .* nothing was started"):
        with reserved(tmp_path / "absent"):
            pass


@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_a_whole_file_obeys_the_umask(tmp_path: Path, mask: int, mode: int) -> None:
    before = os.umask(mask)
    try:
        write_whole(tmp_path / "record.json", "{}")
    finally:
        os.umask(before)
    assert (tmp_path / "record.json").stat().st_mode & 0o777 == mode


def test_an_error_of_a_whole_file_names_it(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file") as caught:
        write_whole(tmp_path / "absent" / "record.json", "{}")
    assert caught.value.filename == str(tmp_path / "absent" / "record.json")
    (tmp_path / "file").touch()  # what was begun cannot be taken away there either, as on a read-only system
    with pytest.raises(OSError, match="Not a directory") as caught:
        write_whole(tmp_path / "file" / "record.json", "{}")
    assert caught.value.filename == str(tmp_path / "file" / "record.json")
