"""Summaries of campaigns: both outputs say the same, texts are escaped, strange numbers are drawn."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from bench.campaign.bands import Failure, Quantity, Sample, Unable, coverage, tails
from bench.campaign.model import Constant, Given, Matrix, Model, StatedEquation, Term
from bench.campaign.speed import Speed
from bench.errors import BenchError
from reports import campaign, campaign_coverage, campaign_model
from reports.campaign_coverage import CoverageContent
from reports.campaign_model import ChainContent, StepLine
from reports.campaign_symbols import axis_label, symbol, with_subscripts

NASTY = '<script>alert("x")</script> #let x = 1 $y$ *b* _c_'
DATE = "2026-01-01T00:00:00+00:00"


def constant(name: str, value: float = 70.0) -> Constant:
    return Constant(
        name=name, unit="N/A", about=NASTY, value=value, standard_uncertainty=0.2, dof=12.0, coverage_factor=2.18,
        coverage_probability=0.95, expanded_uncertainty=0.436, interval=(value - 0.4, value + 0.5), method="monte-carlo",
        verdict="pass", equation=StatedEquation("F_y = K_i i < 3", NASTY), holds_for={"bias_A": 3.0, "max_x": 1.0},
        procedure="p", run_id="p-20260101T000000Z-aaaa", date=DATE, terms=(Term(NASTY, "sensors/x", 0.2, 1.0),), rest=0.0,
    )  # fmt: skip


def chain(names: tuple[str, ...] = ("K_i", "alpha_x_prime", "B@by speed"), outcome: str = "PASS") -> ChainContent:
    n = len(names)
    model = Model(
        schema=1, name="c", title=NASTY, rig="r", uut={"model": "M", "serial": "1"}, rig_sha256="0" * 64, simulated=True,
        seed=3, visit=1, created=DATE, complete=outcome == "PASS", constants=tuple(constant(name) for name in names),
        correlations=Matrix(names, tuple(tuple(float(a == b) for b in range(n)) for a in range(n))),
        given=(Given("mass", "kg", 10.2, 0.0, "normal", NASTY),),
    )  # fmt: skip
    step = StepLine(1, "p", NASTY, outcome, "p-20260101T000000Z-aaaa", DATE, 3.2, ("q",), True, NASTY,
                    (("note", "code", NASTY),), ())  # fmt: skip
    left_out = dataclasses.replace(step, number=2, outcome=None, run="", started="")
    return ChainContent(
        "c.campaign-x", "c.toml", model, outcome, (step, left_out), {"K_i": {"sensors": 0.9, "run": 0.1}}
    )


def many(n: int = 100, judged: bool = True) -> CoverageContent:
    errors = np.random.default_rng(1).standard_normal(n)
    samples = tuple(Sample(float(e), float(e) - 1.96, float(e) + 1.96, 1.96, (8.9e-5, 4e-9, 0.0)) for e in errors)
    seeds = tuple(range(n))
    quantity = Quantity(1, "p", "K_i", "N/A", NASTY, judged, coverage(samples, n), tails(samples, 2), seeds, samples, 3)
    empty = dataclasses.replace(
        quantity, name="alpha_d", coverage=coverage((), n), tails=tails((), 2), seeds=(), samples=()
    )
    return CoverageContent(
        "c.campaign-x", NASTY, "r", n, 0, DATE, "fail", (quantity, empty), (Failure(1, "p", "code", "error", 2, 7, NASTY),),
        (Unable(1, "p", n, ((1, NASTY),)),),
        (("p", NASTY, 1.2),), 1.2, Speed(80, 2, 60.0, 1.1, 0.9, 0.97, 0.95, 0.93), 2,
    )  # fmt: skip


def test_one_rig_in_both_outputs(tmp_path: Path) -> None:
    view = campaign_model.view_of(chain())
    campaign.build(tmp_path, view, DATE)
    page = (tmp_path / "summary.html").read_text()
    assert "<script>" not in page
    assert "&lt;script&gt;" in page
    assert "F<sub>y</sub> = K<sub>i</sub> i &lt; 3" in page
    assert "left out" in page
    assert page.count("<svg") == 2  # uncertainties and correlations
    assert (tmp_path / "summary.pdf").read_bytes() == campaign.pdf(view, DATE)


@pytest.mark.parametrize("names", [(), ("K_i",), tuple(f"K_{k}" for k in range(30))])
def test_any_number_of_constants(names: tuple[str, ...]) -> None:
    view = campaign_model.view_of(chain(names, "ERROR"))
    assert campaign.pdf(view, DATE).startswith(b"%PDF")
    assert "ERROR" in campaign.html(view)


def test_a_constant_of_zero_has_no_relative_uncertainty() -> None:
    content = chain(("K_i",))
    model = dataclasses.replace(content.model, constants=(constant("K_i", 0.0), constant("K_o", 1e-9)))
    assert campaign.html(campaign_model.view_of(dataclasses.replace(content, model=model)))


@pytest.mark.parametrize("n", [2, pytest.param(60, marks=pytest.mark.long), 400])
def test_many_rigs_in_both_outputs(tmp_path: Path, n: int) -> None:
    view = campaign_coverage.view_of(many(n))
    campaign.build(tmp_path, view, DATE)
    page = (tmp_path / "summary.html").read_text()
    assert "<script>" not in page
    assert "Outside a band" in page
    assert f"{n}, from seed 0, visit 2" in page
    assert page.count("<svg") == 3


def test_nothing_at_all_was_measured() -> None:
    content = dataclasses.replace(many(), quantities=(), failures=(), speed=None, verdict="indeterminate")
    page = campaign.html(campaign_coverage.view_of(content))
    assert "Nothing could be judged" in page
    assert "No rig gave a finding" in page


def test_all_within_their_bands_but_one_without_a_truth() -> None:
    passed = [q for q in many(400).quantities if q.coverage.verdict.value == "pass"]
    content = dataclasses.replace(many(400), quantities=tuple(passed), verdict="indeterminate")
    assert passed
    assert "has no truth" in campaign_coverage.view_of(content).outcome_text


def test_a_width_without_an_upper_end() -> None:
    content = many(30)
    found = content.quantities[0].coverage
    assert found.width_range is not None
    open_ended = dataclasses.replace(found, width_range=(found.width_range[0], math.inf))
    quantity = dataclasses.replace(content.quantities[0], coverage=open_ended)
    assert "∞" in campaign.html(campaign_coverage.view_of(dataclasses.replace(content, quantities=(quantity,))))


def test_a_summary_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "summary.html").mkdir()
    with pytest.raises(BenchError, match="summary cannot be written"):
        campaign.build(tmp_path, campaign_model.view_of(chain()), DATE)
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.parametrize(
    ("name", "letter", "subscript", "label"),
    [
        ("K_i", "K", "i", r"$K_{\mathrm{i}}$"),
        ("alpha_x_prime", "α′", "x", r"$\alpha'_{\mathrm{x}}$"),
        ("alpha_x_prime_amb", "α′", "x,amb", r"$\alpha'_{\mathrm{x},\mathrm{amb}}$"),
        ("alpha_tau", "α", "τ", r"$\alpha_{\tau}$"),
        ("gamma_0@upper", "γ", "0", r"$\gamma_{\mathrm{0}}$ (upper)"),
        ("beta", "β", "", r"$\beta$"),
        ("supply", "supply", "", "supply"),
    ],
)
def test_names_as_letters(name: str, letter: str, subscript: str, label: str) -> None:
    found = symbol(name)
    assert (found.letter, found.subscript) == (letter, subscript)
    assert axis_label(name) == label


def test_equations_are_escaped_around_their_subscripts() -> None:
    assert with_subscripts("a_b<c _d") == "a<sub>b</sub>&lt;c _d"
