"""What a live page costs a simulated run: processor time of the run's process with a page over that without, interleaved, the
best of five. The pages are other processes.

    python benchmarks/live_page.py

Target: at most 1.05 where nobody looks, and where the client is stopped or gone. A page that reads costs what it is shown.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from bench.cli import live
from bench.cli.compose import Request, prepare
from bench.cli.live import LivePage, PageRequest
from bench.progress import Silent
from bench.run import runner
from bench.run.supervisor import Supervisor

REPEATS = 5
READ = """
import http.client, sys
connection = http.client.HTTPConnection("127.0.0.1", int(sys.argv[1]))
connection.request("GET", "/events", headers={"X-Levbench-Token": sys.argv[2]})
answer = connection.getresponse()
print(answer.status, flush=True)
while answer.read1(65536):
    pass
"""


@contextmanager
def client(page: LivePage) -> Iterator[subprocess.Popen[str]]:
    """A page that reads all that comes, in a process of its own."""
    words = [sys.executable, "-c", READ, str(page.server.port), page.site.token]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as child:
        try:
            assert child.stdout is not None
            assert child.stdout.readline() == "200\n"
            yield child
        finally:
            child.kill()


@contextmanager
def stopped(page: LivePage) -> Iterator[None]:
    with client(page) as child:
        child.send_signal(signal.SIGSTOP)
        yield


@contextmanager
def gone(page: LivePage) -> Iterator[None]:
    with client(page) as child:
        child.kill()
        child.wait()
    yield


CASES: dict[str, Callable[[LivePage], Any] | None] = {
    "no page": None, "nobody looks": lambda _: nullcontext(), "stopped": stopped, "gone": gone, "reads": client,
}  # fmt: skip


def seconds(request: Request, look: Callable[[LivePage], Any] | None, out: Path) -> float:
    """Processor time of one run, report left out, with those who look."""
    supervisor, progress = Supervisor(), Silent()
    job, connect = prepare(request)
    if look is None:
        begun = time.process_time()
        runner.run(job, out, connect, supervisor, progress, None)
        return time.process_time() - begun
    with live.opened(PageRequest(), supervisor.stop) as page, look(page):
        begun = time.process_time()
        runner.run(job, out, page.watched(job, connect), supervisor, page.progress(progress), None)
        return time.process_time() - begun


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--procedure", default="amb-calibration")
    parser.add_argument("--rig", default="tsbs12")
    parser.add_argument("--repeats", type=int, default=REPEATS)
    asked = parser.parse_args()
    request = Request(procedure=asked.procedure, rig=asked.rig)
    times: dict[str, list[float]] = {name: [] for name in CASES}
    with tempfile.TemporaryDirectory() as folder:
        seconds(request, None, Path(folder))  # what is loaded once
        for _ in range(asked.repeats):
            for name, look in CASES.items():
                times[name].append(seconds(request, look, Path(folder)))
    alone = min(times["no page"])
    for name, found in times.items():
        print(f"{name:13} {min(found):6.2f} s  {min(found) / alone:5.3f}  ({', '.join(f'{t:.2f}' for t in found)})")


if __name__ == "__main__":
    main()
