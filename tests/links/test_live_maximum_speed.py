"""The maximum speed over CAN: the chain of the rig with the drag of T Fig. 6.8, a served rig and a bench as processes of their
own, captures over the link; each step's facts are those of the served machine."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import processes
import pytest

from bench import catalogue
from bench.campaign import file

RIG, SEED = "tsbs12-drag", "3"


def short(folder: Path) -> Path:
    """The shipped campaign with its short plans, three repeats and one spindown a way more quickly."""
    text = file.load("tsbs-drag")[1].read_text(encoding="utf-8")
    text = text.replace("plan = { motor_carries = true }\nvirtual_plan = {", "plan = { motor_carries = true,")
    text = text.replace("virtual_plan = {", "plan = {").replace("plan = { average_s", "plan = { repeats = 3, average_s")
    path = folder / "short.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_maximum_speed_is_as_expected_on_a_served_rig(tmp_path: Path) -> None:
    assert RIG in {entry.name for entry in catalogue.rigs()}
    with processes.served(tmp_path, "--seed", SEED, rig=RIG) as rig:
        given = ("campaign", str(short(tmp_path)), "--backend", "live", "--operator", "auto", "--no-report")
        with processes.real_bench(tmp_path, *given, *rig.links("slcan:socket")) as child:
            assert child.end(840.0) == 0, "\n".join(child.err[-12:])
            found = [json.loads(p.read_text()) for p in (tmp_path / child.out[-1] / "runs").glob("*/record.json")]
        states = rig.state_lines()
    record: dict[str, Any] = next(r for r in found if r["procedure"] == "maximum-speed")
    codes = {f["code"]: f["effect"] for f in record["findings"]}
    assert "speeds-as-expected" in codes
    assert {c for c, effect in codes.items() if effect != "note"} <= set(processes.EXPECTED)
    values = {m["name"]: m["value"] for m in record["measurements"] if not m["where"]}
    assert values["ratio"] == pytest.approx(values["ratio_predicted"], rel=0.01)
    for name in ("half", "op"):
        assert math.isclose(values[f"speed_{name}"], values[f"predicted_{name}"], rel_tol=0.03)
    assert states[-1].endswith("-> OFF")
