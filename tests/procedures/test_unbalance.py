"""Unbalance and its compensation: against what the shaft really does, A2, A5, A6, planted defects, refused plans."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amb_stand import AMB_ROTOR
from bearing_facts import bearings, known

from bench.analysis.vectors import radius2
from bench.cli.virtual import given, simulated_run
from bench.errors import BenchError
from bench.figures import Figure
from bench.findings import Effect, Finding
from bench.procedure import Measured, Quantity
from bench.record.limits import Limit
from bench.record.outcomes import outranking
from bench.record.records import measurement
from bench.record.specs import applied, load_spec
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.rigfile.roles import Status
from bench.uncertainty import Estimate, Influence, interval
from procedures.amb_rotor.conventions import conventions
from procedures.compensation import procedure as compensation
from procedures.synchronous import checks, dwells, estimates, runout
from procedures.synchronous import d_max as unbalance_d_max
from procedures.synchronous.bearings import describe
from procedures.synchronous.coil_peaks import blocks, find_uncertified
from procedures.synchronous.dwells import SLOW, read_dwells
from procedures.synchronous.estimates import Results
from procedures.synchronous.unexplained import UNEXPLAINED
from procedures.unbalance import procedure as unbalance
from procedures.unbalance.procedure import check
from reports.figures import draw as draw_figure
from sim_backend.machines.amb5dof import truth_unbalance
from sim_backend.machines.amb5dof.params import AmbParams
from sim_backend.truth import draw

pytestmark = pytest.mark.xdist_group("unbalance")  # one worker makes the sound run once
RPM = math.pi / 30
SHORT = {"slow_s": 4.2, "dwell_s": 0.8, "capture_s": 0.2, "settle_s": 1.0, "repeat": False}
ONE = {**SHORT, "speeds_rad_s": (3000 * RPM,)}
SEED = 1


@dataclass(frozen=True)
class Run:
    measured: dict[tuple[str, str], Estimate]
    findings: list[Finding]
    recording: Recording[Any]
    results: Results
    plant: AmbParams

    @property
    def serious(self) -> set[str]:
        return {f.code for f in self.findings if f.effect is not Effect.NOTE}


def done(folder: Path, procedure: str, plan: Mapping[str, Any], truth: Mapping[str, float] | None = None) -> Run:
    run = simulated_run(procedure, "amb5dof", SEED, plan, folder / "recording.mcap", truth)
    measured = {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}
    findings = [f for f in run.results if isinstance(f, Finding)]
    plan_ = run.recording.plan
    results = estimates.results(read_dwells(run.recording), run.recording.rig, known(plan_))
    return Run(measured, findings, run.recording, results, draw(load_rig("amb5dof"), SEED, truth).plant)


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Two speeds with and without compensation, the literal observer at the higher one, and the switch."""
    plan = {**SHORT, "speeds_rad_s": (2000 * RPM, 10000 * RPM), "literal_rad_s": (10000 * RPM,), "after_s": 0.6}
    return done(tmp_path_factory.mktemp("compared"), "compensation", plan)


def test_nothing_is_found_on_a_sound_stand(compared: Run) -> None:
    assert not compared.serious
    assert {f.code for f in compared.findings} == {
        "slow-roll",
        "ellipse",
        "zone",
        "bearings",
        "reduction-told",
        "runout-followed",
    }
    assert len(compared.recording.all_steps()) == compensation.step_count(compared.recording.plan)
    assert {name for name, _ in compared.measured} == {q.name for q in compensation.MEASURES}


def test_vectors_are_what_the_shaft_really_does(compared: Run) -> None:
    """Component by component and D_max, with and without compensation, within the intervals."""
    defaults = {n: p.default for n, p in load_rig("amb5dof").parameters.items()}
    away = []
    for r in compared.results.dwells:
        if r.dwell.variant == "literal":
            continue  # its limit cycle is not the other plant's
        settings = {**defaults, **AMB_ROTOR.poles, **AMB_ROTOR.variants[r.dwell.variant], **AMB_ROTOR.select("CCS")}  # type: ignore[index]
        true = truth_unbalance.motion(compared.plant, settings, r.dwell.speed)
        for k, axis in enumerate(AMB_ROTOR.axes):
            for name, value in (("vector_cos", true.shaft[k].real), ("vector_sin", -true.shaft[k].imag)):
                e = r.estimates[name, axis]
                away.append((e.value - value) / e.u)
                assert e.u < 0.2e-6
        for plane, value in zip(("inboard", "outboard"), true.d_max, strict=True):
            found = interval(r.estimates["d_max", plane])
            assert found.low - 0.5e-6 < value < found.high + 0.5e-6
    assert len(away) == 32
    assert np.sqrt(np.mean(np.square(away))) < 2.0
    assert np.abs(away).max() < 4.0


def test_peaks_of_the_coils_are_known_by_more_than_their_resolution(compared: Run) -> None:
    """Against the same captures freed of what only the simulator knows: gains and zeros; as many turns, so the same scatter."""
    p, away = compared.plant, []
    for r in compared.results.dwells:
        assert r.dwell.full is not None
        part = slice(*blocks(r.dwell.full)[[0, -1]])
        for plane, first in (("inboard", 0), ("outboard", 4)):
            four = slice(first, first + 4)
            for name, what, gain, zero in (
                ("current_peak", "currents", p.current_gain, p.current_offset),
                ("voltage_peak", "voltages", p.voltage_gain, p.voltage_offset),
            ):
                read = getattr(r.dwell.full, what)[four, part]
                true = (read - np.array(zero[four])[:, None]) / np.array(gain[four])[:, None]
                e, unit = r.estimates[name, plane], what[0].replace("c", "i").replace("v", "u")
                away.append((e.value - float(np.quantile(np.abs(true), 0.99, axis=1).max())) / interval(e).U)
                of = {i.id.rpartition("/")[2] for i in e.sensitivities if i.id.startswith(f"sensors/{unit}_")}
                assert of == {"gain", "offset"}
                assert any(i.id.startswith(f"scatter/{what[:-1]}/") and i.dof >= 4 for i in e.sensitivities)
                assert any(i.id.startswith("resolution/") for i in e.sensitivities)
                assert e.u > 0.002 * e.value
    assert np.abs(away).max() < 1.0
    assert np.abs(away).max() > 0.1


def test_voltages_without_certificates_are_told() -> None:
    rig = load_rig("amb5dof")
    assert list(find_uncertified(rig)) == []
    bare = rig.model_copy(update={"sensors": {n: s for n, s in rig.sensors.items() if n != "u_zo_n"}})
    (found,) = find_uncertified(bare)
    assert (found.code, found.effect) == ("voltage-not-certified", Effect.NOTE)
    assert "u_zo_n" in found.text
    assert draw(bare, SEED).plant.voltage_gain[7] == 1.0


def test_the_slow_roll_reading_is_not_the_runout(compared: Run) -> None:
    """The loop moves the shaft against it: the reading alone is off by more than the whole runout; the forces put it right."""
    true, found = truth_unbalance.first(compared.plant), compared.results.runouts[1.0]
    assert np.abs(found.reading - true).max() > 1.2 * np.abs(true).max()
    assert np.abs(found.values - true).max() < 0.1 * np.abs(true).max()
    for k in range(4):
        for part, value in ((found.parts[2 * k], true[k].real), (found.parts[2 * k + 1], true[k].imag)):
            assert part.value == pytest.approx(value, abs=3 * part.u)


def test_a6_reduction_over_speed_and_the_literal_observer(compared: Run) -> None:
    for rpm in (2000, 10000):
        e = compared.measured["reduction", f"{rpm} r/min"]
        assert e.value - 2 * e.u > 0.9
        assert e.u < 0.01
    off, literal = (compared.measured["reading", f"10000 r/min, {v}"].value for v in ("off", "literal"))
    assert 1 - literal / off < 0.7
    assert any("as printed" in f.text for f in compared.findings if f.code == "reduction-told")


def test_a5_switched_on(compared: Run) -> None:
    drop, residual = (compared.measured[name, "10000 r/min"] for name in ("drop", "residual"))
    assert drop.value - 2 * drop.u > 0.8
    assert residual.value + 2 * residual.u < 1e-6


def test_compensation_lets_the_shaft_follow_the_runout(compared: Run) -> None:
    """The probes read next to nothing, and the shaft still moves by the runout: what the reduction does not say."""
    on = next(r for r in compared.results.of("corrected") if r.dwell.wanted > 1000)
    true = truth_unbalance.first(compared.plant)
    assert np.abs(on.vectors.values + true).max() < 0.3e-6
    assert np.abs(on.dwell.readings().values).max() < 0.3e-6


def test_figures(compared: Run) -> None:
    drawn = list(compensation.procedure.drawn(compared.recording))
    keys = [f.key for f in drawn]
    assert len(set(keys)) == len(keys)
    assert {"reduction", "switch-amplitude", "switch-readings", "bode-inboard", "polar-outboard", "orbit-inboard-off-10000",
            "spectrum-outboard-corrected-10000", "use-current", "use-voltage"} <= set(keys)  # fmt: skip
    for figure in drawn:
        if isinstance(figure, Figure):
            draw_figure(figure)


@pytest.mark.parametrize("law", [pytest.param("PID", marks=pytest.mark.long), "CCS", "CAC"])
def test_a2_at_14000(tmp_path: Path, law: str) -> None:
    run = done(tmp_path, "unbalance", {**SHORT, "law": law, "speeds_rad_s": (14000 * RPM,)})
    assert not run.serious
    biased = run.measured["current_peak", "inboard, 14000 r/min, off"].value
    assert biased > (0.3 if law == "CAC" else 1.0)
    lower = run.results.dwells[0].dwell.means[4 + 1]  # of the lower coil of yi
    assert abs(lower) < 0.05 if law == "CAC" else lower > 0.5


@pytest.mark.parametrize(
    ("truth", "plan", "code", "effect"),
    [
        ({"position_sign_yi": -1.0}, {}, "sensor-polarity", Effect.ERROR),
        pytest.param({"told_planes": 1.0}, {}, "planes-exchanged", Effect.ERROR, marks=pytest.mark.long),
        ({"told_axes": 1.0}, {}, "axes-exchanged", Effect.ERROR),
        pytest.param({"current_sign_i": -1.0}, {}, "coils-exchanged", Effect.ERROR, marks=pytest.mark.long),
        ({"pulse_missing": 3.0}, {}, "pulse-missing", Effect.ERROR),
        pytest.param({"pulse_missing": 2.0}, {}, "pulse-missing", Effect.ERROR, marks=pytest.mark.long),
        pytest.param({"pulse_doubled": 2.0}, {}, "pulse-doubled", Effect.ERROR, marks=pytest.mark.long),
        pytest.param({"pulse_doubled": math.pi}, {}, "pulse-doubled", Effect.ERROR, marks=pytest.mark.long),
        ({}, {"slow_rad_s": 0.0}, "no-slow-roll", Effect.INDETERMINATE),
        pytest.param({}, {"slow_rad_s": 1200 * RPM}, "slow-roll-too-fast", Effect.INDETERMINATE, marks=pytest.mark.long),
        ({}, {"rate_hz": 500.0}, "aliasing", Effect.ERROR),
        pytest.param({"position_range": 78e-6, "unbalance_i": 1.05e-5, "unbalance_o": 1.05e-5}, {"speeds_rad_s": (4000 * RPM,)},
         "sensor-clipped", Effect.ERROR, marks=pytest.mark.long),
        ({"geometry.clearance": 50e-6}, {}, "ring-too-near", Effect.ERROR),
        pytest.param({"pos_yi.offset": -50e-6}, {}, "ring-too-far", Effect.ERROR, marks=pytest.mark.long),
        ({"unbalance_i": 1.3e-5, "unbalance_o": 1.3e-5}, {"speeds_rad_s": (4000 * RPM,)}, "contact", Effect.INDETERMINATE),
        pytest.param({"loose_weight": 2e-6, "loose_speed": 400.0, "loose_shift": 2.0},
         {"speeds_rad_s": (3000 * RPM, 5000 * RPM), "repeat": True}, "response-changed", Effect.ERROR, marks=pytest.mark.long),
        ({"drop_fraction": 0.01}, {}, "missing-samples", Effect.INDETERMINATE),
    ],
)  # fmt: skip
def test_a_planted_defect_is_named_and_never_passes(
    tmp_path: Path, truth: Mapping[str, float], plan: Mapping[str, Any], code: str, effect: Effect
) -> None:
    run = simulated_run("unbalance", "amb5dof", SEED, {**ONE, **plan}, tmp_path / "recording.mcap", truth)
    found = [f for f in run.results if isinstance(f, Finding) and f.code == code]
    assert found, [f.code for f in run.results if isinstance(f, Finding)]
    assert found[0].effect is effect
    list(unbalance.procedure.drawn(run.recording))  # what can be drawn is drawn


def test_a_clipping_probe_shows_in_the_capture_where_the_controller_does_not_tell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 4000 r/min a turn is 15 samples of the telemetry: none of them stays at the limit for eight."""
    silent = replace(AMB_ROTOR, sensor_range=Status(0))
    monkeypatch.setattr(dwells, "conventions", lambda _: silent)
    truth = {"position_range": 78e-6, "unbalance_i": 1.05e-5, "unbalance_o": 1.05e-5}
    plan = {**ONE, "speeds_rad_s": (4000 * RPM,)}
    run = simulated_run("unbalance", "amb5dof", SEED, plan, tmp_path / "recording.mcap", truth)
    assert any(f.code == "sensor-clipped" for f in run.results if isinstance(f, Finding))


def test_a_finding_of_one_speed_leaves_the_others_alone(tmp_path: Path) -> None:
    """The shaft touches at 4000 r/min: what was measured at 2000 r/min stands, and so would a verdict of fail on it."""
    plan, truth = {**ONE, "speeds_rad_s": (2000 * RPM, 4000 * RPM)}, {"unbalance_i": 1.3e-5, "unbalance_o": 1.3e-5}
    run = done(tmp_path, "unbalance", plan, truth)
    touched = [f for f in run.findings if f.code == "contact"]
    assert [f.where for f in touched] == ["4000 r/min, off"]
    share = next(q for q in unbalance.MEASURES if q.name == "d_max_share")
    failed = {
        where: measurement(share.measured(e, where), Limit(None, 0.0, "1", "", verified=False), SEED)
        for (name, where), e in run.measured.items()
        if name == share.name
    }
    assert len(failed) == 4
    for where, m in failed.items():
        assert outranking(m, run.findings) == (("contact",) if "4000" in where else ())


def test_without_a_slow_roll_readings_and_currents_stand(compared: Run) -> None:
    slow = [d for d in read_dwells(compared.recording) if d.kind != SLOW]
    found = list(checks.slow_roll(slow, compared.recording.plan.speeds_rad_s, unbalance.LESS_RUNOUT))
    assert [f.code for f in found] == ["no-slow-roll"]
    assert set(found[0].concerns) == {"vector_cos", "vector_sin", "major_half_axis", "d_max", "d_max_share"}


def test_the_limit_of_the_steady_state_is_that_of_the_law_it_was_printed_for() -> None:
    """T Fig. 3.7 is CCS; under CAC a sound stand is left with 1.5 to 2.2 µm of mean and order 1."""
    limits = load_spec("amb5dof", "compensation")
    assert "residual" in applied(limits, compensation.Plan(law="CCS"))[0]
    held, notes = applied(limits, compensation.Plan(law="CAC"))
    assert set(limits) - set(held) == {"residual"}
    assert "law = CCS" in notes[0].text


def test_an_ellipse_has_the_degrees_of_freedom_of_all_its_influences(compared: Run) -> None:
    """Certificates and runout carry it, not the fourteen of the dwell's batches: k = 2.45 within a few percent, not 2.86."""
    for r in compared.results.dwells:
        if r.dwell.variant == "off":
            assert np.sqrt(radius2(r.vectors.dof)) < 2.6


@pytest.mark.parametrize(("rpm", "named"), [(12000, True), (11800, False)])
def test_an_order_that_the_telemetry_takes_for_order_1_is_named(tmp_path: Path, rpm: int, named: bool) -> None:
    """A drive that holds 12 000 r/min: five samples of the telemetry in a turn, of which order 4 makes another order 1."""
    truth = {"drive_gain": 1.0, "runout_i4": 0.45e-6, "runout_o4": 0.45e-6}
    run = simulated_run("unbalance", "amb5dof", SEED, {**ONE, "speeds_rad_s": (rpm * RPM,)}, tmp_path / "r.mcap", truth)
    found = [f for f in run.results if isinstance(f, Finding) and f.code == "aliasing"]
    assert bool(found) == named
    assert not named or "order 4 as order 1" in found[0].text
    vectors = [m.estimate for m in run.results if isinstance(m, Measured) and m.quantity.name == "vector_cos"]
    folded = (
        [max(abs(c) for i, c in e.contributions.items() if i.startswith("folded/")) for e in vectors] if named else []
    )
    assert all(0.3 * e.u < f for e, f in zip(vectors, folded, strict=False))


def test_motion_that_does_not_turn_with_the_shaft_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """D_max is of what turns with the shaft: at 47 Hz beside it the shaft went to 45 µm, and D_max said 16 in zone A."""
    shaken = {"inject_amplitude": 0.1, "inject_hz": 47.0, "inject_lines": 1.0, "inject_axis": 0.0}
    variants = conventions(load_rig("amb5dof")).variants  # of the rig file that the run reads
    monkeypatch.setitem(variants, "off", {**variants["off"], **shaken})  # type: ignore[arg-type]
    run = simulated_run("unbalance", "amb5dof", SEED, ONE, tmp_path / "recording.mcap", {})
    found = [f for f in run.results if isinstance(f, Finding) and f.code == "not-synchronous"]
    assert found[0].effect is Effect.INDETERMINATE
    assert "inboard" in found[0].text
    d_max = next(
        m for m in run.results if isinstance(m, Measured) and m.quantity.name == "d_max" and "inboard" in m.where
    )
    assert interval(d_max.estimate).high > 40e-6


def test_planes_exchanged_within_the_loop_do_not_levitate(tmp_path: Path) -> None:
    run = simulated_run("unbalance", "amb5dof", SEED, ONE, tmp_path / "recording.mcap", {"exchange_planes": 1.0})
    assert any(isinstance(f, Finding) and f.effect is Effect.ERROR for f in run.results)
    assert not any(isinstance(m, Measured) for m in run.results)


def test_a_drive_that_gives_up_ends_the_run(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match="OVERLOAD"):
        simulated_run("unbalance", "amb5dof", SEED, ONE, tmp_path / "recording.mcap", {"drive_limit": 0.002})


def test_plans_that_cannot_work_are_refused() -> None:
    rig = load_rig("amb5dof")

    def why(**plan: Any) -> str:
        return "; ".join(check(rig, unbalance.Plan(**{"law": "CCS", **plan})))

    assert why() == ""
    assert why(speeds_rad_s=(14000 * RPM,)) == ""
    assert "envelope" in why(speeds_rad_s=(1600.0,))
    assert "landing" in why(speeds_rad_s=(35.0,))
    assert "unbalance moves the shaft" in why(slow_rad_s=120.0)
    assert "20 turns" in why(slow_s=2.0)
    assert "folds back" in why(rate_hz=1000.0)
    assert "bytes" in why(capture_s=3.0)
    assert "with the plain law off alone" in why(law="PID", variants=("off", "corrected"))
    bare = rig.model_copy(update={"devices": {k: d for k, d in rig.devices.items() if k != "drive"}})
    assert unbalance.procedure.problems(bare, unbalance.Plan()) == (
        "nothing turns it; devices: found none in the role drive",
    )
    assert list(compensation.check(rig, compensation.Plan(law="CCS"))) == []
    assert "something must be compared" in "; ".join(compensation.check(rig, compensation.Plan(law="PID")))
    assert "envelope" in "; ".join(compensation.check(rig, compensation.Plan(law="CCS", switch_rad_s=1600.0)))
    beyond = compensation.Plan(law="CCS", speeds_rad_s=(14000 * RPM,))
    assert "no reduction would be measured" in "; ".join(compensation.check(rig, beyond))
    raised = compensation.Plan(law="CCS", speeds_rad_s=(14000 * RPM,), judged_to_rad_s=14001 * RPM)
    assert list(compensation.check(rig, raised)) == []


def test_runout_by_forces_is_exact_on_its_own_model() -> None:
    """A made-up slow roll: shaft and currents that balance, and a runout on top of it."""
    stand = runout.Stand(
        np.full(4, 6.95e-7), np.full(4, 1.15e-4), np.ones(4), np.zeros(4), np.ones(8), np.zeros(8), np.full(4, 5.25e-4), 1200.0,
        0.98, 5.84e-3, 1.71e-4, 0.097, 0.081, 0.078, 0.1, 0.097, 0.081, 0.155,
        runout.arms(0.097, 0.081), runout.arms(0.078, 0.1),
    )  # fmt: skip
    means = np.array([0, 0, 0, 0, 1.2, 0.8, 1.2, 0.8, 1.1, 0.9, 1.1, 0.9])
    true, u = np.array([2e-6, -2e-6j, 1e-6j, 1e-6]), np.array([3e-6, 2e-6 * np.exp(1j)])
    made = []
    for speed in (31.4, 1000.0):
        i = np.array([0.01, 0.02j, -0.01, 0.005 + 0.001j])
        vectors = np.concatenate([np.zeros(4), np.stack([i, -i], axis=1).ravel()])
        turning = runout.Turning(speed, means, vectors)
        at = runout.shaft_motion(stand, turning, 1.0, u) + true
        made.append(runout.Turning(speed, means, np.concatenate([at, vectors[4:]])))
    found = runout.find_runout(stand, {1.0: made[0]}, made[1])
    assert np.abs(found.runout[1.0] - true).max() < 1e-11
    assert np.abs(found.shaft[1.0] - made[0].vectors[:4] + true).max() < 1e-11
    assert np.abs(found.unbalance - u).max() < 1e-10
    assert found.misfit < 1e-6
    swapped = made[1].vectors.copy()
    swapped[:4] = swapped[[2, 3, 0, 1]]
    assert runout.unbalances(stand, runout.Turning(1000.0, means, swapped), found.runout[1.0])[1] > UNEXPLAINED


def test_orders_mix_in_forces_that_are_not_linear() -> None:
    """Orders 1 and 2 of one coil's current: i^2 makes 2 i1* i2 of them at order 1, beside its slope."""
    stand = runout.Stand(
        np.full(4, 6.95e-7), np.zeros(4), np.ones(4), np.zeros(4), np.ones(8), np.zeros(8), np.full(4, 5.25e-4), 1200.0,
        0.98, 5.84e-3, 1.71e-4, 0.097, 0.081, 0.078, 0.1, 0.097, 0.081, 0.155,
        runout.arms(0.097, 0.081), runout.arms(0.078, 0.1),
    )  # fmt: skip
    means, first, second = np.zeros(12), np.zeros(12, complex), np.zeros(12, complex)
    means[4], first[4], second[4] = 1.5, 0.05, 0.02j
    slow = {1.0: runout.Turning(31.4, means, first), 2.0: runout.Turning(31.4, means, second)}
    found = runout.forces_beyond_slopes(stand, slow, {n: np.zeros(4, complex) for n in slow})
    scale = 6.95e-7 / 5.25e-4**2
    assert found[1.0][0] == pytest.approx(scale * 0.05 * 0.02j)
    assert found[2.0][0] == pytest.approx(scale * 0.05**2 / 2)
    assert np.abs(found[1.0][1:]).max() < 1e-15


def test_d_max_is_greater_wherever_the_centre_may_be() -> None:
    """A circle of 5 um about a place known to 5 um (rectangular): the value is the mean over it, inside the interval."""
    means = [Estimate.of(0.0, Influence(a, a, 5e-6 / math.sqrt(3), "m", "B", "rectangular")) for a in "yz"]
    orbit = [Estimate.exact(x, "m") for x in (5e-6, 0.0, 0.0, -5e-6)]
    e = unbalance_d_max.farthest(means, {1.0: orbit}, "a place")
    generator = np.random.default_rng(2)
    true = 5e-6 + np.hypot(*generator.uniform(-5e-6, 5e-6, (2, 20000)))
    assert e.value == pytest.approx(true.mean(), rel=5e-3)
    found = interval(e)
    assert found.low == pytest.approx(np.quantile(true, 0.025), rel=0.02)
    assert found.high == pytest.approx(np.quantile(true, 0.975), rel=0.02)


def test_both_zeros_of_a_plane_carry_d_max_alike() -> None:
    """About the centre of a circle neither axis has a slope and both have the same share; each alone would make more."""
    means = [Estimate.of(0.0, Influence(a, a, 5e-6 / math.sqrt(3), "m", "B", "rectangular")) for a in "yz"]
    orbit = [Estimate.exact(x, "m") for x in (5e-6, 0.0, 0.0, -5e-6)]
    e = unbalance_d_max.farthest(means, {1.0: orbit}, "a place")
    off = np.random.default_rng(3).uniform(-5e-6, 5e-6, (2, 400, 400))
    off[0], off[1] = off[0, :, :1], off[1, :1, :]  # every z with every y
    true = np.hypot(*off)
    shares = [true.mean(axis=k).var() / true.var() for k in (1, 0)]
    stated = measurement(Measured(unbalance.D_MAX, e), None)
    found = {b.influence: (b.contribution / (stated.standard_uncertainty or 0)) ** 2 for b in stated.budget}
    assert [found["y"], found["z"]] == pytest.approx(shares, abs=0.02)


def test_no_budget_by_monte_carlo_says_more_than_its_result(compared: Run) -> None:
    """The squares of its contributions come to u^2 at most; those of D_max at the kink came to four times as much."""
    stated = [measurement(Measured(Quantity(*key, ""), e), None) for key, e in compared.measured.items()]
    drawn = [m for m in stated if m.method == "monte-carlo" and m.standard_uncertainty]
    for m in drawn:
        assert math.hypot(*(b.contribution for b in m.budget)) <= 1.01 * (m.standard_uncertainty or 0)
    assert {"d_max", "vector_cos"} <= {m.name for m in drawn}


def test_adopted_bearings_take_the_plan_s_place(compared: Run) -> None:
    """The runout is known better, by the calibration's influences and not by the plan's; the probes' zeros drop out of it."""
    rig, model = compared.recording.rig, bearings(compared.recording.rig, compared.plant)
    dwells = read_dwells(compared.recording)
    found = estimates.results(dwells, rig, known(compared.recording.plan, model)).runouts[1.0]
    before, true = compared.results.runouts[1.0], truth_unbalance.first(compared.plant)
    for k, part in enumerate(found.parts):
        value = true[k // 2].imag if k % 2 else true[k // 2].real
        ids = {i.id for i in part.sensitivities}
        assert part.value == pytest.approx(value, abs=3 * part.u)
        assert {"beta-yi", "offset-zo"} <= ids
        assert not any(i.startswith("model/") for i in ids)
        zeros = [c for i, c in part.contributions.items() if i.endswith("/offset") and i.startswith("sensors/pos_")]
        assert np.abs(zeros).max() < 0.02 * part.u
    assert max(p.u for p in found.parts) < 0.8 * max(p.u for p in before.parts)
    (said,) = [f.text for f in compared.findings if f.code == "bearings"]
    assert "no calibration bearing-model was used" in said
    assert "bearing-model-1, 2026-02-03" in describe(known(compared.recording.plan, model)).text


def test_bearings_are_used_where_there_are_some_and_not_missed_where_there_are_none() -> None:
    rig = load_rig("amb5dof")
    (need,) = unbalance.procedure.needs(unbalance.Plan())
    assert unbalance.procedure.needs(unbalance.Plan(bearings="plan")) == ()
    assert compensation.procedure.needs(compensation.Plan()) == (need,)
    model = bearings(rig, draw(rig, SEED).plant)
    assert given([need], {}) == []
    assert given([need], {"bearing-model": model}) == [model]


def test_d_max_between_the_grid_s_places_is_that_of_the_orbit() -> None:
    """An ellipse of 10 by 4 um about places within 5 um, against the distance itself."""
    generator = np.random.default_rng(1)
    placed = [generator.uniform(-5e-6, 5e-6, 400) for _ in range(2)]
    orbit = [np.array([x]) for x in (10e-6, 0.0, 0.0, -4e-6)]
    found = unbalance_d_max._interpolated(placed, orbit, [1.0])
    turn = np.linspace(0, 2 * math.pi, 2000)
    true = np.hypot(placed[0][:, None] + 10e-6 * np.cos(turn), placed[1][:, None] + 4e-6 * np.sin(turn)).max(axis=1)
    assert np.abs(found - true).max() < 0.03e-6
