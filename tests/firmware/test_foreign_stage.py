"""A positioned stage that is not ours, over a DBC and an adapter of its own: at first contact, as processes, in real time. What
the bench tells of it is held against what its controller does by itself (`controller.py` beside its rig file)."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from line_programs import run_bench

from bench.cli.abilities import abilities
from bench.errors import ConfigError
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig
from sim_backend.truth import draw

STAGE = Path(__file__).resolve().parents[2] / "examples" / "linear-stage"
RIG = STAGE / "chariot.toml"
SPEC = importlib.util.spec_from_file_location("stage_controller", STAGE / "controller.py")
assert SPEC is not None
assert SPEC.loader is not None
stage_controller = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(stage_controller)


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[str]:
    """The rig file with the addresses of a controller that runs."""
    program = subprocess.Popen(
        [sys.executable, str(STAGE / "controller.py"), "0", "0"], stdout=subprocess.PIPE, text=True
    )
    try:
        assert program.stdout is not None
        bus, table = program.stdout.readline().split()
        text = RIG.read_text(encoding="utf-8").replace("slcan:/dev/ttyACM0", f"slcan:socket://127.0.0.1:{bus}")
        (tmp_path / RIG.name).write_text(text.replace("127.0.0.1:28664", f"127.0.0.1:{table}"), encoding="utf-8")
        (tmp_path / "chariot.dbc").write_bytes(RIG.with_suffix(".dbc").read_bytes())
        yield str(tmp_path / RIG.name)
    finally:
        program.kill()
        program.communicate()


def run(
    rig: str, folder: Path, procedure: str, *plan: str
) -> tuple[dict[tuple[str, str], tuple[float, float]], list[str]]:
    """Values with U by quantity and place, and codes of findings above a note."""
    words = [word for setting in plan for word in ("--plan", setting)]
    done = run_bench(
        folder, "run", procedure, "--rig", rig, "--backend", "live", "--out", "runs", "--no-report", *words, real=True
    )
    record = json.loads((folder / done.stdout.split()[-1] / "record.json").read_text(encoding="utf-8"))
    assert record["link"]["gaps"] == 0, done.stderr
    values = {(m["name"], m["where"]): (m["value"], m["expanded_uncertainty"]) for m in record["measurements"]}
    return values, [f["code"] for f in record["findings"] if f["effect"] != "note"]


def stepped(start: float, end: float) -> tuple[float, float]:
    """Overshoot, as a share, and settling time to 2 %, s, of the controller by itself, there for the second time."""
    axe, seen = stage_controller.Axe(), list[float]()
    axe.x = axe.wanted = axe.target = start
    axe.mode = stage_controller.TENU
    for place in (end, start, end):
        axe.send(place)
        seen.clear()
        for _ in range(round(1.5 / stage_controller.TICK_S)):
            axe.step()
            seen.append((axe.x - start) / (end - start))
    late = max(k for k, share in enumerate(seen) if abs(share - 1) > 0.02)
    return max(seen) - 1, late * stage_controller.TICK_S


def test_what_it_can_is_told_and_nothing_else_is_missing() -> None:
    """One axis without phases, loads and waves: two procedures; no twin is made of what does not float."""
    assert check_rig(str(RIG))[0] == ()
    rig = load_rig(str(RIG))
    assert [a.procedure for a in abilities(rig) if a.able] == ["positioning", "step-following"]
    with pytest.raises(ConfigError, match="a twin's rotor floats, and a stage has none"):
        draw(rig, 1)


@pytest.mark.long
@pytest.mark.timeout(200)
def test_its_steps_are_those_of_its_controller(rig: str, tmp_path: Path) -> None:
    values, wrong = run(rig, tmp_path, "step-following", "repeats=2", "lead=1", "dwell_s=1.5")
    assert wrong == []
    for way, (start, end) in {"up": (-0.01, 0.01), "down": (0.01, -0.01)}.items():
        overshoot, settled = stepped(start, end)
        found, u = values["overshoot", f"s, {way}"]
        assert abs(found - overshoot) < u + 5e-4  # what the integrator keeps of the friction: some um of 20 mm
        found, u = values["settling_time", f"s, {way}"]
        assert abs(found - settled) < 2 * u
        assert abs(values["static_error", f"s, {way}"][0]) < 2e-6


@pytest.mark.long
@pytest.mark.links
@pytest.mark.timeout(200)
def test_its_accuracy_is_that_of_its_screw(rig: str, tmp_path: Path) -> None:
    places = (-0.021, -0.0037, 0.0123)
    values, _ = run(
        rig, tmp_path, "positioning", f"targets_m={list(places)}", "repeats=3", "dwell_s=1.0", "rate_m_s=0.05"
    )
    off = [stage_controller.truth(at) - at for at in places]
    near = 3e-7  # counts beside which it may rest, and how each arrival differs
    found, u = values["M", "s"]
    assert abs(found - (max(off) - min(off))) < u + near
    found, u = values["B_mean", "s"]
    assert abs(found - 2 * stage_controller.PLAY) < u + near
