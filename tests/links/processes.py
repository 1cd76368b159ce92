"""A served rig and a bench as processes of their own, as a user starts them."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
ANY_PORT = ("--link", "controller=slcan:socket://127.0.0.1:0", "--link", "operator=line:127.0.0.1:0",
            "--link", "fieldbus=modbus-tcp:127.0.0.1:0")  # fmt: skip
LINE_S = 60.0
PATIENCE_S = 3.0
EXPECTED = ("simulated-controller", "telemetry-late", "heartbeat-late", "heartbeat-unprioritised", "clock-unknown")
"""Findings of every served rig, and those about the machine that the test runs on."""


@dataclass
class Child:
    """A process whose lines on standard output and standard error are kept, each stream by a thread."""

    process: subprocess.Popen[str]
    out: list[str] = field(default_factory=list)
    err: list[str] = field(default_factory=list)
    _news: threading.Condition = field(default_factory=threading.Condition)
    _threads: list[threading.Thread] = field(default_factory=list)
    _open: int = 2

    def __post_init__(self) -> None:
        for pipe, lines in ((self.process.stdout, self.out), (self.process.stderr, self.err)):
            thread = threading.Thread(target=self._read, args=(pipe, lines), daemon=True)
            thread.start()
            self._threads.append(thread)

    def _read(self, pipe: Any, lines: list[str]) -> None:
        for line in pipe:
            with self._news:
                lines.append(line.rstrip("\n"))
                self._news.notify_all()
        pipe.close()
        with self._news:
            self._open -= 1
            self._news.notify_all()

    def wait_for(self, text: str, since: int = 0, timeout_s: float = LINE_S) -> str:
        """The first line on standard error, after the first `since`, or on standard output, that holds the text."""

        def found() -> str | None:
            return next((x for x in [*self.err[since:], *self.out] if text in x), None)

        with self._news:
            self._news.wait_for(lambda: found() is not None or not self._open, timeout_s)
            line = found()
        assert line is not None, f"no line with {text!r}; standard error ends {self.err[-8:]}"
        return line

    def end(self, timeout_s: float = 120.0) -> int:
        """Wait for its end; the exit status."""
        status = self.process.wait(timeout_s)
        for thread in self._threads:
            thread.join(5.0)
        return status

    def kill(self) -> None:
        """End it however it stands."""
        if self.process.poll() is None:
            self.process.kill()
        self.end()


def _environment() -> dict[str, str]:
    paths = [str(ROOT / "tests" / "cli"), str(ROOT), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p)}


def _start(folder: Path, *arguments: str, stdin: int = subprocess.DEVNULL) -> Child:
    return Child(subprocess.Popen(
        [sys.executable, *arguments], cwd=folder, env=_environment(), text=True, stdin=stdin,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ))  # fmt: skip


@dataclass
class Served:
    """A served rig: its process and its endpoints, such as `slcan:socket` -> `slcan:socket://127.0.0.1:40001`."""

    child: Child
    endpoints: Mapping[str, str]

    def links(self, controller: str) -> tuple[str, ...]:
        """`--link` options for the bench, with the controller at that endpoint."""
        wanted = {"controller": controller, "operator": "line", "fieldbus": "modbus-tcp"}
        urls = {name: self.endpoints[kind] for name, kind in wanted.items() if kind in self.endpoints}
        return tuple(x for name, url in urls.items() for x in ("--link", f"{name}={url}"))

    def state_lines(self) -> list[str]:
        """`TIME s: FROM -> TO` of the controller, so far."""
        return [x for x in self.child.err if " -> " in x]


def kind_of(url: str) -> str:
    """`slcan:socket`, `slcan:pty`, `serial:socket`, `serial:pty`, `line`, `modbus-tcp` ... of an endpoint."""
    scheme, _, rest = url.partition(":")
    if scheme in ("slcan", "serial", "cli", "modbus-rtu"):
        return f"{scheme}:{'socket' if rest.startswith('socket://') else 'pty'}"
    return scheme


def patient_rig(folder: Path, rig: str = "tsbs12", patience_s: float = PATIENCE_S) -> None:
    """A rig in `folder/rigs`, where server and bench find it first, with a watchdog of seconds: a test machine that
    gives its processes no time for so long is no dead host, and no dead controller."""
    rigs = folder / "rigs"
    rigs.mkdir(exist_ok=True)
    text = (ROOT / "rigs" / f"{rig}.toml").read_text()
    if base := re.search(r'^based_on = "(.*)\.toml"', text, re.MULTILINE):
        patient_rig(folder, base[1], patience_s)
    patient = rf"\g<1>{patience_s}\g<2>{patience_s}"
    (rigs / f"{rig}.toml").write_text(
        re.sub(r"(watchdog_s = .*?default = )[0-9.]+(, .*?high = )[0-9.]+", patient, text)
    )
    own = ROOT / "rigs" / f"{rig}.dbc"
    if own.exists():
        (rigs / own.name).write_bytes(own.read_bytes())


@contextmanager
def served(
    folder: Path, *arguments: str, rig: str = "tsbs12", patience_s: float | None = PATIENCE_S,
    ports: Sequence[str] = ANY_PORT,
) -> Iterator[Served]:  # fmt: skip
    """`bench serve` on free ports for the block; patient as `patient_rig` says, or as the rig file is."""
    if patience_s is not None:
        patient_rig(folder, rig, patience_s)
    child = _start(folder, "-m", "bench.cli.__main__", "serve", rig, *ports, *arguments)
    try:
        child.wait_for("ready")
        urls = [line.split(" ", 1)[1] for line in child.out if " " in line]
        yield Served(child, {kind_of(url): url for url in urls})
        if child.process.poll() is None:
            child.process.send_signal(signal.SIGTERM)
            assert child.end() == 0, child.err[-5:]
    finally:
        child.kill()


@contextmanager
def real_bench(folder: Path, *arguments: str) -> Iterator[Child]:
    """`bench` as users have it, for the block."""
    child = _start(folder, "-m", "bench.cli.__main__", *arguments)
    try:
        yield child
    finally:
        child.kill()


@contextmanager
def bench(
    folder: Path, *arguments: str, stdin: int = subprocess.DEVNULL, catalogue: str = "tiny_catalogue"
) -> Iterator[Child]:
    """`bench` with the tests' small procedures in its catalogue, for the block."""
    child = _start(folder, "-m", catalogue, *arguments, stdin=stdin)
    try:
        yield child
    finally:
        child.kill()


def run(
    folder: Path, rig: Served, controller: str, procedure: str, *arguments: str, name: str = "tsbs12"
) -> tuple[int, dict[str, Any]]:
    """A whole live run; exit status and record."""
    with bench(folder, *live(rig, controller, procedure, *arguments, name=name)) as child:
        status = child.end()
        return status, record_in(folder, child)


def live(rig: Served, controller: str, procedure: str, *arguments: str, name: str = "tsbs12") -> tuple[str, ...]:
    """The arguments of a live run."""
    given = ("run", procedure, "--rig", name, "--backend", "live", "--operator", "auto")
    return (*given, *rig.links(controller), *arguments)


def record_in(folder: Path, child: Child) -> dict[str, Any]:
    """The record of the run whose directory the bench printed last."""
    assert child.out, child.err[-8:]
    found: dict[str, Any] = json.loads((folder / child.out[-1] / "record.json").read_text())
    return found
