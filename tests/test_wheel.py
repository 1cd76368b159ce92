"""What an installed Levbench holds and does: a wheel is built as `pip wheel . --no-deps` does it, and installed by pip where it
meets nothing that a clone has: no compiler, no network, no folder of the packages that can be written."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "install"))
import check_wheel  # noqa: E402

BUILD = "import sys, setuptools.build_meta as made; print(made.build_wheel(sys.argv[1]))"
BESIDE = ("pyproject.toml", "setup.py", "README.md", "LICENSE")
PLAIN = (shutil.which("unshare"), "-rn", shutil.which("setpriv"), "--bounding-set=-all", "--inh-caps=-all", "--")
"""A user whom the modes of files bind, as they do not bind root, and no network: of Linux."""
CORE = "import sim_backend.machines.tsbs.plant"

pytestmark = [pytest.mark.long, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy of what a clone has, without what is left of earlier builds."""
    source, built = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("built")
    for name in {*check_wheel.expected(), *BESIDE}:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, source / name)
    for name in ("benchmarks", "tests"):  # what must be left out must have been there
        (source / name).mkdir()
        (source / name / "__init__.py").touch()
    subprocess.run([sys.executable, "-c", BUILD, str(built)], cwd=source, check=True, capture_output=True)
    (found,) = built.glob("*.whl")
    return found


@dataclass
class Installed:
    """An environment that holds Levbench alone; what it depends on comes from that of the tests."""

    root: Path
    home: Path

    @property
    def site(self) -> Path:
        """Its site-packages."""
        (found,) = self.root.glob("lib/python3*/site-packages")
        return found

    def pip(self, *words: str) -> None:
        """What pip does there, without an index."""
        here = [sys.executable, "-m", "pip", "--python", str(self.root / "bin" / "python")]
        own = {
            name: value for name, value in os.environ.items() if name != "PYTHONPATH"
        }  # what lies there is not installed
        subprocess.run([*here, *words], check=True, capture_output=True, text=True, env=own)

    def writable(self, yes: bool) -> None:
        """Whether its files and folders may be written into."""
        for path in (self.root, *self.root.rglob("*")):
            if not path.is_symlink():
                path.chmod(path.stat().st_mode | 0o200 if yes else path.stat().st_mode & ~0o222)

    def files(self) -> set[str]:
        """What site-packages hold."""
        return {path.relative_to(self.site).as_posix() for path in self.site.rglob("*") if path.is_file()}

    def __call__(self, *words: str, path: str = "", **variables: str) -> subprocess.CompletedProcess[str]:
        """A command of the environment in the folder of a plain user, with `path` after the environment's own."""
        plainly = [str(word) for word in PLAIN] if os.name == "posix" and os.geteuid() == 0 else []
        own = {"PATH": f"{self.root / 'bin'}{os.pathsep}{path}".rstrip(os.pathsep), "HOME": str(self.home),
               "PYTHONPATH": sysconfig.get_paths()["purelib"], "OPENBLAS_NUM_THREADS": "1"}  # fmt: skip
        return subprocess.run([*plainly, str(self.root / "bin" / words[0]), *words[1:]], cwd=self.home, text=True,
                              env=own | variables, capture_output=True, check=False)  # fmt: skip


@pytest.fixture
def installed(wheel: Path, tmp_path: Path) -> Iterator[Installed]:
    """From the wheel, by pip, without an index; read-only."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(tmp_path / "env")], check=True)
    (tmp_path / "home").mkdir()
    place = Installed(tmp_path / "env", tmp_path / "home")
    place.pip("install", "--no-index", "--no-deps", "--no-compile", str(wheel))
    place.writable(False)
    yield place
    place.writable(True)


def test_a_wheel_holds_what_it_must_and_nothing_else(wheel: Path) -> None:
    assert list(check_wheel.problems(wheel)) == []


def test_what_is_wrong_with_a_wheel_is_told(wheel: Path, tmp_path: Path) -> None:
    """Of one that lacks a rig and a compiled core, brings benchmarks, and says that it runs anywhere."""
    lacking = tmp_path / f"{'-'.join(wheel.stem.split('-')[:2])}-py3-none-any.whl"
    with zipfile.ZipFile(wheel) as whole, zipfile.ZipFile(lacking, "w") as file:
        for name in whole.namelist():
            if name != "bench/data/rigs/lira.toml" and "/core-" not in name:
                file.writestr(name, whole.read(name))
        file.writestr("benchmarks/core.py", "")
    told = list(check_wheel.problems(lacking))
    assert [problem.split(":")[0] for problem in told] == [
        "bench/data/rigs/lira.toml", "benchmarks/core.py", "sim_backend/core/", lacking.name,
    ]  # fmt: skip


def test_site_packages_hold_our_packages_and_data_alone(installed: Installed) -> None:
    names = {path.name for path in installed.site.iterdir()} - {"__pycache__"}
    information = {name for name in names if name.startswith("levbench-") and name.endswith(".dist-info")}
    assert names - information == {*check_wheel.PACKAGES, "levbench.py"}
    assert len(information) == 1
    assert not [name for name in installed.files() if "benchmarks" in name or "tests" in name.split("/")]


def test_a_plain_user_runs_it_without_compiler_and_network(installed: Installed) -> None:
    before = installed.files()
    assert installed("python", "-c", f"open({str(installed.site / 'x')!r}, 'w')").returncode == 1  # is read-only
    for words in (("list",), ("check", "tsbs12"), ("check", "amb5dof")):
        done = installed("bench", *words)
        assert done.returncode == 0, done.stderr
        assert "tsbs12" in done.stdout or words[1:] == ("amb5dof",)
    assert str(installed.site / "bench/data/rigs/amb5dof.toml") in done.stdout
    done = installed("bench", "run", "amb-calibration", "--rig", "tsbs12")
    assert done.returncode == 0, done.stderr
    run = Path(done.stdout.splitlines()[-1])
    record = json.loads((installed.home / run / "record.json").read_text(encoding="utf-8"))
    assert record["outcome"] == "PASS"
    assert (installed.home / run / "report.html").exists()
    done = installed("bench", "adopt", str(run))
    assert done.returncode == 0, done.stderr
    assert (installed.home / "rigs/tsbs12.calibrations/sim-0/amb-calibration.json").exists()
    assert "amb-calibration" in installed("bench", "calibrations", "tsbs12").stdout
    assert installed.files() == before
    assert not (installed.home / ".cache/levbench").exists()  # nothing was built


def test_the_page_s_commands_install_it(wheel: Path, tmp_path: Path) -> None:
    """Without an index; what Levbench depends on is in the environment of the tests."""
    page = (ROOT / "docs/how-to/install.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```bash\n(.*?)```", page, re.DOTALL)
    shutil.copy(wheel, tmp_path)
    own = {
        "PATH": os.environ["PATH"],
        "HOME": str(tmp_path),
        "PIP_NO_INDEX": "1",
        "PIP_NO_DEPS": "1",
        "PIP_NO_COMPILE": "1",
    }
    for line in block.splitlines():
        program = line.split()[0]
        more = {"PYTHONPATH": sysconfig.get_paths()["purelib"]} if program.endswith("/bench") else {}
        done = subprocess.run(
            ["bash", "-c", line], cwd=tmp_path, env=own | more, text=True, capture_output=True, check=False
        )
        assert done.returncode == 0, f"{line}\n{done.stderr}"
    assert "amb-calibration" in done.stdout


def test_without_a_compiled_core_it_is_built_once_for_the_user(installed: Installed) -> None:
    cores = sorted((installed.site / "sim_backend/core").glob("*.so"))
    cores[0].parent.chmod(0o755)
    for core in cores:
        core.unlink()
    cores[0].parent.chmod(0o555)
    done = installed("bench", "run", "amb-calibration", "--rig", "tsbs12")
    assert done.returncode == 2
    assert done.stderr.count("bench: ") == 1
    assert "no C compiler" in done.stderr
    assert "Next: install Levbench from a wheel" in done.stderr
    assert installed("python", "-c", CORE, path=os.environ["PATH"]).returncode == 0
    (built,) = (installed.home / ".cache/levbench").iterdir()
    stamp = built.stat().st_mtime_ns
    assert installed("python", "-c", CORE).returncode == 0  # there is no compiler, and none is needed
    assert [path.stat().st_mtime_ns for path in built.parent.iterdir()] == [stamp]
    done = installed("bench", "run", "amb-calibration", "--rig", "tsbs12", path=os.environ["PATH"], HOME="/dev/null")
    assert done.returncode == 2
    assert "XDG_CACHE_HOME" in done.stderr


@pytest.mark.parametrize("first", [True, False], ids=["before", "after"])
def test_another_distribution_of_the_same_name_is_named(
    wheel: Path, installed: Installed, tmp_path: Path, first: bool
) -> None:
    """Installed by pip before ours, or after it: which one's file is there is another one each time."""
    source = tmp_path / "other"
    (source / "bench").mkdir(parents=True)
    (source / "bench" / "__init__.py").write_text("raise RuntimeError('not ours')\n")
    (source / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["setuptools"]\nbuild-backend = "setuptools.build_meta"\n'
        '[project]\nname = "bench"\nversion = "2.8"\n[tool.setuptools]\npackages = ["bench"]\n'
    )
    subprocess.run([sys.executable, "-c", BUILD, str(tmp_path)], cwd=source, check=True, capture_output=True)
    (other,) = tmp_path.glob("*.whl")
    installed.writable(True)
    if first:
        installed.pip("uninstall", "-y", "levbench")
    for file in (other, wheel) if first else (other,):
        installed.pip("install", "--no-index", "--no-deps", "--no-compile", str(file))
    for words in (("--version",), ("list",)):
        done = installed("bench", *words)
        assert done.returncode == 2
        assert "package `bench`: found files of bench 2.8 among ours" in done.stderr
        assert "Traceback" not in done.stderr
