"""Tracking through the whole path: the printed effects A4, what the telemetry's means hide, and planted defects."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amb_stand import AMB_ROTOR
from bearing_facts import known
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulate, simulated_run
from bench.errors import AnalysisError, BenchError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.rigfile.roles import Status
from bench.uncertainty import Estimate
from procedures.amb_rotor.geometry import Edge, Facts
from procedures.synchronous import bearings
from procedures.tracking import checks, drift, estimates
from procedures.tracking import ellipse as estimator
from procedures.tracking.ellipse import Path as Orbit
from procedures.tracking.ellipse import Wave
from procedures.tracking.plan import Plan
from procedures.tracking.procedure import OF_POINTS, check, procedure, step_count
from procedures.tracking.steps import read_orbits
from procedures.unbalance import procedure as unbalance
from reports.figures import draw as draw_figure
from sim_backend.machines.amb5dof import truth_track
from sim_backend.truth import draw

OBSERVED = {**AMB_ROTOR.variants["corrected"], **AMB_ROTOR.poles}

RIGS = Path(__file__).parents[2] / "rigs"
QUICK = {"revolutions": 8, "settle_s": 1.5}
ONE = {"laws": ("CCS",), "compare": ()}
Found = tuple[dict[tuple[str, str], Estimate], list[Finding]]


def tracked(
    folder: Path, seed: int = 1, truth: Mapping[str, float] | None = None, rig: str = "amb5dof", **plan: Any
) -> Found:
    _, results = simulate("tracking", rig, seed, {**QUICK, **plan}, folder / "recording.mcap", truth)
    measured = {(m.quantity.name, m.where.split(",")[0]): m.estimate for m in results if isinstance(m, Measured)}
    return measured, [f for f in results if isinstance(f, Finding)]


def agree(
    measured: Mapping[tuple[str, str], Estimate], law: str, seed: int, orbit: Mapping[str, float], **more: float
) -> None:
    """Every quantity but the distance to the rings is that of the same machine without noise, within 3.5 u."""
    rig = load_rig("amb5dof")
    settings = {name: p.default for name, p in rig.parameters.items()} | more | AMB_ROTOR.select(law)
    for name, value in truth_track.truth(draw(rig, seed).plant, settings, settle_s=1.5, **orbit).items():
        e = measured[name, law]
        assert e.value == pytest.approx(value, abs=3.5 * e.u), (name, law)


def test_what_a_gain_truly_changes_is_in_the_truth(tmp_path: Path) -> None:
    """A rotor whose probe reads 0.8 % too much follows a smaller ellipse at that probe: no error of the run."""
    run = simulated_run("tracking", "amb5dof", 1, {**QUICK, **ONE}, tmp_path / "recording.mcap", {"pos_yi.gain": 1.008})
    true = truth_of_motion(run)
    found = {f"{m.quantity.name}@{m.where}": m.estimate for m in run.results if isinstance(m, Measured)}
    assert {name.split("@")[0] for name in found.keys() - true.keys()} == {"ring_distance"}
    for name, value in true.items():
        assert found[name].value == pytest.approx(value, abs=3.5 * found[name].u), name


def test_a4_flatness_follows_and_the_pid_touches(tmp_path: Path) -> None:
    """T 2.6.2: CCS and CAC within 3 um and 45 urad, CAC by the upper coils alone; PID over 20 um, and on the ring at 100 um."""
    measured, findings = tracked(tmp_path)
    assert {name for name, _ in measured} == {q.name for q in procedure.on(load_rig("amb5dof")).measures} - {
        q.name for q in OF_POINTS
    }
    assert {law for _, law in measured} == {"CCS", "CAC"}
    for law in ("CCS", "CAC"):
        for axis in "yz":
            peak = measured[f"error_peak_{axis}", law]
            assert 0.5e-6 < peak.value < 3e-6
            assert measured[f"error_rms_{axis}", law].value < peak.value < 3 * measured[f"error_rms_{axis}", law].value
        assert max(measured[f"tilt_{name}", law].value for name in ("psi", "theta")) < 45e-6
        agree(measured, law, 1, {"hz": 10.0, "y": 50e-6, "z": 80e-6})
    assert abs(measured["lower_current", "CAC"].value) < 0.01
    assert measured["lower_current", "CCS"].value > 0.8
    assert {f.code for f in findings} == {"contact", "laws-compared"}
    assert all(f.effect is Effect.NOTE for f in findings)
    assert findings[0].where.startswith("PID")
    recording = Recording.open(tmp_path / "recording.mcap", Plan)
    assert len(recording.all_steps()) == step_count(recording.plan)
    drawn = list(procedure.drawn(recording))
    assert [f.key for f in drawn][:5] == ["orbit", "ring-inboard", "ring-outboard", "error-y", "error-z"]
    for figure in drawn:
        draw_figure(figure)


def test_a_wide_ring_shows_the_pids_error_without_contact(tmp_path: Path) -> None:
    for kind in ("toml", "dbc"):
        text = (
            (RIGS / f"amb5dof.{kind}").read_text().replace("clearance = { value = 0.1,", "clearance = { value = 0.15,")
        )
        (tmp_path / f"wide.{kind}").write_text(text.replace("amb5dof.dbc", "wide.dbc"))
    measured, findings = tracked(tmp_path, 1, rig=str(tmp_path / "wide.toml"), laws=("PID",), compare=())
    assert max(measured[f"error_peak_{axis}", "PID"].value for axis in "yz") > 20e-6
    assert "contact" not in {f.code for f in findings}


@pytest.mark.parametrize(
    ("defect", "code", "named"),
    [
        ({"position_sign_zo": -1}, "sensor-polarity", "polarity"),
        pytest.param({"exchange_planes": 1}, "lift-lost", "planes", marks=pytest.mark.long),
        ({"exchange_axes": 1}, "lift-lost", "y and z"),
        pytest.param({"told_planes": 1}, "planes-exchanged", "planes", marks=pytest.mark.long),
        ({"told_axes": 1}, "axes-exchanged", "y and z"),
        pytest.param({"position_range": 76e-6}, "sensor-clipped", "clips", marks=pytest.mark.long),
        pytest.param({"position_range": 60e-6}, "stuck-channel", "range", marks=pytest.mark.long),
        ({"factor_ellipse_on": 0}, "reference-missing", "not applied"),
        pytest.param({"factor_ellipse_hz": 1.02}, "reference-frequency", "10.2 Hz", marks=pytest.mark.long),
        ({"factor_ellipse_hz": 1.00002}, "reference-frequency", "10.000"),  # 0.1 ms and 6 mrad since the start
        pytest.param({"supply_V": 12.0, "inductance": 60e-3}, "voltage-saturated", "voltage", marks=pytest.mark.long),
        pytest.param({"drop_fraction": 0.005}, "missing-samples", "missing", marks=pytest.mark.long),
    ],
    ids=lambda x: "-".join(x) if isinstance(x, dict) else "",
)
def test_a_planted_defect_is_named_and_never_passes(
    tmp_path: Path, defect: Mapping[str, float], code: str, named: str
) -> None:
    _, findings = tracked(tmp_path, 1, defect, **ONE)
    found = [f for f in findings if f.code == code]
    assert found, [(f.code, f.text) for f in findings]
    assert any(f.effect is not Effect.NOTE for f in found)
    assert any(named in f.text for f in found)


def test_a_figure_of_lissajous_is_followed(tmp_path: Path) -> None:
    measured, findings = tracked(tmp_path, hz=5.0, ratio=2, y_m=60e-6, z_m=40e-6, **ONE)
    assert findings[0].code == "laws-compared"
    for axis in "yz":
        assert measured[f"error_peak_{axis}", "CCS"].value < 3e-6
        assert measured[f"amplitude_ratio_{axis}", "CCS"].value == pytest.approx(1, abs=0.03)


def test_contact_that_the_controller_does_not_report_is_named(tmp_path: Path) -> None:
    _, findings = tracked(tmp_path, 1, {"contact_silent": 1}, laws=("PID",), compare=())
    found = {f.code: f.effect for f in findings}
    assert found["contact-unreported"] is Effect.INDETERMINATE
    assert "contact" not in found


def test_contact_of_a_law_under_test_never_passes(tmp_path: Path) -> None:
    _, findings = tracked(tmp_path, 1, laws=("PID",), compare=())
    assert {f.code: f.effect for f in findings}["contact"] is Effect.INDETERMINATE


def test_a_touch_of_the_axial_stop_is_contact(tmp_path: Path) -> None:
    """As in every other procedure of the stand; the radial probes, which cannot show it, do not speak against it."""
    run = simulated_run("tracking", "amb5dof", 1, {**QUICK, **ONE}, tmp_path / "recording.mcap")
    (orbit,), plan = read_orbits(run.recording), run.recording.plan
    flags = orbit.flags | np.where(np.arange(orbit.flags.size) < orbit.flags.size // 10, Status.CONTACT_AXIAL, 0)
    results = estimates.by_law([orbit], run.recording.rig, plan.runout_m)
    found = {f.code: f for f in checks.of_results([replace(orbit, flags=flags)], results, plan)}
    assert found["contact"].effect is Effect.INDETERMINATE
    assert "the axial stop in 10.0%" in found["contact"].text
    assert "ring" not in found["contact"].text
    assert "contact in 10%" in found["laws-compared"].text
    assert "contact-not-seen" not in found


def test_a8_the_error_at_speed_is_within_two_and_a_half_micrometres(tmp_path: Path) -> None:
    """T 3.5, Fig. 3.6: 90 um by 40 um at 2 Hz and 10 000 r/min, averaged over a revolution of the shaft."""
    fast = {"speed_rad_s": 10000 * math.pi / 30, "hz": 2.0, "y_m": 90e-6, "z_m": 40e-6, "revolutions": 6}
    measured, findings = tracked(tmp_path, 1, **ONE, **fast)
    assert {f.effect for f in findings} == {Effect.NOTE}
    for axis in "yz":
        e = measured[f"error_peak_{axis}", "CCS"]
        assert e.value + 2 * e.u < 2.5e-6
    orbit = {"hz": 2.0, "y": 90e-6, "z": 40e-6, "speed": 10000 * math.pi / 30}
    agree(measured, "CCS", 1, orbit, **OBSERVED)


def test_a_drive_that_is_too_weak_ends_the_run(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match="OVERLOAD"):
        tracked(tmp_path, 1, {"drive_limit": 0.002}, speed_rad_s=1000.0, hz=2.0, **ONE)


def test_plans_that_cannot_work_are_refused() -> None:
    rig = load_rig("amb5dof")
    assert list(check(rig, Plan())) == []
    assert "ring" in next(iter(check(rig, Plan(y_m=97e-6))))
    assert "jump" in next(iter(check(rig, Plan(z_m=10e-6))))
    assert "envelope" in next(iter(check(rig, Plan(speed_rad_s=1600.0))))
    assert "ten times" in next(iter(check(rig, Plan(speed_rad_s=500.0))))
    assert "laws: found one twice" in next(iter(check(rig, Plan(laws=("CCS", "CCS")))))
    assert "compare: found one twice" in next(iter(check(rig, Plan(compare=("PID", "PID")))))
    assert list(check(rig, Plan(laws=("PID",)))) == []  # what is judged is beside the others already
    assert Plan(laws=("PID",)).order == ("PID",)
    assert "role drive" in next(iter(check(rig.model_copy(update={"devices": {"controller": rig.devices["controller"]}}),
                                           Plan(speed_rad_s=1000.0))))  # fmt: skip
    assert procedure.problems(load_rig("tsbs12"), Plan())


L_IS, L_OS = 0.078, 0.1
RINGS = (Edge(0, None, 1e-4), Edge(1, None, 1e-4))
FACTS = Facts((1.0,) * 4, (0.0,) * 4, (-L_IS, -L_IS, L_OS, L_OS), (0.0, math.pi / 2) * 2, 0.0123, RINGS)


def orbit(hz: float, turn_s: float = 0.0, lag: float = 0.0, ratio: float = 1.0, tilt: float = 0.0) -> Orbit:
    """Exact means of ten ticks of a rotor that follows with a ratio and a lag in s, tilted about z by a constant; vibrating
    by 8 um when it turns."""
    wave = Wave(hz, 50e-6, 80e-6, 1e-4, 10)
    end = np.arange(1, round(10e3 / hz) + 1) * 1e-3
    reads = end[:, None] - 1e-4 * np.arange(1, 11)
    turn = 2 * math.pi * hz * (reads - FACTS.t_0 - lag)
    y, z = 50e-6 * ratio * np.sin(turn), 80e-6 * ratio * np.cos(turn)
    if turn_s:
        y, z = y + 8e-6 * np.cos(2 * math.pi * reads / turn_s), z + 8e-6 * np.sin(2 * math.pi * reads / turn_s)
    at = [(y - L_IS * tilt), z, (y + L_OS * tilt), z]
    return Orbit(wave, end, np.array([x.mean(axis=1) for x in at], np.float64), turn_s)


@settings(max_examples=20, deadline=None)
@given(hz=st.sampled_from([2.0, 10.0, 37.0]), ratio=st.floats(0.8, 1.3), lag=st.floats(-1e-3, 1e-3))
def test_means_of_ten_ticks_cost_nothing(hz: float, ratio: float, lag: float) -> None:
    """Without the half millisecond that a mean is late, 10 Hz would be 35 mrad or 2.8 um behind."""
    found = estimator.quantities(estimator.turns(orbit(hz, lag=lag, ratio=ratio), FACTS))
    for axis, size in (("y", 50e-6), ("z", 80e-6)):
        assert found[f"amplitude_ratio_{axis}"] == pytest.approx(ratio, rel=1e-6)
        assert found[f"phase_lag_{axis}"] == pytest.approx(2 * math.pi * hz * lag, abs=1e-6)
        whole = size * abs(ratio * np.exp(-2j * math.pi * hz * lag) - 1)
        assert found[f"error_peak_{axis}"] == pytest.approx(whole, rel=0.03, abs=2e-8)


def test_a_turn_of_the_shaft_averages_its_vibration_away() -> None:
    found = estimator.quantities(estimator.turns(orbit(2.0, turn_s=6e-3, tilt=20e-6), FACTS))
    assert max(found["error_peak_y"], found["error_peak_z"]) < 0.05e-6
    assert found["tilt_theta"] == pytest.approx(20e-6, rel=1e-3)
    assert found["ring_distance"] < 100e-6 - 86e-6


def test_a_frequency_that_is_off_by_the_least_shows_in_the_drift_of_the_delays() -> None:
    """By hand: told 10 Hz, it runs at 10.01 Hz; after 100 revolutions it is 10 ms ahead of what is taken for its phase."""
    true = orbit(10.01)
    told = replace(true, wave=replace(true.wave, hz=10.0))
    found = drift.drift(told, FACTS)
    assert found is not None
    assert found.off == pytest.approx(1e-3, rel=1e-3)
    assert found.ahead_s == pytest.approx(1e-3 * (true.t[-1] - FACTS.t_0), rel=1e-3)
    assert found.plain
    assert drift.drift(replace(told, t=told.t[:300], readings=told.readings[:, :300]), FACTS) is None


def test_a_drift_of_scatter_alone_is_students_t() -> None:
    """At five levels of alarm, on 4000 draws of ten revolutions; y scatters by what its smaller amplitude makes of it."""
    rng, t = np.random.default_rng(5), np.arange(10) * 0.1
    drawn = [drift.line(t, rng.normal(size=(10, 2)) * [1.6e-5, 1e-5], np.array([50.0, 80.0]), 1.0)
             for _ in range(4000)]  # fmt: skip
    ratios = np.abs([d.off / d.u for d in drawn])
    assert {d.dof for d in drawn} == {17}
    for level in (0.5, 0.2, 0.05, 0.01, 0.002):
        beyond = float((ratios > stats.t.ppf(1 - level / 2, 17)).mean())
        assert beyond == pytest.approx(level, abs=3.3 * math.sqrt(level * (1 - level) / 4000))


def test_a_record_that_is_too_short_is_told() -> None:
    whole = orbit(10.0)
    with pytest.raises(AnalysisError, match="revolutions"):
        estimator.revolutions(Orbit(whole.wave, whole.t[:300], whole.readings[:, :300], 0.0))


def test_a_certificate_has_one_name_in_all_procedures() -> None:
    """Else results that share a probe would count as independent."""
    rig = load_rig("amb5dof")
    here = {i.id for i in estimates.inputs(rig, 1e-4, 0.0)} - {"timing/start", "geometry/clearance"}
    there = {i.id for e in bearings.collect_inputs(rig, known(unbalance.Plan())).values() for i in e.sensitivities}
    assert here
    assert here <= there
