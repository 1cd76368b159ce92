"""Lines that the standard library understands: the library that knows all lines understands and answers them the same."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
import typer
from hypothesis import given, settings
from hypothesis import strategies as st
from made_histories import record

from bench.cli import plain, start
from bench.cli.__main__ import app, main

RARE = {"weight", "baseline", "figure"}
"""Options that are left to the library."""
WORDS = {
    "--procedure": ("amb-calibration", "step", "amb-calibratoin"), "--rig": ("tsbs12", "tsbs-12", "é", "-x"),
    "--machine": ("real", "served", "simulated", "virtual", ""), "--last": ("1", "2", "40", "0", "-1", "x", "1_0", " 3", "٣"),
    "--show": ("K_i", "K", "Q"), "--seed": ("3", "4", "-1", "1.5"), "--lambda": ("0.4", "2"), "--figure": ("trend.png",),
}  # fmt: skip
FLAGS = ("--failed", "--json", "--help", "--jsno", "stray", "--last=2", "--", "-v")


def words(likely: Sequence[str]) -> st.SearchStrategy[list[str]]:
    """Lines of options with their values, most of them right."""
    right = [[name, value] for name in likely if name in WORDS for value in WORDS[name][:2]]
    right += [[name] for name in likely if name not in WORDS]
    wrong = [[name, value] for name, values in WORDS.items() for value in values] + [
        [name] for name in (*FLAGS, *WORDS)
    ]
    one = st.one_of(*[st.sampled_from(right)] * 4, st.sampled_from(wrong))
    return st.lists(one, max_size=4).map(lambda parts: [word for part in parts for word in part])


RUNS = words(("--procedure", "--rig", "--machine", "--last", "--show", "--failed", "--json"))
TREND = words(("--procedure", "--rig", "--machine", "--last", "--seed", "--json"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("runs")
    for k in range(12):
        record(root, k, 75 + k / 7, seed=(None, 3, 4)[k % 3], served=k % 6 == 0)
    return root


def ended(begin: object, line: Sequence[str]) -> tuple[int, str, str]:
    assert callable(begin)
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        status = begin(line)
    return status, out.getvalue(), err.getvalue()


@settings(max_examples=120)
@given(RUNS)
def test_runs_ends_as_the_library_has_it(folder: Path, line: list[str]) -> None:
    whole = ["runs", "--out", str(folder), *line]
    assert ended(start.main, whole) == ended(main, whole)


@settings(max_examples=60)
@given(st.sampled_from(["K_i", "K", "Q", "-K", ""]), TREND)
def test_trend_ends_as_the_library_has_it(folder: Path, quantity: str, line: list[str]) -> None:
    whole = ["trend", quantity, "--out", str(folder), *line]
    assert ended(start.main, whole) == ended(main, whole)


def test_what_is_typed_most_often_is_understood(folder: Path) -> None:
    runs = (
        "",
        "--last 20",
        "--show K_i --show K_o",
        "--json --show K_i",
        "--procedure step --rig tsbs12 --failed --machine real",
    )
    trend = ("", "--rig tsbs12 --procedure step", "--machine served --last 40", "--seed 3 --json")
    for line in (*(f"runs {x}" for x in runs), *(f"trend K_i {x}" for x in trend)):
        assert plain.plain(line.split()) is not None, line
    for line in (
        "list",
        "run step --rig tsbs12",
        "runs --help",
        "runs --lats 3",
        "trend",
        "trend --json",
        "trend K_i --lambda 0.4",
    ):
        assert plain.plain(line.split()) is None, line


@pytest.mark.parametrize(("command", "known"), [("runs", plain.OF_RUNS), ("trend", plain.OF_TREND)])
def test_every_option_is_known_or_left_to_the_library(command: str, known: dict[str, tuple[str, object]]) -> None:
    whole = typer.main.get_command(app)
    declared = {p.name: p for p in whole.commands[command].params if p.param_type_name == "option"}  # type: ignore[attr-defined]
    assert {name for name, _ in known.values()} == set(declared) - RARE
    for option, (name, read) in known.items():
        assert option in declared[name].opts
        assert (read is None) == declared[name].is_flag


def test_a_reader_that_has_seen_enough_is_no_error(tmp_path: Path) -> None:
    """As `head`. Thirty lines of 300 characters are more than is written at once."""
    folder = tmp_path / ("d" * 250)
    for k in range(30):
        record(folder, k, 75.0)
    reading, writing = os.pipe()
    os.close(reading)
    for begin in ("from bench.cli.start import main", "from bench.cli.__main__ import main"):
        script = f"import sys; {begin}; sys.exit(main(sys.argv[1:]))"
        line = [sys.executable, "-c", script, "runs", "--out", str(folder)]
        done = subprocess.run(line, stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
    os.close(writing)
