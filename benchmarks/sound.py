"""Sound virtual rigs with the plans that people run: each default plan alone and in the chain, and each choice of a plan.

    python -m benchmarks.sound runs/sound.jsonl --first 0 --count 60 --choices 20 --jobs 2
    python -m benchmarks.sound runs/mine.jsonl --rig mine.toml --count 5

Cases that the file holds already are left out, so that the same command goes on where it was stopped. `--report` prints what
the file holds: how many runs of each case ended how, and every one that is not PASS or DONE with what is wrong about it.
"Off" is a value further from its truth than 3 U; a verdict other than pass is told beside the true value and the limit.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

from bench.calibration import Calibration
from bench.cli.campaign.fleet import pool
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import BenchError, ConfigError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.limits import Verdict
from bench.record.outcomes import outcome_of
from bench.record.records import Measurement, measurement, missing
from bench.record.specs import applied, load_spec
from bench.rigfile import load_rig
from benchmarks.cases import FOREIGN, RIGS, TRUTH, Case, able_cases, cases_of, foreign_cases, load, needed


def main() -> None:
    """Run what is missing, or print what there is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=60, help="rigs of each default plan")
    parser.add_argument("--choices", type=int, default=20, help="rigs of each choice of a plan")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", action="append", default=[], metavar="PROCEDURE")
    parser.add_argument(
        "--foreign", action="store_true", help="the rigs of the examples, by their twins, with default plans"
    )
    parser.add_argument(
        "--rig",
        action="append",
        default=[],
        metavar="FILE",
        help="this rig file's own, every procedure that it can run",
    )
    parser.add_argument("--report", action="store_true")
    asked = parser.parse_args()
    if not asked.report:
        asked.file.parent.mkdir(parents=True, exist_ok=True)
        run_missing(asked)
    report(read(asked.file))


def run_missing(asked: argparse.Namespace) -> None:
    """Every seed of the rigs through its cases, one line for each run as it ends."""
    known = {(e["rig"], e["case"], e["seed"]) for e in read(asked.file)}
    seeds = range(asked.first, asked.first + max(asked.count, asked.choices))
    waiting = []
    with pool(asked.jobs) as (workers, _):
        for seed in seeds:
            for rig, found in chosen(asked):
                cases = [c for c in found if seed - asked.first < limit_of(c, asked)]
                left = [c for c in cases if (rig, c.name, seed) not in known]
                if left:
                    waiting.append(workers.submit(run_rig, rig, seed, left, asked.file))
        for job in as_completed(waiting):
            job.result()


def chosen(asked: argparse.Namespace) -> Iterator[tuple[str, Iterator[Case]]]:
    """Each rig that was asked for, with its cases."""
    if asked.rig:
        yield from ((rig, able_cases(rig, asked.only)) for rig in asked.rig)
    elif asked.foreign:
        yield from ((rig, foreign_cases(rig, asked.only)) for rig in FOREIGN)
    else:
        yield from ((rig, cases_of(rig, asked.only)) for rig in RIGS)


def limit_of(case: Case, asked: argparse.Namespace) -> int:
    return int(asked.count if case.changes == "{}" else asked.choices)


def run_rig(rig: str, seed: int, cases: list[Case], file: Path) -> None:
    """The cases on one virtual rig; the calibrations that any of them uses are made first, with default plans and
    the switches that they are needed at. Each is a line of the file as soon as it has ended: one write, so that processes do
    not mix theirs."""
    known: dict[str, Calibration] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.mcap"
        for name, switches in needed(cases).items():
            try:
                known[name] = attempt(rig, name, seed, switches, path, known).calibration()
            except BenchError:
                continue  # the cases that need it say so
        for case in cases:
            line = run_case(case, seed, path, known if case.chain else {})
            with file.open("ab", buffering=0) as out:
                out.write(json.dumps(line).encode() + b"\n")


def attempt(
    rig: str,
    name: str,
    seed: int,
    changes: Mapping[str, Any],
    path: Path,
    known: Mapping[str, Calibration],
    truth: Mapping[str, float] | None = None,
) -> Simulated:
    """A run as `bench run` makes it.

    Raises:
        BenchError: it cannot be made.
    """
    path.unlink(missing_ok=True)
    file = load_rig(rig)
    procedure = load(name)
    plan = procedure.plan.model_validate({**file.plans.get(name, {}), **changes})
    if problems := list(procedure.check(file, plan)):
        raise ConfigError("; ".join(problems))
    return simulated_run(name, rig, seed, changes, path, truth, known)


def run_case(case: Case, seed: int, path: Path, known: Mapping[str, Calibration]) -> dict[str, Any]:
    """One line: how the run ended and what is wrong about it."""
    began = time.process_time()
    line: dict[str, Any] = {"rig": case.rig, "case": case.name, "seed": seed}
    try:
        done = attempt(case.rig, case.procedure, seed, json.loads(case.changes), path, known, TRUTH.get(case.name))
        line |= judged(done, case.rig)
    except ConfigError as error:
        line |= {"outcome": "REFUSED", "wrong": [str(error)]}
    except Exception as error:  # a mistake of ours on one rig is that rig's result
        line |= {"outcome": "ERROR", "wrong": [f"{type(error).__name__}: {error}"]}
    return line | {"cpu_s": round(time.process_time() - began, 2)}


def judged(done: Simulated, rig: str) -> dict[str, Any]:
    """Outcome by the rig's limits, findings that are no notes, verdicts that are not pass, values that are off."""
    left_out = [q.name for q in done.procedure.left_out(done.recording.plan)]
    limits, _ = applied(load_spec(load_rig(rig).name, done.procedure.name), done.recording.plan, left_out)
    findings = [r for r in done.results if isinstance(r, Finding)]
    measured = [r for r in done.results if isinstance(r, Measured)]
    entries = [measurement(m, limits.get(m.quantity.name), done.seed) for m in measured]
    names = {m.quantity.name for m in measured}
    may_lack = {q.name for q in done.procedure.optional} | set(left_out)
    lacking = [q for q in done.procedure.measures if q.name not in names | may_lack]
    entries += [missing(q, limits.get(q.name)) for q in lacking]
    truth = {**done.truth, **truth_of_motion(done)}
    deciding = [f for f in findings if f.effect is not Effect.NOTE]
    wrong = [f"{f.code} ({f.where}): {f.text}" for f in deciding]
    told = {e: verdict_told(e, truth) for e in entries if e.verdict not in (Verdict.PASS, Verdict.NONE)}
    outcome = outcome_of(entries, findings, None)
    return {
        "outcome": str(outcome),
        "wrong": [*wrong, *(text for text, _ in told.values())],
        "off": list(off(entries, truth)),
        "deserved": not deciding and all(fair for _, fair in told.values()),
    }


def verdict_told(entry: Measurement, truth: Mapping[str, float]) -> tuple[str, bool]:
    """A verdict that is not pass beside the truth, and whether the truth deserves it: a value beyond its limit fails, one
    that is nearer to its limit than U leaves it open."""
    said = f"{entry.name} {entry.where} {entry.verdict}"
    true, limit = true_of(entry, truth), entry.limit
    if true is None or limit is None or entry.expanded_uncertainty is None:
        return f"{said}, no truth", False
    within = min(
        math.inf if limit.high is None else limit.high - true, math.inf if limit.low is None else true - limit.low
    )
    fair = within < 0 if entry.verdict is Verdict.FAIL else abs(within) < 2 * entry.expanded_uncertainty
    return (
        f"{said}: true {true:.6g}, limit {limit.low} to {limit.high} {limit.unit}{'' if fair else ', undeserved'}",
        fair,
    )


def off(entries: Iterable[Measurement], truth: Mapping[str, float]) -> Iterator[str]:
    """Values further than 3 U from their truth."""
    for e in entries:
        true = true_of(e, truth)
        if true is not None and e.value is not None and e.expanded_uncertainty is not None:
            far = abs(e.value - true) / max(e.expanded_uncertainty, 1e-300)
            if far > 3:
                yield f"{e.name} {e.where}: {far:.1f} U"


def true_of(entry: Measurement, truth: Mapping[str, float]) -> float | None:
    return truth.get(f"{entry.name}@{entry.where}", truth.get(entry.name))


def read(file: Path) -> list[dict[str, Any]]:
    """The lines of a file; a last one that was cut off is left out."""
    if not file.exists():
        return []
    lines = file.read_text(encoding="utf-8").split("\n")
    return [json.loads(line) for line in lines[:-1]]


def report(lines: list[dict[str, Any]]) -> None:
    """A line for each case, then one for each run that needs a look."""
    ends: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    spent: dict[tuple[str, str], float] = defaultdict(float)
    for e in lines:
        ends[e["rig"], e["case"]][e["outcome"]] += 1
        spent[e["rig"], e["case"]] += e["cpu_s"]
    for key, counts in ends.items():
        told = ", ".join(f"{n} {end}" for end, n in counts.most_common())
        print(f"{Path(key[0]).stem:8} {key[1]:58} {told}  ({spent[key] / counts.total():.1f} s each)")
    for e in lines:
        if e["outcome"] not in ("PASS", "DONE") or e.get("off"):
            deserved = ", as the truth deserves" if e.get("deserved") and not e.get("off") else ""
            print(f"{Path(e['rig']).stem} {e['case']} seed {e['seed']}: {e['outcome']}{deserved}")
            for text in [*e["wrong"], *e.get("off", ())]:
                print(f"    {text}")


if __name__ == "__main__":
    main()
