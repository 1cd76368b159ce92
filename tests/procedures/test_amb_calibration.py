"""The AMB calibration through the whole path: it recovers the truth, follows it, and never passes a defect off as sound."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
from identified import calibrated, serious

from bench.cli.virtual import simulate, simulated_run
from bench.errors import DeviceFault, InterlockError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.limits import Verdict, judge
from bench.record.outcomes import Outcome, outcome_of
from bench.record.records import measurement
from bench.record.specs import load_spec
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.amb_calibration import both_coils, checks
from procedures.amb_calibration.plan import Plan
from procedures.amb_calibration.procedure import check, procedure
from procedures.amb_calibration.pulls import Loaded, Pull
from sim_backend.truth import draw

SHORT = {"settle_s": 0.3, "average_s": 0.2}


def calibrate(
    folder: Path, seed: int, truth: Mapping[str, float] | None = None, plan: Mapping[str, float] = SHORT
) -> tuple[Mapping[str, float], dict[str, Measured], list[Finding]]:
    true, results = simulate("amb-calibration", "tsbs12", seed, plan, folder / "recording.mcap", truth)
    measured = {m.quantity.name: m for m in results if isinstance(m, Measured)}
    return true, measured, [f for f in results if isinstance(f, Finding)]


def test_a_sound_rig_is_recovered_within_its_intervals(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Seed fixed before any tuning; three standard uncertainties, so that an honest rig does not fail by chance."""
    run = calibrated(tmp_path_factory.mktemp("sound"))
    measured = {m.quantity.name: m for m in run.results if isinstance(m, Measured)}
    assert set(measured) == {"K_i", "K_o", "K2_i", "K2_o", "Kw_i", "Kw_o"}
    assert serious(run) == []
    for name, m in measured.items():
        assert abs(m.estimate.value - run.truth[name]) < 3 * m.estimate.u, name
        assert m.estimate.u < 0.01 * abs(measured["K_o"].estimate.value)
    limits = load_spec("tsbs12", "amb-calibration")
    for name in ("K_i", "K_o"):
        assert judge(interval(measured[name].estimate), limits[name]) is Verdict.PASS


@pytest.mark.parametrize("factor", [pytest.param(0.8, marks=pytest.mark.long), 1.2])
def test_the_result_follows_the_truth(tmp_path: Path, factor: float) -> None:
    """Printed values are no input: with the truth 20 % off they are 20 % off, and the limits say so."""
    wanted = {"K_i": factor * 73.2, "K_o": factor * 74.4}
    true, measured, _ = calibrate(tmp_path, 11, wanted)
    limits = load_spec("tsbs12", "amb-calibration")
    for name, value in wanted.items():
        assert true[name] == pytest.approx(value, rel=1e-9)
        assert abs(measured[name].estimate.value - value) < 3 * measured[name].estimate.u
        assert judge(interval(measured[name].estimate), limits[name]) is Verdict.FAIL


def test_loads_that_contradict_each_other_support_no_statement_of_non_conformity(tmp_path: Path) -> None:
    """The reading lies outside the limit; with a wrong mass that says nothing of the machine: the contradiction is in the
    interval, and the finding puts whatever is judged in doubt."""
    _, measured, findings = calibrate(tmp_path, 11, {"mass_error_M2": 0.003, "K_o": 0.8 * 74.4})
    limits = load_spec("tsbs12", "amb-calibration")
    judged = [measurement(m, limits.get(name)) for name, m in measured.items()]
    assert {m.name: m.verdict for m in judged}["K_o"] in (Verdict.FAIL, Verdict.INDETERMINATE)
    assert "load-inconsistent" in {f.code for f in findings if f.effect is Effect.INDETERMINATE}
    assert outcome_of(judged, findings) is Outcome.INDETERMINATE


def test_loads_that_are_far_off_give_no_value(tmp_path: Path) -> None:
    """A mass that is 2 % off would leave K_o known to 50 %: the finding names it, and nothing is stated."""
    _, measured, findings = calibrate(tmp_path, 11, {"mass_error_M1": 0.02})
    (found,) = (f for f in findings if f.effect is not Effect.NOTE)
    assert found.code == "load-inconsistent"
    assert "M1" in found.where
    assert "No value is stated" in found.text
    assert "loads-scatter" not in {f.code for f in findings}
    assert not measured


def test_the_constants_hold_for_the_bias_of_the_plan(tmp_path: Path) -> None:
    """K = 2 b (A + B): at 2.5 A five sixths of the value at 3 A, in the truth as in the result."""
    true, results = simulate("amb-calibration", "tsbs12", 12, {**SHORT, "bias_A": 2.5}, tmp_path / "recording.mcap")
    rig = load_rig("tsbs12")
    at_three = draw(rig, 12).quantities
    measured = {m.quantity.name: m.estimate for m in results if isinstance(m, Measured)}
    for name in ("K_i", "K_o"):
        assert true[name] == pytest.approx(at_three[name] * 2.5 / 3, rel=1e-9)
        assert abs(measured[name].value - true[name]) < 3 * measured[name].u


@pytest.mark.parametrize(
    ("defect", "code", "named"),
    [
        ({"current_sign_o": -1}, "wrong-sign", "outboard"),
        pytest.param({"current_sign_i": -1}, "wrong-sign", "inboard", marks=pytest.mark.long),
        pytest.param({"exchange_current_axes": 1}, "axes-exchanged", "x and y", marks=pytest.mark.long),
        pytest.param(
            {"exchange_current_bearings": 1}, "bearings-exchanged", "inboard and outboard", marks=pytest.mark.long
        ),
        ({"mass_error_M1": 0.02}, "load-inconsistent", "M1"),
        pytest.param({"mass_error_M3": -0.02}, "load-inconsistent", "M3", marks=pytest.mark.long),
        pytest.param({"hanger_off_at_zero": 1}, "load-inconsistent", "hanger", marks=pytest.mark.long),
        pytest.param(
            {"drop_fraction": 0.005}, "missing-samples", "missing", marks=pytest.mark.long
        ),  # see injected faults
        ({"integrator_factor": 0.02}, "unsettled", "integrator"),
        pytest.param({"stuck_current_yo_p": 1}, "stuck-channel", "i_yo_p", marks=pytest.mark.long),
    ],
)
def test_a_defect_is_named_and_does_not_pass(tmp_path: Path, defect: dict[str, float], code: str, named: str) -> None:
    _, _, findings = calibrate(tmp_path, 3, defect)
    fatal = [f for f in findings if f.effect is not Effect.NOTE]
    assert code in {f.code for f in fatal}, fatal
    assert any(named in f.text for f in fatal if f.code == code)


@pytest.mark.parametrize(
    "defect",
    [{"position_sign_yo": -1}, {"exchange_position_axes_o": 1}, {"stuck_position_yo": 1}, {"coil_limit_yo_p": 4.2}],
)
def test_a_rotor_that_cannot_levitate_stops_the_run(tmp_path: Path, defect: dict[str, float]) -> None:
    with pytest.raises((DeviceFault, InterlockError)) as stopped:
        calibrate(tmp_path, 3, defect)
    assert "check" in str(stopped.value) or "envelope" in str(stopped.value)


@pytest.mark.parametrize("kind", ["sensors", "channels", "parameters"])
def test_what_the_rig_file_lacks_is_told_before_anything_starts(kind: str) -> None:
    rig = load_rig("tsbs12")
    name = {"sensors": "i_yi_p", "channels": "flags", "parameters": "angle_ref"}[kind]
    table = {k: v for k, v in getattr(rig, kind).items() if k != name}
    assert procedure.problems(rig.model_copy(update={kind: table}), Plan()) == (f"{kind}: found no {name}",)
    assert list(check(rig, Plan())) == []


@pytest.mark.parametrize(("a", "b"), [(1, 2), pytest.param(3, 4, marks=pytest.mark.long)])
def test_two_exchanged_masses_are_named_and_give_no_number(tmp_path: Path, a: int, b: int) -> None:
    """The labels of two masses exchanged: each is wrong by what the other weighs more or less."""
    kg = {k: load_rig("tsbs12").masses[f"M{k}"].value for k in (a, b)}
    swapped = {f"mass_error_M{a}": kg[b] / kg[a] - 1, f"mass_error_M{b}": kg[a] / kg[b] - 1}
    _, measured, findings = calibrate(tmp_path, 5, swapped)
    serious = [f for f in findings if f.effect is not Effect.NOTE]
    assert [(f.code, f.where, f.effect) for f in serious] == [("masses-exchanged", f"M{a}, M{b}", Effect.ERROR)]
    assert f"M{a} and M{b} are exchanged" in serious[0].text
    assert not measured


def test_a_set_whose_errors_go_with_the_load_is_not_put_on_its_one_sound_mass_alone(tmp_path: Path) -> None:
    """Three masses off with the square of the load leave the same data as a first one that is off."""
    _, _, findings = calibrate(
        tmp_path, 5, {"mass_error_M2": 0.008, "mass_error_M3": 0.016, "mass_error_M4": 0.024})  # fmt: skip
    found = next(f for f in findings if f.code == "load-inconsistent")
    assert "M1" in found.where
    assert "M1 is right and the others are off with the square of the load" in found.text
    shares = {m: float(found.text.split(f"{m} by ")[1].split("%")[0]) for m in ("M2", "M3", "M4")}
    for label, share in (("M2", 0.8), ("M3", 1.6), ("M4", 2.4)):
        assert shares[label] == pytest.approx(share, rel=0.25)


def test_the_first_hanging_tells_exchanged_wires(tmp_path: Path) -> None:
    """No second mass is asked for: an hour of hangings would say no more."""
    run = simulated_run("amb-calibration", "tsbs12", 3, SHORT, tmp_path / "recording.mcap", {"current_sign_i": -1})
    assert [f.code for f in run.results if isinstance(f, Finding)] == ["wrong-sign"]
    assert not run.recording.all_steps()
    hung = [e for e in run.recording.events("operator") if e.get("load")]
    assert len(hung) <= 1
    assert not list(run.procedure.drawn(run.recording))


def test_a_bearing_that_carries_the_rotor_by_one_coil_is_named_before_anything_is_recorded(tmp_path: Path) -> None:
    """At 2 A this rotor's own weight takes the whole bias of the lower outboard coil: K and K2 are one number there."""
    run = simulated_run("amb-calibration", "tsbs12", 0, {**SHORT, "bias_A": 2.0}, tmp_path / "recording.mcap")
    (found,) = (f for f in run.results if isinstance(f, Finding))
    assert (found.code, found.where, found.effect) == ("one-sided", "outboard", Effect.ERROR)
    assert "2.2 A or more" in found.text
    assert not run.recording.all_steps()
    assert not list(run.procedure.drawn(run.recording))


def test_what_the_loads_leave_one_number_is_not_reported_as_two(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same rotor without the look at the first hanging: the correlation of K and K2 says it."""
    monkeypatch.setattr(both_coils, "LEAST", 0.0)
    run = simulated_run("amb-calibration", "tsbs12", 0, {**SHORT, "bias_A": 2.05}, tmp_path / "recording.mcap")
    deciding = [f for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]
    assert [(f.code, f.where) for f in deciding] == [("one-sided", "outboard")]
    assert not any(isinstance(m, Measured) for m in run.results)


@pytest.mark.parametrize(
    ("lean", "seen", "told"), [(0.0, 0.02, False), (0.17, 0.0, True), (0.17, 0.2, False), (0.0, 0.17, True)]
)
def test_an_axis_across_the_pull_shows_how_the_bearing_is_turned(lean: float, seen: float, told: bool) -> None:
    """By hand: axes turned by 10 degrees answer across the pull by sin 10° = 0.17 of what they answer along it."""
    along = Loaded("y", "y", "axis y", 0, ("p", "n"), "", "x", "front", 1.0, True)
    across = Loaded("x", "x", "axis x", 0, ("p", "n"), "", "y", "front", lean, False)
    found = list(checks.askew(Pull("hook", (along,), (across,)), {"y": 0.6, "x": 0.6 * seen}))
    assert [(f.code, f.where) for f in found] == [("pull-askew", "front")] * told
