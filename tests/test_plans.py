"""Plans: which source wins, units in keys, and every problem at once."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import Field

from bench.errors import ConfigError
from bench.procedure import BenchPlan, plans


class Plan(BenchPlan):
    masses: tuple[str, ...] = ("M1", "M2")
    angles: int = Field(8, ge=8)
    settle_s: float = Field(2.0, gt=0)
    max_speed: float = 10.0
    levels_m: tuple[float, ...] = ()
    speeds_rad_s: tuple[float, ...] = Field((30.0,), min_length=1, max_length=3)


def made(*assignments: str, defaults: dict[str, object] | None = None, file: Path | None = None) -> Plan:
    return plans.assemble(Plan, ("rig.toml [plans.p]", defaults or {}), file, assignments)


def test_later_sources_win(tmp_path: Path) -> None:
    file = tmp_path / "plan.toml"
    file.write_text("schema = 1\nangles = 10\nsettle_s = 3.0\n")
    plan = made("settle_s=4", defaults={"angles": 9, "settle_s": 1.0, "max_speed": 5.0}, file=file)
    assert (plan.angles, plan.settle_s, plan.max_speed, plan.masses) == (10, 4.0, 5.0, ("M1", "M2"))


@pytest.mark.parametrize(
    ("text", "field", "value"),
    [
        ("settle_ms=800", "settle_s", 0.8),
        ("max_speed_rpm=60", "max_speed", 6.283185307179586),
        ("levels_um=[1, 2.5]", "levels_m", (1e-6, 2.5e-6)),
        ('masses=["M1", "M4"]', "masses", ("M1", "M4")),
        ("angles = 12", "angles", 12),
    ],
)
def test_values_are_toml_literals_in_si_or_the_units_of_their_keys(text: str, field: str, value: object) -> None:
    found = getattr(made(text), field)
    assert found == (value if field == "masses" else pytest.approx(value, rel=1e-12))


def test_every_problem_is_named_with_its_source() -> None:
    with pytest.raises(ConfigError) as info:
        made("angles=3", "seattle_s=1", defaults={"settle_s": -1.0})
    said = {(p.file, p.key): p for p in info.value.problems}
    assert set(said) == {("--plan", "angles"), ("--plan", "seattle_s"), ("rig.toml [plans.p]", "settle_s")}
    assert "8" in said["--plan", "angles"].expected
    assert said["--plan", "angles"].found == "3"
    assert "settle_s" in said["--plan", "seattle_s"].expected


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speeds_rpm=[]", "--plan: speeds_rad_s: found []; expected at least 1 entry"),
        ("speeds_rad_s=[1.0, 2.0, 3.0, 4.0]", "found [1.0, 2.0, 3.0, 4.0]; expected at most 3 entries"),
        ('masses=["M1", 2]', "--plan: masses.1: found 2; expected a valid string"),
    ],
)
def test_a_list_is_refused_by_key_found_and_expected(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as info:
        made(text)
    assert said in str(info.value)


@pytest.mark.parametrize(
    "text",
    ["angles", "=3", "angles=", "masses=M1", "angles=8\nsettle_s=1", "settle_kg=1", "settle_s=nan", "angles=8.5",
     'angles="8"'],
)  # fmt: skip
def test_what_is_no_assignment_is_refused(text: str) -> None:
    with pytest.raises(ConfigError):
        made(text)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("angles = 8", "found none"),
        ("schema = 2", "newer"),
        ("schema = 1\nangles =", "not TOML"),
        (None, "No such file"),
    ],
)
def test_a_plan_file_that_cannot_be_used(tmp_path: Path, content: str | None, said: str) -> None:
    file = tmp_path / "plan.toml"
    if content is not None:
        file.write_text(content)
    with pytest.raises(ConfigError, match=said):
        made(file=file)


def test_a_misspelt_key_is_answered_with_the_nearest_one() -> None:
    with pytest.raises(ConfigError, match=r"Did you mean settle_s\?"):
        made("setle_ms=1")


def test_a_number_for_a_list_is_told_so() -> None:
    with pytest.raises(ConfigError, match=r"expected a list, as in \[1, 2\]"):
        made("levels_um=10")
