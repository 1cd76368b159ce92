"""Negative stiffness through the whole path, after the chain before it: right, follows the truth, and names what is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from identified import SEED, estimates, identified, notes, scaled, serious, swung
from reanalysed import reanalysed

from bench.calibration import Calibration
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import ConfigError, DeviceFault, InterlockError, RotorNotArrived
from bench.record.limits import Verdict, judge
from bench.record.specs import load_spec
from bench.rigfile import load_rig
from bench.rigfile.roles import ANGLE
from bench.uncertainty import interval
from procedures.negative_stiffness import procedure as negative_stiffness
from procedures.negative_stiffness.estimates import evaluate
from procedures.negative_stiffness.plan import Plan
from procedures.negative_stiffness.procedure import check, procedure, read
from procedures.servomotor import carrying

NAME = "negative-stiffness"
QUICK = {"levels_m": [-40e-6, -20e-6, 0.0, 20e-6, 40e-6], "settle_s": 0.5, "average_s": 0.3}


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Calibration]:
    """Calibrations of the sound rig."""
    return identified(tmp_path_factory.mktemp("known"))


def measure(
    folder: Path, known: Mapping[str, Calibration], truth: Mapping[str, float] | None = None, **plan: object
) -> Simulated:
    return simulated_run(NAME, "tsbs12", SEED, {**QUICK, **plan}, folder / "s.mcap", truth, known)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory, known: dict[str, Calibration]) -> Simulated:
    return measure(tmp_path_factory.mktemp("sound"), known)


def test_a_sound_rig_is_recovered_within_its_intervals(sound: Simulated) -> None:
    """Seed fixed before any tuning; three standard uncertainties, so that an honest rig does not fail by chance."""
    assert serious(sound) == []
    found, limits = estimates(sound), load_spec("tsbs12", NAME)
    assert set(found) == {"alpha_x_prime", "alpha_x_prime_amb"}
    for name, e in found.items():
        assert abs(e.value - sound.truth[name]) < 3 * e.u, name
        assert judge(interval(e), limits[name]) is Verdict.PASS
        assert e.u < 0.01 * e.value


def test_the_position_sensor_carries_the_budget_and_cancels_in_the_comparison(sound: Simulated) -> None:
    """Nine tenths of the variance are one rectangular gain: Monte Carlo. The difference is three times as sharp."""
    found = estimates(sound)["alpha_x_prime"]
    assert found.contributions["sensors/pos_yo/gain"] ** 2 > 0.8 * found.u**2
    assert interval(found).method == "monte-carlo"
    assert evaluate(sound.recording, *read(sound.recording)).estimates["difference"].u < 0.35 * found.u
    assert {"methods-agree", "methods-disagree"} & set(notes(sound))


def test_the_inboard_amb_drops_out(
    sound: Simulated, known: dict[str, Calibration], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another inboard controller, the same answer: its force has no arm about its own plane."""
    written = lambda rig, plan: {**negative_stiffness.settings(rig, plan), "kp_i": 60e3, "ki_i": 0.6e6, "kd_i": 60.0}  # noqa: E731
    monkeypatch.setattr(negative_stiffness, "procedure", replace(negative_stiffness.procedure, settings=written))
    other = measure(tmp_path, known)
    ratio = estimates(other)["alpha_x_prime"].value / estimates(sound)["alpha_x_prime"].value
    assert ratio == pytest.approx(1, abs=5e-4)


@pytest.mark.parametrize("swing", [0.1, pytest.param(-0.1, marks=pytest.mark.long)])
def test_where_the_rotor_was_before_does_not_matter(
    sound: Simulated, known: dict[str, Calibration], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, swing: float
) -> None:
    """A move leaves something in the angle's integrator, which at home puts the rotor at another edge of a count. With the
    edge chosen, every step has the same angle: the lower edge, or one between the steps, is not it."""
    monkeypatch.setattr(carrying, "home", lambda rig: swung(rig, swing))
    run = measure(tmp_path, known, {"alpha_3": 0.3})
    count = Plan().count_rad
    readings = read(run.recording)[0].mean[ANGLE] / count
    assert np.all((readings > 0.05) & (readings < 0.95)), readings
    assert [f for f in serious(run) if f.code != "methods-disagree"] == []  # alpha_d was calibrated with another ripple
    at_rest = read(sound.recording)[0].mean[ANGLE] / count
    assert readings.mean() == pytest.approx(at_rest.mean(), abs=0.04)


def test_a_count_of_the_wrong_size_is_named(known: dict[str, Calibration], tmp_path: Path) -> None:
    assert "rotor-off-edge" in {f.code for f in serious(measure(tmp_path, known, count_rad=0.9e-3))}


def test_the_result_follows_the_truth(known: dict[str, Calibration], tmp_path: Path) -> None:
    """The printed value is no input: with three quarters of it the result is three quarters, and the limits say so."""
    run = measure(tmp_path, known, {"geometry.motor_stiffness": 180e3})
    for name, e in estimates(run).items():
        assert run.truth[name] == pytest.approx(180e3 * 1.3286, rel=0.01)
        assert abs(e.value - run.truth[name]) < 3 * e.u, name
        assert judge(interval(e), load_spec("tsbs12", NAME)[name]) is Verdict.FAIL


@pytest.mark.parametrize(
    ("defect", "code", "named"),
    [
        ({"segment_sign_1": -1}, "segment-sign", "i_m1"),
        pytest.param({"segment_drift_0": 1e-3}, "drifting-sensor", "segments 1 and 3", marks=pytest.mark.long),
        pytest.param({"segment_drift_3": -1e-3}, "drifting-sensor", "segments 2 and 4", marks=pytest.mark.long),
        ({"drift_6": 1e-3}, "drifting-sensor", "i_yo"),
        pytest.param({"position_gain_yo": 1.2}, "gap-inconsistent", "pos_yo", marks=pytest.mark.long),
        pytest.param({"position_gain_yo": 0.8}, "gap-inconsistent", "pos_yo", marks=pytest.mark.long),
        ({"gamma_zero": 0.04}, "axes-coupled", "commutation"),
        pytest.param({"integrator_factor": 0.02}, "unsettled", "integrator", marks=pytest.mark.long),
        pytest.param({"drop_fraction": 0.005}, "missing-samples", "missing", marks=pytest.mark.long),
    ],
)
def test_a_defect_is_named_and_does_not_pass(
    known: dict[str, Calibration], tmp_path: Path, defect: dict[str, float], code: str, named: str
) -> None:
    fatal = serious(measure(tmp_path, known, defect))
    assert any(f.code == code and named in f"{f.text} {f.where}" for f in fatal), fatal


@pytest.mark.parametrize(
    ("factor", "code"), [(-1.0, "wrong-sign"), (1.2, "methods-disagree"), (0.97, "methods-disagree")]
)
def test_a_wrong_force_constant_is_seen_by_the_second_way(
    known: dict[str, Calibration], sound: Simulated, factor: float, code: str
) -> None:
    assert code in {f.code for f in serious(reanalysed(sound, scaled(known, factor)))}


@pytest.mark.parametrize(
    ("defect", "named"),
    [
        ({"exchange_segments": 1}, "pos_"),
        ({"position_sign_yo": -1}, "check sensors"),
        ({"encoder_sign": -1}, "direction"),
        ({"stuck_position_yo": 1}, "sensor"),
    ],
)
def test_a_rotor_that_cannot_be_held_stops_the_run(
    known: dict[str, Calibration], tmp_path: Path, defect: dict[str, float], named: str
) -> None:
    with pytest.raises((DeviceFault, InterlockError, RotorNotArrived), match=named):
        measure(tmp_path, known, defect)


def test_it_needs_both_calibrations_at_this_bias(known: dict[str, Calibration], tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="force-constant"):
        measure(tmp_path, {"amb-calibration": known["amb-calibration"]})
    with pytest.raises(ConfigError, match="bias_A"):
        measure(tmp_path, known, bias_A=2.5, bias_high_A=3.5)


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        ({"levels_m": (-2e-5, -1e-5, 1e-5, 0.0, 2e-5)}, "ascending"),
        ({"levels_m": (0.0, 1e-5, 2e-5, 3e-5, 4e-5)}, "both sides"),
        ({"levels_m": (-15e-5, -1e-5, 0.0, 1e-5, 15e-5)}, "references and envelope"),
        ({"levels_m": (-9e-5, -1e-5, 0.0, 1e-5, 9e-5)}, "outboard AMB"),
        ({"bias_high_A": 3.2}, "15 % more"),
        ({"bias_high_A": 6.0}, "goes to 5 A"),
    ],
)
def test_what_cannot_work_is_told_before_anything_starts(plan: dict[str, object], said: str) -> None:
    rig = load_rig("tsbs12")
    assert any(said in text for text in check(rig, Plan(**plan)))  # type: ignore[arg-type]
    assert list(check(rig, Plan())) == []
    assert list(check(rig, Plan(**QUICK))) == []  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["sensors", "channels", "parameters", "geometry"])
def test_what_the_rig_file_lacks_is_told(kind: str) -> None:
    rig = load_rig("tsbs12")
    name = {"sensors": "i_m1", "channels": "i_m1", "parameters": "motor_share", "geometry": "amb_gap"}[kind]
    table = {k: v for k, v in getattr(rig, kind).items() if k != name}
    assert procedure.problems(rig.model_copy(update={kind: table}), Plan()) == (f"{kind}: found no {name}",)


def test_figures_show_the_data_with_the_fit(sound: Simulated) -> None:
    drawn = {f.key: f for f in procedure.drawn(sound.recording)}
    assert set(drawn) == {"current", "current-residuals", "two-biases", "two-biases-residuals"}
    assert np.ptp(drawn["current"].series[0].y) > 1.0  # amperes
    slopes = [float(np.polyfit(s.x, s.y, 1)[0]) for s in drawn["two-biases"].series]
    assert slopes[1] == pytest.approx(slopes[3], rel=2e-3)  # freed of the AMB, both biases show the same
    assert slopes[2] < 1.15 * slopes[0] < 0  # by the current alone they do not
