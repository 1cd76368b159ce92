"""Limits of `quantity@place`: which one judges, which are refused, and what is missing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.cli.loading import load_procedure
from bench.errors import ConfigError
from bench.record.limited import limit_of, never_measured, unknown_parts, words_of
from bench.record.limits import Limit
from bench.record.specs import in_unit, load_spec, parse_spec
from bench.rigfile import load_rig

ENTRY = 'unit = "1", source = "house", verified = false'
SPEC = f"""
schema = 1
[limits.sensitivity]
s_max = {{ high = 4, {ENTRY} }}
"s_max@yi" = {{ high = 3, {ENTRY} }}
"s_max@yi, at rest" = {{ high = 2, {ENTRY} }}
"s_max@at rest" = {{ high = 1, {ENTRY} }}
"""


@pytest.fixture
def limits() -> dict[str, Limit]:
    return parse_spec(SPEC)["sensitivity"]


@pytest.mark.parametrize(
    ("where", "high"),
    [("yi, at rest", 2), ("yi, 3000 r/min", 3), ("zi, at rest", 1), ("zi, 3000 r/min", 4), ("", 4), ("yi", 3)],
)
def test_the_limit_of_the_place_judges_and_the_nearest_of_several(
    limits: dict[str, Limit], where: str, high: int
) -> None:
    found = limit_of(limits, "s_max", where)
    assert found is not None
    assert found.high == high
    assert limit_of(limits, "s_max_hz", where) is None


def test_of_two_that_fit_alike_the_first_of_the_file_judges(limits: dict[str, Limit]) -> None:
    alike = {key: limits[key] for key in ("s_max@at rest", "s_max@yi")}
    found = limit_of(alike, "s_max", "yi, at rest")
    assert found is not None
    assert found.high == 1


def test_a_place_at_which_nothing_was_measured_is_told(limits: dict[str, Limit]) -> None:
    assert [place for place, _ in never_measured(limits, "s_max", ["yi, 3000 r/min"])] == ["yi, at rest", "at rest"]
    assert [*never_measured(limits, "phase_margin", [])] == []


def test_the_limit_of_a_place_is_in_the_quantitys_unit(limits: dict[str, Limit]) -> None:
    wrong = {**limits, "s_max@zi": Limit(None, 3.0, "Hz", "house", False)}
    left, (found,) = in_unit(wrong, load_procedure("sensitivity").measures)
    assert set(left) == set(limits)
    assert found.concerns == ("s_max@zi",)


def refused(folder: Path, key: str) -> str:
    """What is said of a limit of that key, in a file of the AMB stand."""
    (folder / "amb5dof.toml").write_text(f'schema = 1\n[limits.sensitivity]\n"{key}" = {{ high = 4, {ENTRY} }}')
    with pytest.raises(ConfigError) as caught:
        load_spec("amb5dof", "sensitivity", load_procedure("sensitivity"), (folder,), rig=load_rig("amb5dof"))
    (problem,) = caught.value.problems
    return str(problem)


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("s_max@inbord", "found 'inbord'; expected a place by the rig's name, such as inboard"),
        ("s_max@yi, at rset", "found 'at rset'; expected a place by the rig's name, such as at rest"),
        ("s_max@upper", "found 'upper'; expected a place by the rig's name"),
        ("s_mx@yi", "found s_mx; expected one of s_max, s_max_hz"),
        ("s_mx@yi", "Did you mean s_max@yi?"),
    ],
)
def test_an_unknown_place_or_quantity_is_named_with_the_nearest(tmp_path: Path, key: str, said: str) -> None:
    assert said in refused(tmp_path, key)


RECORDED = {
    "unbalance": ("10000 r/min, off", "inboard, 2000 r/min, off"),
    "run-up": ("yi, 13000 r/min, up, CCS",),
    "coast-down": ("outboard, 8000 r/min, down, CCS",),
    "balance": ("inboard", "yo, weight inboard, 10000 r/min"),
    "sensitivity": ("x, 10000 r/min", "zo, at rest"),
    "compensation": ("10000 r/min, corrected", "2000 r/min, literal"),
    "step": ("A, y, 0 r/min, 10 µm down", "B, z, 0 r/min"),
    "tracking": ("CAC, 10 Hz, 50 × 80 µm, at rest",),
    "bearing-model": ("outboard",),
}


def places() -> Iterator[tuple[str, str, str]]:
    yield from (("amb5dof", name, where) for name, wheres in RECORDED.items() for where in wheres)
    yield from (("tsbs12", "angle-step", "priority, 12°, 200 Hz"), ("tsbs12", "slew", "0.1 Hz"))
    yield ("tsbs12", "spindown", "by the speed channel")


@pytest.mark.parametrize(("rig", "name", "where"), [*places()])
def test_places_of_records_are_known(rig: str, name: str, where: str) -> None:
    assert [*unknown_parts(where, words_of(load_rig(rig), load_procedure(name)))] == []
