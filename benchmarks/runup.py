"""A run-up of a minute with order tracking, from the plan to its report, by part: processor and wall seconds. Target: 10 s.

    python benchmarks/runup.py
    taskset -c 0 perf stat -e instructions:u python benchmarks/runup.py      where others use the machine too

Simulation is the core alone; acquisition is the rest of what goes on while the shaft turns (bytes, decoding, recording, the
recorder's thread); figures are what the procedure draws from its evaluation, drawing their SVG; report is HTML and PDF.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bench.cli import compose, reporting
from bench.progress import PlainProgress
from bench.recording import Recording
from bench.run import runner
from bench.run.supervisor import Supervisor

TARGET_S, RAMP_S = 10.0, 60.0
PLAN = (f"acceleration_rad_s2={(14000 - 600) / 9.5492966 / RAMP_S:.4f}",)
PARTS = ("start", "simulation", "acquisition", "analysis", "figures", "drawing", "report")


@dataclass
class Parts:
    """Processor and wall seconds by part; of nested parts the inner one counts."""

    spent: dict[str, list[float]] = field(default_factory=lambda: defaultdict(lambda: [0.0, 0.0]))
    now: list[str] = field(default_factory=lambda: ["start"])
    last: tuple[float, float] = field(
        default_factory=lambda: (0.0, time.perf_counter())
    )  # imports count as processor time

    def to(self, name: str | None) -> None:
        """Enter a part; None: leave it."""
        cpu, wall = time.process_time(), time.perf_counter()
        for k, (at, before) in enumerate(zip((cpu, wall), self.last, strict=True)):
            self.spent[self.now[-1]][k] += at - before
        self.last = (cpu, wall)
        if name is None:
            self.now.pop()
        else:
            self.now.append(name)

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """A part."""
        self.to(name)
        try:
            yield
        finally:
            self.to(None)

    def timed(self, name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """`work` as a part."""

        def inner(*args: Any, **kwargs: Any) -> Any:
            with self.part(name):
                return work(*args, **kwargs)

        return inner


def whole_run(out: Path, parts: Parts) -> Path:
    """Run, analyse and report; the run's folder."""
    from reports import figures as drawing
    from sim_backend.machines.amb5dof.plant import AmbPlant

    AmbPlant.run = parts.timed("simulation", AmbPlant.run)  # type: ignore[method-assign]
    drawing.draw = parts.timed("drawing", drawing.draw)
    runner.acquired = parts.timed("acquisition", runner.acquired)  # type: ignore[attr-defined]
    runner.evaluate = parts.timed("analysis", runner.evaluate)  # type: ignore[attr-defined]
    job, connect = compose.prepare(compose.Request("run-up", "amb5dof", seed=1, plan=PLAN, out=out))
    drawn = job.procedure.figures
    job = replace(job, procedure=replace(job.procedure, figures=parts.timed("figures", lambda *of: list(drawn(*of)))))
    with Supervisor().watching() as watching:
        report = parts.timed("report", reporting.build)
        result = runner.run(job, out, connect, watching, PlainProgress(sys.stderr), report)
    for finding in result.record.findings:
        if finding.code == "report-failed":
            raise SystemExit(f"no report to measure: {finding.text}")
    return result.directory


def main() -> int:
    """Run and print; 1 when the target is missed."""
    parts = Parts()
    with tempfile.TemporaryDirectory() as folder:
        run = whole_run(Path(folder), parts)
        parts.to(None)
        sizes = {name: (run / name).stat().st_size / 1e6 for name in ("recording.mcap", "report.html", "report.pdf")}
        recording: Recording[Any] = Recording.open(run / "recording.mcap")
        (passage,) = recording.steps("passage")
        seconds = (passage.end_ns - passage.start_ns) * 1e-9
    cpu, wall = (sum(spent[k] for spent in parts.spent.values()) for k in (0, 1))
    print(f"run-up of {seconds:.0f} s; {', '.join(f'{name} {size:.1f} MB' for name, size in sizes.items())}")
    print("part          processor s    wall s")
    for name in PARTS:
        print(f"{name:12s} {parts.spent[name][0]:12.2f} {parts.spent[name][1]:9.2f}")
    print(f"{'whole':12s} {cpu:12.2f} {wall:9.2f}   (target {TARGET_S:.0f})")
    print(json.dumps({"processor_s": cpu, "wall_s": wall, **{name: spent[0] for name, spent in parts.spent.items()}}))
    return int(cpu > TARGET_S)


if __name__ == "__main__":
    sys.exit(main())
