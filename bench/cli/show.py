"""`bench show`: the runs of a folder on a page, with their reports and trends."""

from __future__ import annotations

import shlex
import sqlite3
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar, cast, get_args

from bench.cli.live import EVERYWHERE, LOOK_S, PageRequest, announced, result_of
from bench.cli.runs import which_machine
from bench.cli.trend import TrendRequest, drawn, found_trend
from bench.errors import BenchError, ConfigError
from bench.live.gate import Refused
from bench.os_signals import delivered_to
from bench.record.records import read_record
from bench.run import index
from bench.run.indexrow import IndexEntry, MachineKind
from bench.rundir import LARGEST, RunDirectory

SCHEMA, SHOWN = 1, 100  # runs of a list where nothing is said of their number
Query = Mapping[str, str]
T = TypeVar("T")


def show_command(folder: Path, asked: PageRequest) -> int:
    """Serve the runs of a folder until Ctrl-C.

    Raises:
        ConfigError: there is no such folder, the port is in use, or there is no such address on this host.
        BenchError: the index can neither be read nor rebuilt.
    """
    from bench.live.server import LiveServer
    from bench.live.stored import StoredHandler, stored_site

    if not folder.is_dir():
        found = "a file" if folder.exists() else "no folder there"
        raise ConfigError(f"{folder}: found {found}; expected a folder of run directories. Next: bench show FOLDER")
    stored = StoredRuns(folder)
    none = "" if stored.entries() else f"; no runs in {folder} so far"
    site = stored_site(stored, "" if asked.bind in EVERYWHERE else asked.bind)
    server = LiveServer(site, asked.bind, asked.port, StoredHandler, "--")
    ended: list[str] = []
    with delivered_to(ended.append), server.serving():
        sys.stderr.write(f"{announced(server, asked.bind, 'page')}\nCtrl-C ends it{none}\n")
        sys.stderr.flush()
        while not ended:
            time.sleep(LOOK_S)
    return 0


class StoredRuns:
    """A folder of runs, as `bench.live.stored.Stored` asks for it. One thing at a time: drawing has settings that all threads
    share."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._one = folder, threading.Lock()

    def entries(self) -> list[IndexEntry]:
        """All runs that are there, oldest first.

        Raises:
            BenchError: the index can neither be read nor rebuilt.
        """
        with self._one:
            return self._read(lambda: index.entries(self._folder))

    def runs(self, asked: Query) -> Mapping[str, Any]:
        """The newest runs that have all words of the filter, newest first, and what can be asked of the folder."""
        last = _whole(asked, "last", SHOWN, least=1)
        entries = self.entries()
        words = asked.get("filter", "").lower().split()
        found = [e for e in reversed(entries) if _meant(e, words)]
        with self._one:
            names = self._read(lambda: index.names(self._folder))
        return {"schema": SCHEMA, "folder": str(self._folder), "all": len(entries), "found": len(found),
                "runs": [_run(e) for e in found[:last]], "quantities": names,
                "procedures": sorted({e.procedure for e in entries}), "rigs": sorted({e.rig for e in entries})}  # fmt: skip

    def run(self, run_id: str) -> Mapping[str, Any]:
        """A run with its results and findings, and where its report is.

        Raises:
            BenchError: its record cannot be read any more.
        """
        entry, directory = self._known(run_id)
        try:
            record = read_record(directory.record)
        except ConfigError as error:  # nobody asked wrongly
            raise BenchError(str(error)) from error
        report = f"/run/{entry.run_id}/report.html" if _report(directory).is_file() else None
        return {"schema": SCHEMA, **_run(entry), "folder": str(directory.path), "report": report,
                "results": [result_of(m) for m in record.measurements],
                "findings": [asdict(f) for f in record.findings]}  # fmt: skip

    def report(self, run_id: str) -> bytes:
        """A run's report, as it lies there.

        Raises:
            Refused: 404, there is none.
        """
        _, directory = self._known(run_id)
        path = _report(directory)
        try:
            if path.is_symlink():
                raise Refused(404, f"report: {path} is a link to somewhere else")
            return path.read_bytes()
        except OSError as error:
            raise Refused(
                404, f"report: there is none. Next: bench report {shlex.quote(str(directory.path))}"
            ) from error

    def trend(self, asked: Query) -> Mapping[str, Any]:
        """A quantity's trend: as data, and what `bench trend` prints of it, by parts."""
        from bench.cli.trend_table import parts
        from bench.history.trendjson import as_data

        request = self._trend(asked)
        with self._one:
            found, older = found_trend(request)
            return {**as_data(found), "older": older, "told": list(parts(found, older))}

    def figure(self, asked: Query) -> str:
        """A quantity's trend as SVG."""
        request = self._trend(asked)
        with self._one:
            return drawn(found_trend(request)[0])

    def _trend(self, asked: Query) -> TrendRequest:
        if not asked.get("quantity"):
            raise Refused(400, "quantity: found none; expected a name of results, such as K_i")
        seed = _whole(asked, "seed", 0) if asked.get("seed") else None
        return TrendRequest(asked["quantity"], self._folder, asked.get("rig"), asked.get("procedure"), seed,
                            _whole(asked, "last", TrendRequest.last, least=2), machine=_machine(asked))  # fmt: skip

    def _known(self, run_id: str) -> tuple[IndexEntry, RunDirectory]:
        """A run of the folder. What was asked for is compared with what is there, and becomes no path by itself.

        Raises:
            Refused: 404, none of that name.
        """
        entry = next((e for e in self.entries() if e.run_id == run_id), None)
        if entry is None:
            raise Refused(404, "run: there is none of that name in the folder")
        return entry, RunDirectory(self._folder / entry.run_id)

    def _read(self, ask: Callable[[], T]) -> T:
        try:
            return ask()
        except (sqlite3.Error, OSError) as error:
            raise BenchError(f"{self._folder / index.NAME}: the index cannot be used: {error}") from error


def _report(run: RunDirectory) -> Path:
    return run.path / "report.html"


def _run(e: IndexEntry) -> dict[str, Any]:
    return {
        **e._asdict(),
        "served": bool(e.served),
        "machine": e.machine,
        "which": which_machine(e.served, e.seed, e.visit),
    }


def _meant(e: IndexEntry, words: list[str]) -> bool:
    """Whether all words are in what a line says of the run; `failed` is any that ended neither PASS nor DONE."""
    which = which_machine(e.served, e.seed, e.visit)
    said = " ".join((e.run_id, e.procedure, e.rig, e.uut, e.outcome, e.machine, which)).lower()
    return all(e.outcome not in index.SOUND if word == "failed" else word in said for word in words)


def _machine(asked: Query) -> MachineKind | None:
    """What machine a query is for.

    Raises:
        Refused: 400, there is no such.
    """
    word = asked.get("machine")
    if word is not None and word not in get_args(MachineKind):
        raise Refused(400, f"machine: found {word[:40]}; expected {', '.join(get_args(MachineKind))}")
    return cast("MachineKind | None", word)


def _whole(asked: Query, name: str, default: int, least: int = 0) -> int:
    """A whole number of a query.

    Raises:
        Refused: 400, it is none or out of range.
    """
    text = asked.get(name, str(default))
    if not (text.isascii() and text.isdigit() and least <= int(text) <= LARGEST):
        raise Refused(400, f"{name}: found {text[:40]}; expected a whole number from {least} to {LARGEST}")
    return int(text)
