"""Slewing through the whole path: the loop that the rotor shows is the true one, and the detent is found in its torque."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reanalysed import reanalysed

from bench.calibration import Calibration
from bench.cli.virtual import simulate, simulated_run
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.limits import Verdict
from bench.record.outcomes import Outcome, outcome_of
from bench.record.records import measurement
from bench.record.specs import load_spec
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence
from procedures.slew import fit
from procedures.slew.fit import Gains, Swing
from procedures.slew.plan import Plan
from procedures.slew.procedure import MEASURES, check, needs, procedure, step_count
from reports.figures import draw as draw_figure
from sim_backend.truth import draw

QUICK = {"frequencies_hz": (0.2, 2.0), "periods": 4}
Found = tuple[dict[tuple[str, str], Estimate], list[Finding]]


def slewed(folder: Path, seed: int = 1, truth: Mapping[str, float] | None = None, **plan: Any) -> Found:
    _, results = simulate("slew", "tsbs12", seed, {**QUICK, **plan}, folder / "recording.mcap", truth)
    measured = {(m.quantity.name, m.where): m.estimate for m in results if isinstance(m, Measured)}
    return measured, [f for f in results if isinstance(f, Finding)]


@pytest.mark.parametrize("seed", [7, pytest.param(8, marks=pytest.mark.long)])
def test_the_detent_and_the_closed_loop_are_recovered(tmp_path: Path, seed: int) -> None:
    measured, findings = slewed(tmp_path, seed)
    assert findings == []
    assert {name for name, _ in measured} == {q.name for q in MEASURES}
    plant = draw(load_rig("tsbs12"), seed).plant
    detent = measured["detent", ""]
    assert abs(detent.value - plant.detent) < 2 * detent.u
    assert detent.u < 0.1 * detent.value
    # The loop: alpha (kp + ki/s + kd s / (1 + s T)) on J s^2 + B s, at 2 Hz.
    s = 2j * math.pi * 2.0
    gain = plant.alpha_tau * math.cos(8 * plant.gamma_zero) * float(np.mean(plant.segment_gain))
    loop = (
        gain * (50 + 50 / s + 0.5 * s / (1 + s / (2 * math.pi * 60))) / (plant.polar_inertia * s**2 + plant.viscous * s)
    )
    closed = loop / (1 + loop)
    ratio, lag = measured["amplitude_ratio", "2 Hz"], measured["lag", "2 Hz"]
    assert ratio.value == pytest.approx(abs(closed), abs=0.003)
    assert lag.value == pytest.approx(
        -cmath.phase(closed) / (4 * math.pi), abs=2 * lag.u + 0.3e-3
    )  # one sample of delay
    assert measured["error_rms", "2 Hz"].value == pytest.approx(0.4 * abs(1 - closed) / 2**0.5, rel=0.1)
    assert measured["error_rms", "2 Hz"].value > 5 * measured["error_rms", "0.2 Hz"].value  # it grows with frequency


def test_figures_and_steps(tmp_path: Path) -> None:
    slewed(tmp_path, motor_carries=True)
    recording = Recording.open(tmp_path / "recording.mcap", Plan)
    drawn = list(procedure.drawn(recording))
    assert [f.key for f in drawn] == ["following", "error-time", "error-angle", "growth", "torque-angle", "orders"]
    for figure in drawn:
        draw_figure(figure)
    assert len(recording.all_steps()) == step_count(recording.plan)


@pytest.mark.parametrize(
    ("defect", "code", "named"),
    [
        ({"encoder_sign": -1}, "encoder-direction", "encoder"),
        pytest.param({"exchange_segments": 1}, "segments-exchanged", "exchanged", marks=pytest.mark.long),
        ({"segment_sign_1": -1}, "segment-sign", "segment 1"),
        pytest.param({"detent": 0.2}, "large-detent", "catches", marks=pytest.mark.long),
        ({"coulomb": 0.5}, "friction", "rubs"),
        pytest.param({"factor_sine_amplitude": 0.997}, "reference-scaled", "another amplitude", marks=pytest.mark.long),
        pytest.param({"factor_sine_amplitude": 1.003}, "reference-scaled", "another amplitude", marks=pytest.mark.long),
        pytest.param({"drop_fraction": 0.005}, "missing-samples", "missing", marks=pytest.mark.long),
    ],
)
def test_a_planted_defect_is_named_and_never_passes(
    tmp_path: Path, defect: Mapping[str, float], code: str, named: str
) -> None:
    _, findings = slewed(tmp_path, 1, defect)
    found = [f for f in findings if f.code == code]
    assert found, [f.code for f in findings]
    assert found[0].effect is not Effect.NOTE
    assert named in found[0].text


def test_a_detent_beyond_its_limit_fails_the_run(tmp_path: Path) -> None:
    """The finding says of the detent what its limit says too: it puts what follows the angle in doubt, not the detent."""
    measured, findings = slewed(tmp_path, 1, {"detent": 0.2})
    (detent,) = (q for q in MEASURES if q.name == "detent")
    judged = measurement(detent.measured(measured["detent", ""]), load_spec("tsbs12", "slew")["detent"])
    assert judged.verdict is Verdict.FAIL
    assert outcome_of([judged], findings) is Outcome.FAIL


def test_no_detent_is_not_resolved(tmp_path: Path) -> None:
    measured, findings = slewed(tmp_path, 3, {"detent": 0.0})
    assert [f.code for f in findings] == ["detent-not-resolved"]
    assert measured["detent", ""].value < 1e-3


def test_a_calibrated_torque_constant_is_used(tmp_path: Path) -> None:
    assert needs(Plan()) == ()
    assert [n.procedure for n in needs(Plan(torque_constant="calibration"))] == ["torque-constant"]
    own = Influence(id="earlier/scatter", name="scatter", u=0.01, unit="N m/A", kind="A", distribution="normal", dof=20)
    values = {"alpha_tau": Estimate.of(5.74, own)}
    facts = {"torque-constant": Calibration("torque-constant", values, run_id="earlier", seed=1, sha256="0" * 64)}
    plan = {**QUICK, "torque_constant": "calibration"}
    run = simulated_run("slew", "tsbs12", 1, plan, tmp_path / "recording.mcap", None, facts)
    doubled, design = (
        next(m.estimate for m in r.results if isinstance(m, Measured) and m.quantity.name == "detent")
        for r in (run, reanalysed(run, torque_constant="design"))
    )
    assert doubled.value == pytest.approx(2 * design.value, rel=1e-6)
    assert "earlier/scatter" in doubled.contributions
    assert doubled.u / doubled.value < design.u / design.value


def test_plans_that_cannot_work_are_refused() -> None:
    rig = load_rig("tsbs12")
    assert list(check(rig, Plan())) == []
    assert "must cover" in next(iter(check(rig, Plan(amplitude_rad=0.1))))
    assert "frequencies_hz" in next(iter(check(rig, Plan(frequencies_hz=(30.0,)))))
    assert "torque current" in next(iter(check(rig, Plan(frequencies_hz=(8.0,)))))
    slow = rig.model_copy(update={"envelope": rig.envelope.model_copy(update={"max_speed_rad_s": 5.0})})
    assert "the envelope" in next(iter(check(slow, Plan())))
    bare = rig.model_copy(update={"machine": {}})
    assert "polar_inertia" in procedure.problems(bare, Plan())[0]


COUNT = 2 * math.pi / 4096
GAINS = Gains(50, 0.5, 60)


def swing(hz: float, periods: int, t_0: float, detent: tuple[float, float], counts: bool, seed: int = 0) -> Swing:
    """A rotor that follows exactly: inertia, friction, detent (A) and the onset of the controller in its torque current."""
    t = np.arange(0, 0.3 + (periods + 1.2) / hz, 1e-3)
    omega, on = 2 * math.pi * hz, t >= t_0
    angle = np.where(on, 0.4 * np.sin(omega * (t - t_0)), 0.0)
    speed = np.where(on, np.cos(omega * (t - t_0)), 0.0)
    torque = 0.02 * np.tanh(speed * 10) - 0.01 * angle + detent[0] * np.cos(16 * angle) + detent[1] * np.sin(16 * angle)
    torque += np.random.default_rng(seed).normal(0, 1.6e-3, len(t))
    if counts:
        angle = np.round(angle / COUNT) * COUNT
    none = np.zeros(0)
    return Swing(hz, 0.4, t, angle, torque, t_0 - 2e-3, t_0 + 8e-3, periods, none, none)


@settings(max_examples=15, deadline=None)
@given(c=st.floats(-0.02, 0.02), s=st.floats(-0.02, 0.02), counts=st.booleans())
def test_the_part_that_goes_with_the_angle_is_found(c: float, s: float, counts: bool) -> None:
    found = fit.passes(swing(0.2, 3, 0.2, (c, s), counts), 0.2, 16)
    assert found.cosine.mean() == pytest.approx(c, abs=5e-4)
    assert found.sine.mean() == pytest.approx(s, abs=5e-4)
    assert found.friction.mean() == pytest.approx(0.02, abs=2e-3)


@settings(max_examples=20, deadline=None)
@given(t_0=st.floats(0.2, 0.205), hz=st.sampled_from([1.0, 2.0]))
def test_the_start_is_read_from_the_onset(t_0: float, hz: float) -> None:
    s = swing(hz, 3, t_0, (0.0, 0.0), False)
    u = np.maximum(s.t - 0.5e-3 - t_0, 0)
    slope = 2 * math.pi * hz * 0.4
    onset = slope * (50 * u + 0.5 * (1 - np.exp(-u * 2 * math.pi * 60)))
    begun = Swing(hz, 0.4, s.t, s.angle, s.torque * 0 + onset, 0.199, 0.209, 3, s.shifted, s.shifts)
    assert fit.start(begun, GAINS) == pytest.approx(t_0, abs=1e-4)


def test_counts_are_taken_off_the_error() -> None:
    """A rotor that follows exactly has an error of counts only: 0.44 mrad rms by themselves, hardly anything without."""
    s = swing(0.2, 3, 0.2, (0.0, 0.0), True)
    found = fit.tracking(s, 0.2, COUNT)
    assert found.rms.max() < 0.1e-3
    assert found.ratio == pytest.approx(1, abs=1e-4)
    assert np.abs(found.lag).max() < 1e-4
    uncorrected = fit.tracking(s, 0.2, 0.0)
    assert uncorrected.rms.mean() == pytest.approx(COUNT / 12**0.5, rel=0.02)


def test_records_that_are_too_short_are_told() -> None:
    s = swing(0.2, 3, 0.2, (0.0, 0.0), False)
    short = Swing(
        s.hz, s.amplitude, s.t[:9000], s.angle[:9000], s.torque[:9000], s.earliest, s.latest, 3, s.shifted, s.shifts
    )
    with pytest.raises(AnalysisError, match="periods"):
        fit.tracking(short, 0.2, COUNT)
    with pytest.raises(AnalysisError, match="covers"):
        fit.passes(s, 0.2, 4)
