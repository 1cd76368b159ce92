"""A whole rig that misbehaves: the C controller with its mischief, an operator at a line who hangs masses in it, and the
fieldbus. `ended` lets `bench run` at it and tells how that ended."""

from __future__ import annotations

import json
import os
import re
import socketserver
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from fieldbus_server import FieldbusServer

from bench.rigfile import load_rig

ROOT = Path(__file__).resolve().parents[2]
K_I, K_O = 73.2, 74.4  # N/A, what the limits of specs/tsbs12.toml expect
WATCHDOG_S = 1.0  # a busy machine is no dead host
PLAN = ("angles=8", "settle_s=0.1", "average_s=0.1")
LIMIT_S, STALL_S = 240.0, 0.5
ELSEWHERE = ("mb", "answer-", "deafoperator", "wrongmass")  # switches that the C program has nothing to do with
SWITCH = re.compile(r"([\w-]+)(?:=([-\d.e]+))?(?:@([\d.]+))?")


@dataclass(frozen=True)
class Ended:
    """How a run ended: exit status, seconds, the longest time without a line, what was printed, and, where there was a run, its
    outcome and its findings; the controller's last words."""

    status: int
    seconds: float
    quiet_s: float
    printed: str
    outcome: str
    findings: tuple[str, ...]
    device: str

    @property
    def stalled(self) -> bool:
        """Whether the computer let the controller stand still for so long that a sound one would look dead."""
        found = re.search(r"stalled ([\d.]+)", self.device)
        return found is not None and float(found[1]) > STALL_S

    def __str__(self) -> str:
        found = ", ".join(self.findings) or "no finding"
        head = f"exit {self.status} after {self.seconds:.0f} s, {self.quiet_s:.0f} s of them quiet, {self.outcome or 'no run'}"
        return f"{head}: {found}; {self.device}\n{self.printed}"


class Switches:
    """Misbehaviours of the operator and the fieldbus. START counts from the operator's first request: the rotor is up then."""

    def __init__(self, texts: Sequence[str]) -> None:
        found = [match for text in texts if (match := SWITCH.fullmatch(text))]
        self._values = {m[1]: (float(m[2] or 1), None if m[3] is None else float(m[3])) for m in found}
        self.levitated_s: float | None = None

    def active(self, kind: str) -> float | None:
        """The value of one that is at work."""
        value, start = self._values.get(kind, (None, None))
        if value is None or start is None:
            return value
        up = self.levitated_s
        return value if up is not None and time.monotonic() >= up + start else None


class Operator:
    """Answers lines, and tells the controller's plant what hangs."""

    def __init__(self, switches: Switches, hang: Callable[[float], None], masses: dict[str, float]) -> None:
        self._switches, self._hang, self._masses = switches, hang, masses
        self._closed = threading.Event()
        self._server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), self._handler())
        self.port = int(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, name="operator", daemon=True).start()

    def close(self) -> None:
        """End with every thread."""
        self._closed.set()
        self._server.shutdown()
        self._server.server_close()

    def _handler(self) -> type[socketserver.BaseRequestHandler]:
        outer = self

        class Handler(socketserver.StreamRequestHandler):
            def handle(self) -> None:
                for line in self.rfile:
                    answer = outer._answer(line.decode().split())
                    if answer is None:
                        return
                    self.wfile.write(answer)

        return Handler

    def _answer(self, words: list[str]) -> bytes | None:
        """What is said to a request; None: nothing more, the line closes."""
        s = self._switches
        if s.levitated_s is None:
            s.levitated_s = time.monotonic()
        if s.active("deafoperator") is not None:
            self._closed.wait(LIMIT_S)
            return None
        if s.active("answer-empty") is not None:
            return b"\n"
        if s.active("answer-error") is not None:
            return b"error the hook is gone\n"
        if s.active("answer-gone") is not None:
            return None
        wrong = s.active("wrongmass") if words[1] == "M2" else None
        self._hang(self._masses.get(words[1], 0.0) * (wrong or 1.0))
        return b"ok 0\n"


def rig_file(folder: Path) -> Path:
    """`tsbs12` with a watchdog that forgives a busy machine."""
    for name in ("tsbs12.dbc", "tsbs12.toml"):
        text = (ROOT / "rigs" / name).read_text(encoding="utf-8")
        text, count = re.subn(r"(watchdog_s = \{[^}]*default = )[\d.]+", rf"\g<1>{WATCHDOG_S}", text)
        assert count == (name == "tsbs12.toml")
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "tsbs12.toml"


@contextmanager
def rig_that(program: Path, wire: str, switches: Sequence[str]) -> Iterator[tuple[list[str], list[str]]]:
    """A rig that misbehaves so, for the block: the options of `bench run` that name its links, and a list that gets the
    controller's last words."""
    others = Switches(switches)
    mine = [s for s in switches if not s.startswith(ELSEWHERE)]
    last: list[str] = []
    child = subprocess.Popen(
        [program, wire, "1", str(K_I), str(K_O), *mine], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert child.stdin
    assert child.stdout
    stdin = child.stdin

    def hang(kg: float) -> None:
        stdin.write(f"hang {kg}\n")
        stdin.flush()

    port = int(child.stdout.readline())
    masses = {name: mass.value for name, mass in load_rig("tsbs12").masses.items()}
    with ExitStack() as stack:
        bus, operator = FieldbusServer(others.active), Operator(others, hang, masses)
        stack.callback(bus.close)
        stack.callback(operator.close)
        scheme = "serial" if wire == "packets" else "slcan"
        urls = (f"controller={scheme}:socket://127.0.0.1:{port}", f"fieldbus=modbus-tcp:127.0.0.1:{bus.port}",
                f"operator=line:127.0.0.1:{operator.port}")  # fmt: skip
        yield [word for url in urls for word in ("--link", url)], last
        last.append(child.communicate(timeout=10)[0].strip())


def watched(command: Sequence[str]) -> tuple[int, list[str], float]:
    """Run it; its status, its lines, and the longest time between two of them, s."""
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=ROOT,
                             env={**os.environ, "NO_COLOR": "1", "PYTHONUNBUFFERED": "1"})  # fmt: skip
    with child:
        stop = threading.Timer(LIMIT_S, child.kill)
        stop.start()
        assert child.stdout
        lines, quiet_s, last = [], 0.0, time.monotonic()
        for line in child.stdout:
            quiet_s, last = max(quiet_s, time.monotonic() - last), time.monotonic()
            lines.append(line)
        stop.cancel()
    return child.returncode, lines, max(quiet_s, time.monotonic() - last)


def ended(program: Path, folder: Path, wire: str, switches: Sequence[str]) -> Ended:
    """Let `bench run` at a rig that misbehaves so, with its files in a new folder."""
    folder.mkdir()
    with rig_that(program, wire, switches) as (links, last):
        plan = [word for text in PLAN for word in ("--plan", text)]
        options = [
            "--backend",
            "live",
            "--operator",
            "auto",
            "--no-report",
            "--out",
            str(folder / "runs"),
            *plan,
            *links,
        ]
        rig = str(rig_file(folder))
        command = [sys.executable, "-m", "bench.cli", "run", "amb-calibration", "--rig", rig, *options]
        begin = time.monotonic()
        status, lines, quiet_s = watched(command)
        took = time.monotonic() - begin
    records = [json.loads(path.read_text(encoding="utf-8")) for path in (folder / "runs").glob("*/record.json")]
    record = records[0] if records else {"outcome": "", "findings": []}
    return Ended(status, took, quiet_s, "".join(lines), record["outcome"],
                 tuple(f["code"] for f in record["findings"]), last[0] if last else "")  # fmt: skip
