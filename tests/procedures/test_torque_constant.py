"""The torque calibration through the whole path: it recovers the truth, and never passes a defect off as sound."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.limits import Verdict, judge
from bench.record.specs import load_spec
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, interval
from procedures.torque_constant.plan import Plan
from procedures.torque_constant.procedure import check, procedure

QUICK = {"masses": ["M2", "M3"], "settle_s": 0.7, "average_s": 0.3}
THREE = {**QUICK, "masses": ["M1", "M2", "M3"]}


def calibrate(
    folder: Path, seed: int, truth: Mapping[str, float] | None = None, plan: Mapping[str, object] = QUICK
) -> Simulated:
    return simulated_run("torque-constant", "tsbs12", seed, plan, folder / "recording.mcap", truth)


def results(run: Simulated) -> dict[str, Estimate]:
    return {m.quantity.name: m.estimate for m in run.results if isinstance(m, Measured)}


def serious(run: Simulated) -> dict[str, Finding]:
    return {f.code: f for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE}


def test_a_sound_rig_is_recovered_within_its_intervals(tmp_path: Path) -> None:
    """Seed fixed before any tuning; three standard uncertainties, so that an honest rig does not fail by chance."""
    run = calibrate(tmp_path, 2026)
    found = results(run)
    assert set(found) == {"alpha_tau", "gamma_0t"}
    assert serious(run) == {}
    assert abs(found["alpha_tau"].value - run.truth["alpha_tau"]) < 3 * found["alpha_tau"].u
    assert abs(found["gamma_0t"].value - run.truth["gamma_0"]) < 3 * found["gamma_0t"].u
    assert found["alpha_tau"].u < 2e-3 * found["alpha_tau"].value
    assert len(run.recording.all_steps()) == run.procedure.step_count(run.recording.plan)
    assert {f"sensors/i_m{k}/gain" for k in range(1, 5)} <= set(found["alpha_tau"].contributions)
    limit = load_spec("tsbs12", "torque-constant")["alpha_tau"]
    assert judge(interval(found["alpha_tau"]), limit) is Verdict.PASS


def test_the_result_follows_the_truth(tmp_path: Path) -> None:
    """Printed values are no input: with the constant 20 % off it is 20 % off, and the limit says so."""
    run = calibrate(tmp_path, 11, {"alpha_tau": 0.8 * 2.87})
    found = results(run)["alpha_tau"]
    assert abs(found.value - run.truth["alpha_tau"]) < 3 * found.u
    assert judge(interval(found), load_spec("tsbs12", "torque-constant")["alpha_tau"]) is Verdict.FAIL


@pytest.mark.parametrize(
    ("defect", "code", "named"),
    [
        ({"exchange_segments": 1}, "segments-exchanged", "segments 1 and 2"),
        pytest.param({"encoder_sign": -1}, "encoder-direction", "backwards", marks=pytest.mark.long),
        pytest.param({"segment_sign_1": -1}, "segment-sign", "i_m1", marks=pytest.mark.long),
        ({"lever_slip": 0.05}, "lever-slips", "slips"),
        pytest.param({"segment_drift_2": 0.001}, "current-drift", "i_m3", marks=pytest.mark.long),
        pytest.param({"segment_scale_drift": 1e-4}, "drifting-scale", "drifts by -0.4", marks=pytest.mark.long),
        ({"detent": 3}, "large-detent", "detent"),
        pytest.param({"geometry.lever_left": 0.231}, "arms-disagree", "arm", marks=pytest.mark.long),
        pytest.param({"drop_fraction": 0.005}, "missing-samples", "missing", marks=pytest.mark.long),
    ],
)
def test_a_defect_is_named_and_does_not_pass(tmp_path: Path, defect: dict[str, float], code: str, named: str) -> None:
    found = serious(calibrate(tmp_path, 3, defect))
    assert code in found, found
    assert named in found[code].text


@pytest.mark.long
def test_a_scale_that_drifts_unseen_moves_nothing(tmp_path: Path) -> None:
    """Default plan: 0.06 % over the loads (145 s) moved gamma_0t by 3 to 7 U as long as gamma went in one direction."""
    runs = []
    for size in (0.0, 4e-6):
        (tmp_path / f"{size}").mkdir()
        runs.append(calibrate(tmp_path / f"{size}", 42, {"segment_scale_drift": size}, {}))
        assert serious(runs[-1]) == {}
    sound, drifted = (results(run)["gamma_0t"] for run in runs)
    assert abs(drifted.value - sound.value) < 2 * sound.u


@pytest.mark.parametrize(("mass", "error"), [("M1", -0.02), pytest.param("M3", 0.01, marks=pytest.mark.long)])
def test_a_wrong_mass_is_named(tmp_path: Path, mass: str, error: float) -> None:
    found = serious(calibrate(tmp_path, 3, {f"mass_error_{mass}": error}, THREE))
    assert found["load-inconsistent"].where == mass


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_detent_as_large_as_the_load_never_passes(tmp_path: Path, seed: int) -> None:
    """Whatever its phase: where it is steepest the rotor is off home, where it is flat the current without load is large."""
    assert {"large-detent", "rotor-does-not-turn"} & set(serious(calibrate(tmp_path, seed, {"detent": 3})))


def test_too_short_a_time_to_settle_is_told(tmp_path: Path) -> None:
    found = serious(calibrate(tmp_path, 3, None, {**QUICK, "settle_s": 0.02, "average_s": 0.2, "ki_theta": 60}))
    assert {"not-held", "unsettled"} & set(found)


@pytest.mark.parametrize(
    ("plan", "named"),
    [
        ({"masses": ["M3", "M1"]}, "ascending"),
        ({"masses": ["M1", "M9"]}, "M9"),
        ({"gamma_max_rad": 0.2}, "gamma_max_rad"),
    ],
)
def test_a_plan_that_cannot_work_is_refused(plan: dict[str, object], named: str) -> None:
    rig = load_rig("tsbs12")
    assert any(named in line for line in check(rig, Plan.model_validate(plan)))
    assert list(check(rig, Plan())) == []


@pytest.mark.parametrize("kind", ["geometry", "machine", "sensors", "parameters"])
def test_what_the_rig_file_lacks_is_told(kind: str) -> None:
    rig = load_rig("tsbs12")
    name = {"geometry": "lever_left", "machine": "pole_pairs", "sensors": "i_m2", "parameters": "gamma"}[kind]
    table = {k: v for k, v in getattr(rig, kind).items() if k != name}
    assert any(name in line for line in procedure.problems(rig.model_copy(update={kind: table}), Plan()))
