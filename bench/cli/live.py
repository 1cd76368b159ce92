"""`bench run --live`: the run that goes on, and the page that shows it, put together."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING, Any

from bench import display_units
from bench.errors import Aborted, BenchError, ConfigError
from bench.findings import SIMULATED_CONTROLLER, Finding
from bench.os_signals import delivered_to
from bench.progress import Progress
from bench.recording.tap import Tap
from bench.run.job import Connect, Job, OpenRig

if TYPE_CHECKING:
    from bench.live.progress import LiveProgress
    from bench.live.server import LiveServer
    from bench.live.site import Site
    from bench.record.records import Measurement
    from bench.recording.recorder import Recorder
    from bench.run.runner import RunResult
    from bench.run.supervisor import Supervisor

logger = logging.getLogger("bench.live")
LOOPBACK, EVERYWHERE = "127.0.0.1", ("0.0.0.0", "::")
FETCHED_S = 3.0  # an open page asks for the report at once
GONE_S = 1.5  # a page that is loaded anew is back by then
STAY_S = 300.0
LOOK_S = 0.05


@dataclass(frozen=True)
class PageRequest:
    """A live page as it was asked for; port 0 is any free one."""

    port: int = 0
    bind: str = LOOPBACK


def asked_page(live: bool, port: int | None, bind: str | None) -> PageRequest | None:
    """What the options ask for.

    Raises:
        ConfigError: they contradict each other.
    """
    if live:
        return PageRequest(port or 0, bind or LOOPBACK)
    given = [name for name, value in (("--live-port", port), ("--live-bind", bind)) if value is not None]
    if given:
        raise ConfigError(f"{' and '.join(given)}: found without --live; expected both. Next: add --live")
    return None


class LivePage:
    """The page of one run, while it is served."""

    def __init__(self, server: LiveServer, site: Site, bind: str) -> None:
        from bench.live.publisher import Publisher

        self.server, self.site = server, site
        self.publisher = Publisher(self.site.hub)
        self._bind = bind
        self._progress: LiveProgress | None = None

    @property
    def announced(self) -> str:
        """A line with the address, which holds the token."""
        return announced(self.server, self._bind)

    def progress(self, shown: Progress) -> LiveProgress:
        """A progress display for the page too."""
        from bench.live.progress import LiveProgress

        self._progress = LiveProgress(shown, self.site.hub, self.site.questions)
        return self._progress

    def watched(self, job: Job, connect: Connect) -> Connect:
        """How to open the rig so that the page sees what is recorded."""

        @contextmanager
        def opened(supervisor: Supervisor) -> Iterator[OpenRig]:
            with connect(supervisor) as live:
                yield replace(live, attach=partial(self._attach, job, live))

        return opened

    def _attach(self, job: Job, live: OpenRig, recorder: Recorder | None) -> None:
        if recorder is not None:
            try:
                self._begin(job, live, recorder)
            except Exception:  # a page that cannot be made is no reason to end a run
                logger.warning("the live page cannot show this rig's samples", exc_info=True)
        live.attach(recorder)

    def _begin(self, job: Job, live: OpenRig, recorder: Recorder) -> None:
        from bench.live.buckets import Buckets
        from bench.live.view import view_of

        served = any(f.code == SIMULATED_CONTROLLER for f in live.findings)
        view = view_of(job.rig, live.streams)
        self.site.hub.tell("hello", {
            "schema": 1, "run_id": recorder.path.parent.name, "procedure": job.procedure.name, "rig": job.rig.name,
            "title": job.procedure.title, "backend": job.backend, "served": served, "seed": job.seed, "visit": job.visit,
            "started": datetime.now(UTC).isoformat(timespec="seconds"), "simulated": served or job.backend == "sim",
            "may_stop": True, **view.told(),
        })  # fmt: skip
        main, real_time = live.streams[0].name, job.backend == "live"
        tap = Tap(stream.name for stream in live.streams)
        self.publisher.watch(tap, Buckets(view, main, live.rig.clock.now_ns()), real_time=real_time)
        recorder.tap = tap

    def end(self, result: RunResult, status: int) -> None:
        """The run is over: what came of it, and its report."""
        if self._progress is not None:
            self._progress.settle(Finding(f.code, f.text, f.where, f.effect) for f in result.record.findings)
        report = result.directory / "report.html"
        self.site.report = report if report.is_file() else None
        self._end({"outcome": result.outcome.value, "status": status, "reason": result.reason,
                   "report": "/report.html" if self.site.report else None, "folder": str(result.directory),
                   "results": [result_of(m) for m in result.record.measurements]})  # fmt: skip

    def failed(self, error: BenchError) -> None:
        """There was no run, or it ended without a record."""
        status = 4 if isinstance(error, Aborted) else 2 if isinstance(error, ConfigError) else 3
        self._end({"outcome": "ABORTED" if status == 4 else "ERROR", "status": status, "reason": str(error), "report": None,
                   "folder": "", "results": []})  # fmt: skip

    def _end(self, said: dict[str, Any]) -> None:
        self.site.hub.tell("end", said)

    def stay(self) -> None:
        """Serve the report while a page is open that has asked for it, for some minutes at most. Ctrl-C ends that; the outcome
        stands."""
        ended: list[str] = []
        begun = seen = time.monotonic()
        told = False
        with delivered_to(ended.append):
            while self.site.report is not None and self.site.hub.readers + self.site.fetched and not ended:
                now = time.monotonic()
                seen = now if self.site.hub.readers else seen
                if now - begun > (STAY_S if self.site.fetched else FETCHED_S) or now - seen > GONE_S:
                    return
                if self.site.fetched and not told:
                    told = True
                    with suppress(OSError):
                        sys.stderr.write(f"the live page has the report until it is closed, for at most {STAY_S:.0f} s; "
                                         "Ctrl-C ends that\n")  # fmt: skip
                        sys.stderr.flush()
                time.sleep(LOOK_S)


def result_of(m: Measurement) -> dict[str, Any]:
    """A result as pages are told it: in its SI unit, with the unit to show it in."""
    half = m.expanded_uncertainty
    if half is None and m.interval is not None:
        half = (m.interval[1] - m.interval[0]) / 2
    name = f"{m.name}@{m.where}" if m.where else m.name
    symbol, factor = display_units.of_result(m.unit, m.value or half or 0.0)
    return {"name": name, "value": m.value, "U": half, "unit": m.unit, "display_unit": symbol, "factor": factor,
            "verdict": m.verdict.value}  # fmt: skip


def announced(server: LiveServer, bind: str, what: str = "live page") -> str:
    """A line with the address, which holds the token."""
    unsafe = "without encryption"
    seen = "whoever can read the network can read its token"
    if bind in EVERYWHERE:
        return (
            f"{what}: {server.site.url(LOOPBACK, server.port)} and, {unsafe}, at every address of this computer: {seen}"
        )
    line = f"{what}: {server.site.url(bind, server.port)}"
    return line if server.local else f"{line} {unsafe}: {seen}"


@contextmanager
def opened(asked: PageRequest, stop: Callable[[str], None] | None) -> Iterator[LivePage]:
    """Serve a page within the block; `stop` asks the run to stop, with who wants it; None where nobody may.

    Raises:
        ConfigError: the port is in use, or there is no such address on this host.
    """
    from bench.live.hub import Hub
    from bench.live.questions import Questions
    from bench.live.server import LiveServer
    from bench.live.site import Site

    hub = Hub()
    site = Site(hub, Questions(hub.tell), stop, named="" if asked.bind in EVERYWHERE else asked.bind)
    page = LivePage(LiveServer(site, asked.bind, asked.port), site, asked.bind)
    with page.server.serving(), page.publisher.publishing():
        try:
            yield page
        except BenchError as error:
            page.failed(error)
            raise
