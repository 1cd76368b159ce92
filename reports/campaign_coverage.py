"""The summary of a campaign over many virtual rigs: do the intervals hold the truth, what failed, how fast it went."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from bench import units
from bench.campaign_bands import Failure, Quantity
from bench.campaign_speed import Speed
from reports import campaign_figures, text
from reports.campaign_model import _Numbers
from reports.campaign_symbols import symbol
from reports.campaign_view import Cell, Grid, Section, SummaryView
from reports.compose import _TONES
from reports.view import Fact

NAMED = 6  # quantities in the box with the outcome
SIMULATED = "Simulated rigs – a test of the method, not of a machine"
READING = (
    "Each virtual rig is drawn from the tolerances of the rig file, taken through all steps by bytes, recording and "
    "analysis, and compared with what was drawn. Coverage is the share of rigs whose 95 % interval holds the truth; a rig "
    "without a value counts as a miss. Width is one over the 95th percentile of |error|/U, with the "
    "95 % range that order statistics leave it. A quantity passes if its coverage lies within 0.95 ± 3.3 √(0.95 · 0.05/N) "
    "and its width within 0.8 to 1.25. A width outside whose range reaches inside is indeterminate, and so is everything "
    "below 59 rigs."
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
    steps: tuple[tuple[str, str, float], ...]  # procedure, plan, mean wall time
    rig_s: float
    speed: Speed | None


def view_of(c: CoverageContent) -> SummaryView:
    """The summary as text."""
    outcome = c.verdict.upper()
    out = [q.name for q in c.quantities if q.judged and q.coverage.verdict.value != "pass"]
    named = ", ".join(out[:NAMED]) + (f" and {len(out) - NAMED} more" if len(out) > NAMED else "")
    judged = any(q.judged for q in c.quantities)
    untold = "A quantity that was to be judged has no truth." if judged else "Nothing could be judged."
    said = {
        "PASS": "Every judged quantity lies within both bands.",
        "FAIL": f"Outside a band: {named}.",
        "INDETERMINATE": f"More rigs are needed to decide: {named}." if out else untold,
    }[outcome]
    return SummaryView(
        title=c.title, campaign=c.campaign, simulated=SIMULATED, outcome=outcome, tone=_TONES.get(c.verdict, "none"),
        outcome_text=said,
        identification=(
            Fact("Rig", c.rig), Fact("Virtual rigs", f"{c.rigs}, from seed {c.first_seed}"), Fact("Made", text.moment(c.date)),
        ),
        sections=tuple(_sections(c, _Numbers())), end=f"End of summary {c.campaign}",
    )  # fmt: skip


def _sections(c: CoverageContent, numbers: _Numbers) -> Iterator[Section]:
    if c.quantities:
        low, high = c.quantities[0].coverage.band
        yield Section(
            "Coverage and width", grid=_table(c.quantities),
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
        verdict = c.verdict.value
        unit, one = units.habit(q.unit, c.mean_U or 0.0)
        mean = None if c.mean_U is None else c.mean_U / one
        rows.append((
            Cell(symbol=symbol(q.name), small=_about(q)),
            Cell(f"{c.coverage:.4f}", f"{c.hits} of {c.rigs}", strong=True),
            Cell("–" if c.width is None else f"{c.width:.3f}", reach, strong=True),
            Cell(text.with_unit(text.significant(mean), unit)),
            Cell("–" if c.bias is None else f"{c.bias:+.3f}".replace("-", text.MINUS)),
            Cell(verdict, tone=_TONES.get(verdict, "none")) if q.judged else Cell("not judged", f"({verdict})"),
        ))  # fmt: skip
    header = ("Quantity", "Coverage", "Width", "Mean U", "Mean error / s.d.", "")
    return Grid(header, (3.2, 1.3, 1.4, 1.4, 1.2, 1.6), tuple(rows), (1, 2, 3, 4))


def _about(q: Quantity) -> str:
    place = q.name.partition("@")[2]
    return f"({place}) {q.about}" if place else q.about


def _judged(q: Quantity) -> campaign_figures.Judged:
    c = q.coverage
    return campaign_figures.Judged(
        name=q.name, judged=q.judged, passed=c.verdict.value != "fail", coverage=c.coverage, band=c.band, width=c.width,
        width_range=c.width_range, seeds=np.array(q.seeds, dtype=np.float64),
        ratios=np.array([s.error / s.U if s.U > 0 else 0.0 for s in q.samples]),
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
