"""The console blocks of the documentation, executed page by page, in order, in a folder of their own.

The default run executes the guides that are quick and pages of each machine, `make ci-long` those that are `LONG`, and
`make longer` what only runs a procedure whose figures are `DRAWN` elsewhere. Commands, options and plans of all pages are
checked by default, without starting one.

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
import tomllib
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

import pytest
import typer

from bench import catalogue
from bench.cli.__main__ import app
from bench.cli.loading import load_procedure
from bench.procedure import plans
from bench.rigfile import load_rig

ROOT = Path(__file__).parent.parent
TREE = ("add-a-procedure", "add-a-machine", "add-a-package")
"""Guides that add to the tree itself, in the order in which they are executed, in one scratch copy of it."""
PAGES = sorted(
    p for p in (ROOT / "docs").rglob("*.md") if "```console" in p.read_text(encoding="utf-8") and p.stem not in TREE
)
REFUSED = re.compile(r"\|\| (true|test \$\? -eq 2)")
RIGS = [path.stem for path in (ROOT / "rigs").glob("*.toml")]
CHAIN = re.compile(r'RUN=\$\(bench run [^\\]*\| tail -1\)|bench adopt "\$RUN" [^\\]*')
"""A command on one line that leaves nothing but files and the variable RUN."""
BLOCK = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", re.DOTALL | re.MULTILINE)
END_OF_FILE = "END_OF_FILE"
COPIED = ("bench", "drivers", "procedures", "reports", "sim_backend", "rigs", "specs", "campaigns", "examples",
          "pyproject.toml", ".importlinter")  # fmt: skip
"""What a clone has that these guides use."""


LONG = (
    "add-a-device", "adopt-a-calibration", "amb-calibration", "angle-step", "balance", "bearing-model", "change-a-plan",
    "coast-down", "compare", "compensation", "connect-a-rig", "connect-a-stage", "current-step", "first-calibration",
    "force-constant", "force-coupling", "inject-faults", "lift-off", "maximum-speed", "model", "negative-stiffness",
    "run-a-campaign", "run-up", "sensitivity", "slew", "spindown", "step", "torque-constant", "tracking", "trend",
    "use-in-ci", "watch-a-run",
)  # fmt: skip
"""Pages that take long, or that only run a procedure: by default `tests/procedures` takes each through its whole path and
draws its figures, and `tests/cli` the same commands with their reports and calibrations."""
DRAWN = (
    "actuator-constant", "axis-breakaway", "axis-friction", "bearing-constant", "cogging-map", "coil-map", "force-map",
    "inductance-map", "load-balancing", "loop-response", "map-zero", "mission", "static-characteristics", "unbalance",
)  # fmt: skip
"""Pages that only run a procedure, for a quarter of a minute and more. `tests/procedures` takes each through its whole path and
draws the figures of its report; `make longer` executes the commands themselves."""


def test_there_are_pages_to_execute() -> None:
    assert len(PAGES) >= 4
    assert {*LONG, *DRAWN} <= {page.stem for page in PAGES}
    assert not {*LONG} & {*DRAWN}
    assert {*DRAWN} <= {entry.name for entry in catalogue.PROCEDURES}


def commands(page: Path) -> tuple[tuple[str, ...], list[str]]:
    """The lines of its beginning that build up a chain, and the other lines."""
    text = "\n".join(re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))
    lines = text.splitlines()
    chain = tuple(takewhile(CHAIN.fullmatch, lines))
    return chain, lines[len(chain) :]


def bench_commands(page: Path) -> list[tuple[list[str], bool]]:
    """What its console blocks give to `bench`, word by word, and whether it is meant to start."""
    text = "\n".join(re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))
    found = []
    for line in text.replace("\\\n", " ").splitlines():
        if not re.search(r"\bbench ", line):
            continue
        lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
        lexer.whitespace_split = True
        words = list(lexer)
        for k in (k for k, word in enumerate(words) if word == "bench"):
            end = takewhile(lambda word: not set(word) <= set("();<>|&"), words[k + 1 :])
            found.append((list(end), not REFUSED.search(line)))
    return found


def shell(lines: list[str], folder: Path, **variables: str) -> str:
    """Execute them as one script, with more variables in its environment; standard output."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    script = "\n".join(["set -euo pipefail", *lines])
    done = subprocess.run(["bash", "-c", script], cwd=folder, env={**os.environ, "PATH": path, **variables},
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 0, (done.stdout + done.stderr)[-2000:]
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
    marks = (
        [pytest.mark.long]
        if page.stem in LONG
        else [pytest.mark.long, pytest.mark.longer]
        if page.stem in DRAWN
        else []
    )
    return pytest.param(page, id=page.stem, marks=marks)


@pytest.mark.timeout(600)
@pytest.mark.parametrize("page", [case(page) for page in PAGES])
def test_commands_work(page: Path, tmp_path: Path, chains: Chains) -> None:
    chain, lines = commands(page)
    if chain:
        folder, run = chains.after(chain)
        shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
        lines = [f"RUN={shlex.quote(run)}", *lines]
    shell(lines, tmp_path)


def tree_lines(page: Path) -> list[str]:
    """Its console blocks as they are; a block of another kind that names a file is written to it."""
    lines: list[str] = []
    for kind, name, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "console":
            lines += text.splitlines()
        elif name:
            assert END_OF_FILE not in text
            lines += [f"mkdir -p {shlex.quote(str(Path(name).parent))}", f"cat > {shlex.quote(name)} <<'{END_OF_FILE}'"]
            lines += [*text.splitlines(), END_OF_FILE]
    return lines


def _as_installed(folder: Path) -> None:
    """The entry points of the copy, as an installation of it would leave them."""
    info = folder / "levbench-0.0.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: levbench\nVersion: 0.0.0\n")
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    lines = [
        line for group, named in groups.items() for line in (f"[{group}]", *(f"{k} = {v}" for k, v in named.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


@pytest.mark.long
@pytest.mark.timeout(900)
def test_guides_that_add_to_the_tree_work(tmp_path: Path) -> None:
    """One after the other, each going on from what the one before has left, with the scratch copy in front of the clone."""
    for part in COPIED:
        copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy2
        copy(ROOT / part, tmp_path / part)
    _as_installed(tmp_path)
    for name in TREE:
        shell(tree_lines(ROOT / f"docs/how-to/{name}.md"), tmp_path, PYTHONPATH=str(tmp_path))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_are_understood(page: Path) -> None:
    """Commands and options that there are, and plans that fit their rigs."""
    command = typer.main.get_command(app)
    for words, well in bench_commands(page):
        if words[0] == "--help":
            continue
        chosen = command.commands[words[0]]  # type: ignore[attr-defined]
        asked = chosen.make_context(words[0], words[1:]).params
        if words[0] != "run" or not well or asked["rig"] not in RIGS:
            continue
        procedure, rig = load_procedure(asked["procedure"]), load_rig(asked["rig"])
        defaults = ("rig", rig.plans.get(procedure.name, {}))
        plan = plans.assemble(procedure.plan, defaults, None, tuple(asked["plan"] or ()))
        assert procedure.problems(rig, plan) == ()


def test_the_workflow_for_ci_is_understood() -> None:
    """Its steps are targets of the Makefile, and a session of pytest that finds every procedure."""
    page = (ROOT / "docs/how-to/use-in-ci.md").read_text(encoding="utf-8")
    (workflow,) = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    steps = [shlex.split(line) for line in re.findall(r"- run: (.*)", workflow)]
    targets = [words[1:] for words in steps if words[0] == "make"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert all(re.search(rf"^{name}:", makefile, re.MULTILINE) for names in targets for name in names)
    (session,) = ([sys.executable, *words[1:]] for words in steps if words[0] == ".venv/bin/python")
    done = subprocess.run([*session, "--collect-only", "-q", "-p", "no:cacheprovider", "--junitxml="], cwd=ROOT,
                          capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{len(catalogue.PROCEDURES)} tests collected" in done.stdout


def test_modules_that_pages_name_exist() -> None:
    """Not those of decisions, which are not rewritten, nor what the guides of TREE add."""
    pages = [*ROOT.glob("*.md"), *(p for p in (ROOT / "docs").rglob("*.md") if p.parent.name != "decisions")]
    rooms = "bench|drivers|procedures|reports|sim_backend|tests|benchmarks|examples"
    for page in (p for p in pages if p.stem not in (*TREE, "CHANGELOG")):
        for name in re.findall(rf"`((?:{rooms})/[\w./-]+\.py)`", page.read_text(encoding="utf-8")):
            assert (ROOT / name).exists(), f"{page.name}: {name}"


def test_links_lead_somewhere() -> None:
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


FENCED = re.compile(r"```.*?```", re.DOTALL)
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
ANCHORED = re.compile(r"\]\(([^)#\s:]*)#([^)\s]+)\)")


def anchor(heading: str) -> str:
    """What a heading is linked by: lower case, spaces as hyphens, without other marks."""
    words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", words).replace(" ", "-")


def test_links_into_pages_lead_to_headings() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").rglob("*.md")]
    texts = {page.resolve(): FENCED.sub("", page.read_text(encoding="utf-8")) for page in pages}
    known = {page: {anchor(h) for h in HEADING.findall(text)} for page, text in texts.items()}
    for page, text in texts.items():
        for target, place in ANCHORED.findall(text):
            aimed = (page.parent / target).resolve() if target else page
            assert aimed not in known or place in known[aimed], f"{page.name}: {target}#{place}"
