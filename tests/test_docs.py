"""The console blocks of the documentation, executed page by page, in order, in a folder of their own.

Pages of procedures that build on others begin with the same runs and adoptions. What such a sequence of commands leaves in a
fresh folder is kept for the session: the next page with the same beginning goes on from a copy. Every distinct sequence
is executed once in every session; under xdist these pages are one group (`groups.py`).
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
PAGES = sorted(p for p in (ROOT / "docs").rglob("*.md") if "```console" in p.read_text(encoding="utf-8"))
CHAIN = re.compile(r'RUN=\$\(bench run [^\\]*\| tail -1\)|bench adopt "\$RUN" [^\\]*')
"""A command on one line that leaves nothing but files and the variable RUN."""


LONG = ("force-map", "model", "run-a-campaign", "sensitivity", "step", "tracking")
"""Pages whose commands take more than ten seconds."""


def test_there_are_pages_to_execute() -> None:
    assert len(PAGES) >= 4
    assert {*LONG} <= {page.stem for page in PAGES}


def commands(page: Path) -> tuple[tuple[str, ...], list[str]]:
    """The lines of its beginning that build up a chain, and the other lines."""
    text = "\n".join(re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))
    lines = text.splitlines()
    chain = tuple(takewhile(CHAIN.fullmatch, lines))
    return chain, lines[len(chain) :]


def shell(lines: list[str], folder: Path) -> str:
    """Execute them as one script; standard output."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    script = "\n".join(["set -euo pipefail", *lines])
    done = subprocess.run(["bash", "-c", script], cwd=folder, env={**os.environ, "PATH": path}, capture_output=True,
                          text=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@dataclass
class Chains:
    """What sequences of commands left in a fresh folder, and in RUN."""

    root: Path
    made: dict[tuple[str, ...], tuple[Path, str]] = field(default_factory=dict)

    def after(self, lines: tuple[str, ...]) -> tuple[Path, str]:
        """The folder, which must stay as it is, and RUN after these lines; a beginning that is known is not executed again."""
        if lines not in self.made:
            self.made[lines] = self._executed(lines)
        return self.made[lines]

    def _executed(self, lines: tuple[str, ...]) -> tuple[Path, str]:
        folder = Path(tempfile.mkdtemp(dir=self.root))
        if not lines:
            return folder, ""
        before, run = self.after(lines[:-1])
        shutil.copytree(before, folder, dirs_exist_ok=True)
        out = shell([f"RUN={shlex.quote(run)}", lines[-1], 'printf "\\n%s" "$RUN"'], folder)
        return folder, out.rpartition("\n")[2]


@pytest.fixture(scope="session")
def chains(tmp_path_factory: pytest.TempPathFactory) -> Chains:
    return Chains(tmp_path_factory.mktemp("chains"))


def case(page: Path) -> Any:
    return pytest.param(page, id=page.stem, marks=[pytest.mark.long] if page.stem in LONG else [])


@pytest.mark.timeout(180)
@pytest.mark.parametrize("page", [case(page) for page in PAGES])
def test_commands_work(page: Path, tmp_path: Path, chains: Chains) -> None:
    chain, lines = commands(page)
    if chain:
        folder, run = chains.after(chain)
        shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
        lines = [f"RUN={shlex.quote(run)}", *lines]
    shell(lines, tmp_path)


def test_links_lead_somewhere() -> None:
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"
