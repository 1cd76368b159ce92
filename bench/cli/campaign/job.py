"""One virtual rig through the steps of a campaign: what each process of the pool does, and what it sends back.

Everything that goes in or comes out is plain data, so that it fits through a pipe, a network and a JSON line.
"""

from __future__ import annotations

import gc
import importlib
import logging
import math
import os
import shutil
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bench.cli.campaign.tasks import RigTask, StepTask


@dataclass
class _Line:
    """What is noted of one rig; see docs/reference/campaign.md."""

    seed: int
    visit: int
    began: float
    ended: float = 0.0
    cpu_s: float = 0.0
    steps: list[dict[str, Any]] = field(default_factory=list)
    values: list[dict[str, Any]] = field(default_factory=list)
    findings: list[dict[str, Any]] = field(default_factory=list)
    cannot: list[dict[str, Any]] = field(default_factory=list)
    stopped: str | None = None
    kept: list[str] = field(default_factory=list)


def settle_in(procedures: Sequence[Any]) -> None:
    """What a process of the pool does first: ignore Ctrl-C (the parent ends the campaign in order), end with the
    parent however that ends, know the parent's procedures, and do the heavy imports."""
    import signal
    from multiprocessing import parent_process

    from bench import catalogue

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    logging.getLogger().addHandler(
        logging.NullHandler()
    )  # what stops a rig is in its line; the terminal is the parent's
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    catalogue.PROCEDURES = tuple(procedures)
    importlib.import_module("bench.cli.virtual")
    gc.freeze()  # what is imported stays; looking it through again and again costs a fiftieth of a rig


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)


def run_rig(task: RigTask, seed: int) -> dict[str, Any]:
    """Draw the rig of that seed and take it through every step; one that cannot be relied on is not adopted, and the
    steps that need it are left out.

    Raises:
        ConfigError: the rig file is not the one that the campaign was started with.
    """
    _refuse_another_rig(task)
    line = _Line(seed, task.visit, time.time())
    cpu = time.process_time()
    work = Path(task.folder) / "work" / str(seed)
    work.mkdir(parents=True, exist_ok=True)
    known: dict[str, Any] = {}
    try:
        for number, step in enumerate(task.steps, 1):
            if all(need in known for need in step.needs):
                _run_step(task, step, number, work, known, line)
            elif lacking := _unable(task, step, line):
                line.cannot.append({"step": number, "why": f"needs {lacking}, which this machine cannot do"})
        _refuse_another_rig(task)
        _keep(task, work, line)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    line.ended, line.cpu_s = time.time(), time.process_time() - cpu
    return vars(line)


def _refuse_another_rig(task: RigTask) -> None:
    from bench.errors import ConfigError
    from bench.rigfile import load_rig

    if load_rig(task.rig).digest != task.rig_sha256:
        raise ConfigError(
            f"rig file {task.rig}: changed while the campaign ran; what was done before is noted. "
            "Next: put it back and give the same command, or give --new to start another campaign"
        )


def _run_step(
    task: RigTask, step: StepTask, number: int, work: Path, known: dict[str, Any], line: _Line
) -> None:  # fmt: skip
    """One step into `line`; its facts into `known` if they can be relied on."""
    from bench.cli.campaign.facts import simulated_step
    from bench.errors import BenchError
    from bench.findings import Effect, Finding

    began = time.time()
    path = work / f"{number}-{step.procedure}.mcap"
    try:
        done = simulated_step(task, step, line.seed, path, known)
        findings = [r for r in done.results if isinstance(r, Finding)]
        line.values += _values(number, [r for r in done.results if not isinstance(r, Finding)], done.truth, line.seed)
        if done.cannot:
            line.cannot.append({"step": number, "why": done.cannot})
        if step.adopt and done.calibration is not None and all(f.effect is Effect.NOTE for f in findings):
            known[step.procedure] = done.calibration()
    except BenchError as error:
        findings = [Finding(_code(error), str(error), "", Effect.ERROR)]
    except Exception as error:  # a mistake of ours on one rig is that rig's result, not the campaign's end
        findings = [Finding(f"unexpected-{type(error).__name__}", str(error), "", Effect.ERROR)]
    line.steps.append({"step": number, "wall_s": time.time() - began})
    line.findings += [{"step": number, "code": f.code, "effect": f.effect.value, "text": f.text} for f in findings]
    bad = [f.code for f in findings if f.effect is not Effect.NOTE]
    if bad:
        line.stopped = line.stopped or f"{step.procedure}: {bad[0]}"


def _unable(task: RigTask, step: StepTask, line: _Line) -> str:
    """The procedure that a step needs and that this machine cannot do."""
    unable = [task.steps[c["step"] - 1].procedure for c in line.cannot]
    return next((need for need in step.needs if need in unable), "")


def _code(error: Exception) -> str:
    """`LinkError` -> `link-error`."""
    name = type(error).__name__
    return "".join(f"-{c.lower()}" if c.isupper() and n else c.lower() for n, c in enumerate(name))


def _values(number: int, measured: Iterable[Any], truth: Mapping[str, float], seed: int) -> list[dict[str, Any]]:
    from bench.uncertainty import interval

    found = []
    for m in measured:
        bounds = interval(m.estimate, seed)
        true = truth.get(f"{m.quantity.name}@{m.where}", truth.get(m.quantity.name))
        numbers = (m.estimate.value, bounds.low, bounds.high, bounds.U, 0.0 if true is None else true)
        if not all(map(math.isfinite, numbers)):
            continue  # no value; the rig counts as one that missed it
        found.append({
            "step": number, "name": m.quantity.name, "where": m.where, "unit": m.quantity.unit,
            "value": m.estimate.value, "low": bounds.low, "high": bounds.high, "U": bounds.U,
            "method": bounds.method, "tails": list(bounds.tails), "truth": true,
        })  # fmt: skip
    return found


def _keep(task: RigTask, work: Path, line: _Line) -> None:
    """Recordings worth looking at move to `recordings/<seed>`."""
    for number, step in enumerate(task.steps, 1):
        path = work / f"{number}-{step.procedure}.mcap"
        if path.is_file() and (task.keep == "all" or (task.keep == "missed" and _missed(line, number, step))):
            kept = Path(task.folder) / "recordings" / str(line.seed) / path.name
            kept.parent.mkdir(parents=True, exist_ok=True)
            path.replace(kept)
            line.kept.append(str(kept.relative_to(task.folder)))


def _missed(line: _Line, number: int, step: StepTask) -> bool:
    if any(f["step"] == number and f["effect"] != "note" for f in line.findings):
        return True
    of_step = [v for v in line.values if v["step"] == number and v["name"] in step.judged]
    held = {v["name"] for v in of_step if v["truth"] is None or v["low"] <= v["truth"] <= v["high"]}
    return any(name not in held for name in step.judged)
