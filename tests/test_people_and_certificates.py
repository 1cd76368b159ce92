"""Who measured for whom, and certificates that do not hold on the day of a run."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from test_rigfile import DBC, TOML, changed, of_schema_1, problems, written

from bench.cli.__main__ import main
from bench.quantity import Quantity
from bench.record.records import read_record
from bench.record.setup import certified_of
from bench.rigfile import RigFile
from bench.rigfile.certificates import out_of_date
from bench.rigfile.check_machine import problems_of
from bench.run.certificates import overdue
from bench.rundir import RunDirectory
from bench.uncertainty import Estimate, Influence
from reports import people

SPAN = 'source = "certificate SIM-L-102" }'
CERTIFIED = 'source = "certificate SIM-L-102", certificate = "span" }'
PEOPLE = """
[laboratory]
name = "Rotor laboratory"
place = "hall 3"
accreditation = "D-K-12345-01-00"
other = { project = "A 12" }

[customer]
name = "Pump works"
contact = "Ms Weber"
order = "4711"

[uut]"""


def certificate(days: str) -> str:
    """The servomotor's rig file with a certificate of these days for the span of its AMBs."""
    table = f'[certificates.span]\nnumber = "SIM-L-102"\nlaboratory = "lengths"\n{days}\n\n[hooks]\n'
    return changed(TOML, (SPAN, CERTIFIED), ("[hooks]\n", table))


def test_laboratory_and_customer_are_typed_and_printed() -> None:
    rig = RigFile.parse(changed(TOML, ("[uut]", PEOPLE)), DBC)
    assert rig.laboratory is not None
    assert rig.customer is not None
    assert (rig.laboratory.accreditation, rig.customer.order) == ("D-K-12345-01-00", "4711")
    content = {"laboratory": rig.laboratory.model_dump(), "customer": rig.customer.model_dump(exclude_none=True)}
    told = {f.label: f.text for f in people.facts(content) if not f.blank}
    assert told == {
        "Laboratory": "Rotor laboratory", "Place of the measurements": "hall 3", "Accreditation": "D-K-12345-01-00",
        "Customer and contact": "Pump works, Ms Weber", "Order": "4711", "Project": "A 12",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "key", "expected"),
    [
        ('[laboratory]\nacreditation = "none"\n', "laboratory.acreditation", "no such key"),
        ('[customer]\naddress = "Kiel"\n', "customer.name", "a value"),
        ('[laboratory]\nname = " "\n', "laboratory.name", "match pattern"),
        ('[laboratory]\ncustomer = "A"\n[customer]\nname = "B"\n', "laboratory.customer", "[customer] alone"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, key: str, expected: str) -> None:
    found = problems(tmp_path, changed(TOML, ("[uut]", f"{text}\n[uut]")))
    assert expected in found[key].expected


def test_a_file_of_schema_1_has_any_keys() -> None:
    free = '[laboratory]\nname = "Bearings"\naccreditation = "none"\nroom = "B 2"\n\n[uut]'
    rig = RigFile.parse(changed(of_schema_1(TOML), ("[uut]", free)), DBC)
    assert rig.laboratory is not None
    assert rig.laboratory.other == {"room": "B 2"}


@pytest.mark.parametrize(
    ("days", "day", "said"),
    [
        ('date = "2025-01-10"\ndue = "2026-01-10"', "2026-01-11", ["was due on 2026-01-10"]),
        ('date = "2025-01-10"\ndue = "2026-01-10"', "2026-01-10", []),
        ('date = "2025-01-10"\ndue = "2026-01-10"', "2025-01-09", ["is dated 2025-01-10, which is in the future"]),
        ('date = "2025-01-10"', "2099-01-01", []),
        ("", "2099-01-01", []),
    ],
)  # fmt: skip
def test_a_certificate_holds_from_its_date_through_the_day_it_is_due(days: str, day: str, said: list[str]) -> None:
    rig = RigFile.parse(certificate(days), DBC)
    found = list(out_of_date(rig, date.fromisoformat(day)))
    assert [str(f) for f in found] == [f"certificate span (SIM-L-102, lengths) {text}" for text in said]
    assert all(f.numbers == ("geometry/amb_span",) for f in found)
    assert not list(out_of_date(rig, date.fromisoformat(day), ["geometry/amb_gap"]))


def test_bench_check_tells_it_and_the_file_can_be_used(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(("check", written(tmp_path, certificate('due = "2026-01-10"')))) == 0
    assert "certificate span (SIM-L-102, lengths) was due on 2026-01-10\n" in capsys.readouterr().out


@pytest.mark.long
def test_a_run_whose_results_rest_on_it_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """K_i rests on the span; the outcome is as without."""
    rig = written(tmp_path, certificate('due = "2026-01-10"'))
    short = ("--plan", "settle_s=0.5", "--plan", "average_s=0.2", "--no-report")
    assert main(("run", "amb-calibration", "--rig", rig, "--out", str(tmp_path / "runs"), *short)) == 0
    run = RunDirectory(Path(capsys.readouterr().out.splitlines()[-1]))
    (told,) = (f for f in read_record(run.record).findings if f.code.startswith("certificate-"))
    assert (told.code, told.where, told.effect) == ("certificate-overdue", "certificates.span", "note")
    assert told.text.endswith("the results rest on it: geometry/amb_span")


@dataclass(frozen=True)
class Closed:
    """What is asked of a recording here."""

    rig: RigFile
    wall: dict[str, str]


@pytest.mark.parametrize(("started", "codes"), [
    ("2026-01-11T08:00:00+00:00", ["certificate-overdue"]), ("2025-01-09T08:00:00+00:00", ["certificate-ahead"]),
    ("2026-01-10T23:00:00+00:00", []), ("", []),
])  # fmt: skip
def test_it_is_told_by_the_day_of_the_run_and_of_what_the_results_rest_on(started: str, codes: list[str]) -> None:
    rig = RigFile.parse(certificate('date = "2025-01-10"\ndue = "2026-01-10"'), DBC)
    recording: Any = Closed(rig, {"started": started} if started else {})
    span = Influence("geometry/amb_span", "span", 1e-5, "m", "B", "normal")
    gap = Influence("geometry/amb_gap", "gap", 1e-5, "m", "B", "normal")
    length = Quantity("length", "m", "a length")
    assert [f.code for f in overdue(recording, [length.measured(Estimate(1.0, sensitivities={span: 1.0}))])] == codes
    assert not [*overdue(recording, [length.measured(Estimate(1.0, sensitivities={gap: 1.0}))])]


def test_an_instrument_beside_the_machine_goes_by_a_certificate_too() -> None:
    """A load cell's gain: it stands in the record of what results rest on, its due day is told, a wrong key refused."""
    toml, dbc = (Path(f"rigs/rlsrm.{ending}").read_text(encoding="utf-8") for ending in ("toml", "dbc"))
    cell = 'source = "certificate SIM-F-196, 20 N" }'
    goes_by = cell.replace(" }", ', certificate = "force" }')
    table = '[certificates.force]\nnumber = "SIM-F-196"\ndate = "2024-01-01"\ndue = "2025-01-01"\n\n[capabilities.load_cells.x]'
    rig = RigFile.parse(changed(toml, (cell, goes_by), ("[capabilities.load_cells.x]", table)), dbc)
    gain = "capabilities/load_cells/x/gain"
    found = certified_of(rig, [gain, "scatter/loads/1"])
    assert {i: (c.standard_uncertainty, c.certificate) for i, c in found.items()} == {
        gain: (1e-3, "SIM-F-196, 2024-01-01")
    }
    assert [o.numbers for o in out_of_date(rig, date(2026, 1, 1), [gain])] == [(gain,)]
    key, *_ = (p.key for p in problems_of(RigFile.parse(changed(toml, (cell, goes_by)), dbc)))
    assert key == "capabilities.load_cells.x.gain.certificate"
