"""Two small procedures on a rig file of their own, of which one needs the other's calibration."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from in_process import Bench, bench_in_process

from bench import catalogue
from bench.calibration.file import digest_of

CHAIN = (
    catalogue.Entry("tiny-levitated", "tests.tiny_procedures", "A look at the supply"),
    catalogue.Entry("tiny-chained", "tests.tiny_chain", "What differs from it"),
)
FILE = Path("rigs/tsbs12.calibrations/sim-0/tiny-levitated.json")
RIG = Path("rigs/tsbs12.toml")


def opened(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Bench:
    """`bench` in a directory with a rig file of its own: exit status, standard output, standard error."""
    source = catalogue.rig_path("tsbs12")
    (folder / "rigs").mkdir()
    for suffix in (".toml", ".dbc"):
        shutil.copy(source.with_suffix(suffix), folder / "rigs")
    monkeypatch.setattr(catalogue, "PROCEDURES", CHAIN)
    monkeypatch.chdir(folder)
    return bench_in_process(capsys)


def run(bench: Bench, *extra: str, procedure: str = "tiny-levitated", status: int = 0) -> str:
    found, out, err = bench("run", procedure, "--rig", "tsbs12", "--no-report", *extra)
    assert found == status, err
    return out.splitlines()[-1] if status == 0 or out else err


def adopted(bench: Bench, *extra: str) -> str:
    directory = run(bench, *extra)
    status, out, err = bench("adopt", directory)
    assert status == 0, err
    assert Path(out.splitlines()[-1]).is_file()
    return directory


def chained(bench: Bench, *extra: str, status: int = 2) -> str:
    """What `bench run tiny-chained` says, or its run directory; nothing is made where it is refused."""
    before = set(Path("runs").glob("*"))
    said = run(bench, *extra, procedure="tiny-chained", status=status)
    if status == 2:
        assert set(Path("runs").glob("*")) == before
    return said


def edit(path: Path, *, sealed: bool = True, **changes: Any) -> None:
    """Change a calibration's file. `sealed`: as if it had been adopted so; else the digest is left as it is."""
    content = json.loads(path.read_text(encoding="utf-8")) | changes
    content |= {"digest": digest_of(content)} if sealed else {}
    path.write_text(json.dumps(content), encoding="utf-8")
