"""record.json: round trip, schema, refusals, atomic replacement, outcomes."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from bench.cli.run import summary
from bench.errors import ConfigError
from bench.findings import Effect, Finding
from bench.link.counts import LinkCounts
from bench.procedure import Measured, Quantity
from bench.record.limits import Limit, Verdict
from bench.record.outcomes import Outcome, outcome_of, outranking, unjudged
from bench.record.records import (
    SCHEMA_FILE,
    Record,
    RecordingFile,
    correlations_of,
    findings_of,
    from_json,
    json_schema,
    measurement,
    missing,
    read_record,
    to_json,
    unfinished,
    write_record,
)
from bench.uncertainty import Estimate, Influence

K_I = Quantity("K_i", "N/A", "")
K_O = Quantity("K_o", "N/A", "")
GRAVITY = Estimate.of(0.0, Influence("site/gravity", "gravity", 0.05, "m/s^2", "B", "normal"))
SCATTER = Estimate.of(0.0, Influence("scatter/1", "scatter", 0.1, "N/A", "A", "normal", 20.0))


def measured(value: float = 73.0, quantity: Quantity = K_I) -> Measured:
    return quantity.measured(value + 2 * GRAVITY + SCATTER)


def limit(low: float = 70.0, high: float = 80.0, unit: str = "N/A") -> Limit:
    return Limit(low, high, unit, "design", True)


def start() -> Record:
    return unfinished(
        run_id="amb-calibration-20260101T000000Z-3f2a", procedure="amb-calibration", rig="tsbs12",
        uut={"name": "TSBS", "serial": "001"}, started="2026-01-01T00:00:00Z", seed=1,
        plan={"angles": 8, "masses": ["M1"]}, versions={"levbench": "0.1.0"},
    )  # fmt: skip


def full() -> Record:
    made = (measurement(measured(), limit(), 1), measurement(measured(quantity=K_O), None), missing(K_O, limit()))
    return dataclasses.replace(
        start(), outcome=Outcome.ERROR, ended="2026-01-01T00:10:00Z", measurements=made,
        recording=RecordingFile("recording.mcap", "a3" * 32), link=LinkCounts(9, 1, 0),
        findings=findings_of([Finding("drift", "0.1 mA — µ", "inboard", Effect.INDETERMINATE, ("K_i",))]),
        correlations=correlations_of([measured(), measured(quantity=K_O)]),
    )  # fmt: skip


@pytest.mark.parametrize("record", [start(), full()], ids=["unfinished", "full"])
def test_round_trip_and_schema(record: Record, tmp_path: Path) -> None:
    path = tmp_path / "record.json"
    write_record(path, record)
    assert read_record(path) == record
    schema = json.loads(SCHEMA_FILE.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(json.loads(path.read_text()), schema)


def test_the_shipped_schema_is_the_one_of_the_code() -> None:
    assert json.loads(SCHEMA_FILE.read_text()) == json_schema()


def test_who_says_no_visit() -> None:
    """Records of virtual rigs of before there were visits are of visit 0; a real rig has none."""
    content = json.loads(to_json(start()))
    assert list(content)[8:10] == ["seed", "visit"]
    for seed, visit in ((1, 0), (None, None)):
        old = {key: value for key, value in content.items() if key != "visit"} | {"seed": seed}
        jsonschema.validate(old, json.loads(SCHEMA_FILE.read_text()))
        assert from_json(json.dumps(old)).visit == visit
    assert from_json(json.dumps(content | {"visit": 3})).visit == 3


def test_unfinished() -> None:
    record = start()
    assert record.outcome == Outcome.ERROR
    assert [f.code for f in record.findings] == ["unfinished"]
    assert record.ended is None


def test_measurement_golden() -> None:
    m = measurement(measured(), limit())
    assert m.verdict == Verdict.PASS
    assert m.standard_uncertainty == pytest.approx(0.02**0.5)
    assert m.dof == 80  # half of the variance with 20 degrees of freedom
    assert m.coverage_factor == pytest.approx(1.990, abs=5e-4)
    assert m.interval == pytest.approx((73 - 1.990 * 0.02**0.5, 73 + 1.990 * 0.02**0.5), abs=1e-3)
    assert {b.influence: (b.sensitivity, b.dof) for b in m.budget} == {
        "site/gravity": (2.0, None),
        "scatter/1": (1.0, 20.0),
    }
    assert m.method == "gum"


def test_with_two_degrees_of_freedom_the_interval_is_stated_alone(tmp_path: Path) -> None:
    """In the record, on the terminal, and back from the file."""
    few = Estimate.of(73.0, Influence("scatter/few", "scatter", 0.1, "N/A", "A", "normal", 2.0))
    m = measurement(K_I.measured(few), limit())
    assert (m.standard_uncertainty, m.coverage_factor, m.dof) == (None, None, 2.0)
    assert m.interval == pytest.approx((73 - 0.43027, 73 + 0.43027), abs=1e-4)
    assert m.verdict is Verdict.PASS
    record = dataclasses.replace(full(), measurements=(m,))
    assert from_json(to_json(record)) == record
    assert "73.00 ± 0.43" in summary(record, tmp_path)


def test_correlations_come_from_shared_influences() -> None:
    found = correlations_of([measured(), K_O.measured(2 * GRAVITY)])
    assert found.names == ("K_i", "K_o")
    assert found.matrix[0][1] == pytest.approx(0.5**0.5)


def test_what_is_not_a_number_is_missing_and_never_passes() -> None:
    m = measurement(K_I.measured(Estimate.exact(math.nan)), limit())
    assert (m.verdict, m.value, m.interval) == (Verdict.MISSING, None, None)
    assert outcome_of([m], []) == Outcome.ERROR


def test_a_limit_in_another_unit_is_refused() -> None:
    with pytest.raises(ConfigError, match="unit"):
        measurement(measured(), limit(unit="N/m"))


def test_no_nan_is_ever_written(tmp_path: Path) -> None:
    path = tmp_path / "record.json"
    write_record(path, start())
    with pytest.raises(ValueError, match="JSON"):
        write_record(path, dataclasses.replace(start(), plan={"x": math.inf}))
    assert read_record(path) == start()
    assert [p.name for p in tmp_path.iterdir()] == ["record.json"]


def change(*keys: str | int, to: Any) -> str:
    content = json.loads(to_json(full()))
    place = content
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = to
    return json.dumps(content)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not a record"),
        ("[1]", "no schema"),
        ("{}", "no schema"),
        ('{"schema": 1}', "run_id"),
        (change("schema", to=4), "newer"),
        (change("schema", to=0), "schema: found 0"),
        (change("schema", to=True), "no schema"),
        (change("extra", to=1), "extra"),
        (change("findings", 0, "extra", to=1), "extra"),
        (change("measurements", 0, "budget", 0, "extra", to=1), "extra"),
        (change("outcome", to="GREAT"), "outcome"),
        (change("measurements", 0, "value", to="1"), "value"),
        (change("measurements", 0, "value", to=math.nan), "NaN"),
        (change("plan", "x", to=math.inf), "NaN"),
        (change("plan", "x", to=12345).replace("12345", "1e999"), "NaN"),
    ],
)
def test_refused(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        from_json(text)


def test_unreadable(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        read_record(tmp_path / "none.json")


def of_verdict(verdict: str) -> Any:
    return dataclasses.replace(missing(K_I), verdict=Verdict(verdict))


@pytest.mark.parametrize(
    ("verdicts", "effects", "stopped", "outcome"),
    [
        (["pass", "none"], ["note"], None, "PASS"),
        (["none"], ["note"], None, "DONE"),
        ([], [], None, "DONE"),
        (["none"], ["indeterminate"], None, "INDETERMINATE"),
        (["pass", "indeterminate"], [], None, "INDETERMINATE"),
        (["pass"], ["indeterminate"], None, "INDETERMINATE"),
        (["fail", "indeterminate"], [], None, "FAIL"),
        (["fail"], ["note"], None, "FAIL"),
        (["fail"], ["indeterminate"], None, "INDETERMINATE"),
        (["fail", "missing"], [], None, "ERROR"),
        (["fail"], ["error"], None, "ERROR"),
        (["pass"], [], Outcome.ERROR, "ERROR"),
        (["missing"], ["error"], Outcome.ABORTED, "ABORTED"),
    ],
)
def test_the_strongest_wins(verdicts: list[str], effects: list[str], stopped: Outcome | None, outcome: str) -> None:
    findings = [Finding("c", "t", "", Effect(e)) for e in effects]
    assert outcome_of(map(of_verdict, verdicts), findings, stopped) == outcome


@pytest.mark.parametrize(
    ("concerns", "outcome", "outranked"),
    [
        ((), "INDETERMINATE", ["c"]),
        (("K_i",), "INDETERMINATE", ["c"]),
        (("K_i@inboard",), "INDETERMINATE", ["c"]),
        (("@inboard",), "INDETERMINATE", ["c"]),
        (("K_o", "K_i@outboard", "@outboard"), "FAIL", []),
    ],
)
def test_a_finding_outranks_the_fail_of_the_quantities_that_it_concerns(
    concerns: tuple[str, ...], outcome: str, outranked: list[str]
) -> None:
    """A quantity that no finding touches fails the run all the same."""
    failed = dataclasses.replace(missing(K_I, where="inboard"), verdict=Verdict.FAIL)
    finding = Finding("c", "t", "", Effect.INDETERMINATE, concerns)
    assert outcome_of([failed], [finding]) == outcome
    assert list(outranking(failed, [finding])) == outranked
    other = dataclasses.replace(missing(K_O), verdict=Verdict.FAIL)
    assert outcome_of([failed, other], [dataclasses.replace(finding, concerns=("K_i",))]) == Outcome.FAIL


def test_a_verdict_that_was_asked_for_and_not_given() -> None:
    assert unjudged([of_verdict("none"), of_verdict("pass")], 1) is None
    found = unjudged([of_verdict("none")], 0)
    assert found is not None
    assert (found.code, found.effect) == ("nothing-judged", Effect.ERROR)
    assert "no limit" in found.text
    assert "none of its limits holds" in getattr(unjudged([of_verdict("none")], 2), "text", "")


def test_a_record_of_schema_1_is_read_as_it_stands(tmp_path: Path) -> None:
    """Its PASS may be one that nothing was judged for; its findings concern all quantities."""
    content = json.loads(to_json(full()))
    content |= {"schema": 1, "outcome": "PASS"}
    del content["findings"][0]["concerns"]
    path = tmp_path / "record.json"
    path.write_text(json.dumps(content))
    old = read_record(path)
    assert (old.schema, old.outcome, old.findings[0].concerns) == (1, Outcome.PASS, ())
    assert old.measurements == full().measurements
    jsonschema.validate(content, json.loads(SCHEMA_FILE.read_text()))


def test_a_failed_replacement_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "record.json").mkdir()
    with pytest.raises(OSError, match="directory"):
        write_record(tmp_path / "record.json", start())
    assert [p.name for p in tmp_path.iterdir()] == ["record.json"]
