"""What a campaign over many virtual rigs says: every quantity against its bands, failures, and how fast it went."""

from __future__ import annotations

import dataclasses
import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bench.campaign import Campaign
from bench.campaign.bands import Failure, Quantity, Sample, Tail, Unable, coverage, tails
from bench.campaign.directory import CampaignDirectory
from bench.campaign.speed import Speed, speed
from bench.cli.campaign.steps import Planned
from bench.record.limits import Verdict
from bench.run import provenance

if TYPE_CHECKING:
    from bench.cli.campaign.asked import Asked

Entry = Mapping[str, Any]
Values = list[tuple[int, Mapping[str, Any]]]  # of one quantity: seed, and the value as the journal has it
SHOWN = 3  # seeds named in one line


@dataclass(frozen=True)
class Result:
    """All of it."""

    rigs: int
    first_seed: int
    rows: tuple[Quantity, ...]
    failures: tuple[Failure, ...]
    unable: tuple[Unable, ...]
    stopped: Mapping[str, int]
    step_s: Mapping[str, float]  # mean wall time of one rig by step
    rig_s: float
    speed: Speed | None
    verdict: Verdict
    visit: int = 0

    def text(self) -> str:
        """The table as lines."""
        lines = [f"{self.rigs} rigs from seed {self.first_seed}, visit {self.visit}, {self.rig_s:.2f} s a rig"]
        widest = max((len(row.name) for row in self.rows), default=0)
        if self.rows:
            lines.append(f"  {'':{widest}}  coverage  width   >2U   >3U  >10U")
        for row, before in zip(self.rows, (None, *self.rows), strict=False):
            if before is None or before.step != row.step:
                lines.append(f"step {row.step}, {row.procedure}")
            lines.append(f"  {row.name:{widest}}  {_figures(row)}")
        if self.rows:
            low, high = self.rows[0].coverage.band
            lines.append(f"bands: coverage {low:.4f} to {high:.4f}, width 0.80 to 1.25; errors far out: found/at most")
            lines += [
                f"  tails of {_farthest(row)}" for row in self.rows if any(t.verdict is Verdict.FAIL for t in row.tails)
            ]
        lines += [_unable(u) for u in self.unable]
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
    unable = tuple(u for step in steps if (u := _unable_of(step, entries)) is not None)
    rows = _rows(steps, entries, unable)
    verdicts = [row.verdict for row in rows if row.judged]
    told = {(row.step, _name(row.name)) for row in rows}
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
        rigs=len(entries), first_seed=min((e["seed"] for e in entries), default=0), visit=campaign.visit or 0, rows=rows,
        failures=tuple(_failures(entries, names)), unable=unable,
        stopped=dict(Counter(e["stopped"] for e in entries if e["stopped"]).most_common()),
        step_s={k: sum(v) / len(v) for k, v in times.items()}, rig_s=sum(walls) / len(walls) if walls else 0.0,
        speed=speed(entries), verdict=verdict,
    )  # fmt: skip


def _figures(row: Quantity) -> str:
    c = row.coverage
    width = "-" if c.width is None else f"{c.width:.3f}"
    tails = "  ".join(f"{f'{t.found}/{t.most}':>4}" for t in row.tails)
    said = row.verdict.value if row.judged else f"not judged ({row.verdict.value})"
    return f"{c.coverage:.4f}    {width:5}  {tails}  {said}"


def _farthest(row: Quantity) -> str:
    worst = ", ".join(f"{ratio:+.1f} U on seed {seed}" for seed, ratio in row.farthest[:SHOWN])
    return f"{row.name} in step {row.step}: {worst}"


def _unable(u: Unable) -> str:
    low, high = u.interval
    seeds = ", ".join(str(seed) for seed, _ in u.which[:SHOWN]) + (" ..." if len(u.which) > SHOWN else "")
    share = f"{len(u.which)} of {u.rigs} rigs ({u.share:.1%}; {low:.1%} to {high:.1%})"
    return f"  cannot do {u.procedure}: {share}, as seed {seeds}: {u.which[0][1]}"


def _unable_of(step: Planned, entries: Sequence[Entry]) -> Unable | None:
    which = tuple((e["seed"], c["why"]) for e in entries for c in e["cannot"] if c["step"] == step.number)
    return Unable(step.number, step.procedure.name, len(entries), which) if which else None


def _rows(steps: Sequence[Planned], entries: Sequence[Entry], unable: Sequence[Unable]) -> tuple[Quantity, ...]:
    left_out = {u.step: {seed for seed, _ in u.which} for u in unable}
    parts = []
    for step in steps:
        able = [e for e in entries if e["seed"] not in left_out.get(step.number, ())]
        parts += [(step, len(able), label, values) for label, values in _gathered(step, able)]
    judged = sum(_name(label) in step.judged for step, _, label, _ in parts)
    return tuple(_row(step, rigs, label, values, judged) for step, rigs, label, values in parts)


def _gathered(step: Planned, entries: Sequence[Entry]) -> list[tuple[str, Values]]:
    """The values that have a truth, by `name` or `name@where`, in the order in which the procedure declares them."""
    found: dict[str, Values] = {}
    for e in entries:
        for v in e["values"]:
            if v["step"] == step.number and v["truth"] is not None:
                label = f"{v['name']}@{v['where']}" if v["where"] else v["name"]
                found.setdefault(label, []).append((e["seed"], v))
    given = {v["name"] for e in entries for v in e["values"] if v["step"] == step.number}
    for name in step.judged:
        if entries and name not in given:  # no rig at all gave a value
            found[name] = []
    declared = [q.name for q in step.procedure.measures]
    return sorted(found.items(), key=lambda item: _place(item[0], declared))


def _row(step: Planned, rigs: int, label: str, values: Values, judged: int) -> Quantity:
    quantity = next(q for q in step.procedure.measures if q.name == _name(label))
    samples = tuple(
        Sample(v["value"] - v["truth"], v["low"] - v["truth"], v["high"] - v["truth"], v["U"], tuple(v["tails"]))
        for _, v in values
    )
    return Quantity(
        step=step.number, procedure=step.procedure.name, name=label, unit=quantity.unit, about=quantity.about,
        judged=quantity.name in step.judged, coverage=coverage(samples, rigs), tails=tails(samples, judged),
        seeds=tuple(s for s, _ in values), samples=samples,
        monte_carlo=sum(v["method"] == "monte-carlo" for _, v in values),
    )  # fmt: skip


def _name(label: str) -> str:
    return label.partition("@")[0]


def _place(label: str, declared: list[str]) -> int:
    name = _name(label)
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
        "first_seed": result.first_seed, "visit": result.visit, "verdict": result.verdict.value,
        "quantities": [_entry(row) for row in result.rows],
        "findings": [dataclasses.asdict(f) for f in result.failures], "stopped": dict(result.stopped),
        "unable": [_unable_entry(u) for u in result.unable], "step_s": dict(result.step_s), "rig_s": result.rig_s,
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
        rigs=result.rigs, first_seed=result.first_seed, visit=result.visit, date=now, verdict=result.verdict.value,
        quantities=result.rows, failures=result.failures, unable=result.unable,
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
        "bias": c.bias, "verdict": row.verdict.value, "monte_carlo": row.monte_carlo,
        "tails": [_tail_entry(t) for t in row.tails],
        "farthest": [{"seed": seed, "ratio": r if math.isfinite(r) else None} for seed, r in row.farthest],
    }  # fmt: skip


def _tail_entry(t: Tail) -> dict[str, Any]:
    return {
        "beyond": t.multiple,
        "found": t.found,
        "expected": t.expected,
        "at_most": t.most,
        "verdict": t.verdict.value,
    }


def _unable_entry(u: Unable) -> dict[str, Any]:
    which = [{"seed": seed, "why": why} for seed, why in u.which]
    return {"step": u.step, "procedure": u.procedure, "rigs": len(which), "share": u.share, "interval": list(u.interval),
            "which": which}  # fmt: skip
