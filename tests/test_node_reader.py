"""A recording read in full by the reference implementation in another language. Runs where npm and its packages are."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from recordings import gapped, record

NODE = Path(__file__).resolve().parent / "node"


@pytest.fixture(scope="module")
def reader() -> list[str]:
    """The command that reads a file; installs its packages once, next to the script."""
    npm, node = shutil.which("npm"), shutil.which("node")
    if npm is None or node is None:
        pytest.skip("npm is not installed")
    if not (NODE / "node_modules" / "@mcap" / "support").is_dir():
        command = [npm, "ci", "--no-audit", "--no-fund", "--silent", "--ignore-scripts"]
        done = subprocess.run(command, cwd=NODE, capture_output=True, text=True, timeout=100)
        assert done.returncode == 0, f"npm ci failed: {done.stderr[-200:]}"
    return [node, str(NODE / "read.mjs")]


def read(command: list[str], path: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*command, str(path)], capture_output=True, text=True, timeout=60)


def test_the_lock_pins_every_package_by_its_hash_and_names_no_registry() -> None:
    text = (NODE / "package-lock.json").read_text()
    packages = {name: p for name, p in json.loads(text)["packages"].items() if name}
    assert packages["node_modules/@mcap/core"]["version"] == "2.2.2"
    assert all(p["integrity"].startswith("sha512-") for p in packages.values())
    assert "resolved" not in text
    assert "://" not in text


def test_the_reference_reader_reads_everything(reader: list[str], tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", gapped())
    done = read(reader, tmp_path / "a.mcap")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    # blocks end at the gap before 1205 and where half a second of bench time is over; 120 view windows before the gap
    # and 111 after it, the first and the last of them with five samples
    counts = {"/telemetry/block": 6, "/telemetry/view": 120 + 111, "/raw/controller": 24, "/events": 2 + 2 * 23}
    assert found["sequential"] == counts
    assert found["indexed"] == counts
    assert found["stated"] == counts
    assert found["metadata"] == ["layout", "run", "versions", "integrity", "wall"]
    assert found["attachments"] == ["rig.toml", "plan.json"]


def test_the_reference_reader_reads_captures(reader: list[str], tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", gapped(), captured=2)
    done = read(reader, tmp_path / "a.mcap")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    for n in (1, 2):
        assert found["sequential"][f"/capture/{n}/block"] == 2
        assert found["sequential"][f"/capture/{n}/view"] == 15
    assert found["indexed"] == found["stated"] == found["sequential"]


def test_the_reference_reader_refuses_a_flipped_byte(reader: list[str], tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", gapped())
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[len(data) // 3] ^= 0x10
    (tmp_path / "a.mcap").write_bytes(data)
    done = read(reader, tmp_path / "a.mcap")
    assert done.returncode != 0
    assert "sequential" not in done.stdout
