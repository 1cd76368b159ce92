"""A server that speaks the live page's protocol with a made run: what the page does is tried on it without a machine.

`python tests/browser/standin.py` serves one to look at.
"""

from __future__ import annotations

import json
import mimetypes
import threading
import time
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from real import owned_by
from shaft import MICRON, hello, samples

PAGE = owned_by() / "live" / "page"
TOKEN = "a-token-of-the-tests"
CSP = "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"


@dataclass
class Run:
    """A made run: what was told so far, who listens, what was answered."""

    told: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    changed: threading.Condition = field(default_factory=threading.Condition)
    answers: list[dict[str, Any]] = field(default_factory=list)
    stops: list[dict[str, Any]] = field(default_factory=list)
    streaming: bool = False
    silent: bool = False  # nothing comes, and the connection stays: a network that hangs
    closed: int = 0  # connections up to this number are to end
    ending: bool = False
    opened: int = 0
    holds: bool = False  # a request for events waits for its answer
    refuses: int = 0  # status of what is asked, 0: serve
    began: float = field(default_factory=time.monotonic)

    def tell(self, name: str, data: dict[str, Any]) -> None:
        with self.changed:
            self.told.append((name, data))
            self.changed.notify_all()

    def drop(self) -> None:
        """End every connection that there is."""
        with self.changed:
            self.closed = self.opened
            self.changed.notify_all()


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Standin

    def log_message(self, *_: Any) -> None: ...

    def do_GET(self) -> None:
        path = self.path.partition("?")[0]
        if path == "/events":
            self._events()
        elif path == "/report.html":
            self._send(200, b"<!DOCTYPE html><title>Report</title><h1>The report</h1>", "text/html; charset=utf-8")
        else:
            file = PAGE / (path.lstrip("/") or "index.html")
            if file.parent != PAGE or not file.is_file():
                self._send(404, b"not found", "text/plain")
            else:
                self._send(200, file.read_bytes(), mimetypes.guess_type(file.name)[0] or "text/plain")

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        run = self.server.run
        if self.headers.get("X-Levbench-Token") != TOKEN or run.refuses:
            self._send(run.refuses or 403, b"refused: by the test", "text/plain")
        elif self.path == "/stop":
            run.stops.append(body)
            self._send(202, b"{}", "application/json")
        elif any(a["id"] == body["id"] for a in run.answers):
            self._send(409, json.dumps({"accepted": False, "by": run.answers[-1]["by"]}).encode(), "application/json")
        else:
            run.answers.append(body)
            self._send(200, json.dumps({"accepted": True, "by": body["by"]}).encode(), "application/json")
            run.tell("answered", body)

    def _send(self, status: int, body: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", CSP)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def _events(self) -> None:
        run = self.server.run
        if self.headers.get("X-Levbench-Token") != TOKEN or run.refuses:
            self._send(run.refuses or 403, b"the token is missing or another run's", "text/plain")
            return
        while run.holds and not run.ending:
            time.sleep(0.05)
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        run.opened += 1
        mine, sent = run.opened, 0
        t = 0.0 if mine == 1 else time.monotonic() - run.began  # the first page sees it from its beginning
        try:
            while mine > run.closed and not run.ending:
                with run.changed:
                    if sent >= len(run.told):
                        run.changed.wait(0.05)
                    new, sent = run.told[sent:], len(run.told)
                for name, data in new:
                    self._event(name, data)
                now = time.monotonic() - run.began
                if run.streaming and not run.silent and now - t >= 0.045:
                    self._event("samples", samples(t, now))
                    t = now
        except OSError:
            return

    def _event(self, name: str, data: dict[str, Any]) -> None:
        self.wfile.write(f"event: {name}\ndata: {json.dumps(data)}\n\n".encode())
        self.wfile.flush()


class Standin(ThreadingHTTPServer):
    """The server on a free port of the loopback; `address` is what a run would print."""

    daemon_threads = False  # they are waited for

    def __init__(self, port: int = 0) -> None:
        super().__init__(("127.0.0.1", port), Handler)
        self.run = Run()
        self.address = f"http://127.0.0.1:{self.server_port}/#{TOKEN}"

    def __enter__(self) -> Standin:
        threading.Thread(target=self.serve_forever, args=(0.05,), daemon=True).start()
        return self

    def __exit__(self, *_: Any) -> None:
        self.shutdown()
        self.run.ending = True
        self.server_close()


PROGRESS = {
    "stage": "hanging masses",
    "step": "M2 1.000 kg, loading",
    "done": 23,
    "total": 72,
    "elapsed_s": 184.0,
    "left_s": 391.0,
}
PROMPT = {
    "id": 1, "free": True, "hint": "Another mass: its label (M1, M2, M3, M4, - for none); ? for more",
    "question": "The shaft levitates: 130 V are on the coils, hands away from them.\nHang M3 on the hanger.\n"
                "Press Enter when it hangs still, or type stop to end the run, ? for more.",
    "choices": [{"label": "It hangs still", "answer": ""}],
}  # fmt: skip
FINDINGS = tuple(
    {"code": code, "text": text, "where": where, "effect": effect}
    for code, text, where, effect in (
        ("calibration-due", "The load cell's calibration is due on 2026-12-01.", "load cell", "note"),
        ("missing-samples", "3 of 12 000 samples are missing in step 12; its mean leaves them out.", "hang 12", "note"),
        ("load-not-still", "The hanging mass swings: 0.8 N of 5 Hz.", "hang 14", "indeterminate"),
        ("stuck-channel", "pos_yi has stood on 12.3 µm for 1.0 s while the tick went on.", "pos_yi", "error"),
    )
)
LOG = (
    "links: controller in this process",
    "supply 148.0 V",
    "lift: inboard, outboard, axial",
    "hanging masses: 72 steps",
)
RESULTS = [
    {"name": "K@inboard", "value": 75.004, "U": 0.21, "unit": "N/A", "verdict": "pass"},
    {"name": "K@outboard", "value": 74.876, "U": 0.34, "unit": "N/A", "verdict": "pass"},
    {"name": "i_0@inboard", "value": 0.01234, "U": 0.0031, "unit": "A", "verdict": "none"},
    {"name": "runout@inboard", "value": 4.21e-6, "U": 2.1e-7, "unit": "m", "display_unit": "um", "factor": MICRON,
     "verdict": "pass"},
]  # fmt: skip


def end(outcome: str, status: int, reason: str) -> dict[str, Any]:
    done = outcome in ("PASS", "FAIL", "DONE", "INDETERMINATE")
    return {"outcome": outcome, "status": status, "reason": reason, "report": "/report.html" if done else None,
            "results": RESULTS if done else [], "folder": "runs/20261128T101500Z-amb-calibration-tsbs12"}  # fmt: skip


def begin(run: Run, **changed: Any) -> None:
    """A run that goes on."""
    run.streaming = True
    run.tell("hello", hello(**changed))
    run.tell("progress", PROGRESS)
    for text in LOG:
        run.tell("log", {"text": text})


if __name__ == "__main__":
    with Standin(28600) as server:
        begin(server.run)
        server.run.tell("prompt", PROMPT)
        for one in FINDINGS:
            server.run.tell("finding", one)
        print(server.address)  # noqa: T201
        threading.Event().wait()
