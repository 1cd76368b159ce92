"""A mission through the whole path: what it says of a sound rig, rigs that do not fly, and the fits on arrays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_figures import figures_drawn

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Flown, Simulated, flown
from bench.errors import Aborted
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.record.outcomes import Outcome
from bench.rigfile import load_rig
from bench.rigfile.check_capabilities import problems_of
from bench.uncertainty import interval
from procedures.mission import checks, fit
from procedures.mission.plan import Plan
from procedures.mission.procedure import MEASURES, check, pieces, procedure
from procedures.mission.steps import Flight
from sim_backend.truth import nominal

RIG = load_rig("lira")
REDUCED = {"reduced": 1.0}
GATE_S, ARRIVES_S = 0.25, 8e-3 / 0.02 + 0.02  # of the lift: 8 mm at 20 mm/s, braked with 1 m/s^2
UM = 1e-6


def mission(folder: Path, seed: int = 0, truth: dict[str, float] | None = None, **plan: Any) -> Flown:
    return flown("mission", "lira", seed, plan, folder / "recording.mcap", truth or REDUCED)


def wrong(run: Simulated) -> dict[str, Finding]:
    return {r.code: r for r in run.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


def told(run: Simulated) -> dict[str, Measured]:
    return {f"{m.quantity.name}@{m.where}": m for m in run.results if isinstance(m, Measured)}


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    return mission(tmp_path_factory.mktemp("sound"), truth={**nominal(RIG), **REDUCED}).analysed()


def test_a_nominal_rig_flies(sound: Simulated) -> None:
    assert wrong(sound) == {}
    found = told(sound)
    assert {m.quantity for m in found.values()} == set(MEASURES)
    for probe in ("x1", "x2", "y1", "y2"):
        assert 0 < found[f"peak_reading@{probe}"].estimate.value < 75 * UM
        assert abs(found[f"level_difference@{probe}"].estimate.value) < 0.1 * UM
        assert 18 * UM < found[f"gate_margin@{probe}"].estimate.value < 20 * UM
    assert figures_drawn(sound)


def test_the_gate_passes_a_quarter_of_a_second_after_arrival(sound: Simulated) -> None:
    assert told(sound)["lift_time@"].estimate.value == pytest.approx(ARRIVES_S + GATE_S, abs=4e-3)


@pytest.mark.parametrize(("seed", "observer"), [(1, "position"), (3, "paper")])
def test_the_truth_lies_in_the_intervals(tmp_path: Path, seed: int, observer: str) -> None:
    run = mission(tmp_path, seed, observer=observer).analysed()
    true, found = truth_of_motion(run), told(run)
    assert wrong(run) == {}
    assert {name.removesuffix("@") for name in found} == true.keys()
    missed = [
        name
        for name, m in found.items()
        if not (i := interval(m.estimate)).low <= true[name.removesuffix("@")] <= i.high
    ]
    assert len(missed) <= 2, missed  # of 21, at 95 %
    for name in (n for n in found if n.startswith(("peak_reading", "swing"))):
        value = true[name]
        assert interval(found[name].estimate).high - value < 0.4 * UM + 0.02 * value  # the gain's 1 %, and noise


def test_captures_may_be_several(tmp_path: Path) -> None:
    run = mission(tmp_path, captures=2, repeats=3, currents=False).analysed()
    assert wrong(run) == {}
    assert [len(r) for r in pieces(run.recording.plan)] == [2, 1]
    assert len(run.recording.captures(part="move")) == 2


def test_a_gate_that_does_not_pass_is_an_error_that_names_the_probe(tmp_path: Path) -> None:
    run = mission(tmp_path, truth={**REDUCED, "position_noise": 7e-6}, observer="paper").analysed()
    found = wrong(run)
    assert found["gate-not-passed"].effect is Effect.ERROR
    assert "µm allowed" in found["gate-not-passed"].text
    assert told(run) == {}


@pytest.mark.parametrize("planted", [{**REDUCED, "no_pull": 1.0}, {"exchange_phases": 1.0}])
def test_levitation_that_is_lost_is_aborted_and_says_how_far(tmp_path: Path, planted: dict[str, float]) -> None:
    run = mission(tmp_path, truth=planted, observer="paper")
    assert isinstance(run.machine.cause, Aborted)
    assert run.machine.ending.stopped is Outcome.ABORTED
    assert "farthest is" in str(run.machine.cause)


def synthetic(noise: float, count: int = 17_500, *, seed: int = 1) -> tuple[np.ndarray, list[np.ndarray]]:
    """A bump of 10 µm, 20 ms wide, back by half, with noise; and noise alone."""
    rng, t = np.random.default_rng(seed), np.arange(count) / 35e3
    bump = 10 * UM * (np.exp(-(((t - 0.1) / 0.02) ** 2)) - 0.5 * np.exp(-(((t - 0.3) / 0.02) ** 2)))
    return bump + noise * rng.normal(size=count), [noise * rng.normal(size=5000) for _ in range(4)]


def test_noise_makes_a_largest_value_larger_and_is_taken_off() -> None:
    values, swings = [], []
    for seed in range(20):
        x, rests = synthetic(0.3 * UM, seed=seed)
        assert np.abs(x).max() > 10.3 * UM  # as it is read
        values.append(fit.without_noise(x, rests, 21, fit.largest_distance))
        swings.append(fit.without_noise(x, rests, 21, fit.swing))
    for found, true in ((values, 10 * UM), (swings, 15 * UM)):
        error = np.array([f.value for f in found]) - true
        assert abs(error.mean()) < 0.03 * UM
        assert 0.5 < error.std() / np.mean([f.u for f in found]) < 1.5
        assert all(f.bias > 0 for f in found)


def test_without_noise_nothing_is_taken_off_but_what_the_window_takes() -> None:
    x, rests = synthetic(0.0)
    found = fit.without_noise(x, rests, 21, fit.largest_distance)
    assert (found.bias, found.u) == pytest.approx((0, 0), abs=1e-15)
    assert found.value == pytest.approx(10 * UM, abs=max(found.bent, 1e-12))


def flight(*states: tuple[str, float]) -> Flight:
    t = np.arange(0.0, 5.0, 2e-3)
    far = {name: np.full(len(t), 3 * UM) for name in ("x1", "x2", "y1")}
    return Flight(None, [], [], states, {"t": t, **far, "y2": np.full(len(t), -27 * UM)})


def test_states_tell_what_happened() -> None:
    plan = Plan()
    (never,) = checks.of_flight(flight(("READY", 0.0)), RIG, plan)
    assert never.code == "not-lifted"
    (gate,) = checks.of_flight(flight(("READY", 0.0), ("LIFTING", 1.0), ("LANDING", 4.0)), RIG, plan)
    assert gate.code == "gate-not-passed"
    assert "within 3.0 s: y2 reads up to 27.0 µm" in gate.text
    (short,) = checks.of_flight(flight(("READY", 0.0), ("LIFTING", 1.0), ("LEVITATED", 2.0)), RIG, plan)
    assert short.code == "moves-missing"


def test_a_move_that_outlasts_its_capture_is_missing() -> None:
    from procedures.mission.steps import Move, Piece

    flew = flight(("READY", 0.0), ("LIFTING", 1.0), ("LEVITATED", 2.0))
    moves = [Move(k // 2, 1 - k % 2, 2.5 + 0.5 * k, 2.5 + 0.5 * k + 0.4) for k in range(2 * Plan().repeats)]
    whole = Piece(np.arange(2.4, moves[-1].end + 0.1, 1e-3), {})
    assert not list(checks.of_flight(replace(flew, moves=moves, pieces=[whole]), RIG, Plan()))
    cut = Piece(whole.t[whole.t < moves[-1].begin], {})
    (short,) = checks.of_flight(replace(flew, moves=moves, pieces=[cut]), RIG, Plan())
    assert short.code == "moves-missing"
    assert f"1 of {len(moves)} moves lie in no capture, first that of repeat {moves[-1].repeat}" in short.text


def test_what_came_down_by_itself_is_told() -> None:
    from procedures.mission.steps import Move

    flew = flight(("READY", 0.0), ("LIFTING", 1.0), ("LEVITATED", 2.0), ("LANDING", 3.0))
    (down,) = checks.of_flight(replace(flew, moves=[Move(0, 1, 2.5, 4.0)]), RIG, Plan())
    assert down.code == "came-down"
    assert "1.00 s after the gate the controller went to LANDING by itself" in down.text


@pytest.mark.parametrize(
    ("plan", "key"),
    [
        ({"observer": "neither"}, "observer: found 'neither'"),
        ({"places_m": (8e-3, 30e-3)}, "places_m: found 0.008, 0.03"),
        ({"angle_rate_rad_s": 40.0}, "angle_rate_rad_s: found 40"),
        ({"captures": 9}, "captures: found 9"),
        ({"rest_s": 0.48}, "rest_s: found 0.48 s"),
        ({"repeats": 60}, "captures: found 1, of up to"),
    ],
)
def test_plans_that_cannot_work(plan: dict[str, Any], key: str) -> None:
    assert list(check(RIG, Plan())) == []
    assert [p for p in check(RIG, Plan(**plan)) if p.startswith(key)]


def test_a_motion_leads_somewhere() -> None:
    assert list(problems_of(RIG)) == []
    text = RIG.toml_text.replace('place_channel = "z"', 'place_channel = "gamma"').replace(
        'gate = "gate"', 'gate = "gates"'
    )
    text = text.replace('currents = ["i_d_B1"', 'currents = ["i_d_B3"')
    found = [str(p) for p in problems_of(type(RIG).parse(text, RIG.dbc_text))]
    assert any("capabilities.motion.place_channel: found gamma, in rad; expected a channel in m" in p for p in found)
    assert any("capabilities.motion.gate: found 'gates'" in p for p in found)
    assert any("capabilities.motion.currents: found 'i_d_B3'" in p for p in found)


def test_a_rig_without_motion_lacks_it() -> None:
    lines = procedure.lacking(load_rig("amb5dof"))
    assert any("motion" in line for line in lines)
