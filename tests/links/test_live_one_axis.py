"""The one-axis AMB over CAN: its estimators, a served rig and a bench as processes of their own, captures over the link."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import processes
import pytest

RIG = "amb1dof"
PORTS = ("--link", "controller=slcan:socket://127.0.0.1:0", "--link", "operator=line:127.0.0.1:0")
COMPARE = ("repeats=3", "calm_s=1.0", 'loaded=["overlapping", "observer"]')
DERIVE = ("lines_hz=[16.3, 53.3]", "record_s=1.5", "settle_s=1.0")


def ran(folder: Path, procedure: str, plan: tuple[str, ...]) -> tuple[int, dict[str, Any], list[str]]:
    """Exit status, record and the controller's states."""
    with processes.served(folder, "--seed", "1", rig=RIG, ports=PORTS) as rig:
        given = ("run", procedure, "--rig", RIG, "--backend", "live", "--operator", "auto", "--no-report")
        settings = [x for value in plan for x in ("--plan", value)]
        with processes.real_bench(folder, *given, *rig.links("slcan:socket"), *settings) as child:
            status = child.end(240.0)
            return status, processes.record_in(folder, child), rig.state_lines()


def serious(record: dict[str, Any]) -> list[str]:
    """Codes above a note, but for those about the computer."""
    return [f["code"] for f in record["findings"] if f["effect"] != "note" and f["code"] not in processes.EXPECTED]


@pytest.mark.long
@pytest.mark.timeout(300)
def test_estimators_are_compared_on_a_served_rig(tmp_path: Path) -> None:
    status, record, states = ran(tmp_path, "estimator-compare", COMPARE)
    assert (status, record["outcome"], serious(record)) == (0, "DONE", []), record["findings"]
    assert record["link"]["gaps"] == 0
    found = {(m["name"], m["where"]): m["value"] for m in record["measurements"]}
    assert found["velocity_error_ratio", "single / overlapping"] > 2.5
    assert found["disturbance_error_ratio", "single / overlapping"] > 2.5
    assert 1.65 < found["integral_ratio", "observer / overlapping"] < 1.85
    assert 1.5 < found["peak_ratio", "observer / overlapping"] < 2.0
    assert states[-1].endswith("-> OFF")


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_derivative_is_its_weights_on_a_served_rig(tmp_path: Path) -> None:
    status, record, _ = ran(tmp_path, "derivative", DERIVE)
    assert (status, record["outcome"], serious(record)) == (0, "DONE", []), record["findings"]
    assert "is-this-estimator" in {f["code"] for f in record["findings"]}
    found = {(m["name"], m["where"]): m["value"] for m in record["measurements"]}
    assert found["gain", "53.3 Hz"] == pytest.approx(1.007, abs=0.002)
    assert found["false_derivative", ""] == pytest.approx(14.37, abs=0.2)
