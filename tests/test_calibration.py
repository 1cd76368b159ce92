"""Calibrations as facts: the file, what is refused in it, and identities along a chain."""

from __future__ import annotations

import dataclasses
import json
import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from bench import catalogue
from bench.calibration import (
    Calibration,
    Need,
    adopted,
    certificate,
    certificates_of,
    changed_certificates,
    number,
    settings_differ,
)
from bench.calibration.file import attached, attachment, from_json, read, to_json, write
from bench.calibration.lookup import Lookup
from bench.calibration.store import Store, base_of, stores_of
from bench.errors import ConfigError
from bench.rigfile import RigFile, load_rig
from bench.run.adoption import refuse_other_rig
from bench.uncertainty import Estimate, Influence, correlation

GOLDEN = Path(__file__).parent / "calibrations" / "golden.json"
GAIN = Influence("sensors/i_yo_p/gain", "gain of i_yo_p", 0.0017, "1", "B", "rectangular")
SPAN = Influence("geometry/amb_span", "span", 5e-5, "m", "B", "normal")
SCATTER = Influence("scatter/1", "scatter", 0.1, "N/A", "A", "normal", 20.0)
K = Estimate(74.0, "N/A", {GAIN: -74.0, SPAN: 600.0, SCATTER: 1.0})
EMPTY = "0" * 64


@pytest.fixture(scope="module")
def rig() -> RigFile:
    return load_rig("tsbs12")


def made(**changes: Any) -> Calibration:
    """A calibration of the virtual rig 3."""
    kept: dict[str, Any] = {
        "procedure": "amb-calibration", "values": adopted({"K_o": K}, "run-a"), "settings": {"bias_A": 3.0}, "run_id": "run-a",
        "rig": "tsbs12", "uut": load_rig("tsbs12").uut.serial, "seed": 3, "sha256": EMPTY, "levbench": "0.1.0",
    }  # fmt: skip
    return Calibration(**{**kept, **changes})


def test_the_golden_file() -> None:
    """Written by hand; u^2 = (400 x 5e-5)^2 + 0.03^2 + (2 x 0.02)^2 = 0.0029."""
    c = read(GOLDEN)
    assert (c.procedure, c.seed, c.due, c.state) == ("force-constant", 3, "2027-11-21", "current")
    assert c.settings == {"bias_A": 3.0, "angles": 9}
    value = c.values["alpha_d"]
    assert (value.value, value.unit) == (21.0, "N/A")
    assert value.u == pytest.approx(math.sqrt(0.0029), rel=1e-12)
    scatter = c.influences["amb-calibration-20261121T101500Z-a1b2/scatter/0/1"]
    assert (scatter.kind, scatter.dof) == ("A", 33.0)
    assert c.influences["geometry/amb_span"].dof == math.inf
    assert c.used[0].procedure == "amb-calibration"
    assert c.certificates["geometry/amb_span"].value == 0.125
    assert json.loads(to_json(c)) == json.loads(GOLDEN.read_text(encoding="utf-8"))


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    c = made()
    write(tmp_path / "a.json", c)
    assert read(tmp_path / "a.json") == c
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]


def test_a_number_that_is_none_is_not_written(tmp_path: Path) -> None:
    write(tmp_path / "a.json", made())
    before = (tmp_path / "a.json").read_bytes()
    with pytest.raises(ValueError, match="JSON"):
        write(tmp_path / "a.json", made(values={"K_o": Estimate.exact(math.nan)}))
    assert (tmp_path / "a.json").read_bytes() == before


def changed(path: str, value: Any) -> str:
    """The golden file with one key set (`...` takes it out)."""
    content = json.loads(GOLDEN.read_text(encoding="utf-8"))
    *parents, last = path.split("|")
    table = content
    for key in parents:
        table = table[int(key) if isinstance(table, list) else key]
    if value is ...:
        del table[last]
    else:
        table[last] = value
    return json.dumps(content)


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("schema", 2, "newer"),
        ("schema", 0, "expected 1"),
        ("schema", True, "no schema number"),
        ("schema", ..., "no schema number"),
        ("due", ..., "due"),
        ("due", "someday", "isoformat"),
        ("date", "2026-11-21T10:45:00", "zone"),
        ("colour", "red", "colour"),
        ("settings|bias_A", "3", "bias_A"),
        ("seed", None, "seed"),
        ("seed", 3.5, "seed"),
        ("backend", "cloud", "backend"),
        ("sha256", "abc", "64"),
        ("used|0|state", "fine", "state"),
        ("used|0|note", "x", "note"),
        ("values|alpha_d|value", math.nan, "NaN"),
        ("values|alpha_d|value", None, "value"),
        ("values|alpha_d|sensitivities|site/gravity", 1.0, "site/gravity"),
        ("influences|geometry/amb_span|u", -1.0, "0 or more"),
        ("influences|geometry/amb_span|dof", 0.0, "dof"),
        ("influences|geometry/amb_span|distribution", "flat", "distribution"),
        ("values|alpha_d|sensitivities|geometry/amb_span", 1e308, "infinite"),
    ],
)
def test_what_is_no_calibration_is_refused(path: str, value: Any, said: str) -> None:
    text = changed(path, value)
    if said == "infinite":
        text = text.replace("5e-05", "1e300")
    with pytest.raises(ConfigError, match=said):
        from_json(text, "golden")


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda children: st.lists(children, max_size=4) | st.dictionaries(st.text(max_size=8), children, max_size=4),
    max_leaves=12,
)


@given(json_values)
def test_any_json_is_refused_and_nothing_else_happens(value: Any) -> None:
    with pytest.raises(ConfigError):
        from_json(json.dumps(value))


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(sorted(json.loads(GOLDEN.read_text(encoding="utf-8")))), json_values)
def test_a_key_replaced_is_read_or_refused(key: str, value: Any) -> None:
    content = json.loads(GOLDEN.read_text(encoding="utf-8")) | {key: value}
    try:
        c = from_json(json.dumps(content))
    except ConfigError:
        return
    assert from_json(to_json(c)) == c


@given(st.text(max_size=60))
@example("[" * 100_000)
@example('{"schema": 1e999}')
@example('{"schema": 1, "rig": "\ud800"}')
def test_any_text_is_refused(text: str) -> None:
    with pytest.raises(ConfigError):
        from_json(text)


@pytest.mark.parametrize("text", ["{}", "[1]", "[{}]", '[{"state": "current", "calibration": 1}]', "7", "[[]]", "no"])
def test_a_foreign_attachment_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="a"):
        attached(text, "a")


def test_an_attachment_keeps_the_state_it_was_used_in() -> None:
    expired = dataclasses.replace(made(), expired=True)
    assert attached(attachment([made(), expired]), "a") == (made(), expired)


def test_only_what_a_run_invents_gets_its_name_in_front() -> None:
    older = Influence("run-0/scatter/1", "scatter [run-0]", 0.2, "1", "A", "normal", 9.0)
    values = adopted({"a": K + Estimate.of(0.0, older)}, "run-a", {older.id})
    assert {i.id for i in values["a"].sensitivities} == {
        "sensors/i_yo_p/gain", "geometry/amb_span", "run-a/scatter/1", "run-0/scatter/1",
    }  # fmt: skip
    names = {i.id: i.name for i in values["a"].sensitivities}
    assert names["run-a/scatter/1"] == "scatter [run-a]"
    assert values["a"].u == pytest.approx((K + Estimate.of(0.0, older)).u)


def test_a_gain_used_twice_cancels_and_scatter_does_not() -> None:
    """A force per true ampere from one procedure, a current read by the same sensor in another: the gain is gone."""
    constant = from_json(to_json(made())).values["K_o"]
    gain = Estimate.of(1.0, GAIN)
    current = Estimate.exact(2.0) / gain  # 2 A read; the later run's own scatter has the same id as the earlier one's
    force = constant * current + Estimate.of(0.0, SCATTER)
    assert force.contributions["sensors/i_yo_p/gain"] == pytest.approx(-2 * 2 * 74.0 * GAIN.u)
    per_reading = constant * gain  # the reading's own unit: here it cancels
    assert per_reading.contributions["sensors/i_yo_p/gain"] == pytest.approx(0.0, abs=1e-12)
    assert per_reading.u == pytest.approx(math.hypot(600 * 5e-5, 0.1))
    assert force.contributions["run-a/scatter/1"] == pytest.approx(0.2)
    assert force.contributions["scatter/1"] == pytest.approx(0.1)
    assert correlation(constant, gain) < 0


def test_certificates_are_found_by_identity(rig: RigFile) -> None:
    named = {
        "site/gravity": rig.site.gravity, "masses/density": rig.mass_density, "masses/hanger": rig.hanger,
        "masses/M1": rig.masses["M1"], "geometry/amb_span": rig.geometry["amb_span"],
        "sensors/i_yo_p/gain": rig.sensors["i_yo_p"].gain, "sensors/i_yo_p/offset": rig.sensors["i_yo_p"].offset,
        "machine/amb_asymmetry/i": rig.machine["amb_asymmetry"],
    }  # fmt: skip
    for identity, toleranced in named.items():
        found = certificate(rig, identity)
        assert found is not None, identity
        assert (found.value, found.u) == (toleranced.value, toleranced.standard_uncertainty)
    for identity in ("scatter/1", "site/place", "geometry/none", "sensors/none/gain", "", "run/geometry/amb_span"):
        assert certificate(rig, identity) is None, identity


def test_another_certificate_is_noticed_another_wording_is_not(rig: RigFile) -> None:
    then = certificates_of(rig, ["geometry/amb_span", "masses/M1", "scatter/1"])
    assert sorted(then) == ["geometry/amb_span", "masses/M1"]
    assert changed_certificates(then, rig) == []
    other = {k: dataclasses.replace(c, source="elsewhere") for k, c in then.items()}
    assert changed_certificates(other, rig) == []
    other["masses/M1"] = dataclasses.replace(then["masses/M1"], value=0.6)
    other["masses/M9"] = then["masses/M1"]
    said = changed_certificates(other, rig)
    assert len(said) == 2
    assert "was 0.6 kg" in said[0]
    assert "none any more" in said[1]


def test_settings_are_equal_or_named() -> None:
    assert settings_differ({"bias_A": 3.0, "angles": 9.0}, {"bias_A": 3, "angles": 9}) == []
    assert settings_differ({"bias_A": 2.5}, {"bias_A": 3.0, "angles": 9}) == [
        "bias_A = 2.5; 3 is needed", "angles: not stated; 9 is needed",
    ]  # fmt: skip
    assert [number(x) for x in (3.0, 0.1, -2.0, 1e-7)] == ["3", "0.1", "-2", "1e-07"]


def test_the_due_day_itself_still_counts() -> None:
    c = made(due="2027-11-21")
    assert not c.overdue(datetime(2027, 11, 21, 23, 59, tzinfo=UTC))
    assert c.overdue(datetime(2027, 11, 22, 0, 0, tzinfo=UTC))
    assert c.used_at(datetime(2028, 1, 1, tzinfo=UTC)).state == "expired"


def test_an_adopted_one_replaces_the_current_and_keeps_the_older(tmp_path: Path, rig: RigFile) -> None:
    store = Store.of(rig, 3, tmp_path)
    assert store.current("amb-calibration") is None
    first, second = made(), made(run_id="run-b", date="2026-03-01T00:00:00+00:00")
    assert store.adopt(first) == tmp_path / "sim-3" / "amb-calibration.json"
    store.adopt(first)  # once more changes nothing
    assert [p.name for p in (tmp_path / "sim-3").iterdir()] == ["amb-calibration.json"]
    store.adopt(second)
    assert store.current("amb-calibration") == second
    store.adopt(dataclasses.replace(first, run_id="run-c"))
    names = sorted(p.name for p in (tmp_path / "sim-3").iterdir())
    assert names == [
        "amb-calibration-20260101T000000Z.json",
        "amb-calibration-20260301T000000Z.json",
        "amb-calibration.json",
    ]
    assert read(tmp_path / "sim-3" / names[0]) == first
    assert [s.seed for s in stores_of(rig, tmp_path)] == [3]


def test_two_of_the_same_date_and_a_broken_one_are_all_kept(tmp_path: Path, rig: RigFile) -> None:
    store = Store.of(rig, 3, tmp_path)
    for run in ("run-a", "run-b", "run-c"):
        store.adopt(made(run_id=run))
    assert len(list((tmp_path / "sim-3").iterdir())) == 3
    store.path("amb-calibration").write_text("half a file")
    store.adopt(made(run_id="run-d"))
    assert "half a file" in [p.read_text() for p in (tmp_path / "sim-3").iterdir()]


def test_a_folder_that_cannot_be_written_adopts_nothing(tmp_path: Path, rig: RigFile) -> None:
    (tmp_path / "sim-3").write_text("in the way")
    with pytest.raises(ConfigError, match="nothing was adopted"):
        Store.of(rig, 3, tmp_path).adopt(made())


def test_whose_a_calibration_is(rig: RigFile) -> None:
    store = Store.of(rig, 3)
    assert store.folder == Path(rig.path).parent / "tsbs12.calibrations" / "sim-3"
    assert store.foreign(made()) == ""
    assert store.foreign(made(seed=4)) == "of virtual rig 4; this is virtual rig 3"
    assert "serial no. X" in store.foreign(made(uut="X"))
    assert store.foreign(made(rig="other")) == "of rig other"
    assert store.foreign(made(seed=None, backend="live")) == "of the real rig; this is virtual rig 3"


def test_a_rig_with_other_certificates_does_not_take_a_calibration(rig: RigFile) -> None:
    store = Store.of(rig, 3)
    then = certificates_of(rig, ["geometry/amb_span"])
    refuse_other_rig(made(certificates=then), rig, store)
    older = {k: dataclasses.replace(c, u=2 * c.u) for k, c in then.items()}
    with pytest.raises(ConfigError, match="nothing was adopted"):
        refuse_other_rig(made(certificates=older), rig, store)
    with pytest.raises(ConfigError, match="virtual rig 4"):
        refuse_other_rig(made(seed=4), rig, store)


def test_an_optional_need_is_not_missed_but_must_fit(rig: RigFile, tmp_path: Path) -> None:
    store, now = Store.of(rig, 3, tmp_path), datetime(2026, 6, 1, tzinfo=UTC)
    lookup = Lookup(store, rig, now, lambda need: f"bench run {need.procedure}")
    need = Need("amb-calibration", optional=True)
    assert lookup.found("unbalance", [need]) == ()
    with pytest.raises(ConfigError, match="found none for virtual rig 3"):
        lookup.found("unbalance", [Need("amb-calibration")])
    store.adopt(made(due="2026-12-31"))
    assert [c.procedure for c in lookup.found("unbalance", [need])] == ["amb-calibration"]
    late = dataclasses.replace(lookup, now=datetime(2027, 6, 1, tzinfo=UTC))
    with pytest.raises(ConfigError, match="expired on 2026-12-31"):
        late.found("unbalance", [need])


def test_a_calibration_that_lacks_a_value_is_refused_before_the_run(rig: RigFile, tmp_path: Path) -> None:
    store, now = Store.of(rig, 3, tmp_path), datetime(2026, 6, 1, tzinfo=UTC)
    lookup = Lookup(store, rig, now, lambda need: f"bench run {need.procedure}")
    store.adopt(made(due="2026-12-31"))
    held = sorted(made().values)
    assert len(lookup.found("lift-off", [Need("amb-calibration", facts=tuple(held))])) == 1
    with pytest.raises(
        ConfigError, match=f"does not hold alpha_z; it has {', '.join(held)}\n    next: bench run amb-cal"
    ):
        lookup.found("lift-off", [Need("amb-calibration", facts=(*held, "alpha_z"))])


def test_those_of_an_installed_rig_do_not_lie_in_the_package(
    tmp_path: Path, rig: RigFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which may be read-only, and goes with the next version."""
    monkeypatch.setattr(catalogue, "PACKAGED", tmp_path / "bench/data")
    paths = (tmp_path / part / "tsbs12.toml" for part in ("bench/data/rigs", "rigs"))
    inside, own = (rig.model_copy(update={"path": str(path)}) for path in paths)
    assert base_of(inside) == Path("rigs/tsbs12.calibrations")
    assert base_of(inside, tmp_path) == tmp_path
    assert base_of(own) == tmp_path / "rigs/tsbs12.calibrations"
