"""Whose the packages are that `bench` is made of: folders as pip leaves them, and what is said of them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import levbench

ROOT = Path(__file__).resolve().parents[1]


def installed(folder: Path, name: str, *files: str, listed: str = "RECORD") -> None:
    """A distribution as an installer leaves it: its files, and the list of them."""
    for file in files:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).touch()
    information = folder / (f"{name}.dist-info" if listed == "RECORD" else f"{name}.egg-info")
    information.mkdir()
    lines = [f"{file},sha256=x,0" for file in files] if listed == "RECORD" else sorted({f.split("/")[0] for f in files})
    (information / listed).write_text("".join(f"{line}\n" for line in lines))


def ours(folder: Path) -> None:
    """Levbench's packages, but for what is in them."""
    installed(folder, "levbench-0.1.0", "bench/cli/start.py", *(f"{p}/__init__.py" for p in levbench.PACKAGES))
    (folder / "levbench.py").write_bytes((ROOT / "levbench.py").read_bytes())


def started(*path: Path) -> subprocess.CompletedProcess[str]:
    """`bench --version` with these folders first on the path."""
    own = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, path))}
    done = subprocess.run([sys.executable, "-m", "levbench", "--version"], cwd=path[0], env=own, text=True,
                          capture_output=True, check=False)  # fmt: skip
    assert "Traceback" not in done.stderr
    return done


def test_a_clone_is_levbench_s_own() -> None:
    done = started(ROOT)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("bench ")


@pytest.mark.parametrize("package", ["bench", "drivers", "reports"])
@pytest.mark.parametrize("listed", ["RECORD", "top_level.txt"])
def test_files_among_ours_are_named(tmp_path: Path, package: str, listed: str) -> None:
    ours(tmp_path)
    installed(tmp_path, "benchmarker-1.0", "benchmarker/bench/__init__.py", "bench.py")  # called nearly so, and in vain
    installed(tmp_path, "other-2.8", f"{package}/__init__.py", f"{package}/more.py", listed=listed)
    done = started(tmp_path)
    assert done.returncode == 2
    assert f"package `{package}`: found files of other 2.8 among ours in {tmp_path}" in done.stderr
    assert done.stderr.count("package `") == 1
    assert "Next: python -m venv" in done.stderr


@pytest.mark.parametrize("package", ["bench", "drivers", "reports"])
def test_a_package_that_hides_ours_is_named(tmp_path: Path, package: str) -> None:
    """Of another folder that is earlier on the path, as that of a user's own packages is."""
    installed(tmp_path / "first", "other-0.4.1", f"{package}/__init__.py")
    ours(tmp_path / "second")
    done = started(tmp_path / "first", tmp_path / "second")
    assert done.returncode == 2
    assert f"package `{package}`: found that of other 0.4.1 in {tmp_path / 'first'}" in done.stderr
    assert f"expected the one in {tmp_path / 'second'}" in done.stderr
    assert done.stderr.count("package `") == 1


def test_another_copy_of_levbench_in_front_is_no_other_distribution(tmp_path: Path) -> None:
    ours(tmp_path)
    (tmp_path / "bench/cli/start.py").write_text("def main():\n    return 7\n")
    (tmp_path / "bench/cli/__init__.py").touch()
    (tmp_path / "levbench.py").unlink()
    assert started(tmp_path, ROOT).returncode == 7


@given(st.lists(st.binary(max_size=40), max_size=8))
def test_lists_of_any_bytes_are_searched(tmp_path_factory: pytest.TempPathFactory, lines: list[bytes]) -> None:
    folder = tmp_path_factory.mktemp("site")
    (folder / "odd-1.dist-info").mkdir()
    (folder / "odd-1.dist-info" / "RECORD").write_bytes(b"\n".join([*lines, b"drivers/can.py,,"]))
    owners = list(levbench._owners(str(folder)))
    assert ("odd 1", "drivers") in owners
    assert {package for _, package in owners} <= {*levbench.PACKAGES}
