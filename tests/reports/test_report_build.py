"""Whole reports: fields, traceability, calibrations, correlations, escaping, the SIMULATED mark, equal bytes, errors."""

from __future__ import annotations

import copy
import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import pytest
import typst
from report_samples import (
    HOSTILE,
    K_I,
    RUN_ID,
    TITLE,
    Page,
    SampleRecording,
    SampleRig,
    around,
    budget,
    figures,
    measurement,
    record,
    rig_content,
    toleranced,
    view,
)

import reports
from bench.errors import BenchError
from bench.figures import Sheet
from reports import compose, html, pdf
from reports.figures import draw
from reports.view import SIMULATED, FigureEntry


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
