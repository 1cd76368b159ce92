"""Every procedure on every link, with server and bench as processes of their own, against the same rig in one process.

The bound: both runs see the same machine, so all that is certified or stated by the rig file is common to them. What
differs is noise, the seats of the straps at other instants of the drift, and the host's timing; the budgets call it
Type A. Two results may differ by four times the combined Type A uncertainty of the two, and by nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import processes
import pytest

from bench import catalogue

SEED = "3"
SHORT: Mapping[str, tuple[str, ...]] = {"amb-calibration": ("settle_s=0.5", "average_s=0.3")}
LINKS = ("slcan:socket", "slcan:pty", "serial:socket", "serial:pty")
SIGMAS = 4.0


def plan(procedure: str) -> tuple[str, ...]:
    return tuple(x for setting in SHORT[procedure] for x in ("--plan", setting))


@pytest.fixture(scope="module")
def in_one_process(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, dict[str, Any]]:
    """The records of the procedures on the simulated backend, by name."""
    found = {}
    folder = tmp_path_factory.mktemp("simulated")
    for entry in catalogue.PROCEDURES:
        arguments = ("run", entry.name, "--rig", "tsbs12", "--seed", SEED, "--no-report", *plan(entry.name))
        with processes.real_bench(folder, *arguments) as child:
            assert child.end() == 0, child.err[-8:]
            found[entry.name] = processes.record_in(folder, child)
    return found


def type_a(measurement: Mapping[str, Any]) -> float:
    return math.sqrt(sum(i["contribution"] ** 2 for i in measurement["budget"] if i["type"] == "A"))


@pytest.mark.long
@pytest.mark.timeout(900)
@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("procedure", [e.name for e in catalogue.PROCEDURES])
def test_equal_results(procedure: str, link: str, tmp_path: Path, in_one_process: Mapping[str, dict[str, Any]]) -> None:
    with processes.served(tmp_path, "--seed", SEED) as rig:
        arguments = processes.live(rig, link, procedure, "--no-report", *plan(procedure))
        with processes.real_bench(tmp_path, *arguments) as child:
            assert child.end(800) == 0, child.err[-12:]
            record = processes.record_in(tmp_path, child)
    assert [f for f in record["findings"] if f["code"] not in processes.EXPECTED] == []
    assert record["link"]["errors"] == record["link"]["counts"]["lost"] == 0
    shown = 0
    for ours, theirs in zip(record["measurements"], in_one_process[procedure]["measurements"], strict=True):
        bound = SIGMAS * math.hypot(type_a(ours), type_a(theirs))
        assert abs(ours["value"] - theirs["value"]) <= bound, ours["name"]
        shown += bound < theirs["expanded_uncertainty"] / 2
    assert shown >= 2  # for at least two constants the bound is far narrower than their own uncertainty
