"""One influence in two forms, the unit of a number and a share of it: oracles by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence, correlation, propagate
from bench.uncertainty.forms import by_numbers, form

PITCH = "encoders/x/pitch"


def number(value: float, half_width: float = 0.03, unit: str = "m") -> Toleranced:
    return Toleranced(value=value, unit=unit, half_width=half_width, distribution="rectangular", source="C")


def whole(n: Toleranced) -> Influence:
    return Influence(PITCH, "pitch", n.standard_uncertainty, n.unit, "B", "rectangular")


def share(n: Toleranced) -> Influence:
    return Influence(PITCH, "scale", n.standard_uncertainty / abs(n.value), "1", "B", "rectangular")


def test_a_scale_drops_out_of_a_difference_and_of_a_ratio_of_what_one_encoder_reads() -> None:
    """0.3 m by a share of a pitch of 2, 0.2 m by its unit: 0.3 d - 0.2 d = 0.1 d of the difference, nothing of the ratio."""
    n = number(2.0)
    numbers = {PITCH: n}
    one = by_numbers(Estimate(0.3, "m", {share(n): 0.3}), numbers)
    other = by_numbers(Estimate(0.2, "m", {whole(n): 0.2 / 2.0}), numbers)
    assert (one - other).u == pytest.approx(0.1 * 0.03 / 2 / math.sqrt(3))
    assert (one / other).u == pytest.approx(0.0, abs=1e-15)
    assert correlation(one, other) == pytest.approx(1.0)


def test_a_share_of_a_negative_number_counts_the_other_way() -> None:
    """y = 3 x of x = -2: by x it is 3 u, by a share (x/x_0 - 1) it is -6 u_r; y - 3 x is exact."""
    n = number(-2.0)
    y = by_numbers(Estimate(-6.0, "m", {share(n): -6.0}), {PITCH: n})
    assert {i.unit: c for i, c in y.sensitivities.items()} == {"m": pytest.approx(3.0)}
    assert (y - Estimate(-2.0, "m", {whole(n): 1.0}) * 3).u == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(("value", "unit", "of", "factor"), [
    (-1.0, "m", "1", -1.0), (-1.0, "m", "m", 1.0), (-1.0, "1", "1", 1.0), (1.0, "m", "1", 1.0), (0.0, "m", "m", 1.0),
    (-1.0, "m", "", 1.0), (2.0, "m", "N", None), (2.0, "m", "m", 1.0), (2.0, "m", "1", 1.0), (0.0, "m", "N", None),
])  # fmt: skip
def test_of_a_number_of_size_one_the_unit_tells(value: float, unit: str, of: str, factor: float | None) -> None:
    n = number(value, unit=unit)
    assert form(replace(whole(n), unit=of), n) == factor


@pytest.mark.parametrize("of", [
    {"u": 0.01}, {"u": 0.0}, {"kind": "A"}, {"distribution": "arcsine"}, {"dof": 30.0}, {"u": 0.03 / math.sqrt(6)},
])  # fmt: skip
def test_a_part_of_a_number_or_a_bound_is_another_influence(of: dict[str, float]) -> None:
    n = number(2.0)
    other = replace(whole(n), **of)  # type: ignore[arg-type]
    assert form(other, n) is None
    e = Estimate(1.0, "m", {other: 1.0})
    assert by_numbers(e, {PITCH: n}) is e


def test_an_exact_number_has_no_influence_and_one_of_zero_no_share() -> None:
    assert form(Influence(PITCH, "", 1e-9, "m", "B", "rectangular"), number(2.0, 0.0)) is None
    assert form(Influence(PITCH, "", 0.03, "1", "B", "rectangular"), number(0.0)) is None


@given(st.floats(0.1, 10), st.booleans(), st.floats(-5, 5), st.floats(-5, 5))
def test_draws_of_what_is_not_linear_are_those_of_the_number(size: float, less: bool, a: float, b: float) -> None:
    """A model of a share s, a + b s + s^2, drawn by the number x: s = x/x_0 - 1."""
    n = number(-size if less else size)
    model = lambda p: a + b * p["s"] + 100 * p["s"] ** 2  # noqa: E731
    e = propagate(model, {"s": Estimate(0.0, "1", {share(n): 1.0, Influence("s", "", 0.5, "1", "B", "normal"): 1.0})})
    assert e.nonlinear
    told = by_numbers(e, {PITCH: n})
    assert told.u == pytest.approx(e.u)
    moved, noise = np.linspace(-0.03, 0.03, 7), np.linspace(0.2, -0.1, 7)
    s = moved / n.value + noise
    assert told.sampled({PITCH: moved, "s": noise}) == pytest.approx(a + b * s + 100 * s**2, rel=1e-9, abs=1e-9)
