"""Run-up and coast-down: against what the shaft does when its speed stands, A3, planted defects, refused plans."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amb_stand import AMB_ROTOR

from bench.analysis.criticals import Critical
from bench.analysis.tachometer import Tachometer
from bench.analysis.vectors import contains
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import DeviceFault
from bench.figures import Figure, Sheet
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.limits import Verdict
from bench.record.outcomes import outranking
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, correlation, interval, welch_satterthwaite
from bench.units import RPM
from procedures.coast_down import procedure as coast_down
from procedures.run_up import checks, estimates, figures
from procedures.run_up import procedure as run_up
from procedures.run_up.estimates import Run
from procedures.run_up.steps import Passage, read_passage
from reports.figures import draw as draw_figure
from sim_backend.machines.amb5dof import truth_unbalance
from sim_backend.machines.amb5dof.params import AmbParams
from sim_backend.truth import draw

pytestmark = pytest.mark.xdist_group("runup")  # one worker makes the sound run once
SEED = 1
SHORT: dict[str, Any] = {
    "acceleration_rad_s2": 200.0, "bottom_rad_s": 115.0, "slow_s": 4.2, "settle_s": 0.5, "capture_s": 0.2,
}  # fmt: skip
ONE: dict[str, Any] = {**SHORT, "top_rad_s": 4000 / RPM, "speeds_rad_s": (2500 / RPM,)}
A3: dict[str, Any] = {**SHORT, "law": "CAC", "top_rad_s": 6000 / RPM, "speeds_rad_s": (2000 / RPM, 4800 / RPM)}
HEAVY = {"unbalance_i": 1.4e-5, "unbalance_o": 1.4e-5}  # at which the inboard ring is touched
A3_TRUTH = {
    "inductance": 20e-3, "unbalance_i": 10.7e-6, "unbalance_o": 10.7e-6, "unbalance_phase_i": 0.0,
    "unbalance_phase_o": math.pi / 3,
}  # fmt: skip


def done(
    folder: Path, plan: Mapping[str, Any], truth: Mapping[str, float] | None = None, procedure: str = "run-up"
) -> Simulated:
    return simulated_run(procedure, "amb5dof", SEED, plan, folder / "recording.mcap", truth)


def codes(run: Simulated, *, serious: bool = True) -> set[str]:
    found = [f for f in run.results if isinstance(f, Finding)]
    return {f.code for f in found if not serious or f.effect is not Effect.NOTE}


def evaluated(run: Simulated) -> Run:
    found = run.procedure.evaluated(run.recording).result
    assert found is not None
    return found


def settled(plant: AmbParams, run: Run, law: str, **parameters: float) -> np.ndarray:
    """What the shaft does at the captures' speeds when the speed stands, (n, 4)."""
    assert run.near is not None
    defaults = {n: p.default for n, p in load_rig("amb5dof").parameters.items()}
    settings = {**defaults, **AMB_ROTOR.variants["off"], **parameters, **AMB_ROTOR.select(law)}  # type: ignore[arg-type]
    return truth_unbalance.response(plant, settings, np.array([r.dwell.speed for r in run.near.dwells]))


@pytest.fixture(scope="module")
def up(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    """To 14 000 r/min in seven seconds."""
    return done(tmp_path_factory.mktemp("up"), SHORT)


@pytest.fixture(scope="module")
def found(up: Simulated) -> Run:
    return evaluated(up)


@pytest.fixture(scope="module")
def passage(up: Simulated) -> Passage:
    return read_passage(up.recording)


def test_nothing_is_found_on_a_sound_stand(up: Simulated) -> None:
    """Its rigid modes are so well damped that nothing is critical, and that is said; the rest is measured."""
    assert not codes(up)
    notes = {"bearings", "slow-roll", "ellipse", "zone", "no-critical", "critically-damped", "passed"}
    assert codes(up, serious=False) == notes
    assert len(up.recording.all_steps()) == run_up.step_count(up.recording.plan)
    names = {m.quantity.name for m in up.results if isinstance(m, Measured)}
    assert names == {q.name for q in run_up.MEASURES if q not in run_up.CRITICAL}
    assert len(up.recording.captures()) == 3
    assert float(np.max(up.recording.channel("speed")["speed"])) > 0.995 * 14000 / RPM


def test_vectors_are_those_of_a_speed_that_stands(found: Run) -> None:
    run = found
    assert run.near is not None
    true = settled(draw(load_rig("amb5dof"), SEED).plant, run, "CCS")
    held = [
        contains(r.vectors.one(k), complex(t[k])) for r, t in zip(run.near.dwells, true, strict=True) for k in range(4)
    ]
    assert np.mean(held) >= 0.8
    off = [np.abs(r.vectors.values - t).max() for r, t in zip(run.near.dwells, true, strict=True)]
    assert max(off) < 0.6e-6


def test_the_capture_is_taken_as_the_shaft_comes_through_the_speed(up: Simulated) -> None:
    for captured in up.recording.captures():
        pulses = captured.arrays("pulses", "pulse_age")
        turns = np.ptp(pulses["pulses"])
        mean = 2 * math.pi * turns / np.ptp(pulses["t_s"])
        assert mean == pytest.approx(captured.labels["passed_rad_s"], rel=0.1)


def test_figures(up: Simulated, found: Run) -> None:
    drawn = list(figures.all_figures(found, up.recording.rig, 14000 / RPM))
    keys = [f.key for f in drawn]
    assert len(set(keys)) == len(keys)
    criticals = drawn[0]
    assert isinstance(criticals, Sheet)
    assert len(criticals.rows) == sum(peak.factor is not None for peak in found.peaks) > 0
    assert {"bode-inboard", "polar-outboard", "waterfall", "order-map", "use-current", "use-voltage", "speed"} <= set(
        keys
    )
    assert any(k.startswith("orbit-inboard") for k in keys)
    assert any(k.startswith("spectrum-outboard") for k in keys)
    for figure in drawn:
        if isinstance(figure, Figure) and figure.key in ("bode-inboard", "order-map", "speed"):
            draw_figure(figure)


@pytest.mark.parametrize(
    ("change", "code", "effect"),
    [
        ({"flags": 4}, "contact", Effect.INDETERMINATE),
        ({"flags": 8}, "contact", Effect.INDETERMINATE),
        ({"flags": 1}, "current-saturated", Effect.INDETERMINATE),
        ({"flags": 2}, "voltage-saturated", Effect.INDETERMINATE),
        ({"flags": 64}, "sensor-clipped", Effect.ERROR),
        ({"clips": 20}, "sensor-clipped", Effect.ERROR),
        ({"lost": 500}, "missing-samples", Effect.INDETERMINATE),
        ({"stuck": ("pos_yi",)}, "stuck-channel", Effect.ERROR),
        ({"missing": (9.0,)}, "pulse-missing", Effect.ERROR),
        ({"doubled": (9.0,)}, "pulse-doubled", Effect.ERROR),
        ({"drive": 2.0}, "pulse-missing", Effect.ERROR),
        ({"drive": 0.5}, "pulse-doubled", Effect.ERROR),
        ({"top": 15000 / RPM}, "passage-short", Effect.INDETERMINATE),
    ],
)
def test_what_a_passage_shows_is_named(
    up: Simulated, passage: Passage, change: dict[str, Any], code: str, effect: Effect
) -> None:
    plan, p = up.recording.plan, passage
    assert list(checks.of_passage(p, up.recording, plan)) == []
    if "flags" in change:
        flags = p.flags.copy()
        flags[5000:5010] |= change["flags"]
        p = dataclasses.replace(p, flags=flags)
    elif "drive" in change:
        p = dataclasses.replace(p, driven=(p.driven[0], change["drive"] * p.driven[1]))
    elif "missing" in change or "doubled" in change:
        at = {k: (float(p.t[4000]),) for k in change}
        p = dataclasses.replace(p, tacho=Tachometer(p.tacho.times, p.tacho.turns, **at))
    elif "top" in change:
        plan = plan.model_copy(update={"top_rad_s": change["top"]})
    else:
        p = dataclasses.replace(p, **change)
    found = [f for f in checks.of_passage(p, up.recording, plan) if f.code == code]
    assert found
    assert found[0].effect is effect
    if "flags" in change:
        assert "r/min" in found[0].text  # where on the way


def test_plans_that_cannot_work_are_refused() -> None:
    rig = load_rig("amb5dof")

    def why(**plan: Any) -> str:
        return "; ".join(run_up.check(rig, run_up.Plan(**plan)))

    assert why() == ""
    assert why(**SHORT) == ""
    assert "the envelope allows" in why(top_rad_s=1600.0)
    assert "landing" in why(bottom_rad_s=35.0)
    assert "within a turn" in why(acceleration_rad_s2=200.0)
    assert "expected 1 to 250" in why(acceleration_rad_s2=400.0, bottom_rad_s=200.0)
    assert "shaft makes 22 turns; expected 40" in why(**{**SHORT, "top_rad_s": 260.0, "speeds_rad_s": (200.0,)})
    assert "come through" in why(speeds_rad_s=(1465.0,))
    assert "recorded and uploaded" in why(speeds_rad_s=(500.0, 510.0))
    assert "bytes" in why(capture_s=3.0)
    assert "folds back" in why(rate_hz=500.0)
    assert "the rig has no k9" in why(parameters={"k9": 1.0})
    assert list(coast_down.procedure.check(rig, coast_down.Plan())) == []
    drive = rig.devices["drive"]
    bare = {k: v for k, v in drive.registers.items() if k != "acceleration"}
    devices = {**rig.devices, "drive": drive.model_copy(update={"registers": bare})}
    fixed = rig.model_copy(update={"devices": devices})
    assert "a ramp needs one" in "; ".join(run_up.check(fixed, run_up.Plan()))
    assert list(coast_down.procedure.check(fixed, coast_down.Plan())) == []  # it coasts


@pytest.mark.long
@pytest.mark.timeout(300)
def test_up_and_down_agree_on_criticals_and_with_the_truth(tmp_path: Path) -> None:
    """A PID with little damping: the passage moves each critical, on the two ways to opposite sides; without the lag both are
    where they are when the speed stands."""
    from bench.analysis.criticals import criticals

    parameters = {"kd": 10.0}
    truth = {"unbalance_i": 0.7e-6, "unbalance_o": 0.7e-6}
    plan = {**SHORT, "law": "PID", "parameters": parameters, "top_rad_s": 6500 / RPM, "speeds_rad_s": (2500 / RPM, 5000 / RPM),
            "bottom_rad_s": 85.0}  # fmt: skip
    del plan["acceleration_rad_s2"]
    ways = []
    for procedure, rate in (("run-up", "acceleration_rad_s2"), ("coast-down", "deceleration_rad_s2")):
        (tmp_path / procedure).mkdir()
        run = done(tmp_path / procedure, {**plan, rate: 100.0}, truth, procedure)
        assert not codes(run)
        assert "critical" in codes(run, serious=False)
        ways.append({p.axis: p for p in evaluated(run).peaks if p.critical})
    rig = load_rig("amb5dof")
    defaults = {n: p.default for n, p in rig.parameters.items()}
    speeds = np.linspace(300, 620, 50)
    settings = {**defaults, **AMB_ROTOR.variants["off"], **parameters, **AMB_ROTOR.select("PID")}
    plant = draw(rig, SEED, truth).plant
    little = {name: tuple(0.02 * x for x in getattr(plant, name)) for name in ("unbalance", "runout")}
    true = truth_unbalance.response(dataclasses.replace(plant, **little), settings, speeds)  # small orbits
    both = sorted(set(ways[0]) & set(ways[1]))
    assert len(both) >= 2
    for axis in both:
        up, down = ways[0][axis], ways[1][axis]
        assert up.lagged - down.lagged > 20 / RPM
        assert abs(up.speed.value - down.speed.value) < 0.6 * (up.lagged - down.lagged)
        k = ("yi", "zi", "yo", "zo").index(axis)
        c = criticals(speeds, true[:, k], np.tile(1e-22 * np.eye(2), (50, 1, 1)), draws=2)[0]
        for p in (up, down):
            assert p.factor is not None
            assert p.speed.value == pytest.approx(c.speed, abs=4 * p.speed.u + 1e-3 * c.speed)
            assert p.factor.value == pytest.approx(c.factor, abs=4 * p.factor.u)


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a3_twelve_volts_lose_where_forty_eight_hold(tmp_path: Path) -> None:
    """T Fig. 2.9 with CAC, 20 mH, e 18.9 um (10.7 g mm in each plane, 60 degrees apart), on a drawn stand: its noise, a
    controller that does not know its betas (5 %) and offsets (10 um), its bending modes."""
    held = done(tmp_path, A3, {**A3_TRUTH, "supply_V": 48.0})
    assert not codes(held)
    assert max(np.abs(evaluated(held).shaft).max(axis=1)) < 95e-6
    lost = tmp_path / "lost"
    lost.mkdir()
    with pytest.raises(DeviceFault, match="LEVITATION_LOST"):
        done(lost, A3, {**A3_TRUTH, "supply_V": 12.0})
    recording: Recording[Any] = Recording.open(lost / "recording.mcap", run_up.Plan)
    told = recording.channel("speed")["speed"]
    assert 3000 < told.max() * RPM < 5500
    flags = recording.channel("flags")["flags"].astype(int)
    assert (flags & 2).mean() > 0.05  # the amplifiers' voltages
    (lost / "small").mkdir()
    small = done(lost / "small", A3, {**A3_TRUTH, "supply_V": 12.0, "inductance": 2.65e-3})
    assert "voltage-saturated" not in codes(small)


@pytest.mark.long
@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("truth", "plan", "code", "effect"),
    [
        ({"position_sign_yi": -1.0}, {}, "sensor-polarity", Effect.ERROR),
        ({"told_planes": 1.0}, {}, "planes-exchanged", Effect.ERROR),
        ({"pulse_missing": 5.0}, {}, "pulse-missing", Effect.ERROR),
        ({"pulse_missing": 2.0}, {}, "pulse-missing", Effect.ERROR),
        ({"pulse_doubled": 2.0}, {}, "pulse-doubled", Effect.ERROR),
        ({}, {"slow_rad_s": 0.0}, "no-slow-roll", Effect.INDETERMINATE),
        ({}, {"rate_hz": 500.0}, "aliasing", Effect.ERROR),
        ({"position_range": 78e-6, "unbalance_i": 1.05e-5, "unbalance_o": 1.05e-5}, {}, "sensor-clipped", Effect.ERROR),
        ({"geometry.clearance": 50e-6}, {}, "ring-too-near", Effect.ERROR),
        ({"pos_yi.offset": 50e-6}, {}, "ring-too-near", Effect.ERROR),
        ({"pos_yi.offset": -50e-6}, {}, "ring-too-far", Effect.ERROR),
        (HEAVY, {}, "contact", Effect.INDETERMINATE),
        ({**HEAVY, "contact_silent": 1.0}, {}, "contact-unreported", Effect.INDETERMINATE),
        ({"drop_fraction": 0.01}, {}, "missing-samples", Effect.INDETERMINATE),
    ],
)
def test_a_planted_defect_is_named_and_never_passes(
    tmp_path: Path, truth: Mapping[str, float], plan: Mapping[str, Any], code: str, effect: Effect
) -> None:
    run = done(tmp_path, {**ONE, **plan}, truth)
    found = [f for f in run.results if isinstance(f, Finding) and f.code == code]
    assert found, codes(run, serious=False)
    assert found[0].effect is effect
    list(run.procedure.drawn(run.recording))  # what can be drawn is drawn


def test_exchanged_current_sensors_are_told_where_the_offset_carries_the_weight(tmp_path: Path) -> None:
    """On this rig the exchanged coils seem to carry 0.60 and 0.65 of their share of the weight, which passes as a tolerance."""
    run = simulated_run("run-up", "amb5dof", 0, ONE, tmp_path / "recording.mcap", {"current_sign_i": -1.0})
    assert {(f.code, f.where) for f in run.results if isinstance(f, Finding)} == {("coils-exchanged", "yi")}


def test_intervals_of_a_peak_are_not_nothing(found: Run) -> None:
    for p in found.peaks:
        assert p.factor is not None
        i = interval(p.factor)
        assert 0.002 < (i.high - i.low) / 2 / p.factor.value < 0.05
        assert not p.critical


def test_the_numbers_of_a_critical_are_correlated_and_their_scatter_has_degrees_of_freedom(found: Run) -> None:
    """Speed, amplitude and factor are read off one noisy curve."""
    for p in found.peaks:
        assert p.factor is not None
        own = f"scatter/{p.axis}/{p.number}"
        scattered = [
            Estimate(0.0, "", {i: c for i, c in e.sensitivities.items() if i.id.startswith(own)})
            for e in (p.speed, p.amplitude, p.factor)
        ]
        whole = scattered[0] * (1 / scattered[0].u) + scattered[2] * (0.5 / scattered[2].u)
        assert len({welch_satterthwaite(e) for e in (*scattered, whole)}) == 1
        assert 10 < welch_satterthwaite(whole) < 120
    of_speed_and_amplitude = [correlation(p.speed, p.amplitude) for p in found.peaks]
    assert max(np.abs(of_speed_and_amplitude)) > 0.1


def test_a_criticals_scatter_is_its_covariance() -> None:
    """Against the covariance it was given; a factor outside the record is left out."""
    root = np.array([[2.0, 0, 0, 0], [1e-7, 2e-7, 0, 0], [0.1, -0.3, 0.4, 0], [0.01, 0.02, 0, 0.02]])
    c = Critical(300.0, 5e-6, 280.0, 320.0, 7.5, 0.066, root @ root.T)
    found = estimates.scatter_of(c, "yi/1", 40.0)
    assert [found[n].u for n in ("speed", "amplitude", "factor")] == pytest.approx(np.sqrt(np.diag(c.covariance)[:3]))
    for (i, a), (j, b) in itertools.combinations(enumerate(("speed", "amplitude", "factor")), 2):
        told = c.covariance[i, j] / math.sqrt(c.covariance[i, i] * c.covariance[j, j])
        assert correlation(found[a], found[b]) == pytest.approx(told, abs=1e-9)
    covariance = np.full((4, 4), np.nan)
    covariance[:2, :2] = c.covariance[:2, :2]
    without = estimates.scatter_of(dataclasses.replace(c, factor=math.nan, covariance=covariance), "yi/1", 40.0)
    assert set(without) == {"speed", "amplitude"}


@dataclasses.dataclass(frozen=True)
class Judged:
    name: str
    where: str
    verdict: Verdict = Verdict.FAIL


@pytest.mark.parametrize(
    ("rpm", "doubted", "stands"),
    [
        (5500, [("critical_speed", "yi, peak 1")],
         [("d_max_share", f"inboard, {s} r/min, up, CCS") for s in (3000, 8000, 13000)]),
        (3100, [("separation", "yi, peak 1"), ("d_max_share", "inboard, 3000 r/min, up, CCS")],
         [("d_max_share", "inboard, 8000 r/min, up, CCS")]),
        (13000, [("d_max_share", "inboard, 3000 r/min, up, CCS")], []),
    ],
)  # fmt: skip
def test_a_limit_puts_in_doubt_what_was_measured_beside_it(
    up: Simulated, passage: Passage, rpm: float, doubted: list[tuple[str, str]], stands: list[tuple[str, str]]
) -> None:
    """An amplifier at its voltage at one speed excuses no D_max at another; beside the fastest, which tells the runout, all."""
    flags = passage.flags.copy()
    k = passage.moving.start + int(np.nanargmin(np.abs(passage.speeds[passage.moving] - rpm / RPM)))
    flags[k : k + 5] |= 2
    p = dataclasses.replace(passage, flags=flags)
    found = list(checks.of_passage(p, up.recording, up.recording.plan))
    assert [f.code for f in found] == ["voltage-saturated"]
    assert [outranking(Judged(*m), found) for m in doubted] == [("voltage-saturated",)] * len(doubted)
    assert [outranking(Judged(*m), found) for m in stands] == [()] * len(stands)


def test_a_passage_that_ends_early_excuses_no_orbit(up: Simulated, passage: Passage) -> None:
    plan = up.recording.plan.model_copy(update={"top_rad_s": 15000 / RPM})
    (found,) = checks.of_passage(passage, up.recording, plan)
    assert outranking(Judged("d_max_share", "inboard, 8000 r/min, up, CCS"), [found]) == ()
    assert outranking(Judged("critical_speed", "yi, peak 1"), [found]) == ("passage-short",)
