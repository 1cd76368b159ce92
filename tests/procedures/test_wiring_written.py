"""What the check of the motor's wiring says that it writes is what it writes: the simulator's truth turns the rotor by it."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.cli.virtual import simulated_run
from bench.rigfile import load_rig
from procedures.servomotor import hold, wiring
from procedures.servomotor.parameters import parameter
from procedures.servomotor.wiring import written

QUICK = {
    "repeats": 2,
    "steps_rad": (0.05,),
    "allocations": ("priority",),
    "settle_s": 0.5,
    "standstill_s": 0.3,
    "record_s": 0.7,
}


def test_the_wiring_check_writes_what_it_says(tmp_path: Path) -> None:
    run = simulated_run("angle-step", "tsbs12", 3, QUICK, tmp_path / "r.mcap")
    rig = load_rig("tsbs12")
    told = run.recording.events("parameter")
    begin = next(k for k, e in enumerate(told) if e["value"] == hold.PROBE_GAIN) - 1  # the reference goes first
    end = next(k for k, e in enumerate(told) if e["name"] == parameter(rig, "motor.share"))
    events, at = told[begin:end], {str(e["name"]): float(e["value"]) for e in told[:begin]}
    turn = next(e["value"] for e in events if e["name"] == parameter(rig, "angle.ref"))
    stood = turn - wiring.TURN_RAD  # where the rotor was
    phases: list[tuple[dict[str, float], float]] = []
    for k, e in enumerate(events):
        at[str(e["name"])] = float(e["value"])
        later = told[begin + k + 1]["t_ns"] if begin + k + 1 < len(told) else e["t_ns"]
        if later - e["t_ns"] > 50e6:  # what is written together stands together
            phases.append((dict(at), 1e-9 * (later - e["t_ns"])))
    expected = written(rig)
    assert len(phases) == len(expected)
    for (found, seconds), (values, stands) in zip(phases, expected, strict=True):
        moved = (
            {parameter(rig, "angle.ref"): stood} if values.get(parameter(rig, "angle.ref")) == wiring.TURN_RAD else {}
        )
        assert {k: found[k] for k in values} == pytest.approx({k: v + moved.get(k, 0.0) for k, v in values.items()})
        assert seconds == pytest.approx(stands, abs=0.06)
