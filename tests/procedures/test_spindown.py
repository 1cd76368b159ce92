"""The spindown through the whole path: it recovers the truth, and never passes a defect off as sound."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from bench.cli.compose import Request
from bench.cli.motion_truth import truth_of_motion
from bench.cli.run import execute
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.limits import Verdict, judge
from bench.record.outcomes import Outcome
from bench.record.specs import load_spec
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, correlation, interval
from procedures.spindown.plan import Plan
from procedures.spindown.procedure import check
from sim_backend.truth import draw

RIGS = Path(__file__).parents[2] / "rigs"
QUICK = {"repeats": 2, "steady_s": 0.2}


def run_down(folder: Path, seed: int, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    return simulated_run("spindown", "tsbs12", seed, {**QUICK, **plan}, folder / "recording.mcap", truth)


def folder_in(folder: Path) -> Path:
    made = folder / "other"
    made.mkdir()
    return made


def results(run: Simulated) -> dict[str, Estimate]:
    """The results by the angle, which come without a place."""
    return {m.quantity.name: m.estimate for m in run.results if isinstance(m, Measured) and not m.where}


def serious(run: Simulated) -> dict[str, Finding]:
    return {f.code: f for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE}


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    return run_down(tmp_path_factory.mktemp("sound"), 2026)


def test_a_sound_rig_is_recovered_within_its_intervals(sound: Simulated) -> None:
    """Seed fixed before any tuning; the inertia dominates both B, the drive's own drag T_c."""
    run, found = sound, results(sound)
    assert set(found) == {"B", "B_high", "T_c", "J_z"}
    assert serious(run) == {}
    for name in ("B", "B_high", "T_c"):
        assert abs(found[name].value - run.truth[name]) < 3 * found[name].u, name
        assert interval(found[name]).method == "monte-carlo"
    assert len(run.recording.all_steps()) == run.procedure.step_count(run.recording.plan)
    assert {step.labels["by"] for step in run.recording.steps("coast")} == {"drive"}
    assert correlation(found["B"], found["B_high"]) > 0.95
    assert found["T_c"].contributions["machine/drive_drag"] ** 2 > 0.9 * found["T_c"].u ** 2
    limits = load_spec("tsbs12", "spindown")
    assert judge(interval(found["B"]), limits["B"]) is Verdict.PASS
    assert judge(interval(found["T_c"]), limits["T_c"]) is Verdict.PASS
    assert found["J_z"].value == pytest.approx(0.033)


def test_speed_and_angle_agree_far_below_the_uncertainty_of_either(sound: Simulated) -> None:
    """The inertia cancels in their difference."""
    by_speed = {m.quantity.name: m.estimate for m in sound.results if isinstance(m, Measured) and m.where}
    for name, u in (("B", 2e-5), ("T_c", 3e-4)):
        apart = by_speed[name] - results(sound)[name]
        assert abs(apart.value) < 4 * apart.u
        assert apart.u < u


def test_the_ring_measures_the_inertia_and_takes_its_tolerance_out(tmp_path: Path) -> None:
    run = run_down(tmp_path, 21, added_inertia=True)
    found, true = results(run), draw(load_rig("tsbs12"), 21).values
    assert abs(found["J_z"].value - true["polar_inertia"]) < 3 * found["J_z"].u
    for name in ("B", "B_high", "T_c"):
        assert abs(found[name].value - run.truth[name]) < 3 * found[name].u, name
        assert name == "T_c" or found[name].u < 2e-3 * found[name].value
        assert "machine/polar_inertia" not in found[name].contributions
    assert serious(run) == {}


def test_the_result_follows_the_truth(tmp_path: Path) -> None:
    """Printed values are no input: with the drag 20 % off it is 20 % off, and the limit says so. It is more than the drive can
    give, so that the motor turns it."""
    run = run_down(tmp_path, 11, {"viscous": 1.2 * 0.081}, run_up="motor")
    found = results(run)["B"]
    assert abs(found.value - 0.0972) < 3 * found.u
    assert judge(interval(found), load_spec("tsbs12", "spindown")["B"]) is Verdict.FAIL


@pytest.mark.parametrize(
    ("defect", "said", "run_up"),
    [
        ({"encoder_sign": -1}, {"encoder-direction": "backwards"}, "drive"),
        pytest.param(
            {"encoder_sign": -1},
            {"encoder-direction": "backwards", "speed-not-reached": "did not reach"},
            "motor",
            marks=pytest.mark.long,
        ),
        ({"drive_brakes": 0.15}, {"braked": "brake"}, "drive"),
        pytest.param({"drop_fraction": 0.005}, {"missing-samples": "missing"}, "drive", marks=pytest.mark.long),
        pytest.param({"detent": 3}, {"drag-not-linear": "another shape"}, "drive", marks=pytest.mark.long),
        ({"segment_drift_1": 0.003}, {"constant-torque": "forward"}, "drive"),
    ],
)
def test_a_defect_is_named_and_does_not_pass(
    tmp_path: Path, defect: dict[str, float], said: dict[str, str], run_up: str
) -> None:
    found = serious(run_down(tmp_path, 3, defect, run_up=run_up))
    for code, named in said.items():
        assert code in found, found
        assert named in found[code].text


@pytest.mark.parametrize("brake", [0.0, 0.02, *(pytest.param(x, marks=pytest.mark.long) for x in (0.015, 0.04))])
def test_a_drive_that_brakes_while_coasting_is_named(tmp_path: Path, brake: float) -> None:
    """What the drive gives to hold its speeds has no room for a torque that acts only while it coasts, but for the drag that
    the rig file states."""
    request = Request("spindown", "tsbs12", seed=9300001, plan=("repeats=2", "speed_rad_s=50"), out=tmp_path, report=False,
                      truth=(f"drive_brakes={brake}",))  # fmt: skip
    done = execute(request)
    if brake:
        assert done.outcome in (Outcome.FAIL, Outcome.INDETERMINATE)
        assert "drive-brakes" in {f.code for f in done.record.findings}
    else:
        assert done.outcome is Outcome.PASS, done.reason


def test_the_drives_own_drag_is_in_the_budget_and_in_the_truth(tmp_path: Path) -> None:
    """It moves T_c by no more than its half width, and B not at all."""
    found = []
    for drag in (0.0, 0.01):
        folder = tmp_path / str(drag)
        folder.mkdir()
        found.append(results(run_down(folder, 12, {"drive_drag": drag})))
    apart = found[1]["T_c"].value - found[0]["T_c"].value
    assert apart == pytest.approx(0.01, rel=0.1)
    assert apart < 2.2 * interval(found[0]["T_c"]).U
    assert abs(found[1]["B"].value - found[0]["B"].value) < 0.1 * interval(found[0]["B"]).U


def test_a_wrong_ring_contradicts_the_drawing(tmp_path: Path) -> None:
    """Three per cent of the ring are three per cent of everything; the rig file's inertia knows better."""
    found = serious(run_down(tmp_path, 1, {"ring_inertia": 0.0206}, added_inertia=True))
    assert "inertia-contradicted" in found, found
    assert "0.033" in found["inertia-contradicted"].text


def test_a_rotor_that_stops_too_soon_is_told_so(tmp_path: Path) -> None:
    with pytest.raises(AnalysisError, match="stops too soon: it falls to 3 rad/s"):
        run_down(tmp_path, 1, {"viscous": 0.4}, run_up="motor", speed_rad_s=12.5)


def test_a_run_down_of_a_tenth_of_a_second_is_evaluated_by_its_angle(tmp_path: Path) -> None:
    """J/B is 0.1 s at 3 A, 0.07 s at 4 A: from 45 rad/s it is over in 0.3 and 0.2 s, of which the speed's filter takes one."""
    run = run_down(tmp_path, 6, {"viscous": 0.32, "polar_inertia": 0.033, "drive_drag": 0.005}, run_up="motor",
                   speed_rad_s=45)  # fmt: skip
    assert serious(run) == {}
    assert "angle-alone" in {f.code for f in run.results if isinstance(f, Finding)}
    assert not [m for m in run.results if isinstance(m, Measured) and m.where]
    for name, e in results(run).items():
        if name == "J_z":
            continue
        u = math.sqrt(
            sum(c**2 for i, c in e.contributions.items() if i not in ("machine/polar_inertia", "machine/drive_drag"))
        )
        assert abs(e.value - run.truth[name]) < 3.5 * u, name
        assert u < (2e-3 if name == "T_c" else 2e-3 * e.value), name


def test_while_the_motor_carries_the_drag_is_that_of_one_amb(tmp_path: Path) -> None:
    """60 % of 0.081 N m s/rad are the AMBs', half of which is idle: 0.0567 on the nominal rig, and 0.6 (16/9)/2 + 0.4, 0.0756,
    at 4 A."""
    run = run_down(tmp_path, 2026, motor_carries=True, speed_rad_s=50)
    found = {m.quantity.name: m.estimate for m in run.results if isinstance(m, Measured) and m.where == "motor carries"}
    true = truth_of_motion(run)
    assert serious(run) == {}
    assert true["B"] == pytest.approx(run.truth["B"] * (1 - run.drawn.values["drag_share"] / 2))
    for name in ("B", "B_high", "T_c"):
        assert abs(found[name].value - true[name]) < 1.6 * interval(found[name]).U, name
    assert abs(found["B"].value - run.truth["B"]) > 10 * found["B"].u
    assert len(run.recording.all_steps()) == run.procedure.step_count(run.recording.plan)
    assert run.calibration().settings["motor_carries"] == 1.0
    assert run_down(folder_in(tmp_path), 2026).calibration().settings["motor_carries"] == 0.0


@pytest.mark.parametrize(
    ("defect", "code"),
    [({"exchange_segments": 1.0}, "segments-exchanged"), ({"segment_drift_1": 0.003}, "not-repeatable")],
)
def test_a_motor_that_should_not_carry_is_named(tmp_path: Path, defect: dict[str, float], code: str) -> None:
    assert code in serious(run_down(tmp_path, 3, defect, motor_carries=True, speed_rad_s=50))


def test_a_rig_without_a_motor_cannot_have_it_carry() -> None:
    (said,) = (x for x in check(load_rig("amb5dof"), Plan(motor_carries=True)) if "motor_carries" in x)
    assert "no motor" in said


def test_a_drive_that_can_do_no_more_lets_go_a_little_below(tmp_path: Path) -> None:
    """70 rad/s take more than its 8 N m at the higher bias: it would trip at its limit, and B_high needs no such speed."""
    run = run_down(tmp_path, 0, speed_rad_s=70)
    assert serious(run) == {}
    (lowered,) = (f for f in run.results if isinstance(f, Finding) and f.code == "speed-lowered")
    assert lowered.where == "4 A"
    tops = {s.labels["bias_A"]: abs(s.labels["speed_rad_s"]) for s in run.recording.steps("spin")}
    assert tops[3.0] == 70
    assert 60 < tops[4.0] < 66
    for name, e in results(run).items():
        assert name == "J_z" or abs(e.value - run.truth[name]) < 3 * e.u, name


def test_a_drive_far_too_weak_is_an_error(tmp_path: Path) -> None:
    found = serious(run_down(tmp_path, 0, {"drive_limit": 3.0}))
    assert "speed-not-reached" in found


def test_a_rig_without_a_drive_is_run_up_by_its_motor_and_lacks_nothing(tmp_path: Path) -> None:
    """By default, as the first user without a drive runs it."""
    for name in ("tsbs12.toml", "tsbs12.dbc"):
        (tmp_path / name).write_bytes((RIGS / name).read_bytes())
    text = re.sub(
        r"\[devices\.drive\].*?(?=\n\[(?!devices\.drive))", "", (tmp_path / "tsbs12.toml").read_text(), flags=re.DOTALL
    )
    (tmp_path / "tsbs12.toml").write_text(text)
    done = simulated_run("spindown", str(tmp_path / "tsbs12.toml"), 3, QUICK, tmp_path / "r.mcap")
    assert {step.labels["by"] for step in done.recording.steps("coast")} == {"motor"}
    assert serious(done) == {}


def test_what_is_adopted_holds_for_its_biases(sound: Simulated) -> None:
    calibration = sound.calibration()
    assert {"B", "B_high", "T_c", "J_z"} <= set(calibration.values)
    assert calibration.settings == {"bias_A": 3.0, "bias_high_A": 4.0, "motor_carries": 0.0}


@pytest.mark.parametrize(
    ("plan", "named"),
    [
        ({"speed_rad_s": 80}, "envelope"),
        ({"end_speed_rad_s": 30}, "end_speed_rad_s"),
        ({"bias_high_A": 3.1}, "bias_high_A"),
    ],
)
def test_a_plan_that_cannot_work_is_refused(plan: dict[str, float], named: str) -> None:
    rig = load_rig("tsbs12")
    assert any(named in line for line in check(rig, Plan.model_validate(plan)))
    assert list(check(rig, Plan())) == []


def test_what_the_rig_file_lacks_is_told() -> None:
    rig = load_rig("tsbs12")
    lean = rig.model_copy(update={"machine": {}, "devices": {k: d for k, d in rig.devices.items() if k != "drive"}})
    assert any("ring_inertia" in line for line in check(lean, Plan(added_inertia=True)))
    assert any("role" in line for line in check(lean, Plan(run_up="drive")))
