"""Rig files that are based on another one: laid over each other, refused, traced to the file at fault, and self-contained."""

from __future__ import annotations

import datetime
import json
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench import catalogue
from bench.calibration.store import Store
from bench.cli.__main__ import main
from bench.cli.virtual import simulated_run
from bench.errors import ConfigError, Problem
from bench.inputfile import parse_toml
from bench.recording import Recording
from bench.rigfile import RigFile, load_rig, read_rig
from bench.rigfile.based import over
from bench.rigfile.check import check_rig
from bench.rigfile.tomltext import to_toml
from sim_backend.truth import draw

RIGS = Path(__file__).resolve().parent.parent / "rigs"
HEAD = 'schema = 2\nbased_on = "tsbs12.toml"\nname = "mine"\ntitle = "one of mine"\n'
VARIANTS = ("tsbs12-drag", "tsbs12-close", "tsbs12-offset")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("tsbs12.toml", "tsbs12.dbc"):
        (tmp_path / name).write_bytes((RIGS / name).read_bytes())
    return tmp_path


def written(folder: Path, text: str, head: str = HEAD, name: str = "mine.toml") -> str:
    (folder / name).write_text(head + text, encoding="utf-8")
    return str(folder / name)


def problems(rig: str) -> dict[str, Problem]:
    """By key; loading refuses the rig with the same ones."""
    found, _ = check_rig(rig)
    with pytest.raises(ConfigError) as caught:
        load_rig(rig)
    assert {p.key for p in caught.value.problems} <= {p.key for p in found}
    assert all(str(p) in str(caught.value) for p in caught.value.problems)
    return {p.key: p for p in found}


def test_tables_are_merged_and_values_replace(folder: Path) -> None:
    rig = load_rig(written(folder, """
        [envelope]
        max_current_A = 11.0
        positions = ["pos_xi"]
        [parameters]
        segment_max.default = 7.8
        [geometry]
        clearance = { value = 218, unit = "um", u = 1, distribution = "normal", source = "a gauge" }
        [channels.temp_x]
        signal = "Telemetry.temp_o"
        unit = "K"
        """, HEAD + 'without = ["channels.temp_o", "masses"]\n'))  # fmt: skip
    base = load_rig(str(folder / "tsbs12.toml"))
    assert (rig.name, rig.title, rig.uut) == ("mine", "one of mine", base.uut)
    assert rig.envelope == base.envelope.model_copy(update={"max_current_A": 11.0, "positions": ("pos_xi",)})
    assert rig.parameters["segment_max"] == base.parameters["segment_max"].model_copy(update={"default": 7.8})
    clearance = rig.geometry["clearance"]
    assert (clearance.value, clearance.standard_uncertainty, clearance.half_width) == pytest.approx(
        (218e-6, 1e-6, None)
    )
    assert rig.masses == {}
    assert set(rig.channels) == {*base.channels, "temp_x"} - {"temp_o"}
    same = {"channels", "envelope", "geometry", "masses", "name", "parameters", "title"}
    left = [{k: v for k, v in r.model_dump().items() if k not in same} for r in (rig, base)]
    assert left[0] == left[1]


def test_nothing_said_is_the_base_in_the_same_order(folder: Path) -> None:
    rig, base = load_rig(written(folder, "")), load_rig(str(folder / "tsbs12.toml"))
    for table in ("channels", "parameters", "bearings", "probes", "geometry", "simulation", "devices", "masses"):
        assert list(getattr(rig, table)) == list(getattr(base, table)), table
    assert draw(rig, 3).values == draw(base, 3).values


def test_a_base_has_a_base(folder: Path) -> None:
    written(folder, "[envelope]\nmax_speed_rad_s = 60.0\nmax_current_A = 11.0\n")
    head = HEAD.replace("tsbs12", "mine").replace('"mine"\n', '"yours"\n').replace("one of", "not one of")
    rig = load_rig(written(folder, "[envelope]\nmax_speed_rad_s = 50.0\n", head, "yours.toml"))
    assert (rig.name, rig.envelope.max_speed_rad_s, rig.envelope.max_current_A) == ("yours", 50.0, 11.0)


def test_a_problem_names_the_file_in_which_its_key_stands(folder: Path) -> None:
    base = folder / "tsbs12.toml"
    base.write_text(
        base.read_text().replace('pos_z = { signal = "Telemetry.pos_z"', 'pos_z = { signal = "Telemetry.pos_q"')
    )
    text = '[channels]\nangle.unit = "grad"\nextra = { unit = "m" }\n[geometry]\nclearance = { value = 0.2, unit = "mm" }\n'
    rig = written(folder, text)
    found = problems(rig)
    assert found["channels.pos_z.signal"].file == str(base)
    assert found["channels.angle.unit"].file == rig
    assert found["channels.extra.signal"] == Problem(rig, "channels.extra.signal", "nothing", "a value")
    assert found["geometry.clearance.source"].file == rig  # a number replaces as a whole: it has no source any more


def test_what_was_taken_away_is_missed_where_it_is_asked_for(folder: Path) -> None:
    rig = written(folder, "", HEAD + 'without = ["channels.i_xi_n"]\n')
    coils = problems(rig)["bearings.inboard.axes.xi.coils"]
    assert coils == Problem(str(folder / "tsbs12.toml"), coils.key, "i_xi_n", "a channel of this rig")


@pytest.mark.parametrize(
    ("head", "key", "said"),
    [
        (HEAD.replace('name = "mine"\n', ""), "name", "found nothing; expected a name of its own"),
        (HEAD.replace('"mine"', '"tsbs12"'), "name", "found 'tsbs12', as in its base"),
        (HEAD.replace('title = "one of mine"\n', ""), "title", "found nothing; expected a title of its own"),
        (HEAD + 'without = ["channels.i_m9"]\n', "without", "found 'channels.i_m9'; expected a key of what it is based on"),
        (HEAD + 'without = ["a = 1\\nb"]\n', "without", "found 'a = 1\\nb'; expected a key"),
        (HEAD + 'without = [""]\n', "without", "found ''; expected a key"),
        (HEAD + "without = 3\n", "without", "found 3; expected a list of keys"),
        (HEAD + "links = 3\n", "(file)", "links: found no dbc"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_the_laying_is_told_beside_the_rest(folder: Path, head: str, key: str, said: str) -> None:
    rig = written(folder, '[channels]\nangle.unit = "grad"\n', head)
    if key == "(file)":
        with pytest.raises(ConfigError, match=said):
            check_rig(rig)
        return
    found = problems(rig)
    assert (rig, True, True) == (found[key].file, said in str(found[key]), "channels.angle.unit" in found)


def _same(folder: Path) -> str:
    return written(folder, "", HEAD.replace("tsbs12.toml", "mine.toml"))


def _circle(folder: Path) -> str:
    written(folder, "", HEAD.replace("tsbs12.toml", "mine.toml"), "other.toml")
    return written(folder, "", HEAD.replace("tsbs12.toml", "other.toml"))


def _linked(folder: Path) -> str:
    os.symlink(folder / "mine.toml", folder / "other.toml")
    return written(folder, "", HEAD.replace("tsbs12.toml", "other.toml"))


def _deep(folder: Path) -> str:
    for n in range(4):
        written(folder, "", HEAD.replace("tsbs12.toml", f"{n + 1}.toml" if n < 3 else "tsbs12.toml"), f"{n}.toml")
    return str(folder / "0.toml")


def _elsewhere(folder: Path) -> str:
    return written(folder, "", HEAD.replace("tsbs12.toml", "../tsbs12.toml"))


def _absent(folder: Path) -> str:
    return written(folder, "", HEAD.replace("tsbs12.toml", "tsbs13.toml"))


def _pipe(folder: Path) -> str:
    os.mkfifo(folder / "pipe.toml")
    return written(folder, "", HEAD.replace("tsbs12.toml", "pipe.toml"))


def _no_text(folder: Path) -> str:
    return written(folder, "", HEAD.replace('"tsbs12.toml"', "12"))


def _no_toml(folder: Path) -> str:
    return written(folder, "", HEAD.replace("tsbs12.toml", "tsbs12.dbc"))


def _old(folder: Path) -> str:
    base = folder / "tsbs12.toml"
    base.write_text(base.read_text().replace("schema = 2", "schema = 1"))
    return written(folder, "")


def _large(folder: Path) -> str:
    base, filler = folder / "tsbs12.toml", "x" * 600_000
    base.write_text(f'{base.read_text()}\n[plans.step]\nfiller = "{filler}"\n')
    return written(folder, f'[plans.step]\nmore = "{filler}"\n')


@pytest.mark.parametrize(
    ("write", "said"),
    [
        (_same, "based_on: found 'mine.toml', but mine.toml already; expected a file that is not based on this one"),
        (_circle, "other.toml: based_on: found 'mine.toml', but mine.toml is based on other.toml already"),
        (_linked, "based_on: found 'other.toml', but mine.toml already"),
        (_deep, "3.toml: based_on: found 'tsbs12.toml', one file more than 4; expected fewer"),
        (_elsewhere, "based_on: found '../tsbs12.toml'; expected the name of a rig file beside this one"),
        (_absent, "based_on: found 'tsbs13.toml', which is not there; expected a rig file beside this one"),
        (_pipe, "pipe.toml: cannot be read: found no regular file; expected one"),
        (_no_text, "based_on: found 12; expected the name of a rig file beside this one"),
        (_no_toml, "tsbs12.dbc: not TOML"),
        (_old, "mine.toml: schema: found 2 here and 1 in"),
        (_large, "based_on: found more than 1048576 bytes together; expected fewer"),
    ],
)
def test_a_base_that_cannot_be_is_refused(folder: Path, write: Callable[[Path], str], said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_rig(write(folder))
    assert said in str(caught.value)


def test_bench_check_names_the_file_of_a_plan_and_of_what_is_simulated(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    base = folder / "tsbs12.toml"
    base.write_text(base.read_text().replace("\nangles = 9\n", "\nangles = -9\n"))
    rig = written(folder, '[plans.slew]\nperiods = -1\n[simulation]\nmachine = "tsbx"\n')
    assert main(["check", rig]) == 2
    said = capsys.readouterr().err
    assert f"{rig} [plans.slew]: periods: found -1" in said
    assert f"{base} [plans.amb-calibration]: angles: found -9" in said
    assert f"{rig}: simulation.machine: found" in said


def test_the_map_of_messages_is_found_beside_the_base_and_named_with_it(folder: Path) -> None:
    rig = written(folder, "")
    assert load_rig(rig).dbc_text == load_rig(str(folder / "tsbs12.toml")).dbc_text
    (folder / "tsbs12.dbc").unlink()
    with pytest.raises(ConfigError, match=rf"rig file {folder / 'tsbs12.toml'}: links.controller.dbc: cannot read"):
        read_rig(rig)


@pytest.mark.parametrize("name", VARIANTS)
def test_the_merged_text_stands_by_itself(name: str) -> None:
    text = read_rig(name)
    again = RigFile.parse(text.toml, text.dbc, str(text.path))
    assert again == load_rig(name)
    assert "based_on" not in parse_toml(text.toml)


@pytest.mark.parametrize(("name", "status"), [*zip(VARIANTS, (5, 0, 0), strict=True)])
def test_the_stated_variants_run_and_analyse_from_what_they_recorded(tmp_path: Path, name: str, status: int) -> None:
    """Where the drag is three times the machine's, `slew` says that something brakes: INDETERMINATE."""
    words = ["--plan", "frequencies_hz=[0.5, 2.0]", "--plan", "periods=4", "--no-report"]
    assert main(["run", "slew", "--rig", name, "--seed", "1", "--out", str(tmp_path), *words]) == status
    (run,) = (path.parent for path in tmp_path.glob("*/record.json"))
    recorded = Recording.open(run / "recording.mcap").rig
    assert recorded == load_rig(name).model_copy(update={"path": recorded.path})
    assert main(["analyse", str(run)]) == status
    again, first = (
        json.loads(path.read_text())["measurements"]
        for path in (*run.glob("analyses/*/record.json"), run / "record.json")
    )
    assert again == first


def test_the_stated_variants_differ_from_the_machine_by_what_they_state() -> None:
    """T Fig. 6.8, 6.11 and 6.12: 0.257 N m s/rad with one AMB idle and the bearings' part as it was, 0.6 of 0.081; 0.218 mm
    within 5 um, 91 um along x within 20 um."""
    base = load_rig("tsbs12")
    stated: Mapping[str, Mapping[str, tuple[float, float]]] = {
        "tsbs12-drag": {"viscous": (0.257 + 0.3 * 0.081, 0.00844), "drag_share": (0.6 * 0.081 / 0.2813, 0.0288)},
        "tsbs12-close": {"geometry.clearance": (218e-6, 5e-6)},
        "tsbs12-offset": {"motor_offset_x": (91e-6, 20e-6)},
    }
    for name, numbers in stated.items():
        rig = load_rig(name)
        for seed in range(20):
            drawn, before = draw(rig, seed).values, draw(base, seed).values
            assert {k for k in drawn if drawn[k] != before[k]} == {*numbers}
            assert all(abs(drawn[k] - value) <= 1.001 * half for k, (value, half) in numbers.items())
        changed = {k: p.default for k, p in rig.parameters.items() if p != base.parameters[k]}
        assert changed == ({"segment_max": 7.8, "lag_compensation": 1} if name == "tsbs12-drag" else {})


def test_the_example_of_the_page_is_a_rig(folder: Path) -> None:
    page = (RIGS.parent / "docs" / "reference" / "rig-file.md").read_text(encoding="utf-8")
    example = page.split("## Based on another file")[1].split("```toml\n")[1].split("```")[0]
    rig = load_rig(written(folder, example, ""))
    assert (rig.name, rig.uut.serial, rig.parameters["segment_max"].default) == ("tsbs12-b", "0002", 7.8)
    assert ("temp_m" in rig.channels, list(rig.levers)) == (False, ["left"])
    assert main(["check", rig.path]) == 0


def test_a_calibration_of_the_base_is_of_another_rig(tmp_path: Path) -> None:
    run = simulated_run("slew", "tsbs12", 1, {"frequencies_hz": (0.5, 2.0), "periods": 4}, tmp_path / "a.mcap")
    calibration = run.calibration()
    assert Store.of(load_rig("tsbs12"), 1, tmp_path).foreign(calibration) == ""
    assert Store.of(load_rig("tsbs12-drag"), 1, tmp_path).foreign(calibration) == "of rig tsbs12"


def test_the_commands_take_it_by_name_and_by_path(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert [e.title for e in catalogue.rigs() if e.name == "tsbs12-close"] == [load_rig("tsbs12-close").title]
    for rig in ("tsbs12-close", written(folder, "")):
        assert main(["check", rig]) == 0
        assert "no problems" in capsys.readouterr().out
        assert main(["list", "--rig", rig]) == 0
        assert re.search(r"amb-calibration +yes", capsys.readouterr().out)


BARE = st.from_regex(r"[A-Za-z0-9_-]{1,6}", fullmatch=True)
KEYS = BARE | st.text(st.characters(exclude_categories=("Cs",)), max_size=4)
TEXTS = st.text(st.characters(exclude_categories=("Cs",)), max_size=8)
SCALARS = (
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | TEXTS | st.dates()
    | st.times() | st.datetimes(datetime.datetime(1970, 1, 1))
)  # fmt: skip


def nested(values: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return SCALARS | st.lists(values, max_size=3) | st.dictionaries(KEYS, values, max_size=4)


VALUES = nested(nested(nested(SCALARS)))
TABLES = st.dictionaries(KEYS, VALUES, max_size=5)


@settings(max_examples=300)
@given(TABLES, TABLES)
def test_the_merged_text_parses_to_the_merged_data(base: dict[str, Any], own: dict[str, Any]) -> None:
    merged = over(base, own)
    again = parse_toml(to_toml(merged))
    assert again == merged
    assert _orders(again) == _orders(merged)
    assert over(merged, own) == merged
    for key, value in own.items():
        if not isinstance(value, dict):
            assert merged[key] == value
    assert set(merged) == {*base, *own}


def _orders(table: Mapping[str, Any]) -> dict[str, Any]:
    """The order of keys within each table below the first level."""
    return {k: (list(v), _orders(v)) for k, v in table.items() if isinstance(v, dict)}
