"""JSON schemas of what people write: what ships fits them, slips do not, and every key says what it is."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from bench import catalogue
from bench.cli.__main__ import main
from bench.cli.loading import load_procedure
from bench.cli.schemas import FILES, kinds, schema_of, text_of
from bench.procedure.described import settings_of

ROOT = Path(__file__).parent.parent.parent
SHIPPED = {"rig": ("rigs/*.toml", "examples/*/*.toml", "tests/drafts/*.toml"), "spec": ("specs/*.toml",),
           "campaign": ("campaigns/*.toml",)}  # fmt: skip


def shipped(kind: str) -> list[Path]:
    return [path for pattern in SHIPPED[kind] for path in sorted(ROOT.glob(pattern)) if path.name != "pyproject.toml"]


@pytest.mark.parametrize("kind", FILES)
def test_what_ships_fits(kind: str) -> None:
    fits = Draft202012Validator(schema_of(kind))
    files = shipped(kind)
    assert len(files) >= 5
    for path in files:
        wrong = [
            f"{path.name}: {e.json_path}: {e.message}" for e in fits.iter_errors(tomllib.loads(path.read_text("utf-8")))
        ]
        assert wrong == []


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("rig", 'schema = 2\nname = "x"\n[chanels]\n'),
        ("rig", 'schema = 2\nname = "x"\n[probes.a]\nchanel = "a"\n'),
        ("rig", 'schema = 2\nname = "x"\n[geometry]\namb_gap = { value = 1 }\n'),
        ("rig", 'schema = "two"\nname = "x"\n'),
        ("spec", 'schema = 1\n[limits.step]\novershoot = { low = "1", unit = "%", source = "s", verified = true }\n'),
        ("campaign", 'schema = 1\nname = "x"\nrig = "y"\n[[step]]\nprocedur = "step"\n'),
        ("plan-step", "schema = 1\nsizs_m = [1e-5]\n"),
        ("plan-step", "schema = 1\nsizes_m = 1e-5\n"),
        ("plan-unbalance", "schema = 1\nslow_s = 0.5\n"),
    ],
)
def test_slips_do_not_fit(kind: str, text: str) -> None:
    assert list(Draft202012Validator(schema_of(kind)).iter_errors(tomllib.loads(text)))


def test_a_plan_fits_in_other_units_of_its_settings() -> None:
    fits = Draft202012Validator(schema_of("plan-unbalance"))
    fits.validate(
        {"schema": 1, "speeds_rpm": [2000, 7000], "slow_s": 5, "settle_ms": 800, "rate_hz": 5000, "repeat": False}
    )


@pytest.mark.parametrize("kind", kinds())
def test_each_is_a_schema_without_null(kind: str) -> None:
    schema = json.loads(text_of(kind))
    Draft202012Validator.check_schema(schema)
    assert "null" not in json.dumps(schema)


def keys(schema: Any) -> Iterator[tuple[str, str, Any]]:
    """Every key that a file may have: its table, its name, what is said of it."""
    for name, table in {schema.get("title", ""): schema, **schema.get("$defs", {})}.items():
        for key, value in table.get("properties", {}).items():
            yield name, key, value


@pytest.mark.parametrize("kind", FILES)
def test_every_key_says_what_it_is(kind: str) -> None:
    assert [f"{table}.{key}" for table, key, value in keys(schema_of(kind)) if not value.get("description")] == []


def test_keys_are_told_of_that_there_are() -> None:
    told = tomllib.loads((ROOT / "bench/keys.toml").read_text("utf-8"))
    there = {(table, key) for kind in FILES for table, key, _ in keys(schema_of(kind))}
    assert [f"{table}.{key}" for table, words in told.items() for key in words if (table, key) not in there] == []


@pytest.mark.parametrize("entry", catalogue.PROCEDURES, ids=lambda entry: entry.name)
def test_every_setting_of_a_plan_says_what_it_is(entry: catalogue.Entry) -> None:
    plan = load_procedure(entry.name).plan
    assert set(settings_of(plan)) == set(plan.model_fields)
    file = ROOT / "procedures" / entry.module.split(".")[1] / "settings.toml"
    if file.exists():
        assert set(tomllib.loads(file.read_text("utf-8"))) <= set(plan.model_fields)


def test_shipped_schemas_are_those_of_the_models() -> None:
    """An editor reads them beside the files, by their first lines; `bench schema KIND` writes them."""
    for kind, place in (("rig", "bench/rigfile"), ("spec", "bench/record"), ("campaign", "bench/campaign")):
        assert (ROOT / place / f"{kind}.schema.json").read_text("utf-8") == text_of(kind), kind


@pytest.mark.parametrize("kind", FILES)
def test_what_ships_names_its_schema_first(kind: str) -> None:
    for path in shipped(kind):
        first = path.read_text("utf-8").splitlines()[0]
        assert first.startswith("#:schema "), path.name
        assert (path.parent / first.removeprefix("#:schema ")).resolve().name == f"{kind}.schema.json"
        assert (path.parent / first.removeprefix("#:schema ")).is_file(), path.name


def test_all_are_written_into_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "--into", str(tmp_path / "schemas")]) == 0
    assert {p.name for p in (tmp_path / "schemas").iterdir()} == {f"{kind}.schema.json" for kind in kinds()}
    assert "#:schema schemas/rig.schema.json" in capsys.readouterr().err


def test_a_file_is_no_folder_for_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "schemas"
    path.write_text("mine")
    assert main(["schema", "--into", str(path)]) == 2
    assert "found a file; expected a folder" in capsys.readouterr().err
    assert path.read_text() == "mine"


def test_a_kind_that_is_none_is_answered_by_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "plan-unbalanc"]) == 2
    assert "Did you mean unbalance?" in capsys.readouterr().err
    assert main(["schema", "rigg"]) == 2
    assert "found no schema 'rigg'; expected one of rig" in capsys.readouterr().err
