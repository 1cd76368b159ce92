"""One bench per rig."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from bench.errors import ConfigError
from bench.lock import lock_path, rig_lock

HOLD = """
import sys
from pathlib import Path
from bench.lock import rig_lock
with rig_lock("tsbs12", Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_bench_is_told_who_holds_the_rig_and_since_when(tmp_path: Path) -> None:
    told = pytest.raises(ConfigError, match=r"in use by .* process \d+, since 20.* UTC")
    with rig_lock("tsbs12", tmp_path), told, rig_lock("tsbs12", tmp_path):
        pass


def test_another_rig_is_free(tmp_path: Path) -> None:
    with rig_lock("tsbs12", tmp_path), rig_lock("tsbs13", tmp_path):
        pass


def test_the_lock_is_free_after_the_block(tmp_path: Path) -> None:
    for _ in range(2):
        with rig_lock("tsbs12", tmp_path):
            pass


def test_the_kernel_frees_the_lock_of_a_killed_process(tmp_path: Path) -> None:
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with child:
        assert child.stdout is not None
        assert child.stdout.readline() == "held\n"
        with pytest.raises(ConfigError, match=f"process {child.pid}"), rig_lock("tsbs12", tmp_path):
            pass
        child.send_signal(signal.SIGKILL)
        child.wait()
        with rig_lock("tsbs12", tmp_path):
            pass


def test_names_that_look_alike_in_a_file_name_are_different_locks() -> None:
    assert lock_path("rig a") != lock_path("rig-a")


def test_an_unusable_folder_is_a_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="cannot be opened"), rig_lock("tsbs12", tmp_path / "file"):
        pass
