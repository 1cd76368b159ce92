"""Spec files: what ships, and every way to get one wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.errors import ConfigError
from bench.limits import Limit
from bench.specs import INSTALLED, load_spec, parse_spec

ENTRY = 'unit = "N/A", source = "house", verified = false'


def test_the_shipped_spec() -> None:
    limits = load_spec("tsbs12", "amb-calibration", ("K_i", "K_o"), (INSTALLED,))
    assert set(limits) == {"K_i", "K_o"}
    assert (limits["K_i"].low, limits["K_i"].high) == pytest.approx((65.88, 80.52))
    assert (limits["K_o"].low, limits["K_o"].high) == pytest.approx((66.96, 81.84))
    assert limits["K_i"].unit == "N/A"
    assert limits["K_i"].verified


def test_no_spec_no_limits(tmp_path: Path) -> None:
    assert load_spec("other", "amb-calibration", folders=(tmp_path,)) == {}
    assert load_spec("tsbs12", "other-procedure", folders=(INSTALLED,)) == {}


def test_one_sided() -> None:
    spec = parse_spec(f"schema = 1\n[limits.p]\nq = {{ high = 3, {ENTRY} }}")
    assert spec == {"p": {"q": Limit(None, 3.0, "N/A", "house", False)}}


def test_a_limit_of_an_undeclared_quantity_is_refused() -> None:
    with pytest.raises(ConfigError, match="K_o"):
        load_spec("tsbs12", "amb-calibration", ("K_i",), (INSTALLED,))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("schema = 2", "newer"),
        ("", "schema"),
        ("schema = true", "schema"),
        ("schema = ", "not TOML"),
        ("schema = 1\nlimit = 3", "limit"),
        ("schema = 1\nlimits = 3", "a table"),
        ("schema = 1\n[limits]\np = 3", "limits.p"),
        ("schema = 1\n[limits.p]\nq = 3", "limits.p.q"),
        (f"schema = 1\n[limits.p]\nq = {{ hihg = 3, {ENTRY} }}", "limits.p.q.hihg"),
        (f"schema = 1\n[limits.p]\nq = {{ {ENTRY} }}", "low None, high None"),
        (f"schema = 1\n[limits.p]\nq = {{ low = nan, {ENTRY} }}", "finite"),
        (f"schema = 1\n[limits.p]\nq = {{ low = '3', {ENTRY} }}", "limits.p.q.low"),
        (f"schema = 1\n[limits.p]\nq = {{ nominal = 3, {ENTRY} }}", "nominal and relative"),
        (f"schema = 1\n[limits.p]\nq = {{ nominal = 3, relative = 0.1, low = 1, {ENTRY} }}", "nominal and relative"),
        (f"schema = 1\n[limits.p]\nq = {{ nominal = 3, relative = -0.1, {ENTRY} }}", "relative"),
        ("schema = 1\n[limits.p]\nq = { low = 3 }", "limits.p.q.source"),
    ],
)
def test_refused(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        parse_spec(text)


def test_every_problem_is_named_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_spec("schema = 1\nx = 1\n[limits.p]\nq = { low = 3 }\nr = 4")
    assert len(caught.value.problems) == 5
