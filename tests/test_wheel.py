"""What an installed Levbench holds: a wheel is built as `pip wheel . --no-deps` does it, unpacked, and used."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DATA = ("rigs", "specs", "campaigns")
BUILD = "import sys, setuptools.build_meta as made; print(made.build_wheel(sys.argv[1]))"
ASK = "import sys; sys.path.insert(0, sys.argv[1]); from bench.cli.__main__ import main; sys.exit(main(sys.argv[2:]))"


def needed() -> set[str]:
    """Every file of the packages and of the data that git would not ignore."""
    rooms = ("bench", "drivers", "procedures", "reports", "sim_backend", *DATA)
    found = (path for room in rooms for path in (ROOT / room).rglob("*") if path.is_file())
    names = {path.relative_to(ROOT).as_posix() for path in found}
    return {n for n in names if not n.endswith((".pyc", ".so")) and ".calibrations/" not in n}


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_wheel_holds_every_file_and_finds_its_rigs(tmp_path: Path) -> None:
    source, built = tmp_path / "source", tmp_path / "built"
    built.mkdir()
    for name in needed() | {"pyproject.toml", "README.md", "LICENSE"}:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, source / name)
    subprocess.run([sys.executable, "-c", BUILD, str(built)], cwd=source, check=True, capture_output=True)
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as file:
        assert needed() - set(file.namelist()) == set()
        file.extractall(tmp_path / "site")
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    for words in (("list",), ("check", "tsbs12"), ("check", "amb5dof")):
        done = subprocess.run([sys.executable, "-c", ASK, str(tmp_path / "site"), *words], cwd=folder, text=True,
                              capture_output=True, check=False)  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert "tsbs12" in done.stdout or words[1:] == ("amb5dof",)
    assert str(tmp_path / "site" / "rigs" / "amb5dof.toml") in done.stdout
