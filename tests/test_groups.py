"""Groups of tests for xdist name tests that there are, and the scheduler keeps a group together."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import groups
import pytest

ROOT = Path(__file__).parent.parent


def test_every_part_names_something() -> None:
    assert {groups.REAL_TIME, groups.PATIENT} <= {*groups.GROUPS}
    parts = [part for parts in groups.GROUPS.values() for part in parts]
    for name in groups.COMPUTED:
        file, _, test = name.partition("::")
        assert f"def {test}" in (ROOT / file).read_text(encoding="utf-8"), name
    for part in (*parts, *(name for name in groups.FIRST if name not in groups.GROUPS)):
        file, _, page = part.partition("::test_commands_work")
        if page:
            assert list((ROOT / "docs").rglob(f"{page.strip('[]')}.md")), part
        else:
            assert list(ROOT.glob(f"{file}*")), part


@pytest.mark.parametrize(
    ("nodeid", "group"),
    [
        ("tests/firmware/test_line_drivers.py::test_x", "real-time"),
        ("tests/links/test_killed.py::test_a_killed_rig_is_noticed", "real-time"),
        ("tests/links/test_chain.py::test_equal_results[slcan:socket]", "patient"),
        ("tests/links/test_own_controller.py::test_x[1]", "tests/links/test_own_controller.py"),
        ("tests/links/test_protection_trips.py::test_each_protected_reading_of_the_served_rig_trips[a]", "real-time"),
        (
            "tests/links/test_protection_trips.py::test_each_protected_reading_trips_and_the_machine_is_safe[a]",
            "tests/links/test_protection_trips.py",
        ),
        ("tests/drivers/test_heartbeat_alone.py::test_x[1]", "real-time"),
        ("tests/test_docs.py::test_commands_work[connect-a-rig]", "real-time"),
        ("tests/test_docs.py::test_commands_work[force-coupling]", "chained pages"),
        ("tests/test_docs.py::test_commands_work[slew]", "tests/test_docs.py::test_commands_work[slew]"),
        ("tests/test_docs.py::test_links_lead_somewhere", "tests/test_docs.py"),
        ("tests/sim/test_truth.py::test_x[a::b]", "tests/sim/test_truth.py"),
    ],
)
def test_the_group_of_a_test(nodeid: str, group: str) -> None:
    assert groups.group_of(nodeid) == group


def test_a_group_runs_on_one_worker(tmp_path: Path) -> None:
    """In a session of its own: the tests of `firmware` on one worker, in their order, whatever the others do."""
    (tmp_path / "pyproject.toml").write_text("[tool.pytest.ini_options]\n")
    (tmp_path / "conftest.py").write_text((ROOT / "tests" / "conftest.py").read_text())
    (tmp_path / "groups.py").write_text((ROOT / "tests" / "groups.py").read_text())
    (tmp_path / "tests" / "firmware").mkdir(parents=True)
    many = "import pytest\n@pytest.mark.parametrize('k', range(8))\ndef test_{}(k): pass\n"
    (tmp_path / "tests" / "firmware" / "test_a.py").write_text(many.format("a"))
    (tmp_path / "tests" / "test_b.py").write_text(many.format("b"))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-v", "-n", "2", "--dist", "loadgroup", "-p", "no:cacheprovider",
         "-p", "no:hypothesispytest"], cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    lines = [line.split() for line in done.stdout.splitlines() if "PASSED" in line]
    of_one = [words for words in lines if "firmware" in words[-1]]
    assert len(lines) == 16
    assert len({words[0] for words in of_one}) == 1
    assert [words[-1][-2] for words in of_one] == list("01234567")


def test_what_keeps_up_with_wall_time_goes_first_and_is_not_given_less_of_the_processor(tmp_path: Path) -> None:
    """On two workers in a session of its own: files with more tests come after those in real time, and give way."""
    (tmp_path / "pyproject.toml").write_text("[tool.pytest.ini_options]\n")
    for name in ("conftest.py", "groups.py"):
        (tmp_path / name).write_text((ROOT / "tests" / name).read_text())
    base = os.nice(0)
    yields = max(base, groups.NICE)
    test = "import os, pytest\n@pytest.mark.parametrize('k', range({}))\ndef test_{}(k): assert os.nice(0) == {}\n"
    files = (("firmware/test_a", 4, base), ("links/test_b", 3, base), ("links/test_chain", 2, base),
             ("sim/test_c", 40, yields), ("wire/test_d", 30, yields))  # fmt: skip
    for name, count, nice in files:
        path = tmp_path / "tests" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(test.format(count, path.stem, nice))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n", "2", "--dist", "loadgroup", "-p", "no:cacheprovider",
         "-p", "no:hypothesispytest"], cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert "79 passed" in done.stdout
