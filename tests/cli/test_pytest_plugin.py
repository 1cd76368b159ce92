"""The pytest options as an installed plug-in: from any folder, and of no consequence to other projects."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

from packages import install, small

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = {"pytest11": {"levbench": "bench.cli.pytest_plugin"}}


def session(folder: Path, *arguments: str, cwd: Path | None = None) -> tuple[int, str]:
    """pytest as a process in `folder`, with the plug-in installed in `folder`/site: exit status and output."""
    if not (site := folder / "site").exists():
        install(site, "levbench-installed", PLUGIN, {})
    paths = os.pathsep.join([str(site), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *arguments], cwd=cwd or folder, text=True,
        env={**os.environ, "PYTHONPATH": paths}, capture_output=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


CONFTEST = """
def pytest_addoption(parser):
    for name in ("--rig", "--seed", "--plan", "--out", "--backend"):
        parser.addoption(name, default="theirs")
"""


def test_another_projects_options_stay_its_own(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_theirs.py").write_text(
        "import sys\n"
        "def test_theirs(request):\n"
        "    got = [request.config.getoption(f'--{n}') for n in ('rig', 'seed', 'plan', 'out', 'backend')]\n"
        "    assert got == ['oil', 'theirs', 'a', 'theirs', 'theirs']\n"
        "    assert not [m for m in sys.modules if m.startswith(('numpy', 'pydantic', 'bench.catalogue', 'bench.cli.suite'))]\n"
    )
    (tmp_path / "pytest.ini").write_text(
        "[pytest]\naddopts = --strict-markers --strict-config\nfilterwarnings = error\n"
    )
    status, out = session(tmp_path, "--rig", "oil", "--plan=a")
    assert (status, "1 passed" in out) == (0, True), out
    assert "levbench:" not in out


def test_a_session_without_a_rig_has_none_of_the_options(tmp_path: Path) -> None:
    (tmp_path / "test_theirs.py").write_text(
        "def test_theirs(pytestconfig): assert 'levbench_seed' not in pytestconfig.option\n"
    )
    assert session(tmp_path)[0] == 0
    status, out = session(tmp_path, "--seed", "3")
    assert status == 4
    assert "unrecognized arguments: --seed" in out
    assert "procedures on a rig: pytest --rig RIG" in session(tmp_path, "--help")[1]


def test_a_seed_that_is_none_is_refused_before_anything_is_collected(tmp_path: Path) -> None:
    for option, text in (("--seed", "-3"), ("--visit", "1.5"), ("--seed", str(2**63))):
        status, out = session(tmp_path, "--rig", "tsbs12", f"{option}={text}")
        assert status == 4, out
        assert f"argument {option}: found '{text}'; expected a whole number from 0 to" in out


def test_a_file_is_collected_and_run_from_any_folder(tmp_path: Path) -> None:
    (tmp_path / "look.py").write_text(small("look-here") + "\ndef test_never(): raise ValueError\n")
    status, out = session(tmp_path, "look.py", "--rig", "tsbs12", "--no-report", "--seed", "3", "--junitxml=j.xml",
                          "--strict-markers", "--adopt", "--calibrations=known")  # fmt: skip
    assert (status, "1 passed" in out) == (0, True), out
    suite = ElementTree.parse(tmp_path / "j.xml").getroot().find("testsuite")
    assert suite is not None
    named = {p.get("name"): p.get("value") for p in suite.iter("property")}
    assert (named["levbench.seed"], named["outcome"]) == ("3", "done")
    assert (tmp_path / "known" / "sim-3" / "look-here.json").is_file()


def test_an_option_that_is_taken_goes_by_a_longer_name(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(
        "def pytest_addoption(parser): parser.addoption('--seed', default='theirs')\n"
    )
    (tmp_path / "look.py").write_text(small("look-here"))
    status, out = session(
        tmp_path, "look.py", "--rig", "tsbs12", "--no-report", "--levbench-seed=5", "--junitxml=j.xml"
    )
    assert status == 0, out
    assert "levbench: another plug-in has --seed; here: --levbench-NAME" in out
    assert 'name="levbench.seed" value="5"' in (tmp_path / "j.xml").read_text()


def test_a_file_that_cannot_be_is_one_message(tmp_path: Path) -> None:
    (tmp_path / "look.py").write_text(small("spindown"))
    status, out = session(tmp_path, "look.py", "--rig", "tsbs12")
    assert status == 2, out
    expected = "procedure 'spindown' is taken twice: found levbench (procedures.spindown.procedure) and the file"
    assert expected in " ".join(out.split())
    assert "Traceback" not in out


def test_without_a_path_it_is_the_catalogue(tmp_path: Path) -> None:
    """Ours in the order of the chain, then those of packages; what cannot be loaded is an error of its own item."""
    (tmp_path / "test_theirs.py").write_text("def test_never(): raise ValueError\n")
    install(tmp_path / "site", "levbench-installed", PLUGIN, {})
    install(tmp_path / "site", "lev-look", {"levbench.procedures": {"look-out": "lev_look:procedure"}},
            {"lev_look": small("look-out")})  # fmt: skip
    install(tmp_path / "site", "lev-bad", {"levbench.procedures": {"bad": "lev_bad:procedure"}}, {"lev_bad": "1 / 0"})
    status, out = session(tmp_path, "--rig", "tsbs12", "--no-report", "-k", "look-out or bad", "-v")
    assert status == 1, out
    assert "levbench::look-out PASSED" in out
    assert "levbench::bad ERROR" in out
    assert (
        "procedure 'bad' of lev-bad 1.2 (lev_bad:procedure) cannot be loaded: ZeroDivisionError in lev_bad.py:1" in out
    )
    assert "1 passed" in out
    assert "Traceback" not in out


def test_a_rig_that_is_none_is_a_usage_error(tmp_path: Path) -> None:
    status, out = session(tmp_path, "--rig", "no-such-rig")
    assert status == 4
    assert "ERROR: unknown rig 'no-such-rig'" in out


def test_in_a_clone_it_is_not_registered_twice(tmp_path: Path) -> None:
    status, out = session(tmp_path, "procedures/spindown", "--rig", "tsbs12", "--collect-only", "-q", cwd=ROOT)
    assert status == 0, out
    assert "procedures/spindown/procedure.py::spindown" in out
