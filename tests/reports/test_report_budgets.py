"""The results of a report, their budgets, and what no data can show: numbers, shares, and influences that share a row."""

from __future__ import annotations

import math
from typing import Any

import pytest
from report_samples import Page, around, budget, measurement, view

from reports import budgets, html, many, pdf, text, unseen


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


def test_a_pattern_takes_away_again() -> None:
    reached = ("masses/*", "!masses/hanger")
    assert unseen.is_reached("masses/M1", reached)
    assert not unseen.is_reached("masses/hanger", reached)
    assert not unseen.is_reached("sensors/i_yo_p/gain", reached)


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
