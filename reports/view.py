"""The view model: everything a report says, as finished text, in the order it says it.

Both outputs print these strings and compute nothing, so the HTML and the PDF cannot disagree. The letters in the
comments are the clauses of ISO/IEC 17025:2017, 7.8.2.1 and 7.8.4.1, that a field answers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Tone = Literal["pass", "fail", "indeterminate", "error", "none"]

SIMULATED = "Simulated rig – not a calibration certificate"
EXPIRED = "Made with an expired calibration"
OVERDUE = "Rests on a certificate that is out of date"
CALIBRATIONS = (
    "Earlier calibrations of the same machine that the results rest on. Their influences stand in the budgets: those of the "
    "rig file under its names, those of a calibration's own run with that run in brackets."
)
NO_CALIBRATIONS = "The results rest on no earlier calibration."
DECISION_RULE = (
    "Decision rule (JCGM 106:2012, guarded by the expanded uncertainty): a result passes if its whole 95 % coverage "
    "interval lies inside the limits, fails if the whole interval lies outside them, and is indeterminate otherwise. "
    "For a stated pass the probability that the true value lies beyond a given limit is at most 2.5 %. A result "
    "without a limit, or with one that was stated for other settings, is reported without a verdict. The outcome is PASS "
    "only if no declared quantity is missing, at least one was judged, no verdict is fail or indeterminate, and no "
    "finding affects the outcome; it is DONE if nothing was judged. Data that contradict each other support no statement of "
    "non-conformity: where a finding concerns a quantity that fails, the outcome is INDETERMINATE."
)
STATEMENTS = (
    "The results relate only to the item tested, in the state and under the conditions given above.",
    "This report shall not be reproduced except in full.",
)
ABOUT_UNCERTAINTY = (
    "The number after ± is the expanded uncertainty U, half of the width of the interval with the coverage probability p. "
    "Where ν is stated, U = k·u, with k of the t distribution at the effective degrees of freedom ν (JCGM 100:2008). Where "
    "it is not, the interval is by Monte Carlo, u is the standard deviation of the draws, and k = U/u (JCGM 101:2008). Where k "
    "is not stated, the interval stands alone: there are two degrees of freedom or fewer, or the draws have no standard "
    "deviation."
)
ABOUT_MANY = (
    "One line for each result, with the influences that carry most of its variance; the full uncertainty budget of each "
    "result is in record.json, which belongs to this report."
)
ABOUT_VECTORS = (
    "Two components C (cos) and S (sin) as the amount √(C² + S²) and the angle of S over C: of probes' vectors, zero to peak, "
    "it is the phase lag from the once-per-turn mark to the high spot; of unbalances the angle on the scale of the plane. "
    "The intervals are linear in those of the components and their correlation; an angle that is not known to 45° is left out."
)
NO_RESULTS = "No result was obtained. This report makes no statement about the item tested."


@dataclass(frozen=True)
class Symbol:
    """A quantity's name: a letter set in italics with a subscript, or a whole word and no subscript."""

    plain: str
    letter: str
    subscript: str


@dataclass(frozen=True)
class Fact:
    """A label and its text; `blank` is a line to fill in by hand."""

    label: str
    text: str
    blank: bool = False


@dataclass(frozen=True)
class ResultRow:
    """One line of the results table."""

    symbol: Symbol
    about: str
    where: str
    result: str  # value ± U with unit
    interval: str  # only where it says more than value ± U does, else empty
    k: str
    dof: str
    probability: str
    limit: str
    limit_source: str
    verdict: str
    tone: Tone


@dataclass(frozen=True)
class ManyRow:
    """One of many results of a quantity; `carried` names the greatest shares of its budget."""

    row: ResultRow
    interval: str  # in brackets, or empty
    carried: str


@dataclass(frozen=True)
class ManyResults:
    """A quantity with many results, one line each; `judged` where a limit was applied to any."""

    symbol: Symbol
    about: str
    note: str
    judged: bool
    rows: tuple[ManyRow, ...]


@dataclass(frozen=True)
class FindingRow:
    """A finding; `loud` ones affect the outcome."""

    code: str
    text: str
    where: str
    effect: str
    loud: bool


@dataclass(frozen=True)
class BudgetRow:
    """One influence: estimate and standard uncertainty, contribution in the measurand's unit, share of the variance."""

    name: str
    estimate: str
    u: str
    kind: str
    distribution: str
    dof: str
    sensitivity: str
    contribution: str
    share: str
    percent: float  # 0..100, the length of the bar


@dataclass(frozen=True)
class BudgetTable:
    """The uncertainty budget of one quantity."""

    symbol: Symbol
    where: str  # empty where the quantity's name tells
    unit: str
    result: str
    standard_uncertainty: str
    dof: str
    method: str
    rows: tuple[BudgetRow, ...]
    rest: str  # what the rows leave out, or empty


@dataclass(frozen=True)
class Table:
    """A plain table: header cells and rows of texts; `numeric` names the columns set flush right."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: tuple[int, ...] = ()
    note: str = ""


@dataclass(frozen=True)
class Correlations:
    """The correlation matrix of the results; of many results, the pairs that are correlated most."""

    symbols: tuple[Symbol, ...]  # the columns' headings
    rows: tuple[tuple[str, ...], ...]
    heads: tuple[
        tuple[Symbol, str], ...
    ] = ()  # the rows' headings and places; behind a number where columns have numbers
    pairs: tuple[
        tuple[tuple[Symbol, str], tuple[Symbol, str], str], ...
    ] = ()  # symbol and place, twice, and coefficient
    note: str = ""


@dataclass(frozen=True)
class FigureEntry:
    """A drawn figure with its number. `svg` is our own drawing, safe to place in a page as it is."""

    number: int
    key: str
    title: str
    caption: str
    svg: str
    first: bool = False  # it stands on page 1


@dataclass(frozen=True)
class ReportView:
    """One report. The order of the fields is the order of the page; long tables stand in the annex."""

    title: str  # 7.8.2.1 a
    run_id: str  # 7.8.2.1 d: unique identification, on every page
    rig: str
    uut: str  # 7.8.2.1 g: unambiguous identification of the item
    date: str
    simulated: str  # the banner, empty for a real rig
    expired: str  # another banner, empty where every calibration and certificate was in date
    outcome: str
    tone: Tone
    outcome_text: str
    identification: tuple[Fact, ...]  # 7.8.2.1 c, g, i
    decided: tuple[FindingRow, ...]  # the findings that affect the outcome
    warned: tuple[FindingRow, ...]  # notes of certificates that did not hold
    judged: tuple[ResultRow, ...]  # the results that were held against a limit, the worst first; else the first results
    judged_title: str
    judged_note: str
    sheets: tuple[Table, ...]  # of the procedure
    results: tuple[ResultRow, ...]  # 7.8.2.1 m, 7.8.4.1 a (uncertainty in the measurand's unit), 7.8.4.1 e
    vectors: Table  # of the same, those that are vectors as amount and angle
    about_vectors: str
    no_results: str
    about_uncertainty: str
    decision_rule: str  # 7.8.6
    unseen: Table  # influences that no check can reach, and below what is assumed besides
    about_unseen: str
    assumed: tuple[str, ...]
    notes: tuple[FindingRow, ...]  # 7.8.2.1 n: what the bench itself noticed and what did not affect the outcome
    figures: tuple[FigureEntry, ...]
    budgets: tuple[BudgetTable, ...]  # 7.8.4.1 a
    method: tuple[str, ...]  # 7.8.2.1 f
    conditions: tuple[Fact, ...]  # 7.8.4.1 b
    traceability: Table  # 7.8.4.1 c
    calibrations: Table  # 7.8.4.1 c, d: earlier results this run used
    about_calibrations: str
    laboratory: tuple[Fact, ...]  # 7.8.2.1 b, e, h, j, n, o, p: what only people know; from [laboratory] or blank
    statements: tuple[str, ...]  # 7.8.2.1 l and its note
    many: tuple[ManyResults, ...]  # the annex: quantities with many results; their full budgets are in record.json
    about_many: str
    more_budgets: tuple[BudgetTable, ...]  # of what was not judged
    link: tuple[Table, ...]
    link_note: str
    correlations: Correlations | None
    plan: tuple[Fact, ...]  # 7.8.2.1 f, k: settings; no sampling beyond them
    versions: tuple[Fact, ...]
    recording: tuple[Fact, ...]  # the file that everything above was computed from
    end: str  # 7.8.2.1 d: a clear end
