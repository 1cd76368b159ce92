"""Ctrl-C outside of a run: a line and a documented status, whenever it comes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import bench
from bench.cli.__main__ import main

ROOT = Path(__file__).resolve().parents[2]
BEGIN = "import sys; from bench.cli.start import main; sys.exit(main())"


@pytest.mark.parametrize(
    ("loaded", "arguments"), [("typer", ("list",)), ("pydantic", ("check", "tsbs12")), ("numpy", ("export", "."))]
)
def test_while_a_library_is_loaded(tmp_path: Path, loaded: str, arguments: tuple[str, ...]) -> None:
    (tmp_path / f"{loaded}.py").write_text("raise KeyboardInterrupt\n")
    paths = os.pathsep.join([str(tmp_path), str(ROOT)])
    done = subprocess.run([sys.executable, "-c", BEGIN, *arguments], env={**os.environ, "PYTHONPATH": paths}, text=True,
                          capture_output=True, check=False)  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (4, "", "bench: stopped\n")


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"bench {bench.__version__}\n"
