"""The guide to Python and the notebook, executed as they stand, in a folder with the run that they ask for."""

from __future__ import annotations

import ast
import json
import re
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
from matplotlib import pyplot as plt

from bench.cli.__main__ import main

ROOT = Path(__file__).parent.parent.parent
GUIDE = (ROOT / "docs/how-to/use-from-python.md").read_text(encoding="utf-8")
NOTEBOOK = json.loads((ROOT / "examples/orbit.ipynb").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the run of the guide in it, and no window for figures."""
    path = tmp_path_factory.mktemp("notebook")
    (command,) = re.findall(r"```console\nbench (.*?)\n```", GUIDE)
    assert main([*shlex.split(command), "--out", str(path / "runs")]) == 0
    mpl.use("Agg")
    yield path
    plt.close("all")


def shown(blocks: Sequence[str]) -> list[Any]:
    """Execute blocks one after the other in one namespace; the value of each one's last line, as a notebook shows it."""
    names: dict[str, Any] = {}
    found = []
    for block in blocks:
        tree = ast.parse(block)
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, "<block>", "exec"), names)
        found.append(
            eval(compile(ast.Expression(last.value), "<block>", "eval"), names) if isinstance(last, ast.Expr) else None
        )
    return found


def test_the_guide_works(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    blocks = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
    assert len(blocks) == 6
    found = shown(blocks)
    assert (folder / "orbit.png").stat().st_size > 10_000
    assert len(found[-1]) == 4  # two bearings at two speeds


def test_the_notebook_works_and_holds_no_outputs(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    cells = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)
    run, results, *_, same, runs = shown(["".join(cell["source"]) for cell in cells])
    assert "unbalance on amb5dof, simulated, seed 1: PASS" in run._repr_html_()
    assert len(results) == 4
    assert same is True
    assert len(runs) == 1
