"""What a campaign over many virtual rigs says: every quantity against its bands, failures, and how fast it went."""

from __future__ import annotations

import dataclasses
import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bench import provenance
from bench.campaign import Campaign
from bench.campaign_bands import Failure, Quantity, Sample, coverage
from bench.campaign_directory import CampaignDirectory
from bench.campaign_speed import Speed, speed
from bench.cli.campaign_steps import Planned
from bench.limits import Verdict

if TYPE_CHECKING:
    from bench.cli.campaign import Asked

Entry = Mapping[str, Any]


@dataclass(frozen=True)
class Result:
    """All of it."""

    rigs: int
    first_seed: int
    rows: tuple[Quantity, ...]
    failures: tuple[Failure, ...]
    stopped: Mapping[str, int]
    step_s: Mapping[str, float]  # mean wall time of one rig by step
    rig_s: float
    speed: Speed | None
    verdict: Verdict

    def text(self) -> str:
        """The table as lines."""
        lines = [f"{self.rigs} rigs from seed {self.first_seed}, {self.rig_s:.2f} s a rig"]
        for row in self.rows:
            c = row.coverage
            width = "-" if c.width is None else f"{c.width:.3f}"
            said = c.verdict.value if row.judged else f"not judged ({c.verdict.value})"
            lines.append(f"  {row.name:14} coverage {c.coverage:.4f}  width {width:6} {said}")
        if self.rows:
            low, high = self.rows[0].coverage.band
            lines.append(f"bands: coverage {low:.4f} to {high:.4f}, width 0.80 to 1.25")
        lines += [f"  {f.effect}: {f.code} in {f.procedure}: {f.rigs} rigs, as seed {f.example}: {f.text}"
                  for f in self.failures if f.effect != "note"]  # fmt: skip
        if self.speed is not None:
            s = self.speed
            lines.append(
                f"parallel efficiency {s.efficiency:.0%} on {s.jobs} processes "
                f"(a rig alone {s.alone_s:.2f} s; busy {s.busy:.0%}, computing {s.cpu:.0%} of the time; "
                f"{s.own:.0%} without other programs)"
            )
        return "\n".join([*lines, f"bands: {self.verdict.value}"]) + "\n"


def judged(campaign: Campaign, steps: Sequence[Planned], entries: Sequence[Entry]) -> Result:
    """Put the rigs' lines together; quantities without a truth are left out."""
    rows = tuple(row for step in steps for row in _rows(step, entries))
    verdicts = [row.coverage.verdict for row in rows if row.judged]
    told = {(row.step, row.name.partition("@")[0]) for row in rows}
    if any((s.number, name) not in told for s in steps for name in s.judged):
        verdicts.append(Verdict.INDETERMINATE)  # the truth does not hold that quantity
    order = (Verdict.FAIL, Verdict.INDETERMINATE)
    verdict = next((v for v in order if v in verdicts), Verdict.PASS if verdicts else Verdict.INDETERMINATE)
    names = {s.number: s.procedure.name for s in steps}
    times: dict[str, list[float]] = {}
    for s in (s for e in entries for s in e["steps"]):
        times.setdefault(f"{s['step']} {names[s['step']]}", []).append(s["wall_s"])
    walls = [e["ended"] - e["began"] for e in entries]
    return Result(
        rigs=len(entries), first_seed=min((e["seed"] for e in entries), default=0), rows=rows,
        failures=tuple(_failures(entries, names)),
        stopped=dict(Counter(e["stopped"] for e in entries if e["stopped"]).most_common()),
        step_s={k: sum(v) / len(v) for k, v in times.items()}, rig_s=sum(walls) / len(walls) if walls else 0.0,
        speed=speed(entries), verdict=verdict,
    )  # fmt: skip


def _rows(step: Planned, entries: Sequence[Entry]) -> list[Quantity]:
    found: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    about = {q.name: q for q in step.procedure.measures}
    for e in entries:
        for v in e["values"]:
            if v["step"] == step.number and v["truth"] is not None:
                label = f"{v['name']}@{v['where']}" if v["where"] else v["name"]
                found.setdefault(label, []).append((e["seed"], v))
    given = {v["name"] for e in entries for v in e["values"] if v["step"] == step.number}
    for name in step.judged:
        if entries and name not in given:  # no rig at all gave a value
            found[name] = []
    rows = []
    for label, values in sorted(found.items(), key=lambda item: _place(item[0], list(about))):
        name = values[0][1]["name"] if values else label
        samples = tuple(
            Sample(v["value"] - v["truth"], v["low"] - v["truth"], v["high"] - v["truth"], v["U"]) for _, v in values
        )
        rows.append(Quantity(
            step=step.number, procedure=step.procedure.name, name=label, unit=about[name].unit, about=about[name].about,
            judged=name in step.judged, coverage=coverage(samples, len(entries)), seeds=tuple(s for s, _ in values),
            samples=samples, monte_carlo=sum(v["method"] == "monte-carlo" for _, v in values),
        ))  # fmt: skip
    return rows


def _place(label: str, declared: list[str]) -> int:
    name = label.partition("@")[0]
    return declared.index(name) if name in declared else len(declared)


def _failures(entries: Sequence[Entry], names: Mapping[int, str]) -> list[Failure]:
    seen: dict[tuple[int, str, str], list[tuple[int, str]]] = {}
    for e in entries:
        first: dict[tuple[int, str, str], str] = {}
        for f in e["findings"]:
            first.setdefault((f["step"], f["code"], f["effect"]), f["text"])
        for key, text in first.items():
            seen.setdefault(key, []).append((e["seed"], text))
    found = [
        Failure(step, names[step], code, effect, len(rigs), rigs[0][0], rigs[0][1])
        for (step, code, effect), rigs in seen.items()
    ]
    return sorted(found, key=lambda f: (f.effect == "note", -f.rigs, f.step, f.code))


def write(directory: CampaignDirectory, asked: Asked, result: Result, report: bool) -> None:
    """`coverage.json`, and the summary if wanted."""
    content = {
        "schema": 1, "name": asked.campaign.name, "rig": asked.rig.name, "rigs": result.rigs,
        "first_seed": result.first_seed, "verdict": result.verdict.value,
        "quantities": [_entry(row) for row in result.rows],
        "findings": [dataclasses.asdict(f) for f in result.failures], "stopped": dict(result.stopped),
        "step_s": dict(result.step_s), "rig_s": result.rig_s,
        "speed": None if result.speed is None else dataclasses.asdict(result.speed),
    }  # fmt: skip
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    directory.coverage.write_text(text, encoding="utf-8")
    if report:
        _summary(directory, asked, result)


def _summary(directory: CampaignDirectory, asked: Asked, result: Result) -> None:
    from reports import campaign as summary
    from reports import campaign_coverage as page

    now = provenance.now()
    numbered = [
        (s, next((v for k, v in result.step_s.items() if k.startswith(f"{s.number} ")), 0.0)) for s in asked.steps
    ]
    content = page.CoverageContent(
        campaign=directory.path.name, title=asked.campaign.title or asked.campaign.name, rig=asked.rig.name,
        rigs=result.rigs, first_seed=result.first_seed, date=now, verdict=result.verdict.value,
        quantities=result.rows, failures=result.failures,
        steps=tuple((s.procedure.name, _plan(s), wall) for s, wall in numbered), rig_s=result.rig_s, speed=result.speed,
    )  # fmt: skip
    summary.build(directory.path, page.view_of(content), now)


def _plan(step: Planned) -> str:
    return ", ".join(f"{key} = {json.dumps(value)}" for key, value in step.plan.model_dump(mode="json").items())


def _entry(row: Quantity) -> dict[str, Any]:
    c = row.coverage
    reach = None if c.width_range is None else [x if math.isfinite(x) else None for x in c.width_range]
    return {
        "step": row.step, "procedure": row.procedure, "name": row.name, "unit": row.unit, "judged": row.judged,
        "rigs": c.rigs, "values": c.values, "hits": c.hits, "coverage": c.coverage, "band": list(c.band),
        "width": c.width, "width_range": reach, "pooled_width": c.pooled_width, "mean_expanded_uncertainty": c.mean_U,
        "bias": c.bias, "verdict": c.verdict.value, "monte_carlo": row.monte_carlo,
    }  # fmt: skip
