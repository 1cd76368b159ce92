"""Completion as shells do it: the script is taken up, and what a key would offer is asked for."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bench import catalogue
from bench.cli import completing, schemas
from bench.cli.__main__ import app
from bench.cli.completion import commands_of

ASK = """eval "$(bench completion bash)"
COMP_WORDS=({words}) COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
_bench
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


def offered(words: str, folder: Path) -> list[str]:
    """What bash would offer after these words, of which the last is begun."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(["bash", "-c", ASK.format(words=words)], cwd=folder, env={**os.environ, "PATH": path},
                          capture_output=True, text=True, check=True)  # fmt: skip
    assert done.stderr == ""
    return done.stdout.split("\n")[:-1] if done.stdout.strip() else []


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("bench se", ["serve"]),
        ("bench run unbal", ["unbalance"]),
        ("bench run step --back", ["--backend"]),
        ("bench run step --backend ''", ["sim", "live"]),
        ("bench run step --rig tsbs12-d", ["tsbs12-drag"]),
        ("bench check amb5", ["amb5dof"]),
        ("bench campaign spindle", ["spindle-motion", "spindle-rundown"]),
        ("bench export --to m", ["mcap", "mdf"]),
        ("bench serve mine", ["mine"]),
        ("bench run step --spec ''", []),
        ("bench completion z", ["zsh"]),
        ("bench schema plan-unb", ["plan-unbalance"]),
        ("bench runs --procedure unbal", ["unbalance"]),
        ("bench trend K_i --rig tsbs12-d", ["tsbs12-drag"]),
        ("bench trend ''", []),
    ],
)
def test_bash_offers_what_fits(words: str, expected: list[str], tmp_path: Path) -> None:
    (tmp_path / "rigs").mkdir()
    (tmp_path / "rigs" / "mine.toml").write_text("schema = 2\n")
    assert offered(words, tmp_path) == expected


def test_runs_are_offered_the_newest_first(tmp_path: Path) -> None:
    for name in (
        "step-20260101T000000Z-0000",
        "unbalance-20260301T000000Z-0001",
        "listen-20260401T000000Z-0001",
        "mine",
    ):
        (tmp_path / "runs" / name).mkdir(parents=True)
    found = ["runs/unbalance-20260301T000000Z-0001", "runs/step-20260101T000000Z-0000"]
    for words in ("bench report ''", "bench run --continue ''", "bench compare runs/s ''"):
        assert list(dict.fromkeys(offered(words, tmp_path))) == found


def test_quantities_are_those_that_were_measured(tmp_path: Path) -> None:
    from tests.test_index import measuring

    measuring(tmp_path / "runs", 1, 71.0)
    for words in ("bench trend K", "bench runs --show K"):
        assert offered(words, tmp_path) == ["K_i"]
    assert offered("bench trend B", tmp_path) == ["B", r"B@by\ the\ channel"]  # one word of the shell each
    (tmp_path / "runs" / "amb-calibration-20260101T000002Z-3f2a").mkdir()  # what it cannot read is told elsewhere
    assert offered("bench trend K", tmp_path) == ["K_i"]
    (tmp_path / "runs" / "index.sqlite").unlink()
    (tmp_path / "runs" / "index.sqlite").mkdir()  # as in a folder that cannot be written: records are read instead
    assert offered("bench trend K", tmp_path) == ["K_i"]


def test_every_procedure_and_command_is_known(tmp_path: Path) -> None:
    assert offered("bench run ''", tmp_path) == [entry.name for entry in catalogue.PROCEDURES]
    assert set(offered("bench ''", tmp_path)) >= {command.name for command in commands_of(app)}


def test_every_schema_is_known() -> None:
    assert list(completing.kinds()) == schemas.kinds()


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_take_their_script(shell: str) -> None:
    """As far as their programs are here: without them the script is looked at alone."""
    done = subprocess.run(
        [sys.executable, "-m", "bench.cli", "completion", shell], capture_output=True, text=True, check=True
    )
    assert "bench _complete RIG" in done.stdout
    if shutil.which(shell):
        taken = subprocess.run(
            [shell, "-n", "/dev/stdin"], input=done.stdout, capture_output=True, text=True, check=False
        )
        assert (taken.returncode, taken.stderr) == (0, "")


def test_an_unknown_shell_is_refused() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bench.cli", "completion", "cmd"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "found shell 'cmd'; expected one of bash, zsh, fish" in done.stderr


def test_a_key_loads_no_command_line() -> None:
    """Only names of files are read: neither typer nor numpy is waited for."""
    script = (
        "import sys; from bench.cli.start import main; main(['_complete', 'RIG']); "
        "print(sorted({'typer', 'numpy', 'pydantic', 'rich'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert "tsbs12" in done.stdout


def test_nothing_is_offered_for_a_kind_that_is_none() -> None:
    script = "import sys; from bench.cli.start import main; sys.exit(main(['_complete', 'NOTHING']))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")
