"""A made run on the live page: channels, an orbit, steps, findings, questions, STOP and an end, without an engine.

`python tests/live/made_run.py [PORT [SECONDS]]` serves it and prints the address.
"""

from __future__ import annotations

import math
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from bench.live.buckets import Buckets
from bench.live.hub import Hub
from bench.live.publisher import Publisher
from bench.live.questions import Questions
from bench.live.server import LiveServer
from bench.live.site import Site
from bench.live.view import View, view_of
from bench.question import Choice, Question
from bench.recording.tap import Tap
from bench.rigfile import load_rig
from bench.samples import ChannelInfo, SampleBlock, StreamLayout

RIG = load_rig("tsbs12")
MAIN = StreamLayout("controller", 1_000_000, tuple(ChannelInfo(name, c.unit) for name, c in RIG.channels.items()))


class MadeRun:
    """What a run tells its page; its questions go unasked until `ask`."""

    def __init__(self, port: int = 0, address: str = "127.0.0.1") -> None:
        self.hub = Hub()
        self.questions = Questions(self.hub.tell)
        self.stopped: list[str] = []
        self.site = Site(self.hub, self.questions, self.stopped.append)
        self.tap = Tap(["controller"])
        self.publisher = Publisher(self.hub)
        self.server = LiveServer(self.site, address, port)
        self.view: View = view_of(RIG, [MAIN])
        self.samples = 0

    @contextmanager
    def served(self) -> Iterator[MadeRun]:
        with self.server.serving(), self.publisher.publishing():
            yield self

    @property
    def url(self) -> str:
        return self.site.url("127.0.0.1", self.server.port)

    def hello(self) -> None:
        self.hub.tell("hello", {
            "schema": 1, "run_id": "made-20260101T000000Z-0000", "procedure": "made", "rig": RIG.name, "title": "A made run",
            "backend": "sim", "served": False, "seed": 0, "visit": 0, "started": "2026-01-01T00:00:00+00:00",
            "simulated": True, "may_stop": True, **self.view.told(),
        })  # fmt: skip
        self.publisher.watch(self.tap, Buckets(self.view, "controller", 0), real_time=False)

    def block(self, n: int = 50) -> None:
        """The next samples of a shaft that turns at 10 Hz."""
        index = np.arange(self.samples, self.samples + n)
        t = index * 1e-3
        names = list(RIG.channels)
        columns = {name: 1e-6 * k + 1e-6 * np.sin(2 * math.pi * t + k) for k, name in enumerate(names)}
        turn = 2 * math.pi * 10 * t
        for k, (x, y) in enumerate((("pos_xi", "pos_yi"), ("pos_xo", "pos_yo"))):
            columns[x], columns[y] = (40 + 20 * k) * 1e-6 * np.cos(turn), (40 + 10 * k) * 1e-6 * np.sin(turn)
        for name in ("i_xi_p", "i_xi_n", "i_yi_p", "i_yi_n", "i_xo_p", "i_xo_n", "i_yo_p", "i_yo_n", "i_z_p", "i_z_n"):
            columns[name] = 6 + np.sin(turn)
        columns |= {"speed": np.full(n, 20 * math.pi), "supply": 148 + 0.5 * np.sin(t), "state": np.full(n, 3.0),
                    "fault": np.zeros(n), "temp_i": np.full(n, 305.0), "temp_o": np.full(n, 306.0),
                    "temp_m": np.full(n, 310.0)}  # fmt: skip
        t_ns = (index * 1_000_000).astype(np.int64)
        self.tap.put(SampleBlock("controller", self.samples, index.astype(np.uint64), t_ns, int(t_ns[-1]), 0, columns))
        self.samples += n


def main(port: int, seconds: float) -> None:
    """Serve for some seconds, and the end for a minute."""
    run = MadeRun(port)
    with run.served():
        sys.stderr.write(f"{run.url}\n")
        run.hello()
        asked = threading.Thread(target=_ask, args=(run,), daemon=True)
        asked.start()
        begun = time.monotonic()
        step = 0
        while (now := time.monotonic() - begun) < seconds and not run.stopped:
            run.block()
            if now > step:
                step += 1
                run.hub.tell("progress", {"stage": "acquire", "step": f"hang M{step % 4 + 1}", "done": step,
                                          "total": int(seconds), "elapsed_s": now, "left_s": seconds - now})  # fmt: skip
                run.hub.tell("log", {"text": f"warning: made line {step}"})
            if step % 10 == 5:
                run.hub.tell("finding", {"code": "samples-lost", "text": f"{step} samples were lost", "where": "link",
                                         "effect": "note", "id": "samples-lost/link/1"}, "samples-lost/link/1")  # fmt: skip
            time.sleep(0.05)
        with tempfile.TemporaryDirectory() as folder:
            run.site.report = Path(folder, "report.html")
            run.site.report.write_text(
                "<!doctype html><title>Report</title><style>h1{color:teal}</style><h1>A made report</h1>"
            )
            stopped = bool(run.stopped)
            reason = f"operator-stop: STOP by {run.stopped[0]}" if stopped else ""
            result = {"name": "K_i@inboard", "value": 75.0, "U": 0.4, "unit": "N/A", "verdict": "pass"}
            run.hub.tell("end", {"outcome": "ABORTED" if stopped else "PASS", "status": 4 if stopped else 0, "reason": reason,
                                 "report": "/report.html", "results": [result]})  # fmt: skip
            time.sleep(60)


def _ask(run: MadeRun) -> None:
    choices = [Choice("Done: it hangs still", ""), Choice("Another mass hangs…", "?")]
    number = 0
    while True:
        time.sleep(8)
        number += 1
        asked = Question(
            f"Hang M{number} on the hanger.", "Type the label of another mass that hangs instead.", choices
        )
        with run.questions.ask(asked) as opened:
            while opened.look() is None:
                time.sleep(0.05)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 0, float(sys.argv[2]) if len(sys.argv) > 2 else 60.0)
