"""Load balancing over CAN: the chain of the rig whose motor is off centre, a served rig and a bench as processes of their own,
captures over the link; each step's facts are those of the served machine."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import processes
import pytest

from bench.campaign import file

RIG, SEED = "tsbs12-offset", "3"


def short(folder: Path) -> Path:
    """The shipped campaign with its short plans, and a turn with and without, twice."""
    text = file.load("tsbs-offset")[1].read_text(encoding="utf-8")
    text = text.replace("virtual_plan = {", "plan = {").replace(
        'ways = ["forward"]', 'ways = ["forward"], turns = 1, repeats = 2'
    )
    path = folder / "short.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.long
@pytest.mark.timeout(900)
def test_balancing_does_what_it_should_on_a_served_rig(tmp_path: Path) -> None:
    with processes.served(tmp_path, "--seed", SEED, rig=RIG) as rig:
        given = ("campaign", str(short(tmp_path)), "--backend", "live", "--operator", "auto", "--no-report")
        with processes.real_bench(tmp_path, *given, *rig.links("slcan:socket")) as child:
            assert child.end(840.0) == 0, "\n".join(child.err[-12:])
            found = [json.loads(p.read_text()) for p in (tmp_path / child.out[-1] / "runs").glob("*/record.json")]
        states = rig.state_lines()
    record: dict[str, Any] = next(r for r in found if r["procedure"] == "load-balancing")
    codes = {f["code"]: f["effect"] for f in record["findings"]}
    assert {c for c, effect in codes.items() if effect != "note"} <= set(processes.EXPECTED)
    values = {f"{m['name']}@{m['where']}": m["value"] for m in record["measurements"]}
    for source in ("from the loads", "from the facts"):
        assert values["reduction@forward"] == pytest.approx(values[f"predicted_reduction@{source}, forward"], abs=0.02)
    assert values["unbalance_ratio@forward"] < 1 / 2.5
    assert states[-1].endswith("-> OFF")
