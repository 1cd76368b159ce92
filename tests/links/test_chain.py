"""The identification chain over CAN as one campaign, and its first step on every other link (`make links`), with server
and bench as processes of their own, against the same rig in one process.

The bound: both runs see the same machine, so all that is certified or stated by the rig file is common to them. What
differs is noise, the seats of the straps at other instants of the drift, and the host's timing; the budgets call it
Type A, here and in the calibrations that a step rests on. Two results may differ by four times the combined Type A
uncertainty of the two, and by nothing else.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import processes
import pytest

from bench import catalogue
from bench.campaign import file

SEED = "3"
NAME = "tsbs-identification"
LINKS = {"slcan:socket": 6, "slcan:pty": 1, "serial:socket": 1, "serial:pty": 1}
"""How many steps of the chain on each link: it takes as long as the machine takes."""
SIGMAS = 4.0
RUN_S = 1200.0
Records = Mapping[str, dict[str, Any]]


def short(folder: Path, steps: int) -> Path:
    """The first steps of the shipped campaign with the short plans of virtual rigs, as a file."""
    text = file.load(NAME)[1].read_text(encoding="utf-8").partition("[equations]")[0]
    head, *tables = text.split("[[step]]")
    lines = [line for line in "[[step]]".join([head, *tables[:steps]]).splitlines() if not line.startswith("plan =")]
    path = folder / "short.toml"
    path.write_text("\n".join(lines).replace("virtual_plan =", "plan ="))
    return path


def records(folder: Path, child: processes.Child) -> Records:
    """The records of a campaign's runs, by procedure."""
    runs = (folder / child.out[-1] / "runs").glob("*/record.json")
    found = [json.loads(path.read_text()) for path in runs]
    return {record["procedure"]: record for record in found}


def over(folder: Path, link: str, steps: int) -> Records:
    """The first steps of the chain on a served rig over one link."""
    with processes.served(folder, "--seed", SEED) as rig:
        arguments = ("campaign", str(short(folder, steps)), "--backend", "live", "--operator", "auto", "--no-report")
        with processes.real_bench(folder, *arguments, *rig.links(link)) as child:
            assert child.end(RUN_S) == 0, "\n".join(child.err[-12:])
            return records(folder, child)


@pytest.fixture(scope="module")
def in_one_process(tmp_path_factory: pytest.TempPathFactory) -> Records:
    folder = tmp_path_factory.mktemp("simulated")
    arguments = ("campaign", str(short(folder, 6)), "--seed", SEED, "--no-report")
    with processes.real_bench(folder, *arguments) as child:
        assert child.end(RUN_S) == 0, "\n".join(child.err[-8:])
        return records(folder, child)


def test_the_chain_has_what_identifies_the_machine() -> None:
    steps = [step.procedure for step in file.load(NAME)[0].step]
    assert steps[:6] == [
        "amb-calibration",
        "force-constant",
        "negative-stiffness",
        "force-coupling",
        "torque-constant",
        "spindown",
    ]
    assert set(steps) <= {entry.name for entry in catalogue.PROCEDURES}


def type_a(measurement: Mapping[str, Any]) -> float:
    return math.sqrt(sum(i["contribution"] ** 2 for i in measurement["budget"] if i["type"] == "A"))


@pytest.mark.timeout(2 * RUN_S)
@pytest.mark.parametrize(
    "link", [pytest.param(link, marks=pytest.mark.long if n > 1 else pytest.mark.links) for link, n in LINKS.items()]
)
def test_equal_results(link: str, tmp_path: Path, in_one_process: Records) -> None:
    chain = over(tmp_path, link, LINKS[link])
    assert len(chain) == LINKS[link]
    for procedure, record in chain.items():
        notes = [f for f in record["findings"] if f["code"] not in processes.EXPECTED and f["effect"] != "note"]
        assert (procedure, notes) == (procedure, [])
        assert record["link"]["errors"] == record["link"]["counts"]["lost"] == 0, procedure
        compare(link, record, in_one_process[procedure])


def compare(link: str, record: Mapping[str, Any], other: Mapping[str, Any]) -> None:
    """Measurement by measurement; at every step there is one whose bound is narrower than its own uncertainty, so that the
    comparison says more than the two intervals do."""
    shown = 0
    for ours, theirs in zip(record["measurements"], other["measurements"], strict=True):
        assert ours["name"] == theirs["name"]
        bound = SIGMAS * math.hypot(type_a(ours), type_a(theirs))
        assert abs(ours["value"] - theirs["value"]) <= bound, (
            link,
            ours["name"],
            ours["value"],
            theirs["value"],
            bound,
        )
        shown += bound < theirs["expanded_uncertainty"]
    assert shown >= 1, (link, record["procedure"])
