"""Sensitivity: against the linearised loop, planted defects, refused plans, the envelope."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amb_stand import AMB_ROTOR
from scipy.optimize import brentq

from bench.analysis import peaks
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.errors import InterlockError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.rigfile.envelope import Envelope
from bench.uncertainty import Estimate
from bench.units import RPM
from procedures.sensitivity import checks, estimates, margins
from procedures.sensitivity.injection import Comb, combs
from procedures.sensitivity.plan import Plan
from procedures.sensitivity.procedure import check, procedure
from procedures.sensitivity.steps import REFINED, WIRING, Taken, read_taken
from reports.figures import draw as draw_figure
from sim_backend.machines.amb5dof import truth_sensitivity
from sim_backend.truth import draw

pytestmark = pytest.mark.xdist_group("sensitivity")
SHORT: dict[str, Any] = {
    "modes_hz": (), "settle_s": 3.0, "start_s": 0.3, "refined_periods": 4, "high_hz": 500.0, "axes": ("zi",),
    "speeds_rad_s": (0.0,),
}  # fmt: skip
SEED = 1
TURNING: dict[str, Any] = {"law": "CCS", "speeds_rad_s": (4000 * math.pi / 30,)}


@dataclass(frozen=True)
class Run:
    measured: dict[tuple[str, str], Estimate]
    findings: list[Finding]
    recording: Recording[Any]
    taken: list[Taken]
    truth: Mapping[str, float]

    @property
    def serious(self) -> set[str]:
        return {f.code for f in self.findings if f.effect is not Effect.NOTE}


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """One axis at rest and turning."""
    path = tmp_path_factory.mktemp("sound") / "recording.mcap"
    run = simulated_run("sensitivity", "amb5dof", SEED, {**SHORT, "speeds_rad_s": (0.0, 6000 / RPM)}, path)
    measured = {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}
    findings = [f for f in run.results if isinstance(f, Finding)]
    return Run(measured, findings, run.recording, read_taken(run.recording), truth_of_motion(run))


@pytest.fixture(scope="module")
def settings() -> dict[str, float]:
    return {n: p.default for n, p in load_rig("amb5dof").parameters.items()} | AMB_ROTOR.select("PID")


def test_nothing_is_found_on_a_sound_stand(sound: Run) -> None:
    assert not sound.serious
    assert {f.code for f in sound.findings} == {"zone", "margins", "injection", "orders-excluded", "scope"}
    for where in ("zi, at rest", "zi, 6000 r/min"):
        assert {"s_max", "s_max_hz", "phase_margin", "gain_reduction"} <= {n for n, w in sound.measured if w == where}


def test_s_max_is_that_of_the_linearised_loop(sound: Run) -> None:
    """At rest the closed form; turning, the quiet machine with its unbalance and runout."""
    for where in ("zi, at rest", "zi, 6000 r/min"):
        value, hz = (sound.truth[f"{name}@{where}"] for name in ("s_max", "s_max_hz"))
        s_max, at = sound.measured["s_max", where], sound.measured["s_max_hz", where]
        assert s_max.value == pytest.approx(value, abs=3 * s_max.u)
        assert at.value == pytest.approx(hz, abs=3.5 * at.u)
        assert s_max.u < 0.01 * value


def test_margins_are_those_of_the_linearised_loop(sound: Run, settings: Mapping[str, float]) -> None:
    loop = truth_sensitivity.loop(draw(load_rig("amb5dof"), SEED).plant, settings)
    open_loop = 1 / loop.sensitivity(np.geomspace(2.0, 500.0, 4000))[:, 1] - 1
    for name, value in (
        ("phase_margin", margins.phase(open_loop)),
        ("gain_reduction", margins.fall(open_loop)),
    ):
        e = sound.measured[name, "zi, at rest"]
        assert e.value == pytest.approx(value, abs=4 * e.u + 0.01 * value)


def test_the_refined_grid_is_fine_and_the_orders_are_left_out(sound: Run) -> None:
    for t in (t for t in sound.taken if t.kind == REFINED):
        model = next(estimates.found_peaks([t])).model
        assert t.grid.step <= model.width(75.0) / 2
    excluded = {hz for t in sound.taken if t.speed for hz in t.excluded}
    assert {97.0, 101.0, 197.0, 201.0} <= excluded
    assert not any(t.excluded.size for t in sound.taken if not t.speed)


def test_figures(sound: Run) -> None:
    drawn = list(procedure.drawn(sound.recording))
    assert {f.key for f in drawn} == {
        f"{k}-{rpm}" for k in ("sensitivity", "bode", "nyquist", "coherence") for rpm in (0, 6000)
    }
    assert len(drawn[0].bands) == 4
    for figure in drawn:
        draw_figure(figure)


def _follow(axis: str, value: complex) -> Any:
    out = np.zeros(5, complex)
    out[AMB_ROTOR.all_axes.index(axis)] = value
    return out


@pytest.mark.parametrize(
    ("change", "code", "effect"),
    [
        ({"flags": 64}, "sensor-clipped", Effect.ERROR),
        ({"clips": 20}, "sensor-clipped", Effect.ERROR),
        ({"flags": 4}, "contact", Effect.INDETERMINATE),
        ({"flags": 1}, "current-saturated", Effect.INDETERMINATE),
        ({"flags": 2}, "voltage-saturated", Effect.INDETERMINATE),
        ({"clipped": 1e-3}, "injection-clipped", Effect.INDETERMINATE),
        ({"follows": _follow("yo", 0.9)}, "wrong-axis", Effect.ERROR),
        ({"follows": _follow("zi", -0.9)}, "coils-exchanged", Effect.ERROR),
        ({"lost": 50, "expected": 1000}, "missing-samples", Effect.INDETERMINATE),
        ({"turning": 300.0, "speed": 350.0}, "speed-off", Effect.INDETERMINATE),
    ],
)
def test_what_is_wrong_with_a_capture_is_named(sound: Run, change: dict[str, Any], code: str, effect: Effect) -> None:
    survey = next(t for t in sound.taken if t.kind == WIRING)
    assert not list(checks.of_signals([survey], sound.recording.plan))
    found = list(checks.of_signals([dataclasses.replace(survey, **change)], sound.recording.plan))
    assert [(f.code, f.effect) for f in found] == [(code, effect)]
    if code == "wrong-axis":
        assert "those of yo do" in found[0].text


def test_an_amplitude_that_is_not_the_one_asked_for(sound: Run) -> None:
    survey = sound.taken[0]
    half = dataclasses.replace(survey, injected=survey.injected / 2)
    assert [f.code for f in checks.of_signals([half], sound.recording.plan)] == ["injection-wrong"]


def test_what_is_wrong_with_a_peak_is_named(sound: Run) -> None:
    """Too coarse a grid, no coherence, another S at half the amplitude, a maximum elsewhere, a machine that changes."""
    plan = sound.recording.plan
    result = estimates.results([t for t in sound.taken if not t.speed])[0]
    peak = result.peaks[0]

    def codes(*peaks: Any) -> set[str]:
        found = checks.of_results([dataclasses.replace(result, peaks=peaks)], plan)
        return {f.code for f in found if f.effect is not Effect.NOTE}

    replace = dataclasses.replace
    assert codes(peak) == set()
    assert codes() == {"peak-not-refined"}
    assert codes(replace(peak, top=replace(peak.top, width=1.0))) == {"grid-too-coarse"}
    assert codes(replace(peak, coherence=0.5)) == {"coherence-low"}
    assert codes(replace(peak, change=0.2, u_change=0.01)) == {"not-linear"}
    assert codes(replace(peak, top=replace(peak.top, inside=False))) == {"peak-not-refined"}
    assert codes(replace(peak, model=replace(peak.model, probability=1e-6))) == {"not-explained"}
    unlikely = replace(peak, model=replace(peak.model, probability=7e-4))  # of one peak, but not of the worst of two
    assert codes(unlikely) == {"not-explained"}
    assert not codes(unlikely, peak)
    elsewhere = replace(result.curve, values=np.where(result.curve.hz > 300, 9.0, result.curve.values))
    found = checks.of_results([replace(result, curve=elsewhere)], plan)
    assert "peak-not-refined" in {f.code for f in found}


def test_zones() -> None:
    assert [checks.zone(s) for s in (1.0, 2.99, 3.0, 3.99, 4.5, 5.0)] == list("AABBCD")


def test_plans_that_cannot_work_are_refused() -> None:
    rig = load_rig("amb5dof")

    def why(**plan: Any) -> str:
        return "; ".join(check(rig, Plan(**{**rig.plans["sensitivity"], **plan})))

    assert why() == ""
    assert why(law="CCS", speeds_rad_s=(0.0, 14000 / RPM)) == ""
    assert (
        "amplitude_A: found 0.05 A for each of 128 lines; expected less: injection: found a peak of 0.88 A; the envelope allows"
        in why(amplitude_A=0.05)
    )
    assert "folds back" in why(rate_hz=2000.0)
    assert "envelope" in why(speeds_rad_s=(0.0, 1600.0))
    assert "landing" in why(speeds_rad_s=(20.0,))
    assert "power of two" in why(low_hz=3.0)
    assert "memory" in why(periods=40)
    assert "each once" in why(axes=("yi", "yi"))
    assert "found none" in "; ".join(procedure.problems(rig.model_copy(update={"capture": None}), Plan()))
    bare = rig.model_copy(update={"devices": {k: d for k, d in rig.devices.items() if k != "drive"}})
    assert "nothing turns" in next(iter(check(bare, Plan(speeds_rad_s=(0.0, 1000.0)))))


def test_a_refused_injection_names_what_asks_for_it() -> None:
    """A line beyond its parameter's range is not the amplitude's fault, nor is an envelope that allows no injection."""
    rig = load_rig("amb5dof")

    def why(changed: Any) -> str:
        return "; ".join(check(changed, Plan(**rig.plans["sensitivity"])))

    def narrowed(name: str, **to: float) -> Any:
        found = rig.parameters[name].model_copy(update=to)
        return rig.model_copy(update={"parameters": {**rig.parameters, name: found}})

    lines = why(narrowed("inject_lines", high=64.0))
    assert lines.startswith("capabilities.injection.lines: found 128 lines at once: parameter inject_lines: ")
    assert "range in the rig file" in lines
    assert "amplitude" not in lines
    assert why(narrowed("inject_step", high=3.0)).startswith("low_hz, high_step_hz, scan_step_hz: found ")
    assert why(narrowed("inject_hz", high=300.0)).startswith("low_hz, high_hz: found lines from ")
    none = rig.model_copy(update={"envelope": rig.envelope.model_copy(update={"max_injection_A": 0.0})})
    assert why(none).startswith(
        "envelope.max_injection_A: found none; expected what may be added to a current reference, A: "
    )


def test_no_injection_leaves_the_envelope() -> None:
    """What a comb may reach is never less than what it does reach, and the envelope refuses it."""
    envelope = Envelope(load_rig("amb5dof"))
    envelope.check_injection(0.25)
    for peak in (0.26, 0.0, math.nan):
        with pytest.raises(InterlockError, match="max_injection_A"):
            envelope.check_injection(peak)
    t = np.arange(5000) * 1e-4
    for count in (1, 2, 3, 5, 17, 64, 128):
        k = np.arange(count)
        phases = 2 * math.pi * np.outer(t, 2.0 + 2.0 * k) - math.pi * k * (k + 1) / count
        comb = Comb(2.0, 2.0, count, 0.004)
        assert np.abs(0.004 * np.sin(phases).sum(axis=1)).max() <= comb.peak * (1 + 1e-9)
    assert [c.count for c in combs(2.0, 2.0, 600.0, 1e-3)] == [128, 128, 44]
    assert Comb(262.0, 16.0, 4, 1e-3).period_s == 0.5


@pytest.mark.long
@pytest.mark.parametrize(
    ("truth", "plan", "code", "effect"),
    [
        ({"position_sign_zi": -1.0}, {}, "sensor-polarity", Effect.ERROR),
        ({"told_planes": 1.0}, {}, "planes-exchanged", Effect.ERROR),
        ({"told_axes": 1.0}, {}, "axes-exchanged", Effect.ERROR),
        ({"factor_inject_axis": 2.0}, {}, "wrong-axis", Effect.ERROR),
        ({"factor_inject_amplitude": 0.5}, {}, "injection-wrong", Effect.ERROR),
        ({"current_sign_i": -1.0}, {}, "coils-exchanged", Effect.ERROR),
        ({}, {"rate_hz": 1000.0}, "aliasing", Effect.ERROR),
        ({"position_range": 78e-6, "unbalance_i": 1.05e-5, "unbalance_o": 1.05e-5}, TURNING, "sensor-clipped", Effect.ERROR),
        ({"supply_V": 12.0, "inductance": 60e-3}, {}, "voltage-saturated", Effect.INDETERMINATE),
        ({"factor_inject_amplitude": 0.0}, {}, "injection-wrong", Effect.ERROR),
        ({"geometry.clearance": 50e-6}, TURNING, "ring-too-near", Effect.ERROR),
        ({"unbalance_i": 1.3e-5, "unbalance_o": 1.3e-5}, TURNING, "contact", Effect.INDETERMINATE),
        ({"position_noise": 6e-6}, {"amplitude_A": 1e-3}, "coherence-low", Effect.INDETERMINATE),
        ({"drop_fraction": 0.01}, {}, "missing-samples", Effect.INDETERMINATE),
    ],
)  # fmt: skip
def test_a_planted_defect_is_named_and_never_passes(
    tmp_path: Path, truth: Mapping[str, float], plan: Mapping[str, Any], code: str, effect: Effect
) -> None:
    run = simulated_run("sensitivity", "amb5dof", SEED, {**SHORT, **plan}, tmp_path / "recording.mcap", truth)
    found = [f for f in run.results if isinstance(f, Finding) and f.code == code]
    assert found, [f.code for f in run.results if isinstance(f, Finding)]
    assert found[0].effect is effect
    list(procedure.drawn(run.recording))  # what can be drawn is drawn


@pytest.mark.long
def test_planes_exchanged_within_the_loop_do_not_levitate(tmp_path: Path) -> None:
    run = simulated_run("sensitivity", "amb5dof", SEED, SHORT, tmp_path / "recording.mcap", {"exchange_planes": 1.0})
    assert any(isinstance(f, Finding) and f.effect is Effect.ERROR for f in run.results)
    assert not any(isinstance(m, Measured) for m in run.results)


@pytest.mark.parametrize("crossing", [2.5, 3.1, 4.0, 5.3, 9.1])
def test_how_far_a_gain_may_fall_between_the_lowest_lines(crossing: float) -> None:
    """L = -K (1 + T s + w/s)/(1 - s²/w0²) is real and negative at s = j sqrt(w/T), where it is -K/(1 + w/(T w0²)): by hand.
    Straight lines from one line of the survey to the next are off by 0.4 to 0.9 %."""
    gain, damping, pole = 3.4, 1 / (2 * math.pi * 20), 2 * math.pi * 30
    integral = damping * (2 * math.pi * crossing) ** 2
    hz = np.arange(2, 256, 4.0)
    s = 2j * math.pi * hz
    loop = -gain * (1 + damping * s + integral / s) / (1 - s**2 / pole**2)
    found = margins.fall(margins.between(hz, loop))
    assert found == pytest.approx((1 + integral / damping / pole**2) / gain, rel=2.5e-3)


def test_how_far_a_gain_may_rise_is_not_where_noise_crosses_the_axis() -> None:
    """A first-order loop with delay, K e^(-s D)/(1 + s T), has |L| where its angle is -180° by bisection. Each of 40 draws of
    lines with 7 % of noise gives a value; none is further off than its u says, and together they lie about it: lines that
    are weighed by |S| as read, and not by the smooth one, pull |L| up."""
    gain, constant, delay = 1.19, 1 / (2 * math.pi * 25), 1 / 600
    w = brentq(lambda w: w * delay + math.atan(w * constant) - math.pi, 1.0, 1e4)
    true = math.hypot(1, w * constant) / gain
    hz = np.concatenate([np.arange(2, 256, 4.0), np.arange(264, 2000, 16.0)])
    s = 2j * math.pi * hz
    exact = 1 / (1 + gain * np.exp(-s * delay) / (1 + s * constant))
    power, off = 0.07**2 * np.abs(exact) ** 2, []
    covariance = power[:, None, None] / 2 * np.eye(2)
    for seed in range(40):
        z = exact + peaks.noise(covariance, seed + 1, 1)[0]
        drawn, smooth = peaks.noise(covariance, 0, margins.DRAWS), peaks.smoother(hz, z, covariance)
        found = margins._least(hz, z, smooth.at_lines(z), power, drawn, smooth)
        assert found is not None
        off.append((found[0] - 1 / true) / found[1])
    assert np.abs(off).max() < 4.0
    assert np.std(off) == pytest.approx(1.0, abs=0.3)
    assert abs(np.mean(off)) < 0.3
