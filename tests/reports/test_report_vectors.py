"""Vectors as amount and angle, settings and certificates in the units people write, findings and correlations once."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from report_samples import measurement, record

from bench import display_units
from reports import budgets, compose, html, many, pdf, tables, vectors
from reports.text import DASH

NARROW = "\u202f"


def pair(c: float, s: float, u: float, where: str = "yi") -> list[dict[str, Any]]:
    return [
        measurement(f"vector_{part}", value, u, unit="m", where=where, expanded_uncertainty=2 * u)
        for part, value in (("cos", c), ("sin", s))
    ]


def test_components_are_told_as_amount_and_lag() -> None:
    made = vectors.table(record(measurements=[*pair(3e-6, 4e-6, 0.05e-6), measurement()], correlations=None))
    assert made.rows == (("vector", "yi", f"(5.00 ± 0.10){NARROW}µm", f"10.0{NARROW}µm", "(53.1 ± 1.1)°"),)


@pytest.mark.parametrize("r", [-0.9, 0.0, 0.6])
def test_the_half_widths_follow_from_the_correlation(r: float) -> None:
    """Against a cloud of vectors."""
    c, s, u = -3e-6, 1.5e-6, 0.02e-6
    made = record(measurements=pair(c, s, u), correlations=[[1.0, r], [r, 1.0]])
    row = vectors.table(made).rows[0]
    cloud = np.random.default_rng(1).multivariate_normal([c, s], u**2 * np.array([[1, r], [r, 1]]), 100_000)
    amount, angle = np.hypot(*cloud.T), np.degrees(np.arctan2(cloud[:, 1], cloud[:, 0]))
    assert float(row[2].split("± ")[1].split(")")[0]) == pytest.approx(2e6 * amount.std(), rel=0.1)
    assert float(row[4].split("± ")[1].split(")")[0]) == pytest.approx(2 * angle.std(), rel=0.1)


def test_a_vector_that_may_be_none_has_no_angle() -> None:
    assert vectors.table(record(measurements=pair(1e-7, 0.0, 1e-7), correlations=None)).rows[0][4] == DASH
    assert vectors.table(record(measurements=pair(0.0, 0.0, 1e-7), correlations=None)).rows[0][4] == DASH


def test_places_are_kept_apart_and_what_is_missing_is_left_out() -> None:
    lone = measurement("vector_cos", 1e-6, 1e-8, unit="m", where="zo")
    missing = [dict(m, value=None) for m in pair(1e-6, 1e-6, 1e-8, "zi")]
    made = record(measurements=[*pair(1e-6, 0, 1e-8), *pair(0, 1e-6, 1e-8, "yo"), lone, *missing], correlations=None)
    assert [row[1] for row in vectors.table(made).rows] == ["yi", "yo"]


def test_angles_and_times_are_told_in_the_fields_units() -> None:
    assert display_units.of_result("rad", 0.33) == ("deg", math.pi / 180)
    assert display_units.of_result("rad", 27e-6) == ("urad", 1e-6)
    assert display_units.of_result("s", 2.9e-3) == ("ms", 1e-3)
    assert display_units.of_result("s", 67.0) == ("s", 1.0)


@pytest.mark.parametrize(
    ("key", "value", "label", "said"),
    [
        ("spacing_m", 2e-5, "spacing_um", "20"),
        ("speeds_rad_s", [0, 1047.1975512], "speeds_rpm", "0, 10" + NARROW + "000"),
        ("tilt_rad", 0.0003, "tilt_mrad", "0.3"),
        ("trial_angle_rad", [0.0, math.pi / 2], "trial_angle_deg", "0, 90"),
        ("trial_kg", [1e-4, 1e-4], "trial_g", "0.1, 0.1"),
        ("amplitude_A", 0.004, "amplitude_mA", "4"),
        ("refit_u_kg_m", 0.0, "refit_u_kg_m", "0"),
        ("acceleration_rad_s2", 24.5, "acceleration_rad_s2", "24.5"),
        ("max_speed_m_s", 5e-6, "max_speed_m_s", "5" + NARROW + "×" + NARROW + "10⁻⁶"),
        ("length_m", 0.3, "length_m", "0.3"),
        ("coupled", True, "coupled", "yes"),
    ],
)
def test_settings_are_told_as_a_plan_takes_them(key: str, value: Any, label: str, said: str) -> None:
    (fact,) = tables.settings({key: value})
    assert (fact.label, fact.text.replace(" ", " ")) == (label, said)


def test_a_certificate_is_told_in_the_unit_that_it_is_written_in() -> None:
    def row(value: float, half: float, unit: str) -> tuple[str, ...]:
        entry = {"value": value, "unit": unit, "half_width": half, "source": "s"}
        return tables.traceability({"geometry": {"x": entry}}, {"geometry/x"}).rows[0][1:3]

    assert row(0.000525, 1e-5, "m") == (f"0.525{NARROW}mm", f"± 0.01{NARROW}mm")
    assert row(0.0, 5e-6, "m") == (f"0{NARROW}µm", f"± 5{NARROW}µm")
    assert row(math.pi / 4, math.pi / 360, "rad") == ("45°", "± 0.5°")
    assert row(0.98, 0.005, "kg") == (f"0.98{NARROW}kg", f"± 0.005{NARROW}kg")


def test_a_limit_stands_in_the_power_of_ten_of_its_result() -> None:
    limit = {"low": 5.9075e-7, "high": 7.9925e-7, "source": "T", "verified": True}
    one = measurement("beta_yi", 7.09e-7, 1.2e-8, unit="N m^2/A^2", limit=limit)
    made = compose.view_of(record(measurements=[one], correlations=None), compose.Surroundings("t"))
    assert made.results[0].limit == f"(590.75 to 799.25){NARROW}×{NARROW}10⁻⁹{NARROW}N·m²/A²"


def test_notes_are_no_reason_where_a_limit_is_crossed() -> None:
    note = {"code": "slow-roll", "text": "t", "where": "", "effect": "note"}
    crossed = measurement(verdict="indeterminate")
    made = record(outcome="INDETERMINATE", measurements=[crossed], findings=[note], correlations=None)
    view = compose.view_of(made, compose.Surroundings("t"))
    assert view.outcome_text == "The 95 % interval crosses a limit: K_i."


def test_what_is_found_alike_in_many_places_is_said_once() -> None:
    same = [{"code": "c", "text": "t", "where": where, "effect": "note"} for where in ("yi", "zi", "yi")]
    made = compose.view_of(record(findings=same), compose.Surroundings("t"))
    assert [(f.text, f.where) for f in made.notes] == [("t", "yi; zi")]


def test_long_names_head_the_rows_of_a_correlation_matrix_and_numbers_its_columns() -> None:
    names = [f"{name}@{axis}, at rest" for axis in ("yi", "zo") for name in ("s_max", "gain_reduction")]
    matrix = [[1.0 if a == b else 0.3 for b in range(4)] for a in range(4)]
    given = record(correlations={"names": names, "matrix": matrix})
    found = tables.correlations(given, {})
    assert found is not None
    assert [s.plain for s in found.symbols] == ["1", "2", "3", "4"]
    assert [at for _, at in found.heads] == ["yi, at rest"] * 2 + ["zo, at rest"] * 2
    view = compose.view_of(given, compose.Surroundings("t"))
    assert "gain reduction" in html.render(view)
    assert pdf.render(view).startswith(b"%PDF")


def test_short_symbols_head_the_columns_and_nothing_correlated_is_a_sentence() -> None:
    found = tables.correlations(record(), {})
    assert found is not None
    assert [s.plain for s in found.symbols] == ["K_i", "K_o"]
    none = tables.correlations(record(correlations=[[1.0, 0.0], [0.0, 1.0]]), {})
    assert none is not None
    assert none.note.startswith("0 of the 1 pairs")


def test_influences_of_one_name_are_told_apart() -> None:
    parts = [
        {"name": "response", "influence": f"nonlinear/{p}", "contribution": 1.0, "type": "B"} for p in ("re", "im")
    ]
    assert [row.name for row in budgets.budget_table(measurement(budget=parts)).rows] == [
        "response (re)",
        "response (im)",
    ]


def test_a_speed_in_an_identity_is_not_cut() -> None:
    ends = ("A, 0 r/min, up", "A, 0 r/min, down")
    parts = [{"name": "scatter", "influence": f"run/{end}", "contribution": 1.0, "type": "B"} for end in ends]
    assert [row.name for row in budgets.budget_table(measurement(budget=parts)).rows] == [
        f"scatter ({e})" for e in ends
    ]


def test_judged_quantities_come_first() -> None:
    plain = [measurement("a", verdict="none", limit=None, where=str(k)) for k in range(6)]
    judged = [measurement("b", where=str(k)) for k in range(6)]
    view = compose.view_of(record(measurements=[*plain, *judged], correlations=None), compose.Surroundings("t"))
    assert [g.symbol.plain for g in view.many] == ["b", "a"]
    assert many.names([*plain, *judged]) == {"a", "b"}
