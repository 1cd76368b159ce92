"""The summary of a campaign over many virtual rigs: do the intervals hold the truth, what failed, how fast it went."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from bench import display_units
from bench.campaign.bands import Failure, Quantity, Unable
from bench.campaign.speed import Speed
from reports import campaign_figures, text
from reports.campaign_model import _Numbers
from reports.campaign_symbols import symbol
from reports.campaign_view import Cell, Grid, Section, SummaryView
from reports.resultrows import TONES
from reports.view import Fact

NAMED = 6  # quantities in the box with the outcome
FARTHEST = 20  # errors that are listed
SIMULATED = "Simulated rigs – a test of the method, not of a machine"
READING = (
    "Each virtual rig is drawn from the tolerances of the rig file, taken through all steps by bytes, recording and "
    "analysis, and compared with what was drawn. Coverage is the share of rigs whose 95 % interval holds the truth; a rig "
    "without a value counts as a miss. Width is one over the 95th percentile of |error|/U, with the "
    "95 % range that order statistics leave it. A quantity passes if its coverage lies within 0.95 ± 3.3 √(0.95 · 0.05/N) "
    "and its width within 0.8 to 1.25. Errors beyond 2 U, 3 U and 10 U (U on the side towards the truth) may not be more than "
    "the 99.9 % quantile, shared among the judged quantities, of what t with the degrees of freedom of each interval gives, or "
    "its own JCGM 101 draws. A width outside whose range reaches inside is indeterminate, and so is everything "
    "below 59 rigs."
)
UNABLE = (
    "A machine whose controller or drive reports a fault, or that does not come into the state in which the step begins, with "
    "the share of such rigs and its 95 % interval (Clopper and Pearson). Coverage is over the others. A rig that flies and "
    "gives no value counts as a miss."
)
EFFICIENCY = (
    "Parallel efficiency is T₁ n/(processes × T): n rigs took the wall time T, and one rig takes T₁ while it is alone on "
    "the machine, measured on the first rigs of the same campaign. Busy and computing are the shares of processes × T "
    "spent in rigs and on a processor: other programs lower the last. Without other programs: busy times the processor "
    "time of a rig alone over that of a rig among others."
)


@dataclass(frozen=True)
class CoverageContent:
    """What the summary is made of."""

    campaign: str
    title: str
    rig: str
    rigs: int
    first_seed: int
    date: str
    verdict: str
    quantities: tuple[Quantity, ...]
    failures: tuple[Failure, ...]
    unable: tuple[Unable, ...]
    steps: tuple[tuple[str, str, float], ...]  # procedure, plan, mean wall time
    rig_s: float
    speed: Speed | None
    visit: int = 0


def view_of(c: CoverageContent) -> SummaryView:
    """The summary as text."""
    outcome = c.verdict.upper()
    out = [q.name for q in c.quantities if q.judged and q.coverage.verdict.value != "pass"]
    far = [q.name for q in c.quantities if q.judged and any(t.verdict.value == "fail" for t in q.tails)]
    judged = any(q.judged for q in c.quantities)
    untold = "A quantity that was to be judged has no truth." if judged else "Nothing could be judged."
    said = {
        "PASS": "Every judged quantity lies within its bands, and its errors within its tails.",
        "FAIL": " ".join(
            f"{what}: {_named(names)}."
            for what, names in (("Outside a band", out), ("Too many errors far out", far))
            if names
        ),
        "INDETERMINATE": f"More rigs are needed to decide: {_named(out)}." if out else untold,
    }[outcome]
    return SummaryView(
        title=c.title, campaign=c.campaign, simulated=SIMULATED, outcome=outcome, tone=TONES.get(c.verdict, "none"),
        outcome_text=said,
        identification=(
            Fact("Rig", c.rig), Fact("Virtual rigs", f"{c.rigs}, from seed {c.first_seed}, visit {c.visit}"),
            Fact("Made", text.moment(c.date)),
        ),
        sections=tuple(_sections(c, _Numbers())), end=f"End of summary {c.campaign}",
    )  # fmt: skip


def _named(names: Sequence[str]) -> str:
    return ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")


def _sections(c: CoverageContent, numbers: _Numbers) -> Iterator[Section]:
    if c.quantities:
        low, high = c.quantities[0].coverage.band
        yield Section(
            "Coverage, width and tails", grid=_table(c.quantities),
            note=f"Bands for {c.rigs} rigs: coverage {low:.4f} to {high:.4f}, width 0.80 to 1.25. {READING}",
        )  # fmt: skip
        judged = [_judged(q) for q in c.quantities]
        yield Section("Against the bands", pictures=(numbers.picture(campaign_figures.bands(judged, c.rigs), True),))
        shown = [j for j in judged if len(j.ratios)]
        if shown:
            yield Section("Errors", pictures=(
                numbers.picture(campaign_figures.histograms(shown), True),
                numbers.picture(campaign_figures.scatters(shown), True),
            ))  # fmt: skip
        if (farthest := _farthest(c.quantities)).rows:
            yield Section("Errors farthest out", grid=farthest)
    if c.unable:
        yield Section("Rigs that cannot do a step", grid=_unable(c.unable), note=UNABLE)
    yield (Section("Findings", grid=_failures(c)) if c.failures else Section("Findings", lead="No rig gave a finding."))
    yield Section("Time", facts=tuple(_time(c)), note=EFFICIENCY if c.speed else "")
    rows = tuple((Cell(str(n)), Cell(name), Cell(plan), Cell(f"{s:.2f}{text.NARROW}s")) for n, (name, plan, s) in
                 enumerate(c.steps, 1))  # fmt: skip
    yield Section("Steps", grid=Grid(("", "Procedure", "Plan", "A rig takes"), (0.3, 1.6, 5, 1), rows, (3,)))


def _table(quantities: Sequence[Quantity]) -> Grid:
    rows = []
    for q in quantities:
        c = q.coverage
        reach = ""
        if c.width_range is not None:
            high = f"{c.width_range[1]:.2f}" if np.isfinite(c.width_range[1]) else "∞"
            reach = f"{c.width_range[0]:.2f} to {high}"
        verdict = q.verdict.value
        unit, one = display_units.of_result(q.unit, c.mean_U or 0.0)
        mean = None if c.mean_U is None else c.mean_U / one
        rows.append((
            Cell(symbol=symbol(q.name), small=_about(q)),
            Cell(f"{c.coverage:.4f}", f"{c.hits} of {c.rigs}", strong=True),
            Cell("–" if c.width is None else f"{c.width:.3f}", reach, strong=True),
            Cell(", ".join(str(t.found) for t in q.tails), "at most " + ", ".join(str(t.most) for t in q.tails)),
            Cell(text.with_unit(text.significant(mean), unit)),
            Cell("–" if c.bias is None else f"{c.bias:+.3f}".replace("-", text.MINUS)),
            Cell(verdict, tone=TONES.get(verdict, "none")) if q.judged else Cell("not judged", f"({verdict})"),
        ))  # fmt: skip
    header = ("Quantity", "Coverage", "Width", "Beyond 2 U, 3 U, 10 U", "Mean U", "Mean error / s.d.", "")
    return Grid(header, (3.0, 1.3, 1.4, 1.2, 1.4, 1.1, 1.6), tuple(rows), (1, 2, 3, 4, 5))


def _farthest(quantities: Sequence[Quantity]) -> Grid:
    """Those beyond 2 U, over all quantities."""
    found = sorted(((q, *one) for q in quantities for one in q.farthest), key=lambda item: -abs(item[2]))
    rows = tuple(
        (Cell(symbol=symbol(q.name), small=_about(q)), Cell(q.procedure), Cell(str(seed)),
         Cell(f"{ratio:+.1f}{text.NARROW}U".replace("-", text.MINUS), strong=True))
        for q, seed, ratio in found[:FARTHEST]
    )  # fmt: skip
    return Grid(("Quantity", "Step", "Seed", "Error"), (4, 1.5, 1.2, 1), rows, (2, 3))


def _unable(unable: Sequence[Unable]) -> Grid:
    rows = []
    for u in unable:
        low, high = (100 * x for x in u.interval)
        seeds = ", ".join(str(seed) for seed, _ in u.which)
        share = f"{100 * u.share:.1f}{text.NARROW}% ({low:.1f} to {high:.1f}{text.NARROW}%)"
        rows.append((Cell(u.procedure), Cell(str(len(u.which)), share), Cell(f"seeds {seeds}", u.which[0][1])))
    return Grid(("Step", "Rigs", "Which, and why the first"), (1.4, 1.4, 4), tuple(rows), (1,))


def _about(q: Quantity) -> str:
    place = q.name.partition("@")[2]
    return f"({place}) {q.about}" if place else q.about


def _judged(q: Quantity) -> campaign_figures.Judged:
    c = q.coverage
    return campaign_figures.Judged(
        name=q.name, judged=q.judged, passed=c.verdict.value != "fail", coverage=c.coverage, band=c.band, width=c.width,
        width_range=c.width_range, seeds=np.array(q.seeds, dtype=np.float64),
        ratios=np.array([s.ratio for s in q.samples]),
        holds=np.array([s.holds for s in q.samples], dtype=np.bool_),
    )  # fmt: skip


def _failures(c: CoverageContent) -> Grid:
    rows = tuple(
        (Cell(f.procedure), Cell(f.code, f.effect), Cell(str(f.rigs), f"{100 * f.rigs / c.rigs:.1f}{text.NARROW}%"),
         Cell(f.text, f"seed {f.example}"))
        for f in c.failures
    )  # fmt: skip
    return Grid(("Step", "Finding", "Rigs", "For example"), (1.3, 1.6, 0.6, 4), rows, (2,))


def _time(c: CoverageContent) -> Iterator[Fact]:
    yield Fact("One rig", f"{c.rig_s:.2f}{text.NARROW}s of wall time")
    if c.speed is not None:
        s = c.speed
        yield Fact("Together", f"{s.rigs} rigs in {s.wall_s / 60:.1f}{text.NARROW}min on {s.jobs} processes")
        alone = f"one rig alone: {s.alone_s:.2f}{text.NARROW}s"
        yield Fact("Parallel efficiency", f"{_percent(s.efficiency)} ({alone})")
        yield Fact("Without other programs", _percent(s.own))
        yield Fact("Busy, computing", f"{_percent(s.busy)}, {_percent(s.cpu)}")


def _percent(share: float) -> str:
    return f"{100 * share:.0f}{text.NARROW}%"
