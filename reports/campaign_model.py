"""The summary of a campaign on one rig: the model of the machine, what limits it, and how it was come by."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from bench.campaign.model import Constant, Given, Matrix, Model
from bench.figures import Figure
from reports import campaign_figures, figures, text
from reports.campaign_symbols import place, symbol
from reports.campaign_view import Cell, Grid, Picture, Section, SummaryView
from reports.figures import Drawn
from reports.resultrows import TONES
from reports.view import SIMULATED, Fact, FigureEntry, Tone

NAMED, LEAST = 3, 0.005  # largest influences that a row of the table names, and the least share worth naming
ASIDE = ("max_", "settle_", "average_")  # settings of a plan that a constant does not depend on


@dataclass(frozen=True)
class StepLine:
    """One step of the chain as the journal has it; no outcome: it was left out."""

    number: int
    procedure: str
    title: str
    outcome: str | None
    run: str
    started: str
    wall_s: float
    uses: tuple[str, ...]
    adopted: bool
    reason: str
    findings: tuple[tuple[str, str, str], ...]  # effect, code, text
    figures: tuple[Figure, ...]


@dataclass(frozen=True)
class ChainContent:
    """What the summary is made of."""

    campaign: str  # the directory's name
    file: str
    model: Model
    outcome: str
    steps: tuple[StepLine, ...]
    shares: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # constant -> share of variance by kind
    versions: Mapping[str, str] = field(default_factory=dict)


def view_of(c: ChainContent) -> SummaryView:
    """The summary as text. Equal contents give equal views."""
    model = c.model
    uut = ", ".join(str(v) for v in model.uut.values()) or text.DASH
    identification = [Fact("Item under test", uut), Fact("Rig", model.rig), Fact("Made", text.moment(model.created))]
    if model.seed is not None:
        identification.append(Fact("Virtual rig", f"seed {model.seed}, visit {model.visit or 0}"))
    numbered = _Numbers()
    return SummaryView(
        title=model.title or model.name, campaign=c.campaign, simulated=SIMULATED if model.simulated else "",
        outcome=c.outcome, tone=_tone(c.outcome), outcome_text=_said(c), identification=tuple(identification),
        sections=tuple(_sections(c, numbered)), end=f"End of summary {c.campaign}",
    )  # fmt: skip


class _Numbers:
    """Figures are numbered through the page."""

    def __init__(self) -> None:
        self._last = 0

    def picture(self, drawn: Drawn, wide: bool) -> Picture:
        self._last += 1
        return Picture(
            FigureEntry(self._last, f"{self._last}-{drawn.key}", drawn.title, drawn.caption, drawn.svg), wide
        )


def _tone(outcome: str) -> Tone:
    return TONES.get(outcome.lower(), "none")


def _said(c: ChainContent) -> str:
    counts = Counter(s.outcome for s in c.steps)
    if c.model.complete:
        unjudged = f"; {counts['DONE']} of them without a limit" if counts["DONE"] else ""
        return f"All {len(c.steps)} steps were done as asked{unjudged}; {len(c.model.constants)} constants."
    bad = next((s for s in c.steps if s.outcome not in ("PASS", "DONE")), None)
    return "" if bad is None else f"{bad.procedure}: {bad.reason or 'not run'}"


def _sections(c: ChainContent, numbers: _Numbers) -> Iterator[Section]:
    if c.model.constants:
        yield Section(
            "The model of the machine", grid=_constants(c.model.constants),
            note="The number after ± is the expanded uncertainty for a coverage probability of 95 %. Influences are named "
            "with their share of the variance. All of this is in model.json, with the correlations.",
        )  # fmt: skip
        made = [
            campaign_figures.Made(k.name, k.expanded_uncertainty / abs(k.value), c.shares.get(k.name, {}))
            for k in c.model.constants
            if k.value != 0 and not place(k.name)
        ]
        drawn = campaign_figures.uncertainties(made)
        yield Section("Uncertainties", pictures=(numbers.picture(drawn, True),))
    mapped = _correlations(c.model.correlations)
    if mapped is not None:
        yield Section("Correlations", pictures=(numbers.picture(mapped, True),))
    yield Section("The steps", grid=_steps(c.steps))
    pictures = [numbers.picture(_of_run(figures.draw(f), s), False) for s in c.steps for f in s.figures]
    if pictures:
        yield Section("What was measured", pictures=tuple(pictures))
    found = [(s, f) for s in c.steps for f in s.findings]
    if found:
        yield Section("Findings", grid=_findings(found))
    if any(k.equation for k in c.model.constants):
        yield Section("Equations", grid=_equations(c.model.constants))
    if c.model.given:
        yield Section("Numbers that no step measured", grid=_given(c.model.given))
    yield Section("Files", facts=(
        Fact("Campaign file", c.file), Fact("Model", "model.json (model.schema.json describes it)"),
        Fact("Rig file, SHA-256", c.model.rig_sha256), Fact("Versions", ", ".join(f"{k} {v}" for k, v in c.versions.items())),
    ))  # fmt: skip


def _correlations(found: Matrix) -> Drawn | None:
    """The map, without the second values of one quantity (`B@by the speed channel`)."""
    shown = [k for k, name in enumerate(found.names) if not place(name)]
    if len(shown) < 2:
        return None
    rows = [[found.matrix[a][b] for b in shown] for a in shown]
    return campaign_figures.correlations([found.names[k] for k in shown], rows)


def _of_run(drawn: Drawn, step: StepLine) -> Drawn:
    return Drawn(f"{step.number}-{drawn.key}", f"{step.procedure}: {drawn.title}", drawn.caption, drawn.svg)


def _constants(constants: Sequence[Constant]) -> Grid:
    rows = []
    for k in sorted(constants, key=lambda k: bool(place(k.name))):  # second values of a quantity last
        interval = ""
        if k.method == "monte-carlo":
            low, high = k.interval
            interval = text.interval(low, high, k.expanded_uncertainty, k.unit) + " (Monte Carlo)"
        named = [t for t in k.terms[:NAMED] if t.share >= LEAST]
        largest = "; ".join(f"{_short(t.name)} {100 * t.share:.0f}{text.NARROW}%" for t in named)
        about = f"({place(k.name)}) {k.about}" if place(k.name) else k.about
        rows.append((
            Cell(symbol=symbol(k.name), small=about),
            Cell(text.result(k.value, k.expanded_uncertainty, k.unit), interval, strong=True),
            Cell(text.factor(k.coverage_factor), f"ν {text.degrees_of_freedom(k.dof)}" if k.method == "gum" else ""),
            Cell(largest), Cell(k.date[:10], k.procedure),
        ))  # fmt: skip
    header = ("Constant", "Value", "k", "Largest influences", "Date, step")
    return Grid(header, (2.7, 2.75, 0.75, 2.6, 1.35), tuple(rows))


def _short(name: str) -> str:
    return name.partition(" [")[0]  # whose run it was stands in the budget


def _steps(steps: Sequence[StepLine]) -> Grid:
    rows = []
    for s in steps:
        uses = f"uses {', '.join(s.uses)}" if s.uses else ""
        said = s.reason or "; ".join(x for x in (uses, "adopted" if s.adopted else "") if x)
        outcome = s.outcome or "left out"
        rows.append((
            Cell(str(s.number)), Cell(s.procedure, s.title), Cell(outcome, tone=_tone(outcome)),
            Cell(text.moment(s.started) if s.started else text.DASH, s.run), Cell(f"{s.wall_s:.1f}{text.NARROW}s"),
            Cell(said),
        ))  # fmt: skip
    header = ("", "Procedure", "Outcome", "Started, run", "Took", "")
    return Grid(header, (0.3, 2.4, 0.9, 3.0, 0.7, 1.8), tuple(rows), (4,))


def _findings(found: Sequence[tuple[StepLine, tuple[str, str, str]]]) -> Grid:
    rows = tuple((Cell(s.procedure), Cell(code, effect), Cell(said)) for s, (effect, code, said) in found)
    return Grid(("Step", "Finding", ""), (1.2, 1.4, 4), rows)


def _equations(constants: Sequence[Constant]) -> Grid:
    rows = []
    for k in constants:
        if k.equation is not None and not place(k.name):
            settings = {name: value for name, value in k.holds_for.items() if not name.startswith(ASIDE)}
            holds = ", ".join(f"{name} = {text.plain(value)}" for name, value in settings.items())
            name = Cell(symbol=symbol(k.name))
            rows.append((name, Cell(k.equation.text, equation=True), Cell("", k.equation.source), Cell("", holds)))
    return Grid(("Constant", "Equation", "Source", "Measured at"), (0.8, 3.9, 2.0, 1.8), tuple(rows))


def _given(given: Sequence[Given]) -> Grid:
    rows = tuple(
        (Cell(g.name), Cell(text.result(g.value, 2 * g.standard_uncertainty or None, g.unit)), Cell(g.distribution),
         Cell("", g.source))
        for g in given
    )  # fmt: skip
    return Grid(("Number", "Value ± 2u", "Distribution", "Source"), (2.4, 1.9, 1, 3), rows)
