"""A run with its live page, in simulation or on a served rig, or the page of a folder of runs, as processes of their own.

They are this clone's, or with INSTALLED those of an environment that Levbench's wheel was installed into; what it depends on
comes from that of the tests.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

ROOT = Path(__file__).resolve().parents[2]
INSTALLED = Path(os.environ["INSTALLED"]).absolute() if os.environ.get("INSTALLED") else None
PYTHON = str(INSTALLED / "bin" / "python") if INSTALLED else sys.executable
BENCH = [str(INSTALLED / "bin" / "bench")] if INSTALLED else [PYTHON, "-m", "bench.cli"]
PORTS = ("controller=slcan:socket://127.0.0.1:0", "fieldbus=modbus-tcp:127.0.0.1:0", "operator=line:127.0.0.1:0")
END_S = 60


class Run:
    """A run that goes on, the address of its page, what it said."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.said: list[str] = []
        found = None
        assert process.stderr is not None
        for line in process.stderr:
            self.said.append(line)
            if found := re.search(r"live page: (http\S+)", line):
                break
        assert found is not None, "".join(self.said)
        self.address = found[1]
        self.reader = threading.Thread(target=self._read, args=(process.stderr,))
        self.reader.start()

    def _read(self, stream: IO[str]) -> None:
        self.said += stream

    def end(self) -> tuple[int, dict[str, Any]]:
        """Exit status and record."""
        status = self.process.wait(END_S)
        self.reader.join(END_S)
        assert self.process.stdout is not None
        folder = Path(self.process.stdout.read().splitlines()[-1])
        return status, json.loads((folder / "record.json").read_text(encoding="utf-8")) | {"folder": folder}


def _environment() -> dict[str, str]:
    dependencies = [path for path in sys.path if Path(path).name == "site-packages"]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(dependencies) if INSTALLED else str(ROOT)}


def owned_by() -> Path:
    """Where the package `bench` lies that the processes of these tests run."""
    said = subprocess.run([PYTHON, "-c", "import bench; print(bench.__path__[0])"], cwd="/", env=_environment(), text=True,
                          capture_output=True, check=True)  # fmt: skip
    return Path(said.stdout.strip())


def finished(out: Path, *words: str) -> Path:
    """The folder of a run without a page, which is over."""
    done = subprocess.run([*BENCH, "run", *words, "--out", str(out)], cwd=out, env=_environment(), text=True,
                          capture_output=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
    return Path(done.stdout.splitlines()[-1])


@contextmanager
def shown(folder: Path) -> Iterator[str]:
    """The address of `bench show` on a folder."""
    command = [*BENCH, "show", str(folder)]
    with subprocess.Popen(command, cwd=folder, env=_environment(), text=True, stderr=subprocess.PIPE) as process:
        try:
            assert process.stderr is not None
            found = re.search(r"page: (http\S+)", process.stderr.readline())
            assert found is not None
            yield found[1]
        finally:
            process.terminate()


@contextmanager
def run(out: Path, *words: str) -> Iterator[Run]:
    """`bench run` with a live page; it is stopped at the end if it still goes on."""
    command = [*BENCH, "run", *words, "--live", "--out", str(out)]
    with subprocess.Popen(command, cwd=out, env=_environment(), text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE) as process:  # fmt: skip
        found = None
        try:
            found = Run(process)
            yield found
        finally:
            process.terminate()
            if found is not None:
                found.reader.join(END_S)


@contextmanager
def served(rig: str, links: Sequence[str] = PORTS) -> Iterator[list[str]]:
    """The words that connect a run to a rig that is served in real time."""
    command = [*BENCH, "serve", rig, *(word for link in links for word in ("--link", link))]
    with subprocess.Popen(
        command, cwd="/", env=_environment(), text=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        try:
            assert process.stdout is not None
            asked = [link.partition(":")[0] for link in links]  # link and scheme
            found = {}
            for line in process.stdout:
                if line.startswith("ready"):
                    break
                link, _, url = line.strip().partition(" ")
                if f"{link}={url.partition(':')[0]}" in asked and "/dev/" not in url:
                    found[link] = url
            yield ["--backend", "live", *(word for link, url in found.items() for word in ("--link", f"{link}={url}"))]
        finally:
            process.terminate()
