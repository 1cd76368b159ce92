"""`bench` as a process of its own: signals on a line it prints, kill, full disk, imports, and pytest as the runner."""

from __future__ import annotations

import json
import os
import pty
import resource
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from bench.recording import Recording

ROOT = Path(__file__).resolve().parents[2]
RUN = ("run", "tiny-levitated", "--rig", "tsbs12", "--no-report")


def environment() -> dict[str, str]:
    paths = [str(ROOT / "tests" / "cli"), str(ROOT), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p)}


def start(tmp_path: Path, *arguments: str, **options: Any) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "tiny_catalogue", *arguments], cwd=tmp_path, env=environment(), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options,
    )  # fmt: skip


def read_to(child: subprocess.Popen[str], beginning: str) -> str:
    """The first line of standard error that begins so."""
    assert child.stderr is not None
    for line in child.stderr:
        if line.startswith(beginning):
            return line
    raise AssertionError(f"the child ended without a line {beginning!r}")


def record_in(tmp_path: Path) -> tuple[Path, dict[str, Any]]:
    (path,) = (tmp_path / "runs").glob("*/record.json")
    return path.parent, json.loads(path.read_text())


def test_a_terminal_that_closes_makes_the_rig_safe(tmp_path: Path) -> None:
    """As a connection over ssh that is lost: SIGHUP, and nothing that is written goes anywhere any more."""
    code = [sys.executable, "-m", "tiny_catalogue", *RUN, "--plan", "seconds=3600.0"]
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(tmp_path)
        os.execve(sys.executable, code, environment())
    seen = b""
    while b"acquire" not in seen:
        seen += os.read(terminal, 4096)
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 4, seen
    directory, record = record_in(tmp_path)
    assert [f["text"] for f in record["findings"]] == ["stopped by SIGHUP"]
    recording: Recording[Any] = Recording.open(directory / "recording.mcap")
    assert [e["name"] for e in recording.events("command")][-2:] == ["LAND", "DISABLE"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_lands_the_rotor_and_a_second_one_changes_nothing(tmp_path: Path, number: signal.Signals) -> None:
    with start(tmp_path, *RUN, "--plan", 'act="count"') as child:
        read_to(child, "at ")
        child.send_signal(number)
        read_to(child, "make safe")
        child.send_signal(signal.SIGTERM)
        out, err = child.communicate()
    assert child.returncode == 4
    assert "Traceback" not in err
    directory, record = record_in(tmp_path)
    assert (tmp_path / out.strip()).resolve() == directory.resolve()
    assert record["outcome"] == "ABORTED"
    assert [f["code"] for f in record["findings"]] == ["signal"]
    assert number.name in record["findings"][0]["text"]
    recording: Recording[Any] = Recording.open(directory / "recording.mcap")
    assert not recording.truncated
    assert [e["name"] for e in recording.events("command")][-2:] == ["LAND", "DISABLE"]


def test_what_a_killed_run_leaves_behind(tmp_path: Path) -> None:
    with start(tmp_path, *RUN, "--plan", 'act="count"') as child:
        for _ in range(10):
            line = read_to(child, "at ")
        child.kill()
        child.communicate()
    directory, record = record_in(tmp_path)
    assert record["outcome"] == "ERROR"
    assert [f["code"] for f in record["findings"]] == ["unfinished"]
    recording: Recording[Any] = Recording.open(directory / "recording.mcap")
    assert recording.truncated
    *_, last = recording.blocks("telemetry")
    assert last.t_ns[-1] >= int(line.split()[1]) - 1_000_000_000
    with start(tmp_path, "analyse", str(directory)) as child:
        _, err = child.communicate()
    assert child.returncode == 3
    assert "recording-truncated" in err


def test_a_full_disk_ends_the_run_with_the_machine_safe(tmp_path: Path) -> None:
    def small_files() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))

    with start(tmp_path, *RUN, "--plan", "seconds=20.0", preexec_fn=small_files) as child:
        _, err = child.communicate()
    assert child.returncode == 3, err
    assert "Traceback" not in err
    directory, record = record_in(tmp_path)
    assert record["outcome"] == "ERROR"
    assert "recording-failed" in [f["code"] for f in record["findings"]]
    assert "make-safe-failed" not in [f["code"] for f in record["findings"]]
    log = (directory / "run.log").read_text()
    assert log.index("recording stopped") < log.index("make safe: switch the amplifiers off")


WITHOUT_SIMULATOR = """
import sys
class Refuse:
    def find_spec(self, name, *_):
        if name.partition(".")[0] == "sim_backend":
            raise ImportError("the simulator is not there")
sys.meta_path.insert(0, Refuse())
import tiny_catalogue
tiny_catalogue.pytest_configure()
sys.exit(tiny_catalogue.main(sys.argv[1:]))
"""


def test_a_stored_run_is_analysed_without_the_simulator(tmp_path: Path) -> None:
    with start(tmp_path, *RUN) as child:
        child.communicate()
    directory, record = record_in(tmp_path)
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_SIMULATOR, "analyse", str(directory)], cwd=tmp_path, env=environment(),
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    again = json.loads((Path(done.stdout.strip()) / "record.json").read_text())
    assert again["measurements"] == record["measurements"]


# Not pydantic: typer itself imports it, where it is installed, to convert arguments.
HEAVY = ("numpy", "scipy", "pandas", "matplotlib", "mcap", "cantools", "cffi", "pyarrow")


@pytest.mark.parametrize("command", ["--help", "list"])
def test_help_and_list_import_nothing_heavy(command: str) -> None:
    code = (
        "import sys; from bench.cli.__main__ import main; status = main(sys.argv[1:]); "
        f"print([m for m in {HEAVY!r} if m in sys.modules]); sys.exit(status)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, command], cwd=ROOT, env=environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"


def pytest_on(tmp_path: Path, *arguments: str) -> tuple[int, str, ElementTree.Element]:
    """pytest with the small procedure in a fresh process: exit status, output, JUnit suite."""
    junit = tmp_path / "junit.xml"
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "tiny_catalogue", "tests/tiny_procedures.py", f"--junitxml={junit}",
         "-p", "no:cacheprovider", "-p", "no:hypothesispytest", f"--out={tmp_path / 'runs'}", *arguments],
        cwd=ROOT, env=environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    suite = ElementTree.parse(junit).getroot().find("testsuite")
    assert suite is not None
    return done.returncode, done.stdout, suite


@pytest.mark.parametrize(
    ("plan", "status", "counts"),
    [('act="measure"', 0, ("1", "0", "0")), ('then="doubt"', 1, ("1", "1", "0")), ('act="refuse"', 1, ("1", "0", "1"))],
)
def test_pytest_asks_whether_the_machine_is_right(
    tmp_path: Path, plan: str, status: int, counts: tuple[str, str, str]
) -> None:
    found, output, suite = pytest_on(tmp_path, "--rig", "tsbs12", "--no-report", "--seed", "2", "--plan", plan)
    assert found == status, output
    assert tuple(suite.get(k) for k in ("tests", "failures", "errors")) == counts
    of_suite = {p.get("name"): p.get("value") for p in suite.findall("properties/property")}
    assert of_suite["levbench.rig"] == "tsbs12"
    assert of_suite["levbench.seed"] == "2"
    of_item = {p.get("name"): p.get("value") for p in suite.findall("testcase/properties/property")}
    assert of_item["supply.unit"] == "V"
    assert Path(str(of_item["run"])).is_dir()
    if status == 0:
        assert float(str(of_item["supply.value"])) == pytest.approx(148, abs=2)
    assert "Traceback" not in output


def test_pytest_adopts_what_passes(tmp_path: Path) -> None:
    known = tmp_path / "known"
    found, output, _ = pytest_on(tmp_path, "--rig", "tsbs12", "--no-report", "--adopt", f"--calibrations={known}")
    assert found == 0, output
    assert [p.relative_to(known).as_posix() for p in known.rglob("*.json")] == ["sim-0/tiny-levitated.json"]


def test_pytest_collects_no_procedure_without_a_rig(tmp_path: Path) -> None:
    found, output, suite = pytest_on(tmp_path)
    assert found == 5, output
    assert suite.get("tests") == "0"
