"""What is not adopted, and not used: records that contradict their recordings, files that were changed, dates to come."""

from __future__ import annotations

import json
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from chained import FILE, RIG, Bench, adopted, chained, edit, opened, run

from bench.calibration.file import digest_of, from_json
from bench.calibration.store import Store
from bench.errors import ConfigError
from bench.rigfile import load_rig
from bench.run.adoption import Adoption
from tests.tiny_procedures import procedure

ROOT = Path(__file__).resolve().parents[2]
SPEC = """schema = 1
[limits.tiny-levitated]
supply = { high = 1.0, unit = "V", source = "a test", verified = false }
"""


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Bench:
    return opened(tmp_path, monkeypatch, capsys)


def rewrite(directory: str, **changes: Any) -> None:
    """Change the record of a run."""
    path = Path(directory) / "record.json"
    path.write_text(json.dumps(json.loads(path.read_text(encoding="utf-8")) | changes), encoding="utf-8")


def refused(bench: Bench, directory: str, *extra: str) -> str:
    status, out, err = bench("adopt", directory, *extra)
    assert (status, out) == (2, "")
    assert not FILE.exists()
    return err


def failed(bench: Bench) -> str:
    """A run that fails its limit."""
    Path("limits.toml").write_text(SPEC, encoding="utf-8")
    status, out, _ = bench("run", "tiny-levitated", "--rig", "tsbs12", "--no-report", "--spec", "limits.toml")
    assert status == 1
    return out.splitlines()[-1]


def test_a_record_that_says_pass_where_the_recording_fails(bench: Bench) -> None:
    directory = failed(bench)
    assert "found outcome FAIL" in refused(bench, directory)
    rewrite(directory, outcome="PASS")
    for extra in ((), ("--anyway",)):
        said = refused(bench, directory, *extra)
        assert "the record contradicts its recording; nothing was adopted" in said
        assert said.splitlines()[1] == (
            "  record.json: outcome: found PASS; expected FAIL, which the recording gives (supply fail)"
        )
        assert len(said.splitlines()) == 2


def test_what_failed_is_adopted_anyway_as_what_failed(bench: Bench) -> None:
    directory = failed(bench)
    assert bench("adopt", directory, "--anyway")[0] == 0
    assert json.loads(FILE.read_text(encoding="utf-8"))["outcome"] == "FAIL"


@pytest.mark.parametrize("key", ["started", "ended"])
def test_a_record_with_another_date(bench: Bench, key: str) -> None:
    directory = run(bench)
    then = json.loads((Path(directory) / "record.json").read_text(encoding="utf-8"))[key]
    rewrite(directory, **{key: "2028" + then[4:]})
    said = refused(bench, directory)
    assert f"record.json: {key}: found 2028{then[4:]}; expected {then}, which the recording has" in said


def test_a_record_with_another_name_or_seed(bench: Bench) -> None:
    directory = run(bench)
    rewrite(directory, run_id="tiny-levitated-20261122T120000Z-abcd", seed=7)
    said = refused(bench, directory)
    assert "run_id: found tiny-levitated-20261122T120000Z-abcd; expected" in said
    assert "seed: found 7; expected 0" in said


def test_a_record_of_another_visit_and_an_old_one_without(bench: Bench) -> None:
    directory = run(bench, "--visit", "2")
    rewrite(directory, visit=3)
    assert "visit: found 3; expected 2, which the recording has" in refused(bench, directory)
    directory = run(bench)
    path = Path(directory) / "record.json"
    record = json.loads(path.read_text(encoding="utf-8"))
    assert record.pop("visit") == 0
    path.write_text(json.dumps(record), encoding="utf-8")
    assert bench("adopt", directory)[0] == 0


def test_a_record_that_judged_nothing_does_not_say_pass(bench: Bench) -> None:
    directory = run(bench)
    rewrite(directory, outcome="PASS")
    assert "outcome: found PASS; expected DONE" in refused(bench, directory)


def test_an_old_record_said_pass_of_what_was_not_judged(bench: Bench) -> None:
    """Schema 1 knew no DONE."""
    directory = run(bench)
    rewrite(directory, outcome="PASS", schema=1)
    assert bench("adopt", directory)[0] == 0
    assert json.loads(FILE.read_text(encoding="utf-8"))["outcome"] == "DONE"


def test_what_the_record_alone_knows_counts(bench: Bench) -> None:
    """A signal while the report was built: the recording does not have it."""
    directory = run(bench)
    rewrite(directory, outcome="ABORTED")
    assert "found outcome ABORTED; expected PASS or DONE" in refused(bench, directory)
    assert bench("adopt", directory, "--anyway")[0] == 0
    assert json.loads(FILE.read_text(encoding="utf-8"))["outcome"] == "ABORTED"


def test_a_run_of_a_clock_that_was_ahead(bench: Bench) -> None:
    directory = Path(run(bench))
    began = datetime.fromisoformat(json.loads((directory / "record.json").read_text(encoding="utf-8"))["started"])
    adoption = Adoption.open(directory)
    with pytest.raises(ConfigError, match="expected a date that is past"):
        adoption.calibration(procedure, anyway=True, now=began - timedelta(seconds=61))
    assert adoption.calibration(procedure, now=began - timedelta(seconds=59)).date == began.isoformat()


def test_a_calibration_of_the_future_is_not_used(bench: Bench) -> None:
    adopted(bench)
    soon = (datetime.now(UTC) + timedelta(days=2)).isoformat(timespec="seconds")
    edit(FILE, date=soon)
    assert f"dated {soon}, which is in the future" in chained(bench, "--allow-expired")
    _, out, _ = bench("calibrations", "tsbs12")
    assert "in the future" in out
    status, _, err = bench("check", str(RIG))
    assert status == 2
    assert f"sim-0/tiny-levitated.json: date: found {soon}; expected one that is past" in err


def scaled(factor: float) -> dict[str, Any]:
    values = json.loads(FILE.read_text(encoding="utf-8"))["values"]
    values["supply"]["value"] *= factor
    return {"values": values}


def test_a_calibration_that_was_edited_is_not_used(bench: Bench) -> None:
    adopted(bench)
    edit(FILE, sealed=False, **scaled(1.02))
    said = chained(bench)
    assert "was changed since it was adopted" in said
    assert "digest: found content with sha256" in said
    assert "then `bench adopt RUN`" in said
    status, out, _ = bench("calibrations", "tsbs12")
    assert status == 2
    assert "unreadable" in out
    status, _, err = bench("check", str(RIG))
    assert status == 2
    assert "rigs/tsbs12.calibrations/sim-0/tiny-levitated.json: digest: found content with sha256" in err


def test_a_file_that_is_set_otherwise_is_the_same(bench: Bench) -> None:
    """Sorted keys, whole numbers without a point, as other programs write JSON: the content is what it was."""
    adopted(bench)
    content = json.loads(
        FILE.read_text(encoding="utf-8"), parse_float=lambda t: int(float(t)) if float(t).is_integer() else float(t)
    )
    FILE.write_text(json.dumps(content, sort_keys=True), encoding="utf-8")
    record = json.loads((Path(chained(bench, status=0)) / "record.json").read_text(encoding="utf-8"))
    assert record["findings"] == []
    assert str(FILE) not in bench("check", str(RIG))[2]


def test_a_calibration_by_hand_carries_no_digest_and_the_run_says_so(bench: Bench) -> None:
    adopted(bench)
    content = json.loads(FILE.read_text(encoding="utf-8")) | scaled(1.02)
    del content["digest"]
    FILE.write_text(json.dumps(content), encoding="utf-8")
    assert str(FILE) not in bench("check", str(RIG))[2]
    _, out, _ = bench("calibrations", "tsbs12")
    assert f"carries no digest; its content has {digest_of(content)}" in out
    directory = Path(chained(bench, status=0))
    (note,) = json.loads((directory / "record.json").read_text(encoding="utf-8"))["findings"]
    assert (note["code"], note["effect"]) == ("calibration-without-digest", "note")
    assert bench("report", str(directory))[0] == 0
    assert "carries no digest" in (directory / "report.html").read_text(encoding="utf-8")
    edit(FILE)  # with the digest that `bench calibrations` told
    record = json.loads((Path(chained(bench, status=0)) / "record.json").read_text(encoding="utf-8"))
    assert record["findings"] == []


def test_the_certificate_of_the_guide_is_a_calibration() -> None:
    page = (ROOT / "docs" / "how-to" / "adopt-a-calibration.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    c = from_json(text)
    assert not c.sealed
    assert Store.of(load_rig("tsbs12"), None).foreign(c) == ""
    assert c.values["alpha_d"].u == pytest.approx(0.05)
