"""From a record and what surrounds it to the view model."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

from bench.figures import Sheet
from reports import budgets, front, habit, many, people, resultrows, tables, text, unseen, vectors
from reports.counts import counts, words
from reports.figures import Drawn
from reports.linktable import clean, link_table
from reports.outcome import outcome_text
from reports.view import (
    ABOUT_MANY,
    ABOUT_UNCERTAINTY,
    ABOUT_VECTORS,
    CALIBRATIONS,
    DECISION_RULE,
    EXPIRED,
    NO_CALIBRATIONS,
    NO_RESULTS,
    OVERDUE,
    SIMULATED,
    STATEMENTS,
    BudgetTable,
    Fact,
    FindingRow,
    ReportView,
    ResultRow,
    Table,
)

Content = Mapping[str, Any]
CERTIFICATES = ("certificate-overdue", "certificate-ahead")
UNSHOWN = (
    "polarity-not-shown",
    "one-way",
)  # notes of what the data of this run cannot show: they stand with the assumptions


@dataclasses.dataclass(frozen=True)
class Surroundings:
    """What a report needs beside the record: plain content, so that an old run needs no procedure to be printed."""

    title: str
    method: str = ""
    reached: Sequence[str] = ()  # patterns of influences that a check of the procedure reaches
    assumes: Sequence[str] = ()  # what is in no budget and no data can show
    definitions: Mapping[str, str] = dataclasses.field(default_factory=dict)  # quantity name -> definition
    titles: Mapping[str, str] = dataclasses.field(default_factory=dict)  # quantity name -> what readers call it
    rig: Content = dataclasses.field(default_factory=dict)  # the rig file's content
    integrity: Any = None
    conditions: Mapping[str, str] = dataclasses.field(default_factory=dict)  # measured ones: label -> text
    truncated: bool = False
    readable: bool = True  # False: there is no recording that could be read


def view_of(record: Content, around: Surroundings, shown: Sequence[Drawn | Sheet] = ()) -> ReportView:
    """The report of one record. Equal inputs give an equal view: nothing here asks for the time."""
    outcome = str(record.get("outcome", "ERROR"))
    told = [habit.told(m) for m in record.get("measurements") or () if isinstance(m, Mapping)]
    measurements = front.main_first([budgets.named(m) for m in told])
    findings = tuple(_findings(record, around))
    rows = tuple(resultrows.row(m, around.definitions, around.titles) for m in measurements)
    judged_title, judged, judged_note = front.judged(vectors.folded(record, measurements, rows))
    like = many.names(measurements)
    first_budgets, more_budgets = _budgets(measurements, like, around)
    rig_name = str(around.rig.get("name") or record.get("rig") or text.DASH)
    return ReportView(
        title=around.title,
        run_id=str(record.get("run_id") or text.DASH),
        rig=rig_name,
        uut=_uut(record.get("uut")),
        date=text.moment(record.get("started"))[:10],
        simulated=SIMULATED if _simulated(record) else "",
        expired=" · ".join(_overdue(record)),
        outcome=outcome,
        tone=resultrows.TONES.get(outcome.lower(), "none"),
        outcome_text=outcome_text(record, rows, findings),
        identification=_identification(record, around, rig_name),
        decided=tuple(f for f in findings if f.loud),
        warned=tuple(f for f in findings if f.code in CERTIFICATES),
        judged=judged,
        judged_title=judged_title,
        judged_note=judged_note,
        sheets=front.sheets(shown),
        results=resultrows.told_once(_few(measurements, rows, like)),
        vectors=vectors.table(record),
        about_vectors=ABOUT_VECTORS,
        no_results="" if rows else NO_RESULTS,
        about_uncertainty=ABOUT_UNCERTAINTY,
        decision_rule=DECISION_RULE,
        unseen=unseen.unseen(measurements, around.reached, around.titles),
        about_unseen=unseen.ABOUT,
        assumed=_assumed(around, findings) if rows else (),
        notes=tuple(f for f in findings if not f.loud and f.code not in (*CERTIFICATES, *(UNSHOWN if rows else ()))),
        figures=front.entries(shown),
        budgets=first_budgets,
        method=tuple(_prose(p, around) for p in _paragraphs(around.method)),
        conditions=_conditions(around),
        traceability=tables.traceability(around.rig, budgets.identities(measurements)),
        calibrations=tables.calibrations(record.get("calibrations")),
        about_calibrations=CALIBRATIONS if record.get("calibrations") else NO_CALIBRATIONS,
        laboratory=people.facts(around.rig),
        statements=STATEMENTS,
        many=many.grouped(measurements, rows),
        about_many=ABOUT_MANY,
        more_budgets=more_budgets,
        link=_link(record.get("link"), around),
        link_note=f"{_link_note(around)} {clean(_mapping(record.get('link')))}".strip(),
        correlations=tables.correlations(record, around.titles),
        plan=tuple(tables.settings(record.get("plan") or {})),
        versions=tuple(tables.facts(record.get("versions") or {})),
        recording=(*_recording(record.get("recording")), *_continued(record.get("continues"))),
        end=f"End of report {record.get('run_id') or ''}".rstrip(),
    )


def _few(measurements: Sequence[Content], rows: Sequence[ResultRow], like: Collection[str]) -> list[ResultRow]:
    """The rows of quantities that have few results."""
    return [r for m, r in zip(measurements, rows, strict=True) if str(m.get("name", "")) not in like]


def _budgets(
    measurements: Sequence[Content], like: Collection[str], around: Surroundings
) -> tuple[tuple[BudgetTable, ...], tuple[BudgetTable, ...]]:
    """The budgets that stand in the report's body, and those of its annex."""
    few = [m for m in measurements if m.get("budget") and m.get("name") not in like]
    chosen = front.budgeted(few)
    tables_of = [(m in chosen, budgets.budget_table(m, around.rig, around.titles)) for m in few]
    return tuple(t for told, t in tables_of if told), tuple(t for told, t in tables_of if not told)


def _assumed(around: Surroundings, findings: Sequence[FindingRow]) -> tuple[str, ...]:
    """Sentences on what is in no budget and no data can show: the procedure's, and what this run could not look at."""
    of_run = [f.text[:1].upper() + f.text[1:] for f in findings if f.code in UNSHOWN and not f.loud]
    return (*(_prose(a, around) for a in around.assumes), *of_run)


def _prose(said: str, around: Surroundings) -> str:
    """A text for readers: quantities by their titles, signs and units as print has them."""
    return text.prose(tables.called(said, around.titles, around.definitions))


def _findings(record: Content, around: Surroundings) -> Iterable[FindingRow]:
    known = {str(f.get("code")) for f in record.get("findings") or ()}
    if around.truncated and not any("truncated" in code for code in known):
        said = "The recording is truncated: it was not closed. Everything here comes from its complete part."
        yield FindingRow("truncated-recording", said, "recording", "", True)
    same: dict[tuple[str, str, str], list[str]] = {}  # what is said alike of many places is said once
    for f in record.get("findings") or ():
        said_of = (str(f.get("code", "")), str(f.get("text", "")), str(f.get("effect") or "note"))
        same.setdefault(said_of, []).append(str(f.get("where") or ""))
    for (code, said, effect), places in same.items():
        where = "; ".join(dict.fromkeys(filter(None, places)))
        yield FindingRow(code, _prose(said, around), _prose(where, around), effect, effect != "note")


def _uut(uut: Any) -> str:
    if not isinstance(uut, Mapping):
        return str(uut or text.DASH)
    name = str(uut.get("name") or uut.get("type") or uut.get("model") or "")
    serial = uut.get("serial") or uut.get("serial_number") or ""
    parts = [name, f"serial no. {serial}" if serial else ""]
    return ", ".join(p for p in parts if p) or ", ".join(str(v) for v in uut.values()) or text.DASH


def _identification(record: Content, around: Surroundings, rig_name: str) -> tuple[Fact, ...]:
    performed = text.span(record.get("started"), record.get("ended"))
    rig_title = str(around.rig.get("title") or "")
    site = around.rig.get("site")
    site_name = str(site.get("place") or "") if isinstance(site, Mapping) else ""
    seed, visit = record.get("seed"), record.get("visit") or 0
    found = [
        Fact("Item under test", _uut(record.get("uut"))),
        Fact("Rig", f"{rig_name} – {rig_title}" if rig_title else rig_name),
        Fact("Procedure", str(record.get("procedure") or text.DASH)),
        Fact("Performed", performed),
        Fact("Location", site_name, blank=not site_name),  # 7.8.2.1 c
    ]
    if seed is not None:
        found.append(Fact("Virtual rig", f"seed {seed}, visit {visit}"))
    return tuple(found)


def _conditions(around: Surroundings) -> tuple[Fact, ...]:
    site = around.rig.get("site")
    at_site = {k: v for k, v in site.items() if k != "place" and v is not None} if isinstance(site, Mapping) else {}
    stated = [dataclasses.replace(f, label=words(f.label)) for f in tables.facts(at_site)]
    return (*stated, *(Fact(label[:1].upper() + label[1:], said) for label, said in around.conditions.items()))


def _simulated(record: Content) -> bool:
    """In this process, which has a seed, or served: then the controller said so."""
    return record.get("seed") is not None or _has_finding(record, "simulated-controller")


def _overdue(record: Content) -> Iterable[str]:
    """Banners of what was out of date."""
    used = [c for c in record.get("calibrations") or () if isinstance(c, Mapping)]
    if any(c.get("state") == "expired" for c in used) or _has_finding(record, "calibration-expired"):
        yield EXPIRED
    if any(_has_finding(record, code) for code in CERTIFICATES):
        yield OVERDUE


def _has_finding(record: Content, code: str) -> bool:
    findings = record.get("findings")
    told = [f for f in findings if isinstance(f, Mapping)] if isinstance(findings, list | tuple) else []
    return any(f.get("code") == code for f in told)


def _mapping(found: Any) -> Content:
    return found if isinstance(found, Mapping) else {}


def _link(link: Any, around: Surroundings) -> tuple[Table, ...]:
    made = [link_table(link)] if _mapping(link) else []
    made += counts("Recording", around.integrity)
    return tuple(made)


def _link_note(around: Surroundings) -> str:
    if not around.readable:
        return "There is no recording that can be read."
    if around.truncated:
        return "The recording is truncated: its closing counts are missing and its last part may be lost."
    return "The recording was closed with its counts."


def _recording(recording: Any) -> tuple[Fact, ...]:
    if not isinstance(recording, Mapping) or not recording.get("sha256"):
        return (Fact("Recording", "none, or its digest was not taken"),)
    return (
        Fact("File", str(recording.get("file") or text.DASH)),
        Fact("SHA-256", str(recording["sha256"])),
    )


def _continued(runs: Any) -> Iterator[Fact]:
    """The stopped runs whose steps the recording took over."""
    for run in runs if isinstance(runs, list | tuple) else ():
        if isinstance(run, Mapping):
            steps, stopped = run.get("steps", text.DASH), run.get("stopped", text.DASH)
            yield Fact("Goes on with", f"{run.get('run_id', text.DASH)}: its first {steps} steps, stopped by {stopped}")
            yield Fact("SHA-256 of that recording", str(run.get("sha256", text.DASH)))


def _paragraphs(method: str) -> tuple[str, ...]:
    return tuple(" ".join(p.split()) for p in method.split("\n\n") if p.strip())
