"""A run with its live page, in simulation or on a served rig, as processes of their own."""

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
BENCH = [sys.executable, "-m", "bench.cli"]
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
    return {**os.environ, "PYTHONPATH": str(ROOT)}


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
        command, env=_environment(), text=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
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
