"""Campaign files: strict, every problem at once, and never anything but a campaign or a ConfigError."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench import catalogue
from bench.campaign import Campaign, file
from bench.errors import ConfigError

GOOD = """
schema = 1
name = "two"
rig = "tsbs12"
[[step]]
procedure = "amb-calibration"
plan = { settle_s = 0.5, masses = ["M1", "M2", "M3", "M4"] }
judged = ["K_i"]
[[step]]
procedure = "amb-calibration"
adopt = false
[virtual]
count = 3
[truth]
coulomb = 0.05
"""


def problems(text: str) -> dict[str, str]:
    with pytest.raises(ConfigError) as caught:
        Campaign.parse(text, "c.toml")
    return {p.key: str(p) for p in caught.value.problems}


def test_a_file_as_it_is_meant() -> None:
    c = Campaign.parse(GOOD)
    assert [s.adopt for s in c.step] == [None, False]
    assert c.step[0].judged == ("K_i",)
    assert c.virtual is not None
    assert (c.virtual.first_seed, c.virtual.count) == (0, 3)
    assert c.truth == {"coulomb": 0.05}


def test_every_problem_is_named_at_once_with_its_place() -> None:
    found = problems("""
        schema = 1
        name = "A campaign"
        seed = -1
        visit = -1
        colour = "blue"
        [[step]]
        procedure = "amb-calib"
        plan = 3
        [[step]]
        plan = { settle_s = 1 }
        [virtual]
        count = 0
    """)
    assert set(found) == {
        "name", "rig", "seed", "visit", "colour", "step.1.plan", "step.1.procedure", "step.2.procedure", "virtual.count",
    }  # fmt: skip
    assert "amb-calibration" in found["step.1.procedure"]


@pytest.mark.parametrize(
    ("extra", "key"),
    [
        ("seed = 3\n[virtual]\ncount = 2", "seed"),
        ('backend = "live"\n[virtual]\ncount = 2', "virtual"),
        ('backend = "live"\nseed = 3', "seed"),
        ('backend = "live"\nvisit = 0', "visit"),
        ('backend = "live"\n[truth]\ncoulomb = 0.1', "truth"),
    ],
)
def test_keys_that_contradict_each_other(extra: str, key: str) -> None:
    text = f'schema = 1\nname = "x"\nrig = "tsbs12"\n{extra}\n[[step]]\nprocedure = "amb-calibration"'
    assert key in problems(text)


def test_a_campaign_has_steps() -> None:
    assert "step" in problems('schema = 1\nname = "x"\nrig = "tsbs12"')


@pytest.mark.parametrize(
    ("schema", "said"), [("2", "newer Levbench"), ("0", "expected schema = 1"), ("true", "expected schema = 1")]
)
def test_another_schema_is_refused(schema: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        Campaign.parse(GOOD.replace("schema = 1", f"schema = {schema}"))


def test_without_a_schema() -> None:
    with pytest.raises(ConfigError, match="found none"):
        Campaign.parse(GOOD.replace("schema = 1", ""))


def test_found_by_name_like_rigs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    made, path = file.load("tsbs-identification")
    assert path == catalogue.INSTALLED_CAMPAIGNS / "tsbs-identification.toml"
    assert made.name == "tsbs-identification"
    (tmp_path / "campaigns").mkdir()
    (tmp_path / "campaigns" / "two.toml").write_text(GOOD)
    assert file.load("two")[0].name == "two"
    assert "two" in {c.name for c in catalogue.campaigns()}
    with pytest.raises(ConfigError, match=r"Did you mean two\?"):
        file.load("too")


def test_what_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="cannot be read"):
        file.load(str(tmp_path / "x.toml"))


# TOML as text from values: what a person might write by mistake, at every place.
WORDS = st.sampled_from(
    ["schema", "name", "rig", "step", "procedure", "plan", "virtual", "count", "truth", "given", "equations", "judged"]
)
LEAVES = st.one_of(
    st.integers(-(2**70), 2**70), st.floats(), st.booleans(), st.text(max_size=8),
    st.sampled_from(["amb-calibration", "tsbs12"]),
)  # fmt: skip
VALUES = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS | st.text(max_size=4), inner, max_size=3),
    max_leaves=8,
)  # fmt: skip


def toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, float):
        return {"inf": "inf", "-inf": "-inf", "nan": "nan"}.get(repr(value), repr(value))
    return json.dumps(value)


@settings(max_examples=100, deadline=None)
@given(st.dictionaries(WORDS, VALUES, max_size=6), st.booleans())
def test_any_toml_is_a_campaign_or_a_config_error(table: dict[str, Any], whole: bool) -> None:
    base: dict[str, Any] = {"schema": 1, "name": "x", "rig": "tsbs12", "step": [{"procedure": "amb-calibration"}]}
    text = "\n".join(f"{k} = {toml(v)}" for k, v in {**(base if whole else {}), **table}.items())
    try:
        Campaign.parse(text)
    except ConfigError as error:
        assert "found" in str(error) or "not TOML" in str(error)  # noqa: PT017 (both ways are allowed)


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=200))
def test_any_text_is_a_campaign_or_a_config_error(text: str) -> None:
    with pytest.raises(ConfigError):
        Campaign.parse(text)
