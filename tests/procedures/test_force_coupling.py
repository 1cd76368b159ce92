"""Force coupling through the whole path, after the chain before it: right, and what is wrong is named."""

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
from procedures.force_coupling.estimates import evaluate
from procedures.force_coupling.fit import TERMS
from procedures.force_coupling.plan import Plan
from procedures.force_coupling.procedure import check, procedure, read
from procedures.servomotor import carrying

NAME = "force-coupling"
QUICK = {"settle_s": 0.5, "average_s": 0.3}


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Calibration]:
    """Calibrations of the sound rig."""
    return identified(tmp_path_factory.mktemp("known"))


def measure(
    folder: Path, known: Mapping[str, Calibration], truth: Mapping[str, float] | None = None, **plan: object
) -> Simulated:
    return simulated_run(NAME, "tsbs12", SEED, {**QUICK, **plan}, folder / "c.mcap", truth, known)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory, known: dict[str, Calibration]) -> Simulated:
    return measure(tmp_path_factory.mktemp("sound"), known)


def test_a_sound_rig_is_recovered_within_its_intervals(sound: Simulated) -> None:
    """Seed fixed before any tuning; three standard uncertainties, so that an honest rig does not fail by chance."""
    assert serious(sound) == []
    found, limits = estimates(sound), load_spec("tsbs12", NAME)
    assert set(found) == {"alpha_ratio", "alpha_c", "gamma_0"}
    for name, e in found.items():
        assert abs(e.value - sound.truth[name]) < 3 * e.u, name
        assert judge(interval(e), limits[name]) is Verdict.PASS
    assert found["alpha_ratio"].u < 1e-3
    assert found["gamma_0"].u < np.radians(0.02)
    assert "as-printed" in notes(sound)


def test_gains_of_the_current_sensors_do_not_reach_the_ratio(sound: Simulated) -> None:
    ratio = estimates(sound)["alpha_ratio"]
    gains = [v for k, v in ratio.contributions.items() if k.startswith("sensors/i_m") and k.endswith("gain")]
    assert max(np.abs(gains)) < 0.05 * ratio.u


def test_ripple_at_home_is_what_makes_equal_constants_look_unequal(
    known: dict[str, Calibration], tmp_path: Path
) -> None:
    """Our reading of T's alpha_d/alpha_c = 0.85: one constant of 13 N/A, and the ripple of T's finite elements (7.7 and
    6.7 % of it), measured at the home angle."""
    truth = {"alpha_d": 13.0, "alpha_c": 13.0, "alpha_2": 13 * 1.50 / 19.36, "alpha_3": 13 * 1.29 / 19.36}
    found = estimates(measure(tmp_path, known, truth))["alpha_ratio"]
    assert found.value == pytest.approx((19.36 - 1.50) / (19.36 + 1.29), abs=3 * found.u)
    assert found.value == pytest.approx(0.85, abs=0.02)


def test_the_two_edges_of_the_encoders_count_show_the_ripple(known: dict[str, Calibration], tmp_path: Path) -> None:
    run = measure(tmp_path, known, {"alpha_2": 0.3, "alpha_3": -0.3})
    fit = evaluate(run.recording, read(run.recording), Plan().count_rad).fit
    for name, true in (
        ("rho_2", 0.3 / (run.truth["alpha_ratio"] * run.truth["alpha_c"])),
        ("rho_3", -0.3 / run.truth["alpha_c"]),
    ):
        assert fit.term(name) == pytest.approx(true, abs=max(3 * fit.fit.u[TERMS.index(name)], 0.05 * abs(true)))
    assert abs(estimates(run)["alpha_ratio"].value - run.truth["alpha_ratio"]) < 3 * estimates(run)["alpha_ratio"].u
    assert "ripple" in notes(run)


@pytest.mark.parametrize("swing", [0.1, pytest.param(-0.1, marks=pytest.mark.long)])
def test_where_the_rotor_was_before_does_not_matter(
    known: dict[str, Calibration], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, swing: float
) -> None:
    """With what a move leaves in the angle's integrator the rotor would stand at another edge, or between two."""
    monkeypatch.setattr(carrying, "home", lambda rig: swung(rig, swing))
    run = measure(tmp_path, known)
    data = read(run.recording)
    readings = data.each(lambda step: step.branch) * data.mean[ANGLE] / Plan().count_rad
    assert np.all((readings > 0.05) & (readings < 0.95)), readings
    assert serious(run) == []


def test_a_count_of_the_wrong_size_is_named(known: dict[str, Calibration], tmp_path: Path) -> None:
    fatal = serious(measure(tmp_path, known, count_rad=0.9e-3))
    assert "rotor-off-edge" in {f.code for f in fatal}


@pytest.mark.parametrize(
    ("defect", "code", "named"),
    [
        ({"segment_sign_1": -1}, "segment-sign", "i_m1"),
        pytest.param({"segment_drift_0": 1e-3}, "drifting-sensor", "segments 1 and 3", marks=pytest.mark.long),
        pytest.param({"segment_drift_3": -1e-3}, "drifting-sensor", "segments 2 and 4", marks=pytest.mark.long),
        ({"gamma_zero": 0.04}, "commutation-off", "zero"),
        pytest.param({"gamma_zero": 0.012}, "zero-moved", "force-constant", marks=pytest.mark.long),
        ({"factor_gamma": 1.015}, "gamma-scaled", "another angle"),
        pytest.param({"factor_gamma": 0.985}, "gamma-scaled", "another angle", marks=pytest.mark.long),
        pytest.param({"segment_gain_1": 0.7, "segment_gain_3": 0.7}, "windings-differ", "i_m2", marks=pytest.mark.long),
        ({"integrator_factor": 0.02}, "unsettled", "integrator"),
        pytest.param({"drop_fraction": 0.005}, "missing-samples", "missing", marks=pytest.mark.long),
    ],
)
def test_a_defect_is_named_and_does_not_pass(
    known: dict[str, Calibration], tmp_path: Path, defect: dict[str, float], code: str, named: str
) -> None:
    fatal = serious(measure(tmp_path, known, defect))
    assert any(f.code == code and named in f"{f.text} {f.where}" for f in fatal), fatal


def test_a_calibration_that_does_not_say_where_the_zero_was_is_used_as_it_is(
    known: dict[str, Calibration], sound: Simulated
) -> None:
    own = known["force-constant"]
    before = replace(own, values={name: e for name, e in own.values.items() if name != "alpha_cross@0"})
    assert len(before.values) == len(own.values) - 1
    run = reanalysed(sound, {**known, "force-constant": before})
    assert serious(run) == []
    assert estimates(run) == estimates(sound)


def test_a_force_constant_of_the_wrong_sign_is_named(known: dict[str, Calibration], sound: Simulated) -> None:
    assert "wrong-sign" in {f.code for f in serious(reanalysed(sound, scaled(known, -1.0)))}


def test_a_position_gain_does_not_matter_here(known: dict[str, Calibration], sound: Simulated, tmp_path: Path) -> None:
    """The shaft is held at the sensors' zero; a gain moves no zero. It is no defect of this run."""
    run = measure(tmp_path, known, {"position_gain_yo": 1.2})
    assert serious(run) == []
    for name, e in estimates(run).items():
        assert abs(e.value - sound.truth[name]) < 3 * e.u, name


@pytest.mark.parametrize(
    ("defect", "named"),
    [
        ({"exchange_segments": 1}, "pos_"),
        ({"position_sign_yo": -1}, "check sensors"),
        ({"encoder_sign": -1}, "direction"),
    ],
)
def test_a_rotor_that_cannot_be_held_stops_the_run(
    known: dict[str, Calibration], tmp_path: Path, defect: dict[str, float], named: str
) -> None:
    with pytest.raises((DeviceFault, InterlockError, RotorNotArrived), match=named):
        measure(tmp_path, known, defect)


def test_it_needs_the_force_constant(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="force-constant"):
        measure(tmp_path, {})


@pytest.mark.parametrize(
    ("gammas", "said"),
    [
        ((-0.04, 0.0, -0.01, 0.02, 0.05), "ascending"),
        ((0.0, 0.01, 0.02, 0.03, 0.04), "both sides"),
        ((-0.12, -0.05, 0.0, 0.05, 0.12), "allow"),
    ],
)
def test_what_cannot_work_is_told_before_anything_starts(gammas: tuple[float, ...], said: str) -> None:
    rig = load_rig("tsbs12")
    assert any(said in text for text in check(rig, Plan(gamma_rad=gammas)))
    assert list(check(rig, Plan())) == []


def test_figures_show_the_currents_and_what_the_model_leaves(sound: Simulated) -> None:
    drawn = {f.key: f for f in procedure.drawn(sound.recording)}
    assert set(drawn) == {"currents", "turn", "residuals", "residuals-as-printed"}
    left = np.concatenate([s.y for s in drawn["residuals"].series])
    printed = np.concatenate([s.y for s in drawn["residuals-as-printed"].series])
    assert np.abs(left).max() < 2.0 < np.abs(printed).max()  # mA
