"""Whole reports: numbers, required fields, escaping, the SIMULATED mark, equal bytes, errors."""

from __future__ import annotations

import copy
import dataclasses
import json
import math
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
import typst
from report_samples import (
    HOSTILE,
    RUN_ID,
    SampleRecording,
    SampleRig,
    budget,
    figures,
    measurement,
    record,
    rig_content,
    toleranced,
)

import reports
from bench.errors import BenchError
from bench.figures import Sheet
from bench.procedure import Quantity
from reports import budgets, compose, html, many, pdf, text, unseen
from reports.figures import draw
from reports.view import SIMULATED, FigureEntry, ReportView

K_I = Quantity("K_i", "N/A", "inboard AMB: dF/di at zero control current")
TITLE = "AMB force-current constants"


def around(**changes: Any) -> compose.Surroundings:
    sample = SampleRecording()
    made = compose.Surroundings(
        title=TITLE,
        method="Masses are hung.\n\nA fit is made.",
        definitions={"K_i": K_I.about},
        rig=rig_content(),
        integrity=sample.integrity,
    )
    return dataclasses.replace(made, **changes)


def view(surroundings: compose.Surroundings | None = None, **changes: Any) -> ReportView:
    return compose.view_of(record(**changes), surroundings or around())


class Page(HTMLParser):
    """The words of a page, and its tags."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.tags: list[str] = []
        self.feed(source)
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def test_numbers_of_the_results_table() -> None:
    row = view().results[0]
    assert row.result == "(23.412 ± 0.082)\u202fN/A"
    assert (row.k, row.dof, row.probability) == ("1.96", "812", "95\u202f%")
    assert (row.limit, row.limit_source, row.verdict) == ("22 to 25\u202fN/A", "drawing 12-004, table 2", "pass")
    assert row.interval == ""  # value ± U says it


def test_an_unverified_limit_and_an_unsymmetric_interval_say_so() -> None:
    limit = {"low": None, "high": 3.0, "source": "ISO 14839-3", "verified": False}
    lopsided = measurement(limit=limit, method="monte-carlo", interval=[23.30, 23.55])
    row = view(measurements=[lopsided]).results[0]
    assert row.limit_source == "ISO 14839-3 (limit not verified against its source)"
    assert "Monte Carlo" in row.interval
    assert "[23.300,\u00a023.550]" in row.interval


def test_each_method_prints_what_it_has() -> None:
    """k of the t distribution beside its degrees of freedom; k = U/u without them by Monte Carlo; neither where the interval
    stands alone."""
    drawn = measurement("K_i", method="monte-carlo", coverage_factor=1.65, dof=None)
    alone = measurement("K_o", standard_uncertainty=None, coverage_factor=None, dof=2.0)
    made = view(measurements=[measurement("Kw_i"), drawn, alone])
    assert [(r.k, r.dof) for r in made.results] == [("1.96", "812"), ("1.65", text.DASH), (text.DASH, "2")]
    assert [(b.dof, b.standard_uncertainty == "not stated") for b in made.budgets] == [
        ("812", False), ("", False), ("2", True)
    ]  # fmt: skip
    page = Page(html.render(made)).text
    assert "Combined standard uncertainty not stated" in page
    assert "Where ν is stated, U = k·u" in page
    assert pdf.render(made).startswith(b"%PDF")


def test_budget_shares_add_up_and_the_small_rest_is_stated() -> None:
    table = view().budgets[0]
    assert [row.name for row in table.rows][:2] == ["current sensor gain, inboard", "AMB span"]
    assert table.rows[0].share == "88.2\u202f%"
    assert sum(row.percent for row in table.rows) == pytest.approx(100, abs=1.5)
    assert table.rest.startswith("5 further influences, each below 1\u202f% of the variance: 0.0044\u202fN/A")


def test_a_budget_has_estimate_and_uncertainty_of_each_input_and_the_unit_of_its_sensitivity() -> None:
    """187.2 (N/A)/m at u = 0.0094/187.2 m: a reader can compute each line again."""
    rows = {row.name: row for row in view().budgets[0].rows}
    span = rows["AMB span"]
    assert (span.estimate, span.u, span.sensitivity) == ("125\u202fmm", "0.050\u202fmm", "0.187\u202fN/A/mm")
    assert rows["angle dependence, mean over a turn"].estimate == "–"
    assert rows["current sensor gain, inboard"].sensitivity == "23.4\u202fN/A"


def test_page_one_has_what_was_judged_the_worst_first_and_what_decided() -> None:
    made = view(
        outcome="FAIL",
        findings=[{"code": "clipped", "text": "A probe clips.", "where": "yi", "effect": "indeterminate"},
                  {"code": "slow", "text": "It was slow.", "where": "", "effect": "note"}],
        measurements=[measurement("a"), measurement("b", verdict="none", limit=None), measurement("c", verdict="fail")],
        correlations=None,
    )  # fmt: skip
    assert (made.judged_title, [r.symbol.plain for r in made.judged]) == ("What was judged", ["c", "a"])
    assert made.judged_note == "1 more result in the sections below."
    assert [f.code for f in made.decided] == ["clipped"]
    assert [f.code for f in made.notes] == ["slow"]
    assert [b.symbol.plain for b in made.budgets] == ["a", "c"]
    assert [b.symbol.plain for b in made.more_budgets] == ["b"]


def test_the_first_two_figures_and_the_tables_stand_before_the_results() -> None:
    weights = Sheet("weights", "Weights", "On the scale.", ("Plane", "g"), (("inboard", "0.141"),), (1,))
    made = compose.view_of(record(), around(), [weights, *(draw(f) for f in figures()[:3])])
    assert [f.first for f in made.figures] == [True, True, False]
    page = Page(html.render(made)).text
    places = [
        page.index(words) for words in ("What was judged", "Figure 2.", "0.141", "Decision rule", "Figure 3.", "Annex")
    ]
    assert places == sorted(places)


def test_what_only_the_simulator_knows_is_not_printed_and_like_sensors_share_a_row() -> None:
    other = {**budget()[0], "influence": "sensors/i_yi_n/gain"}
    rows = view(measurements=[measurement(budget=[*budget(), other])]).traceability.rows
    assert not any("42.4242" in cell for row in rows for cell in row)
    assert rows[-1][0] == "sensors: gain of i_yi_p, i_yi_n"
    assert not any("M2" in row[0] or "i_xi_p" in row[0] for row in rows)  # no result rests on them
    certificate = ("masses.M1", "0.5\u202fkg", "U = 5\u202f×\u202f10⁻⁵\u202fkg (k = 2), normal")
    assert certificate in [row[:3] for row in rows]


def test_what_no_data_can_show_is_made_from_the_budget() -> None:
    """What carries most comes first, with the result that it carries most of; what a check reaches and Type A is left out."""
    entries = [
        ("sensors/a/gain", "B", 3.0),
        ("masses/M1", "B", 2.0),
        ("scatter/1", "A", 1.0),
        ("site/gravity", "B", 0.1),
    ]
    budget = [
        {"name": f"the {i}", "influence": i, "type": kind, "contribution": c, "sensitivity": -7.0, "distribution": "normal",
         "dof": None}
        for i, kind, c in entries
    ]  # fmt: skip
    made = view(around(reached=("masses/*",), assumes=("All masses alike: K by that share.",)), measurements=[
        measurement(budget=budget), measurement(name="K_o", budget=budget[2:])])  # fmt: skip
    rows = made.unseen.rows
    assert [row[0] for row in rows] == ["the sensors/a/gain", "1 further influence"]
    assert rows[0][1:] == ("64\u202f%", "K_i", "3.0\u202fN/A", "−7.00\u202fN/A")
    page = Page(html.render(made)).text
    places = [page.index(w) for w in ("What no data can show", "All masses alike", "Results", "Decision rule", "Notes")]
    assert places == sorted(places)


def test_what_is_in_every_result_is_one_row_of_what_no_data_can_show() -> None:
    made = view(measurements=[
        measurement(name=f"K_{b}", budget=[{**budget()[0], "name": "encoder count", "influence": f"run/{b}/count"}])
        for b in "io"
    ])  # fmt: skip
    assert [row[0] for row in made.unseen.rows] == ["encoder count"]


def test_the_gains_of_all_probes_are_one_row_and_those_of_currents_another() -> None:
    names = (
        "gain of pos_yi",
        "gain of pos_zo",
        "gain of i_yi_p",
        "offset of zi",
        "offset of yi",
        "mass of the shaft",
        "mass of the disc",
    )
    entries = [
        {**budget()[0], "name": name, "influence": name.replace(" ", "/"), "type": "B", "contribution": c}
        for c, name in zip((9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0), names, strict=True)
    ]
    rows = view(measurements=[measurement(budget=entries)]).unseen.rows
    assert [row[0] for row in rows] == [
        "gain of pos_yi (and 1 alike)", "gain of i_yi_p", "offset of zi (and 1 alike)", "mass of the shaft",
        "mass of the disc"]  # fmt: skip


def test_an_influence_of_one_place_has_the_estimate_of_the_rig_files_number() -> None:
    rig = {"machine": {"amb_asymmetry": {"value": 0.0, "unit": "1", "half_width": 0.03, "distribution": "rectangular"}}}
    entry = {
        **budget()[0],
        "influence": "machine/amb_asymmetry/o",
        "sensitivity": 6.0,
        "contribution": 0.1,
        "unit": "1",
    }
    assert [row.estimate for row in budgets.budget_table(measurement(budget=[entry]), rig).rows] == ["0"]


def test_prose_has_symbols_for_names_and_escapes_the_rest() -> None:
    """What a finding says of `alpha_dx` is of the quantity that the table calls by its symbol."""
    said = "alpha_x_prime and dF_y/di_y <b>, i_yi_p: K_i"
    finding = {"code": "c", "text": said, "where": "alpha_x_prime", "effect": "note"}
    page = html.render(view(around(titles={"alpha_x_prime": "α′_x"}), findings=[finding]))
    assert (
        "<i>α′</i><sub>x</sub> and <i>dF</i><sub>y</sub>/<i>di</i><sub>y</sub> &lt;b&gt;, i_yi_p: <i>K</i><sub>i</sub>"
        in page
    )
    assert "alpha_x_prime" not in page


def test_a_pattern_takes_away_again() -> None:
    reached = ("masses/*", "!masses/hanger")
    assert unseen.is_reached("masses/M1", reached)
    assert not unseen.is_reached("masses/hanger", reached)
    assert not unseen.is_reached("sensors/i_yo_p/gain", reached)


def test_every_required_field_is_in_the_page_in_order() -> None:
    page = Page(html.render(view())).text
    wanted = [
        TITLE,
        RUN_ID,
        "TSBS-12-001",
        "tsbs12",
        "2026-01-01 00:00:00 to",
        "Edmonton",
        "PASS",
        "What was judged",
        "Results",
        K_I.about,
    ]
    wanted += [
        "23.412",
        "Decision rule",
        "Notes",
        "Return to zero",
        "Uncertainty budget",
        "Method",
        "A fit is made.",
    ]
    wanted += ["Conditions", "Gravity", "Air density", "Traceability", "certificate SIM-M-001"]
    wanted += [
        "Laboratory",
        "Customer",
        "Item received",
        "Date of issue",
        "Authorised by",
        "relate only",
        "except in full",
    ]
    wanted += ["Annex", "Correlations", "−0.43", "Link and recording", "872\u202f341", "Plan settings", "settle_s"]
    wanted += ["Versions and digest", "a3f1" * 16, f"End of report {RUN_ID}"]
    at = 0
    for words in wanted:
        words = " ".join(words.split())
        found = page.find(words, at if words != RUN_ID else 0)
        assert found >= 0, f"{words!r} is missing or out of order"
        at = found if words not in (RUN_ID, TITLE) else at


def test_unknown_people_are_blank_and_known_ones_are_named() -> None:
    blank = {f.label: f.blank for f in view().laboratory}
    assert all(blank.values())
    rig = rig_content() | {"laboratory": {"name": "Bearing Laboratory", "accreditation": "none"}}
    known = {f.label: f for f in view(around(rig=rig)).laboratory}
    assert known["Laboratory"].text == "Bearing Laboratory"
    assert known["Accreditation"].text == "none"
    assert known["Customer and contact"].blank


def test_simulated_is_marked_even_for_seed_zero_and_never_on_a_real_rig() -> None:
    assert SIMULATED in Page(html.render(view(seed=0))).text
    assert SIMULATED not in html.render(view(seed=None))
    assert view(seed=0).simulated == SIMULATED


@pytest.mark.parametrize(("said", "shown"), [({}, "seed 1, visit 0"), ({"visit": 3}, "seed 1, visit 3")])
def test_a_virtual_rig_is_named_by_seed_and_visit(said: dict[str, int], shown: str) -> None:
    """Records of before there were visits are of visit 0."""
    assert {f.label: f.text for f in view(**said).identification}["Virtual rig"] == shown


def test_findings_that_affect_the_outcome_are_loud() -> None:
    loud = {"code": "mass-suspect", "text": "M3 is off the line.", "where": "M3", "effect": "indeterminate"}
    made = view(findings=[loud], outcome="INDETERMINATE")
    assert made.decided[0].loud
    assert "mass-suspect" in made.outcome_text
    assert 'class="finding loud"' in html.render(made)


def test_a_fail_stands_first_and_says_where_a_finding_outranks_it() -> None:
    doubt = {"code": "load-inconsistent", "text": "The loads contradict each other.", "where": "M2",
             "effect": "indeterminate", "concerns": []}  # fmt: skip
    failed = [measurement("K_o", verdict="fail"), measurement("K_i")]
    made = view(outcome="INDETERMINATE", findings=[doubt], measurements=failed, correlations=None)
    assert made.outcome_text.startswith("Outside the limits with the whole 95 % interval: K_o.")
    assert "no statement of non-conformity: the data are contradicted (load-inconsistent)" in made.outcome_text
    assert made.judged[0].verdict == "fail"
    touched = view(outcome="FAIL", findings=[doubt | {"concerns": ["K_i"]}], measurements=failed, correlations=None)
    assert touched.outcome_text == (
        "Outside the limits with the whole 95 % interval: K_o. Findings that prevent other decisions: load-inconsistent."
    )


def test_a_run_that_nothing_judged_has_a_neutral_box() -> None:
    made = view(outcome="DONE", measurements=[measurement(verdict="none", limit=None)], correlations=None)
    assert (made.tone, made.outcome) == ("none", "DONE")
    assert made.outcome_text == "Every declared quantity was measured. No acceptance limit was applied."
    assert 'class="outcome none"' in html.render(made)
    assert pdf.render(made, None).startswith(b"%PDF")


def test_pass_without_limits_claims_no_conformity() -> None:
    made = view(measurements=[measurement(verdict="none", limit=None)])
    assert made.outcome_text.endswith("No acceptance limit was applied.")


def test_an_error_without_measurements_says_that_it_says_nothing() -> None:
    lost = {"code": "link-lost", "text": "No frame for 0.5 s.", "where": "can0", "effect": "error"}
    made = view(
        around(rig={}, integrity=None, readable=False),
        outcome="ERROR", measurements=[], correlations=[], ended=None, recording=None, findings=[lost],
    )  # fmt: skip
    page = Page(html.render(made)).text
    assert "makes no statement about the item tested" in page
    assert "end not recorded" in page
    assert "link-lost" in made.outcome_text
    assert pdf.render(made).startswith(b"%PDF")


def test_a_truncated_recording_is_said_aloud() -> None:
    stopped = {"code": "operator-abort", "text": "Stopped.", "where": ""}
    made = view(around(truncated=True), outcome="ABORTED", findings=[stopped])
    assert made.decided[0].loud
    assert "truncated" in made.link_note
    assert made.outcome_text == "The run was stopped before its end. See the finding operator-abort."


def test_many_correlations_are_told_by_pairs() -> None:
    """A matrix of 20 columns would leave the page: the largest pairs instead, with their places."""
    names = [f"overshoot@{k} µm" for k in range(20)]
    matrix = [[1.0 if a == b else 0.0 for b in range(20)] for a in range(20)]
    matrix[3][7] = matrix[7][3] = -0.62
    matrix[1][2] = matrix[2][1] = 0.93
    matrix[5][6] = matrix[6][5] = 0.02
    made = view(correlations={"names": names, "matrix": matrix})
    page = html.render(made)
    text = Page(page).text
    assert "2 of the 190 pairs have a coefficient of at least 0.05 in size. record.json" in text
    assert text.index("0.93") < text.index("\u22120.62")
    row = page[page.index("1 µm</td>") :]
    assert row.index("2 µm</td>") < row.index("0.93")
    assert "0.02" not in text[text.index("Correlations of the results") :][:600]
    tables_printed = str(typst.query(pdf.sources(made), "table", ignore_system_fonts=True))
    assert tables_printed.index("2 µm") < tables_printed.index("0.93") < tables_printed.index("\u22120.62")


def hostile() -> tuple[dict[str, Any], SampleRecording]:
    h = HOSTILE
    entry = {
        "name": h,
        "influence": h,
        "contribution": 1.0,
        "sensitivity": 1.0,
        "type": h,
        "distribution": h,
        "dof": None,
    }
    limit = {"low": 1, "high": None, "source": h, "verified": False}
    made = record(
        uut={"name": h, "serial": h}, run_id=h, rig=h, procedure=h, plan={h: h}, versions={h: h}, link={h: h},
        findings=[{"code": h, "text": h, "where": h, "effect": h}], recording={"file": h, "sha256": h},
        measurements=[measurement(h, unit=h, where=h, verdict=h, limit=limit, budget=[entry])] * 2,
    )  # fmt: skip
    rig = {
        "name": h, "title": h, "site": {"place": h, h: h}, "laboratory": {"name": h, h: h},
        "masses": {h: toleranced(1.0, h, u=1.0, k=2, source=h)},
    }  # fmt: skip
    return made, SampleRecording(SampleRig(rig))


def test_hostile_texts_are_printed_and_not_obeyed(tmp_path: Path) -> None:
    made, recording = hostile()
    drawn = dataclasses.replace(figures()[0], title=HOSTILE, caption=HOSTILE, x_label=HOSTILE, y_label=HOSTILE)
    paths = reports.build(tmp_path, recording, made, [drawn], title=HOSTILE, method=HOSTILE)  # type: ignore[arg-type]
    page = Page(paths.html.read_text("utf-8"))
    assert "script" not in page.tags
    assert page.text.count(" ".join(HOSTILE.split())) > 20
    assert "49" not in re.findall(r"\{\{ (\S+) \}\}", page.text)
    assert paths.pdf.read_bytes().startswith(b"%PDF")  # `#include "a.typ"` obeyed would not compile


def test_equal_input_gives_equal_bytes_and_a_build_leaves_its_input_alone(tmp_path: Path) -> None:
    given = record()
    before = copy.deepcopy(given)
    outputs = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        built = reports.build(tmp_path / name, SampleRecording(), given, figures()[2:4], title=TITLE, measures=[K_I])  # type: ignore[arg-type]
        outputs.append((built.html.read_bytes(), built.pdf.read_bytes()))
        assert sorted(p.name for p in (tmp_path / name).iterdir()) == ["report.html", "report.pdf"]
    assert outputs[0] == outputs[1]
    assert given == before


def test_the_pdf_has_the_sections_of_the_page_in_the_same_order() -> None:
    made = compose.view_of(record(), around(), [draw(f) for f in figures()[:3]])
    in_page = re.findall(r"<h2>(.*?)</h2>", html.render(made))
    asked = typst.query(pdf.sources(made), "heading.where(level: 1)", field="body", ignore_system_fonts=True)
    in_pdf = [heading["text"] for heading in json.loads(asked)]
    assert in_pdf == in_page
    assert len(in_pdf) == 16


def test_the_page_fetches_nothing() -> None:
    source = html.render(view())
    assert not re.search(r"(?:src|href)\s*=\s*[\"'](?!#)", source)
    assert "@import" not in source


def test_a_record_that_cannot_be_printed_is_our_error(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match="cannot be made"):
        reports.build(tmp_path, None, record(measurements=[measurement() | {"value": "many"}]), title=TITLE)
    assert not list(tmp_path.iterdir())


def test_a_refusal_of_typst_is_our_error() -> None:
    bad = FigureEntry(1, "bad", "t", "c", "this is not SVG")
    with pytest.raises(BenchError, match="the PDF report cannot be made"):
        pdf.render(dataclasses.replace(view(), figures=(bad,)))


def test_an_unwritable_run_directory_is_our_error(tmp_path: Path) -> None:
    in_the_way = tmp_path / "file"
    in_the_way.write_text("x")
    with pytest.raises(BenchError, match="cannot be written"):
        reports.build(in_the_way, None, record(), title=TITLE)


def test_the_parts_of_one_scatter_are_one_row() -> None:
    """Those of Type A whose identities differ in numbers only; masses differ in a number too and are not of Type A."""

    def entry(influence: str, name: str, contribution: float, kind: str = "A", dof: int = 43) -> dict[str, Any]:
        return {"influence": influence, "name": name, "contribution": contribution, "sensitivity": 1.0, "type": kind,
                "distribution": "normal", "dof": dof}  # fmt: skip

    entries = [
        entry("run-1/scatter/0/1", "scatter at 0° (1) [run-1]", 0.3),
        entry("run-1/scatter/1/2", "scatter at 40° (2) [run-1]", 0.4),
        entry("scatter/1", "scatter (1)", 0.2, dof=7),
        entry("run-2/scatter/1", "scatter (1) [run-2]", 0.1),
        entry("masses/M1", "mass M1", 0.1, "B"),
        entry("masses/M2", "mass M2", 0.1, "B"),
    ]
    table = budgets.budget_table(measurement(budget=entries))
    assert [(r.name, r.contribution, r.dof) for r in table.rows] == [
        ("scatter, 2 parts [run-1]", "0.50", "43"), ("scatter (1)", "0.20", "7"), ("scatter (1) [run-2]", "0.10", "43"),
        ("mass M1", "0.10", "43"), ("mass M2", "0.10", "43"),
    ]  # fmt: skip


def test_a_budget_by_monte_carlo_is_one_of_its_standard_uncertainty() -> None:
    """Two zeros at a kink, the slope of one of which is nought: 0.6 and 0.6 of u = 1; 24 % is of both together."""
    entries = [
        {"influence": f"sensors/pos_{a}/offset", "name": f"zero of pos_{a}", "contribution": 0.6, "sensitivity": c, "type": "B",
         "distribution": "rectangular", "dof": None, "unit": "m", "standard_uncertainty": 1.2}
        for a, c in (("y", 0.0), ("z", -1.0))
    ] + [{"influence": "gain", "name": "gain", "contribution": 0.2, "sensitivity": 2.0, "type": "A", "distribution": "normal",
          "dof": 5, "unit": "1", "standard_uncertainty": 0.1 / math.sqrt(5 / 3)}]  # fmt: skip
    made = measurement(budget=entries, method="monte-carlo", standard_uncertainty=1.0)
    table = budgets.budget_table(made)
    assert [(r.name, r.sensitivity, r.share) for r in table.rows] == [
        ("zero of pos_y", "not linear", "36.0\u202f%"), ("zero of pos_z", "not linear", "36.0\u202f%"),
        ("gain", "2.00\u202fN/A", "4.0\u202f%"), ("several influences together", "\u2013", "24.0\u202f%"),
    ]  # fmt: skip
    (row,) = view(around(reached=()), measurements=[made]).unseen.rows
    assert (row[1], row[4]) == ("36\u202f%", "not linear")
    assert many.carried(made).endswith("several influences together 24\u202f%; 1 more")


def test_the_calibrations_used_are_named_and_an_expired_one_stands_on_every_page() -> None:
    used = {"procedure": "amb-calibration", "run_id": "amb-calibration-1", "date": "2026-11-21T10:15:00+00:00",
            "due": "2027-11-21", "sha256": "ab" * 32, "state": "current"}  # fmt: skip
    made = compose.view_of(record(calibrations=[used]), around())
    assert made.calibrations.rows == (
        ("amb-calibration", "amb-calibration-1", "2026-11-21", "2027-11-21", "current", "ab" * 32),
    )
    assert made.expired == ""
    assert view().about_calibrations == "The results rest on no earlier calibration."
    made = compose.view_of(record(calibrations=[used | {"state": "expired"}], seed=None), around())
    assert made.expired == "Made with an expired calibration"
    assert html.render(made).count(made.expired) == 3  # at the top, where the page ends, and on each page of print
    pages = pdf.render(made, None)
    assert pages.startswith(b"%PDF")
