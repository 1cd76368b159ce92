"""Procedures on the twins of another laboratory's rigs, by their own messages: a run, a refusal, what each lacks by name."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench import catalogue
from bench.cli.loading import load_procedure
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.step import capturing, checks
from procedures.step.plan import Plan
from procedures.step.steps import read_steps

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
SPINDLE, STAND = str(EXAMPLES / "vertical-spindle/spindle.toml"), str(EXAMPLES / "plain-stand/stand.toml")


RUNNING = {
    SPINDLE: {"step", "tracking", "unbalance", "run-up", "coast-down", "balance", "spindown"},
    STAND: {"amb-calibration", "step", "bearing-model", "sensitivity", "tracking"},
}


def told(run: Simulated) -> dict[tuple[str, str], float]:
    return {(m.quantity.name, m.where): m.estimate.value for m in run.results if isinstance(m, Measured)}


def lacking(run: Simulated) -> set[str]:
    """What a record would call missing, so that its outcome is an error."""
    needed = {q.name for q in run.procedure.measures if q not in run.procedure.optional}
    return needed - {name for name, _ in told(run)}


def wrong(run: Simulated) -> list[str]:
    return [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE]


@pytest.mark.parametrize("seed", [4, pytest.param(1000001, marks=pytest.mark.long)])
def test_a_standing_shaft_with_axes_at_30_degrees_is_stepped(tmp_path: Path, seed: int) -> None:
    """Set points by bearing axis in one message, telemetry at 2 kHz, no capture, no choice of law; an integrator that is as
    fast as the swing is long. Every quantity that has a truth, of bearings that are alike (4) and that are not."""
    run = simulated_run("step", SPINDLE, seed, {"axes": ["y"]}, tmp_path / "spindle.mcap")
    assert wrong(run) == []
    truth, compared = truth_of_motion(run), Counter[str]()
    for m in run.results:
        if isinstance(m, Measured) and (true := truth.get(f"{m.quantity.name}@{m.where}")) is not None:
            compared[m.quantity.name] += 1
            assert abs(m.estimate.value - true) < 2 * interval(m.estimate, seed).U, (m.quantity.name, m.where)
    shown = ("overshoot", "rise_time", "settling_time", "steady_error", "bandwidth")
    assert compared == {"damping": 1, "natural_frequency": 1, **dict.fromkeys(shown, 4)}
    (frame,) = (f.text for f in run.results if isinstance(f, Finding) and f.code == "coordinates")
    assert frame.startswith("y is along LowU and UppU, 30° from the terminal box.")
    recording = Recording.open(tmp_path / "spindle.mcap", Plan)
    written = [e["t_ns"] for e in recording.events("parameter") if e["name"] in ("TargetLowerU", "TargetUpperU")]
    assert written
    assert written[::2] == written[1::2]
    _two_writes_apart_are_told(recording)


def test_a_controller_with_a_rate_of_its_own_is_told_by_the_sizes(tmp_path: Path) -> None:
    """20 µm in half a millisecond, at a rate that no parameter sets: no step for a loop of 90 Hz that pushes as the set point
    goes."""
    plan = {"axes": ["y"], "settle_s": 1.0}
    run = simulated_run("step", SPINDLE, 1, plan, tmp_path / "spindle.mcap", {"own_slew": 0.04})
    assert "set-points-slewed" in wrong(run)
    (text,) = (f.text for f in run.results if isinstance(f, Finding) and f.code == "set-points-slewed")
    assert "bind it as set_points.slew" in text


@pytest.mark.parametrize(("rate", "found"), [(0.0, False), (0.5, True)])
def test_a_law_that_differentiates_its_error(tmp_path: Path, rate: float, found: bool) -> None:
    """At 0.5 m/s a step is there within a tick, and the derivative pushes as it goes: the start is then found 0.1 to 0.2 ms
    early, and settling times were 2.8 U too long in silence."""
    truth = {"own_slew": rate} if rate else {}
    run = simulated_run("step", SPINDLE, 0, {"axes": ["y"], "settle_s": 1.0}, tmp_path / "spindle.mcap", truth)
    assert wrong(run) == []
    assert ("start-unclear" in {f.code for f in run.results if isinstance(f, Finding)}) is found
    true = truth_of_motion(run)
    times = [m for m in run.results if isinstance(m, Measured) and m.quantity.name == "settling_time"]
    assert len(times) == 4
    for m in times:
        assert abs(m.estimate.value - true[f"settling_time@{m.where}"]) < 1.1 * interval(m.estimate).U
        assert (interval(m.estimate).U > 2e-4) is found


@pytest.mark.parametrize(
    ("softer", "told_of"),
    [(0.7, True), pytest.param(0.85, True, marks=pytest.mark.long), (0.6, False)],
)
def test_a_bearing_that_holds_more_softly(tmp_path: Path, softer: float, told_of: bool) -> None:
    """The lower bearing's proportional gain: at 0.7 and 0.6 of it the mean pole was told 5.5 and 42 Hz off in silence, where
    what both integrators leave was taken to fade alike. At 0.6 one of the poles has a damping of 0.99."""
    run = simulated_run(
        "step", SPINDLE, 1, {"axes": ["y"], "settle_s": 1}, tmp_path / "s.mcap", {"factor_KpLower": softer}
    )
    assert wrong(run) == []
    assert ("oscillations-unlike" in {f.code for f in run.results if isinstance(f, Finding)}) is not told_of
    assert lacking(run) == set()
    seen = [m for m in run.results if isinstance(m, Measured) and m.quantity.name in ("damping", "natural_frequency")]
    assert len(seen) == (2 if told_of else 0)
    truth = truth_of_motion(run)
    for m in seen:
        assert abs(m.estimate.value - truth[f"{m.quantity.name}@{m.where}"]) < 1.5 * interval(m.estimate).U


def _two_writes_apart_are_told(recording: Recording[Plan]) -> None:
    """The step rises in 2.6 ms: 0.2 ms between the set points of its bearings are told, 0.1 ms are not."""
    steps = read_steps(recording)
    for apart, codes in ((0.0, set()), (1e-4, set()), (2e-4, {"set-points-apart"})):
        so = [replace(d, apart=apart) if k == 1 else d for k, d in enumerate(steps)]
        found = list(checks.of_steps(so, recording.plan))
        assert {f.code for f in found} == codes
        for f in found:
            assert f.effect is Effect.INDETERMINATE
            assert f"@{steps[1].case.where}" in f.concerns
            assert "0.2 ms apart" in f.text
            assert "one message" in f.text


def test_a_stand_that_nothing_turns_is_calibrated_by_hand(tmp_path: Path) -> None:
    """At the angles to which the operator turns it; seed fixed before any tuning. What gravity does not pull along is told."""
    run = simulated_run("amb-calibration", STAND, 4, {"settle_s": 0.4, "average_s": 0.2}, tmp_path / "stand.mcap")
    assert wrong(run) == []
    found = {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}
    assert set(found) == {(q, where) for q in ("K", "K2", "Kw") for where in ("y_vorn", "y_hinten")}
    for (quantity, where), estimate in found.items():
        assert abs(estimate.value - run.truth[f"{quantity}@{where}"]) < 3 * estimate.u, (quantity, where)
    assert {f.where for f in run.results if isinstance(f, Finding) and f.code == "no-known-force"} == {
        "x_vorn",
        "x_hinten",
    }
    turned = [e["angle_rad"] for e in run.recording.events("operator") if e.get("action") == "turn"]
    assert len(turned) == 8
    assert {"K@y_vorn", "K@y_vorn, 7", "F0@y_hinten, 0"} < set(run.calibration().values)


@pytest.mark.parametrize(
    ("truth", "code", "where"),
    [({"told_coils.y_vorn": 1.0}, "wrong-sign", "y_vorn"),
     pytest.param({"mass_error_G2": 0.003}, "load-inconsistent", "G2", marks=pytest.mark.long),
     pytest.param({"hanger_off_at_zero": 1.0}, "load-inconsistent", "no load", marks=pytest.mark.long)],
)  # fmt: skip
def test_what_is_wrong_with_masses_or_coils_is_told(
    tmp_path: Path, truth: dict[str, float], code: str, where: str
) -> None:
    run = simulated_run("amb-calibration", STAND, 4, {"settle_s": 0.4, "average_s": 0.2}, tmp_path / "s.mcap", truth)
    assert [(f.code, f.where) for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == [
        (code, where)
    ]


PULLEY = """[hooks.seite]
at = { from = "bearings/vorn", by = { value = 60, unit = "mm", half_width = 0.1, distribution = "rectangular", source = "-" } }
pull = { value = -90, unit = "deg", half_width = 0.5, distribution = "rectangular", source = "set by a level" }

[hooks.seite.pulley]
friction = { value = 0.01, unit = "1", half_width = 0.005, distribution = "rectangular", source = "weights on both sides" }
misalignment = { value = 0, unit = "deg", half_width = 0.5, distribution = "rectangular", source = "by eye" }

[spans]"""


def changed(folder: Path, old: str, new: str) -> str:
    """The plain stand with another rig file."""
    text = Path(STAND).read_text(encoding="utf-8")
    assert old in text
    (folder / "stand.toml").write_text(text.replace(old, new), encoding="utf-8")
    (folder / "stand.dbc").write_bytes(Path(STAND).with_name("stand.dbc").read_bytes())
    return str(folder / "stand.toml")


@pytest.mark.long
@pytest.mark.parametrize(
    ("old", "new", "plan"),
    [('= { direction = { value = 0, unit = "deg"', '= { direction = { value = 40, unit = "deg"', {}),
     ("[spans]", PULLEY, {}), ("[spans]", "[spans]", {"angles": 1})],
    ids=["axes at 40 and -50 degrees", "a side pull over a pulley", "a shaft that stays as it stands"],
)  # fmt: skip
def test_whatever_pulls_is_in_the_budget(tmp_path: Path, old: str, new: str, plan: dict[str, int]) -> None:
    """Seeds fixed before any tuning. Where both axes of a bearing feel the load each has its constant; friction and angle of a
    pulley make the interval of what it pulls along wider."""
    rig, every = changed(tmp_path, old, new), {"y_vorn", "y_hinten", "x_vorn", "x_hinten"}
    run = simulated_run("amb-calibration", rig, 1, {"settle_s": 0.4, "average_s": 0.2, **plan}, tmp_path / "s.mcap")
    assert wrong(run) == []
    found = {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}
    assert {where for _, where in found} == (every if not plan else {"y_vorn", "y_hinten"})
    for (quantity, where), estimate in found.items():
        assert abs(estimate.value - run.truth[f"{quantity}@{where}"]) < 3 * estimate.u, (quantity, where)
    if new == PULLEY:
        budget = {i.id: abs(c * i.u) for i, c in found["K", "x_vorn"].sensitivities.items()}
        assert budget["hooks/seite/pulley/friction"] > 0.001 * found["K", "x_vorn"].value
    if plan:
        assert "one-angle" in [f.code for f in run.results if isinstance(f, Finding)]


def test_steps_are_captured_where_telemetry_is_slow(tmp_path: Path) -> None:
    """Telemetry of 500 Hz, a rise of 2 ms, captures of 8 kHz: each step has one, and means over half a millisecond of it. Seed
    fixed before any tuning."""
    run = simulated_run("step", STAND, 1, {"axes": ["y"]}, tmp_path / "stand.mcap")
    assert wrong(run) == []
    found = told(run)
    assert found["natural_frequency", "A, y, 0 r/min"] == pytest.approx(run.truth["frequency"], rel=0.03)
    assert found["damping", "A, y, 0 r/min"] == pytest.approx(run.truth["damping"], rel=0.05)
    assert found["rise_time", "A, y, 0 r/min, 20 µm up"] == pytest.approx(2.15e-3, rel=0.05)
    steps = [s for s in run.recording.all_steps() if s.kind == "set-point"]
    assert [c.labels["step"] for c in run.recording.captures()] == list(range(len(steps)))
    telemetry, names = steps[0].read("LageYVorn"), ["LageYVorn"]
    fast = capturing.averaged(run.recording.captures()[0], names, 1.25e-4)
    at = np.searchsorted(fast["t_ns"], telemetry["t_ns"][5:200])
    of_four = [fast["LageYVorn"][k - 3 : k + 1].mean() for k in at]
    assert np.std(of_four - telemetry["LageYVorn"][5:200]) < 0.02e-6  # the same ticks, rounded to 0.03 µm


def test_telemetry_that_is_too_slow_for_a_step_is_told_and_nothing_measured(tmp_path: Path) -> None:
    """Two samples of 2 ms in a rise, and no captures: an overshoot by them would be a guess."""
    text = Path(STAND).read_text(encoding="utf-8")
    rig = changed(tmp_path, text[text.index("[capture]") : text.index("[plans.amb-calibration]")], "")
    run = simulated_run("step", rig, 1, {"axes": ["y"]}, tmp_path / "stand.mcap")
    assert wrong(run) == ["telemetry-too-slow"]
    assert told(run) == {}


@pytest.mark.parametrize("path", [SPINDLE, STAND], ids=["spindle", "stand"])
def test_what_a_procedure_lacks_is_told_by_tables_and_names(path: str) -> None:
    rig = load_rig(path)
    lacking = {entry.name: load_procedure(entry.name).lacking(rig) for entry in catalogue.PROCEDURES}
    assert {name for name, lines in lacking.items() if not lines} == RUNNING[path]
    if path == STAND:
        assert all("nothing turns it" in lacking[name][0] for name in ("unbalance", "run-up", "coast-down", "balance"))
    if path == SPINDLE:
        assert lacking["amb-calibration"][0].startswith("no weight across the shaft: found one that stands")
    lines = [line for said in lacking.values() for line in said]
    assert all(line.partition(": ")[2] for line in lines)
    assert any("no injection" in line for line in lacking["sensitivity"]) == (path == SPINDLE)


def test_an_orbit_ends_as_smoothly_as_it_began(tmp_path: Path) -> None:
    """It shrinks from where its last point was: the set points jumped across the whole ellipse, which tripped a shaft of less
    room, and took the stand's to twice its orbit."""
    run = simulated_run("tracking", STAND, 1, {"settle_s": 1.0, "revolutions": 6.0}, tmp_path / "t.mcap")
    assert wrong(run) == []
    recording = run.recording
    (orbit,) = recording.steps("orbit")
    for name in ("LageYVorn", "LageYHinten", "LageXVorn", "LageXHinten"):
        within, after = (
            np.abs(recording.channel(name, *span)[name]).max()
            for span in ((orbit.start_ns, orbit.end_ns), (orbit.end_ns, orbit.end_ns + 2_000_000_000))
        )
        assert after < 1.1 * within
