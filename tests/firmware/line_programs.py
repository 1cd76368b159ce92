"""The C controller with a command line as a process, the rigs that it is, its law in closed form, and a bench on it."""

from __future__ import annotations

import math
import os
import queue
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from bench.cli import opening
from bench.cli.compose import with_links
from bench.procedure.rig import Rig
from bench.rigfile import load_rig
from bench.run.supervisor import Supervisor

ROOT = Path(__file__).resolve().parents[2]
TICKS_S = 280_000
PATIENT_MS = 5000
NATURAL, ZETA, NOISE_A = 2 * math.pi * 4000, 0.6, 5e-3
"""Of each current's law, rad/s and 1; standard deviation of a reading."""
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join((str(Path(__file__).parent), str(ROOT)))}
MACHINE = {"telemetry-late", "heartbeat-late", "heartbeat-unprioritised", "clock-unknown"}
"""Findings about the machine that the test runs on."""
KINDS = ("lira", "north")
PLACES = ("tcp", "pty")


def rigs_in(folder: Path) -> Path:
    """A folder with `rigs/`, in which lira and north lie."""
    rigs = folder / "rigs"
    rigs.mkdir()
    for path in (ROOT / "rigs/lira.toml", ROOT / "rigs/lira.dbc", Path(__file__).parent / "line/north.toml"):
        shutil.copy(path, rigs / path.name)
    return folder


def law(seconds: np.ndarray[tuple[int], np.dtype[np.float64]]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Answer to a step of 1 at 0, in closed form."""
    t = np.clip(seconds, 0.0, None)
    root = math.sqrt(1 - ZETA**2)
    turn = NATURAL * root * t
    return np.asarray(1 - np.exp(-ZETA * NATURAL * t) * (np.cos(turn) + ZETA / root * np.sin(turn)))


def rise_time() -> float:
    """From a tenth to nine tenths, s, by the closed form."""
    at = [brentq(lambda t, y=y: float(law(np.array([t]))[0]) - y, 0.0, math.pi / NATURAL) for y in (0.1, 0.9)]
    return float(at[1] - at[0])


@dataclass
class Controller:
    """The program as a process: where it answers, and what it says on its standard output."""

    process: subprocess.Popen[str]
    where: str = ""
    _lines: queue.Queue[str] = field(default_factory=queue.Queue)

    def __post_init__(self) -> None:
        threading.Thread(target=self._read, daemon=True).start()
        self.where = self.said()

    def _read(self) -> None:
        assert self.process.stdout
        for line in self.process.stdout:
            self._lines.put(line.strip())

    def said(self, timeout_s: float = 20.0) -> str:
        """The next line that it says."""
        return self._lines.get(timeout=timeout_s)

    @property
    def url(self) -> str:
        """Of the controller's link."""
        return f"cli:{self.where}" if "://" in self.where else f"cli:serial:{self.where}"


@contextmanager
def controller(program: Path, place: str, kind: str = "lira", watchdog_ms: int = 80) -> Iterator[Controller]:
    """The program for the block, on a free port or a pseudo terminal of its own; as `north` it speaks the dialect. A test
    that is not about its watchdog lets it wait for longer, so that a busy machine is no dead host."""
    words = ["--dialect"] if kind == "north" else []
    words += ["--watchdog", str(watchdog_ms), *(["tcp", "0"] if place == "tcp" else ["pty"])]
    with subprocess.Popen([program, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
        try:
            yield Controller(child)
        finally:
            assert child.stdin
            child.stdin.close()


@contextmanager
def opened(folder: Path, kind: str, url: str) -> Iterator[Rig]:
    """The rig as a live run has it; its operator is a line that nobody answers."""
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        links = [f"controller={url}", f"operator=line:127.0.0.1:{nobody.getsockname()[1]}"]
        rig = with_links(load_rig(str(folder / "rigs" / f"{kind}.toml")), links)
        with opening.live(rig, "auto")(Supervisor()) as there:
            yield there.rig


def run_bench(folder: Path, *words: str, real: bool = False) -> subprocess.CompletedProcess[str]:
    """`bench` with the procedure `line-look` in its catalogue, or as users have it, to its end."""
    module = "bench.cli.__main__" if real else "line_catalogue"
    return subprocess.run(
        [sys.executable, "-m", module, *words], cwd=folder, env=ENVIRONMENT, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=100,
    )  # fmt: skip
