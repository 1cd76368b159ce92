"""Pages as they are printed: what stands on page 1, and texts as readers know them."""

from __future__ import annotations

import json

import pytest
import typst
from report_samples import budget, figures, measurement, record

from bench.figures import Sheet
from reports import compose, front, pdf, text
from reports.resultrows import told_once

N = "\u202f"
PLACE = """
#let placed(h) = (h.body.fields().at("text", default: ""), h.location().page())
#context [#metadata(query(heading).map(placed)) <pages>]
"""


def crowded(judged: int, rows: int) -> compose.ReportView:
    """A front page with judged results, two figures, two tables of so many rows and all that no data can show."""
    names = ["gain of pos_yi", "zero of pos_yi", "gain of i_yi_p", "beta of yi", "clearance", "mass", "AMB gap"]
    influences = [
        {**budget()[0], "name": name, "influence": name, "type": "B", "contribution": 9.0 - k}
        for k, name in enumerate(names)
    ]
    results = [
        measurement(f"d_{k}", where=f"inboard, {k}000 r/min, off", budget=influences, verdict="pass")
        for k in range(judged)
    ]
    sheets = [
        Sheet(f"s{k}", f"Table {k}", "How.", ("Plane", "g"), (("inboard", "0.141"),) * rows, (1,)) for k in range(2)
    ]
    assumes = ("Runout that changes with the speed is in every vector with its whole amount. " * 2,) * 3
    around = compose.Surroundings("Two-plane balancing by influence coefficients", assumes=assumes)
    return compose.view_of(record(measurements=results), around, [*front.drawn(figures()[:2]), *sheets])


@pytest.mark.parametrize(("judged", "rows", "last"), [(2, 2, 1), (10, 12, 2)])
def test_what_no_data_can_show_stands_on_page_1_and_long_tables_go_behind_it(judged: int, rows: int, last: int) -> None:
    made = pdf.sources(crowded(judged, rows))
    made["main.typ"] += PLACE.encode()
    ((places,),) = [json.loads(typst.query(made, "<pages>", field="value", ignore_system_fonts=True))]
    pages = dict(places)
    assert pages["What was judged"] == pages["What no data can show"] == 1
    assert pages["Table 1"] == last


@pytest.mark.parametrize(
    ("typed", "printed"),
    [
        ("some 4 mN m off", f"some 4{N}mN{N}m off"),
        ("1 % at 10 r/min", f"1{N}% at 10{N}r/min"),
        ("by -0.1 % of M2-3", f"by −0.1{N}% of M2-3"),
        ("+-15 %, 115 um", f"±15{N}%, 115{N}µm"),
        ("(u 4e-06)", f"(u 4{N}×{N}10⁻⁶)"),
        ("50 × 80 µm", f"50{N}×{N}80{N}µm"),
        ("with u = 10 at rest", f"with u{N}={N}10 at rest"),
        ("run-20260101T000000Z-1a2b", "run-20260101T000000Z-1a2b"),
        ("2 sides of 3 masses", "2 sides of 3 masses"),
    ],
)
def test_prose_is_printed_with_signs_and_units_in_one_piece(typed: str, printed: str) -> None:
    assert text.prose(typed) == printed


def test_a_definition_names_no_identifiers_and_stands_once() -> None:
    around = compose.Surroundings(
        "t",
        definitions={"order_cos": "cosine", "order_sin": "as order_cos, of settling_time", "settling_time": "s"},
        titles={"order_cos": "order 1, cos"},
    )
    made = compose.view_of(record(measurements=[measurement("order_sin", where=w) for w in ("a", "b")]), around)
    assert [r.about for r in made.results] == ["as order 1, cos, of settling time", ""]


def test_another_limit_says_its_source_again() -> None:
    limits = [{"low": None, "high": high, "source": "drawing", "verified": True} for high in (30.0, 30.0, 40.0)]
    around = compose.Surroundings("t")
    made = compose.view_of(
        record(
            measurements=[measurement(limit=x, where=f"place {k}") for k, x in enumerate(limits)], correlations=None
        ),
        around,
    )
    assert [r.limit_source for r in made.results] == ["drawing", "", "drawing"]
    assert told_once(()) == ()


def test_an_influence_of_a_sensor_is_told_with_its_channel_and_runs_keep_their_names() -> None:
    entries = [
        {**budget()[0], "name": "gain", "influence": "sensors/i_yi_p/gain"},
        {**budget()[0], "name": "amb gap", "influence": "geometry/amb_gap"},
        {**budget()[0], "name": "scatter [amb-calibration-1]", "influence": "x"},
    ]
    made = compose.view_of(record(measurements=[measurement(budget=entries)]), compose.Surroundings("t"))
    names = {row.name for row in made.budgets[0].rows}
    assert names == {"gain of i_yi_p", "AMB gap", "scatter [amb-calibration-1]"}


def test_one_day_is_said_once() -> None:
    assert text.span("2026-01-01T00:00:00+00:00", "2026-01-01T00:01:00+00:00") == "2026-01-01 00:00:00 to 00:01:00 UTC"
    assert text.span("2026-01-01T23:59:00+00:00", "2026-01-02T00:01:00+00:00") == (
        "2026-01-01 23:59:00 to 2026-01-02 00:01:00 UTC"
    )
    assert text.span("2026-01-01T00:00:00+00:00", None) == "2026-01-01 00:00:00 UTC, end not recorded"


@pytest.mark.parametrize(("judged", "rows"), [(2, 2), (10, 1), (10, 12), (16, 4)])
def test_the_pages_settle(judged: int, rows: int) -> None:
    """A table that asks where it stands, and goes to the next page for it, would go back and forth: then typst gives up, and
    each page says that it is the first."""
    _, warnings = typst.Compiler(pdf.sources(crowded(judged, rows))).compile_with_warnings()
    assert [w.message for w in warnings] == []
