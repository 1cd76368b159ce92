"""What the checks of unbalance say: of planted defects on whole runs, of missing certificates, of plans that cannot work."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from amb_stand import AMB_ROTOR
from test_unbalance import RPM, SEED, SHORT, done

from bench.cli.virtual import simulated_run
from bench.errors import BenchError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.limits import Limit
from bench.record.outcomes import outranking
from bench.record.records import measurement
from bench.rigfile import load_rig
from bench.rigfile.roles import Status
from bench.uncertainty import interval
from procedures.amb_rotor.conventions import conventions
from procedures.compensation import procedure as compensation
from procedures.synchronous import dwells
from procedures.synchronous.coil_peaks import find_uncertified
from procedures.unbalance import procedure as unbalance
from procedures.unbalance.procedure import check
from sim_backend.truth import draw

ONE = {**SHORT, "speeds_rad_s": (3000 * RPM,)}


def test_voltages_without_certificates_are_told() -> None:
    rig = load_rig("amb5dof")
    assert list(find_uncertified(rig)) == []
    bare = rig.model_copy(update={"sensors": {n: s for n, s in rig.sensors.items() if n != "u_zo_n"}})
    (found,) = find_uncertified(bare)
    assert (found.code, found.effect) == ("voltage-not-certified", Effect.NOTE)
    assert "u_zo_n" in found.text
    assert draw(bare, SEED).plant.voltage_gain[7] == 1.0


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
