"""Many virtual rigs: each rig is one job of a pool of processes, noted in the journal as soon as it is done."""

from __future__ import annotations

import multiprocessing
import os
import shutil
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench import catalogue, os_signals
from bench.campaign.directory import CampaignDirectory
from bench.cli import threads
from bench.cli.campaign.job import run_rig, settle_in
from bench.cli.campaign.tasks import RigTask
from bench.errors import BenchError
from bench.progress import Progress

ALONE = 4  # rigs that are timed alone, after one that pays for the imports
WORTH = 10  # rigs for each of those, at least: fewer, and the timing would cost more than it tells
ASK_S = 0.2  # how often a signal is looked for


@dataclass
class Stopped:
    """Whether a signal asks the campaign to end."""

    by: str = ""

    def received(self, name: str) -> None:
        self.by = self.by or name


@contextmanager
def pool(jobs: int) -> Iterator[tuple[Executor, int]]:
    """Processes of their own interpreter each, with library threads limited to one: one process per core."""
    before = {name: os.environ.get(name) for name in threads.LIMITS}
    os.environ.update(dict.fromkeys(threads.LIMITS, "1"))
    spawned = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(jobs, spawned, settle_in, (catalogue.PROCEDURES,))
    try:
        yield executor, jobs
    finally:
        executor.shutdown(cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def run_fleet(
    directory: CampaignDirectory, task: RigTask, seeds: list[int], jobs: int, executor: Executor, progress: Progress
) -> str:
    """Do the rigs that the journal lacks; returns the signal that ended it early, or "".

    After a signal no rig is begun; those under way are finished and noted.

    Raises:
        BenchError: a process died; the journal is whole.
        OSError: the journal cannot be written.
    """
    stopped, journal = Stopped(), directory.journal
    shutil.rmtree(directory.path / "work", ignore_errors=True)  # of a campaign that was killed
    done = {e["seed"] for e in journal.entries() if e["kind"] == "rig"}
    left = deque(s for s in seeds if s not in done)
    wanted = set(seeds)
    progress.total(len(left))
    if left:
        progress.step(f"rig {left[0]}")
    session = os.urandom(4).hex()
    count = ALONE + 1 if jobs > 1 and len(left) >= ALONE * WORTH else 0
    kinds = deque(["first", *["measured"] * (count - 1)] if count else [])

    def note(line: dict[str, Any], alone: str) -> None:
        journal.append({"kind": "rig", "session": session, "jobs": jobs, "alone": alone, **line})
        done.add(line["seed"])
        if line["stopped"]:
            progress.line(f"rig {line['seed']}: {line['stopped']}")
        if len(done & wanted) < len(wanted):
            progress.step(f"rig {line['seed']} done")

    try:
        with os_signals.delivered_to(stopped.received):
            while kinds and not stopped.by:
                _in_turn(executor, task, left, 1, stopped, lambda line: note(line, kinds.popleft()), progress, 1)
            if not stopped.by:
                _in_turn(executor, task, left, jobs + 1, stopped, lambda line: note(line, "no"), progress, len(left))
    except BrokenProcessPool as error:
        raise BenchError(
            "a process of the campaign died: killed, or out of memory. What is done is noted. "
            "Next: the same command goes on with the rest (--jobs 1 needs the least memory)"
        ) from error
    finally:
        shutil.rmtree(directory.path / "work", ignore_errors=True)
    return stopped.by


def _in_turn(
    executor: Executor, task: RigTask, left: deque[int], window: int, stopped: Stopped,
    note: Callable[[dict[str, Any]], None], progress: Progress, most: int,
) -> None:  # fmt: skip
    """At most `most` rigs, with at most `window` of them handed out at a time: each has a process, and one waits."""
    running: set[Future[dict[str, Any]]] = set()
    told = False
    begun = 0
    while running or (left and begun < most and not stopped.by):
        while left and begun < most and len(running) < window and not stopped.by:
            running.add(executor.submit(run_rig, task, left.popleft()))
            begun += 1
        finished, running = wait(running, ASK_S, FIRST_COMPLETED)
        for future in finished:
            note(future.result())
        if stopped.by and not told:
            told = True
            waiting = {f for f in running if f.cancel()}
            running -= waiting
            progress.line(f"{stopped.by}: finishing {len(running)} rigs under way; the same command goes on later")


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def task_folder(directory: CampaignDirectory) -> Path:
    """Absolute: a process of the pool may stand elsewhere."""
    return directory.path.resolve()
