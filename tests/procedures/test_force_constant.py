"""The force constant through the whole path, after the calibration: it recovers the truth, and names what is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from identified import CALIBRATE, SEED, WEIGH, estimates, identification, serious
from reanalysed import reanalysed

from bench.calibration import Calibration
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import ConfigError, DeviceFault
from bench.findings import Effect, Finding
from bench.record.limits import Verdict, judge
from bench.record.specs import load_spec
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, interval
from bench.uncertainty.coverage import ensemble
from procedures.force_constant import checks
from procedures.force_constant.fitting import check, predicted_controls
from procedures.force_constant.plan import Plan
from procedures.force_constant.procedure import procedure
from procedures.force_constant.steps import read_ramps
from procedures.servomotor.conventions import conventions

NAME, CALIBRATION = "force-constant", "amb-calibration"
SHORT = {"settle_s": 0.15}


def calibrated(folder: Path, seed: int, **plan: object) -> Calibration:
    return simulated_run(CALIBRATION, "tsbs12", seed, {**CALIBRATE, **plan}, folder / f"c{seed}.mcap").calibration()


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    """Of the sound rig."""
    return identification(tmp_path_factory.mktemp("identified")).known[CALIBRATION]


def measure(
    folder: Path, calibration: Calibration, truth: Mapping[str, float] | None = None, **plan: object
) -> Simulated:
    return simulated_run(NAME, "tsbs12", SEED, {**WEIGH, **plan}, folder / "f.mcap", truth, {CALIBRATION: calibration})


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    """One run on the sound rig."""
    return identification(tmp_path_factory.mktemp("identified")).motor


def test_a_sound_rig_is_recovered_within_its_intervals(sound: Simulated) -> None:
    """Seed fixed before any tuning; three standard uncertainties, so that an honest rig does not fail by chance."""
    assert serious(sound) == []
    found, limits = estimates(sound), load_spec("tsbs12", NAME)
    assert set(found) == {"alpha_d", "alpha_dx"}
    for name, e in found.items():
        assert abs(e.value - sound.truth[name]) < 3 * e.u, name
        assert judge(interval(e), limits[name]) is Verdict.PASS
    assert found["alpha_d"].u < 2e-3 * found["alpha_d"].value
    assert found["alpha_dx"].u < 2e-2 * found["alpha_dx"].value


def test_scatter_that_was_pooled_over_the_angles_is_counted_once(sound: Simulated) -> None:
    """Of the calibration and of the steps: each covariance is one estimate, however many angles a mean is over."""
    for name, e in estimates(sound).items():
        stems = {ensemble(i).partition("/")[2] or i.id for i in e.sensitivities if i.kind == "A"}
        own = {"curvature_i", "curvature_o"} if name == "alpha_dx" else set()
        assert stems == {"scatter/angles", name.replace("alpha_dx", "x").replace("alpha_d", "y"), *own}


def test_what_the_calibration_shares_is_in_the_report(sound: Simulated) -> None:
    """Without the sensors of this run alone the AMBs give alpha_d to a few hundredths of a per cent; taken alone the
    calibration would leave 0.3 % and more."""
    a = procedure.evaluated(sound.recording).result
    by_ambs = [v for k, v in a.y.mean.contributions.items() if not k.startswith("sensors/i_m")]
    assert sum(v**2 for v in by_ambs) ** 0.5 < 6e-4 * a.y.mean.value
    assert a.alone.mean.u > 2 * a.y.mean.u
    notes = {f.code: f.text for f in sound.results if isinstance(f, Finding)}
    assert f"{a.alone.mean.u:.4f} N/A" in notes["shared-influences"]
    assert "K_x = K_y" in notes["horizontal-assumed"]


def test_the_ripple_is_seen_over_the_angle(tmp_path: Path, calibration: Calibration) -> None:
    """alpha_d at home is alpha_d less the ripple; the mean over nine angles holds neither."""
    run = measure(tmp_path, calibration, {"alpha_2": 0.28, "alpha_3": 0.0})
    known = procedure.stated(run.recording)
    home, mean = known["alpha_d@0"], known["alpha_d"]
    assert set(known) == {"alpha_d", "alpha_dx", "alpha_cross@0", *(f"alpha_d@{k}" for k in range(9))}
    assert mean.value - home.value == pytest.approx(0.28, abs=0.02)
    assert abs(mean.value - run.truth["alpha_d"]) < 3 * mean.u
    assert serious(run) == []


@pytest.mark.parametrize("factor", [pytest.param(0.8, marks=pytest.mark.long), 1.2])
def test_the_result_follows_the_truth(tmp_path: Path, calibration: Calibration, factor: float) -> None:
    """Printed values are no input: with the truth 20 % off they are 20 % off, and the limits say so."""
    run = measure(tmp_path, calibration, {"alpha_d": 12.1 * factor})
    limits = load_spec("tsbs12", NAME)
    e = estimates(run)["alpha_d"]
    assert abs(e.value - run.truth["alpha_d"]) < 3 * e.u
    assert judge(interval(e), limits["alpha_d"]) is Verdict.FAIL


def test_a_current_sensor_that_changed_since_the_calibration_is_found_by_the_load_at_rest(
    tmp_path: Path, calibration: Calibration, sound: Simulated
) -> None:
    """0.3 %, the certificate's half width: alpha_d moves by up to 3 U, and both rows agree."""
    assert not any(f.code == "load-moved" for f in sound.results if isinstance(f, Finding))
    changed = sound.drawn.values["i_yo_p.gain"] + 0.003
    run = measure(tmp_path, calibration, {"i_yo_p.gain": changed})
    (found,) = (f for f in serious(run) if f.code == "load-moved")
    assert (found.where, found.effect, found.concerns) == ("outboard", Effect.INDETERMINATE, ("alpha_d",))
    assert "i_yo_p changed by +0.30%" in found.text
    before = {n: e for n, e in calibration.values.items() if not n.startswith(("F0", "hanger"))}
    assert "load-moved" not in {
        f.code for f in serious(reanalysed(run, {CALIBRATION: replace(calibration, values=before)}))
    }


@pytest.mark.parametrize(
    ("defect", "code", "named"),
    [
        ({"exchange_segments": 1}, "segments-exchanged", "1 and 2"),
        pytest.param({"segment_sign_1": -1}, "segment-sign", "segment 1", marks=pytest.mark.long),
        pytest.param({"segment_drift_0": 2e-3}, "drifting-sensor", "segment 1 or 3", marks=pytest.mark.long),
        pytest.param({"drift_2": 1e-3}, "drifting-sensor", "inboard AMB, axis y", marks=pytest.mark.long),
        pytest.param({"drift_6": 1e-3}, "drifting-sensor", "outboard AMB, axis y", marks=pytest.mark.long),
        pytest.param({"drop_fraction": 0.005}, "missing-samples", "missing", marks=pytest.mark.long),
        ({"integrator_factor": 0.05}, "unsettled", "integrator"),
        pytest.param({"stuck_current_yo_p": 1}, "stuck-channel", "i_yo_p", marks=pytest.mark.long),
        pytest.param({"asymmetry_o": 0.15}, "rows-disagree", "K_x of an AMB", marks=pytest.mark.long),
    ],
)
def test_a_defect_is_named_and_does_not_pass(
    tmp_path: Path, calibration: Calibration, defect: dict[str, float], code: str, named: str
) -> None:
    found = serious(measure(tmp_path, calibration, defect, **SHORT))
    assert code in {f.code for f in found}, found
    assert any(named in f.text for f in found if f.code == code), found


def test_a_coil_that_cannot_reach_its_current_does_not_pass(
    tmp_path: Path, calibration: Calibration, sound: Simulated
) -> None:
    """This rig cannot even lift with 8 A at the lower limit; one that lifts says so by the controller's flags."""
    with pytest.raises(DeviceFault, match="check"):
        measure(tmp_path, calibration, {"coil_limit_yo_p": 8.0})
    data = read_ramps(sound.recording)
    for bit, named in ((1, "AMB"), (128, "motor"), (8, "outboard touchdown")):
        flagged = replace(
            data, table=replace(data.table, flags=np.where(data.table.each(lambda at: at.i_y_A) == -2, bit, 0))
        )
        found = list(checks.of_signals(flagged, conventions(load_rig("tsbs12")), Plan()))
        assert [(f.code, f.effect) for f in found] == [
            ("contact" if bit == 8 else "current-saturated", Effect.INDETERMINATE)
        ]
        assert named in found[0].text
        assert "i_y -2 A" in found[0].where


def altered(calibration: Calibration, change: object) -> Calibration:
    values = {name: change(name, calibration.values) for name in calibration.values}  # type: ignore[operator]
    return replace(calibration, values=values)


def test_a_calibration_with_a_wrong_sign_is_named(sound: Simulated, calibration: Calibration) -> None:
    wrong = altered(calibration, lambda n, v: -v[n] if n.startswith("K_i@") else v[n])
    found = {(f.code, f.where): f.text for f in serious(reanalysed(sound, {CALIBRATION: wrong}))}
    assert "opposite sign of K_i" in found["rows-disagree", "y"]
    assert ("rows-disagree", "x") not in found  # the horizontal constants rest on the vertical ones


def test_a_calibration_of_other_angles_is_named(sound: Simulated, calibration: Calibration) -> None:
    def next_angle(name: str, values: Mapping[str, Estimate]) -> Estimate:
        quantity, at, angle = name.partition("@")
        return values[f"{quantity}@{(int(angle) + 1) % 9}"] if at else values[name]

    wrong = altered(calibration, next_angle)
    found = {f.code: f.text for f in serious(reanalysed(sound, {CALIBRATION: wrong}))}
    assert set(found) & {"rows-disagree", "misfit"}
    assert any("further on" in text for text in found.values()), found


@pytest.mark.long
def test_a_calibration_of_another_rig_does_not_pass(tmp_path: Path) -> None:
    """The runner refuses it; where it comes through all the same, forces and moments contradict each other."""
    other = calibrated(tmp_path, SEED + 1)
    assert {f.code for f in serious(measure(tmp_path, other))} & {"rows-disagree", "misfit"}


def test_eight_angles_cannot_tell_the_ripple(tmp_path: Path) -> None:
    eight = calibrated(tmp_path, SEED, angles=8, settle_s=0.3, average_s=0.2)
    found = serious(measure(tmp_path, eight, angles=8))
    assert [f.code for f in found] == ["ripple-unresolved"]
    assert found[0].effect is Effect.INDETERMINATE


@pytest.mark.parametrize("wrong", [{"bias_A": 2.5}, {"angles": 12}])
def test_a_calibration_at_other_settings_is_refused(
    tmp_path: Path, calibration: Calibration, wrong: dict[str, float]
) -> None:
    with pytest.raises(ConfigError, match="|".join(wrong)):
        measure(tmp_path, calibration, **wrong)


def test_figures_show_both_rows_and_what_sharing_does(sound: Simulated) -> None:
    made = {f.key: f for f in procedure.drawn(sound.recording)}
    assert list(made) == ["force-y", "residuals-y", "angle-y", "sharing", "force-x", "angle-x"]
    shared, alone = made["sharing"].series
    assert shared.u is not None
    assert alone.u is not None
    assert alone.u[2] > 2 * shared.u[2]
    assert procedure.drawn(sound.recording)


@pytest.mark.parametrize(
    ("plan", "told"),
    [
        ({"levels_A": (-3, 0, 3)}, "at least five"),
        ({"levels_A": (0.5, 1, 1.5, 2, 2.5)}, "both signs"),
        ({"levels_A": (-2, -1, 1, 0, 2)}, "ascending"),
        ({"levels_A": (-12, -6, 0, 6, 12)}, "the range of i_y"),
        ({"ramp_A_s": 50.0}, "loses levitation within 17 ms"),
        ({"levels_A": (-6, -3, 0, 3, 6)}, "outboard AMB would need about 3."),
        ({"bias_A": 1.5}, "outboard AMB would need about"),
    ],
)
def test_what_cannot_work_is_refused_with_numbers(plan: dict[str, object], told: str) -> None:
    rig = load_rig("tsbs12")
    assert list(check(rig, Plan())) == []
    assert any(told in line for line in check(rig, Plan.model_validate(plan))), list(
        check(rig, Plan.model_validate(plan))
    )


def test_predicted_controls_by_hand() -> None:
    """Outboard at -3 A: (100.1 N 0.92 + 1.896 12.1 3 N) / 74.4 N/A."""
    found = predicted_controls(load_rig("tsbs12"), Plan())
    assert found["outboard"] == pytest.approx((100.06 * 0.92 + 1.896 * 36.3) / 74.4, rel=1e-3)


@pytest.mark.parametrize("kind", ["sensors", "channels", "parameters", "machine", "geometry"])
def test_what_the_rig_file_lacks_is_told_before_anything_starts(kind: str) -> None:
    rig = load_rig("tsbs12")
    name = {"sensors": "i_m3", "channels": "flags", "parameters": "i_ramp", "machine": "pole_pairs",
            "geometry": "motor_to_outboard_amb"}[kind]  # fmt: skip
    table = {k: v for k, v in getattr(rig, kind).items() if k != name}
    assert procedure.problems(rig.model_copy(update={kind: table}), Plan()) == (f"{kind}: found no {name}",)
