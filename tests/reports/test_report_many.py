"""Quantities with many results: one line each, with what carries the budget; few results keep their budgets."""

from __future__ import annotations

import string

import pytest
from report_samples import HOSTILE, Page, around, measurement, record

from reports import compose, html, many, pdf
from reports.counts import counts
from reports.text import DASH, NARROW
from reports.view import ABOUT_MANY, ReportView

PERCENT = f"{NARROW}%"
SHARES = f"current sensor gain, inboard 88{PERCENT}; 8 more"


def view_of(count: int, **changes: object) -> ReportView:
    """`count` results of d_max beside one of K_i."""
    some = [measurement("d_max", 0.1 * n, where=f"{1000 * n}\u202fr/min", **changes) for n in range(1, count + 1)]
    return compose.view_of(record(measurements=[*some, measurement()], correlations=None), around())


def test_few_results_keep_their_budgets() -> None:
    view = view_of(many.MANY)
    assert view.many == ()
    assert len(view.results) == len(view.budgets) == many.MANY + 1
    assert ABOUT_MANY not in html.render(view)


def test_many_results_get_a_line_each() -> None:
    view = view_of(many.MANY + 1)
    assert [r.symbol.plain for r in view.results] == [b.symbol.plain for b in view.budgets] == ["K_i"]
    (group,) = view.many
    assert [m.row.where for m in group.rows] == [f"{1000 * n}\u202fr/min" for n in range(1, many.MANY + 2)]
    assert {m.carried for m in group.rows} == {SHARES}
    assert group.judged
    assert f"{many.MANY + 1} results, p = 95" in group.note
    assert "drawing 12-004, table 2" in group.note
    page = Page(html.render(view)).text
    assert page[page.index("Results in full") :].count("current sensor gain, inboard 88") == many.MANY + 1
    assert ABOUT_MANY in page
    assert pdf.render(view).startswith(b"%PDF")


def test_an_interval_by_monte_carlo_is_in_brackets() -> None:
    (group,) = view_of(8, method="monte-carlo", verdict="none", limit=None, interval=[0.05, 0.9]).many
    assert not group.judged
    assert many.BRACKETS in group.note
    assert all(m.interval.startswith("[") for m in group.rows)


def test_only_many_results_is_a_report_too() -> None:
    some = [measurement(where=str(n)) for n in range(9)]
    view = compose.view_of(record(measurements=some, correlations=None), around())
    assert view.results == view.budgets == ()
    assert view.no_results == ""
    assert "No result was obtained" not in html.render(view)
    assert pdf.render(view).startswith(b"%PDF")


def test_hostile_texts_in_many_results() -> None:
    entry = {"name": HOSTILE, "influence": HOSTILE, "contribution": 1.0, "type": "B"}
    some = [measurement(HOSTILE, unit=HOSTILE, where=HOSTILE, budget=[entry]) for _ in range(8)]
    view = compose.view_of(record(measurements=some, correlations=None), around(definitions={HOSTILE: HOSTILE}))
    page = Page(html.render(view))
    assert "script" not in page.tags
    assert page.text.count(" ".join(HOSTILE.split())) > 8
    assert pdf.render(view).startswith(b"%PDF")


@pytest.mark.parametrize(("squares", "said"), [
    ((9, 1), f"a 90{PERCENT}, b 10{PERCENT}"), ((80, 9, 11), f"a 80{PERCENT}, c 11{PERCENT}; 1 more"),
    ((1.001, *(1,) * 19), f"a 5{PERCENT}; 19 more"), ((), DASH), ((0, 0), DASH),
])  # fmt: skip
def test_what_carries_a_budget(squares: tuple[float, ...], said: str) -> None:
    """The greatest is told however small it is; no budget is a dash."""
    entries = [
        {"name": n, "influence": n, "contribution": s**0.5, "type": "B"}
        for n, s in zip(string.ascii_letters, squares, strict=False)
    ]
    assert many.carried({"budget": entries}) == said


@pytest.mark.parametrize("streams", [1, 2, 11])
def test_many_streams_are_rows(streams: int) -> None:
    """A table as wide as there are captures would not fit a page."""
    names = sorted(f"capture/{k}" for k in range(1, streams + 1))  # as a recording gives them: 10 before 2
    (table,) = counts("Recording", {"samples": dict.fromkeys(names, 5), "lost": {"capture/1": 1}})
    if streams > 2:
        assert table.header == ("", "Samples", "Lost")
        assert table.rows[0] == ("capture/1", "5", "1")
        assert table.rows[-1] == ("capture/11", "5", DASH)
    assert len(table.header) <= 3
    assert {len(row) for row in table.rows} == {len(table.header)}


def test_very_many_streams_are_one_row_of_their_sum() -> None:
    """Seventy captures would fill two pages with what nobody reads."""
    names = [f"capture/{k}" for k in range(1, 71)]
    tree = {"samples": dict.fromkeys([*names, "telemetry", "drive"], 5), "lost": {"capture/1": 1, "capture/70": 2}}
    (table,) = counts("Recording", tree)
    assert table.rows == (("capture/1 to capture/70", "350", "3"), ("drive", "5", DASH), ("telemetry", "5", DASH))
