"""Pull over force constant: the bare model against statics solved another way, the whole path, what is planted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.calibration import Calibration
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.pull_ratio import checks, estimates, fit
from procedures.pull_ratio.plan import Plan
from procedures.pull_ratio.planes import BOTH, Level, asked, axes, needed_N, order, planes, upwards
from procedures.pull_ratio.procedure import check, procedure, step_count
from procedures.pull_ratio.steps import Taken
from reports.figures import draw as draw_figure

REDUCED = {"reduced": 1.0}
SHORT = {"levels_m": (-20e-6, 0.0, 20e-6), "average_s": 0.03}
MASS, G = 1.34, 9.81
PULL, FORCE = (380e3, 365e3), (3.6, 3.8)


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1, calibration: Calibration | None = None,
        **plan: Any) -> Simulated:  # fmt: skip
    return simulated_run(
        "pull-ratio", "lira", seed, {**SHORT, **plan}, folder / "recording.mcap", {**REDUCED, **(truth or {})},
        {} if calibration is None else {"unstable-pole": calibration},
    )  # fmt: skip


def codes(done: Simulated, least: Effect = Effect.INDETERMINATE) -> set[str]:
    strong = [e for e in Effect if e is not Effect.NOTE] if least is not Effect.NOTE else list(Effect)
    return {r.code for r in done.results if isinstance(r, Finding) and r.effect in strong}


def values(done: Simulated) -> dict[str, Any]:
    named = {f"{r.quantity.name}@{r.where}": r.estimate for r in done.results if isinstance(r, Measured)}
    return {name.removesuffix("@"): estimate for name, estimate in named.items()}


def levels(turn: float = 0.0, lever: float = 0.98, middle: float = 2e-3, gains: tuple[float, float] = (1.0, 1.0),
           centres: tuple[complex, complex] = (0j, 0j), plan: Plan | None = None) -> list[Taken]:  # fmt: skip
    """By forces and moments, of a shaft that stands as the probes' readings say: complex x + jy, planes at 45 mm, a centre of
    mass that is off the middle. The currents of both planes are solved for, not taken from `fit`'s own formula."""
    rig, out = load_rig("lira"), []
    first, second = 0.045 - middle, -0.045 - middle
    for one in order(rig, plan or Plan()):
        points = asked(rig, one)
        y = [points.get(f"ref_x{k}", 0.0) + 1j * points.get(f"ref_y{k}", 0.0) for k in (1, 2)]
        true = [a / g for a, g in zip(y, gains, strict=True)]
        mean, half = sum(true) / 2, (true[0] - true[1]) / 2 * lever
        x = [mean + half, mean - half]
        pulled = [p * (at - c) for p, at, c in zip(PULL, x, centres, strict=True)]
        # sum of forces carries the weight, moments about the centre of mass vanish
        matrix = np.array([[1.0, 1.0], [first, second]])
        held = np.linalg.solve(matrix, [1j * MASS * G - sum(pulled), -(first * pulled[0] + second * pulled[1])])
        i = held / np.array(FORCE) * np.exp(-1j * turn)
        readings = np.array([v for a in y for v in (a.real, a.imag)])
        currents = np.array([v for a in i for v in (a.real, a.imag)])
        out.append(Taken(one, readings, currents, {"gamma": 0.0}, 0.0, 0.0, ("LEVITATED",), 0, 100))
    return out


@pytest.mark.parametrize("middle", [-5e-3, 0.0, 2e-3])
@pytest.mark.parametrize("turn", [0.0, math.radians(10)])
@pytest.mark.parametrize("lever", [0.9, 1.0, 1.1])
def test_neither_lever_nor_centre_of_mass_nor_frame_is_in_the_ratio(lever: float, turn: float, middle: float) -> None:
    rig = load_rig("lira")
    r = estimates.result(levels(turn, lever, middle), rig, None)
    for k, (pull, force) in enumerate(zip(PULL, FORCE, strict=True)):
        for axis in "xy":
            assert r.estimates["pull_ratio", f"{axis}{k + 1}"].value == pytest.approx(pull / force, rel=1e-9)
        assert r.estimates["frame_turn", f"RA{k + 1}"].value == pytest.approx(turn, abs=1e-9)
    assert r.estimates["lever_ratio", ""].value == pytest.approx(lever, rel=1e-9)
    assert not list(checks.of_result(r, levels(turn, lever), rig, Plan())) or turn or lever != 1.0


def test_along_an_axis_alone_the_frame_would_cost_its_cosine() -> None:
    """10 degrees: 99.8 in the place of 101.3 A/mm; the component along d alone."""
    turn, some = math.radians(10), levels(math.radians(10), 1.0)
    found = fit.statics(np.array([t.readings for t in some]), np.array([t.currents for t in some]))
    alone = -(found.slopes[0, 0] + found.slopes[0, 2])
    assert alone == pytest.approx(PULL[0] / FORCE[0] * math.cos(turn), rel=1e-9)
    assert pytest.approx(101351, abs=1) == 375e3 / 3.7
    assert 375e3 / 3.7 * math.cos(turn) == pytest.approx(99812, abs=1)


def test_without_current_along_the_weight_it_is_centre_and_sag_together() -> None:
    """Plane 1 carries m g (l + c)/(2 l) of the weight, c towards it; x: the centre alone. No probe's zero is in it."""
    centres, middle = (7e-6 + 3e-6j, -4e-6 - 2e-6j), 2e-3
    r = estimates.result(levels(0.05, 1.0, middle, centres=centres), load_rig("lira"), None)
    for k, centre in enumerate(centres):
        share = (1 + (1 - 2 * k) * middle / 0.045) / 2
        assert r.estimates["current_free", f"x{k + 1}"].value == pytest.approx(centre.real, abs=1e-12)
        expected = centre.imag + MASS * G * share / PULL[k]
        assert r.estimates["current_free", f"y{k + 1}"].value == pytest.approx(expected, abs=1e-12)


def test_with_force_constants_the_pull_of_each_plane() -> None:
    from bench.uncertainty import Estimate

    known = {f"K_B@RA{k + 1}": Estimate.exact(force, "N/A") for k, force in enumerate(FORCE)}
    r = estimates.result(levels(0.05), load_rig("lira"), None, known)
    for k, pull in enumerate(PULL):
        assert r.estimates["K_pull", f"RA{k + 1}"].value == pytest.approx(pull, rel=1e-9)
    assert {q.name for q in procedure.left_out(Plan())} == {"bearing_constant", "magnet_centre", "K_pull"}
    assert {q.name for q in procedure.left_out(Plan(constants="calibration"))} == {"bearing_constant", "magnet_centre"}
    assert [n.procedure for n in procedure.needs(Plan(constants="calibration"))] == ["bearing-constant"]


def test_with_the_pole_the_centre_along_the_weight_needs_neither_mass_nor_constant() -> None:
    """g/lambda^2, 17.5 um; K by lambda^2 m over the sum of the ratios is the weighted mean of both, not either of them."""
    from bench.uncertainty import Estimate

    rig, centres = load_rig("lira"), (3e-6j, -2e-6j)
    pole = Estimate.exact(math.sqrt(sum(PULL) / MASS), "1/s")
    some = levels(centres=centres, middle=0.0, lever=1.0)
    r = estimates.result(some, rig, {"pole@x": pole, "pole@y": pole})
    assert ("magnet_centre", "x") not in r.estimates
    assert r.estimates["magnet_centre", "y"].value == pytest.approx(
        0.5e-6, abs=0.02e-6
    )  # planes 4 % apart: second order
    weighted = sum(PULL) / sum(p / k for p, k in zip(PULL, FORCE, strict=True))
    assert r.estimates["bearing_constant", "x"].value == pytest.approx(weighted, rel=1e-9)
    assert FORCE[0] < weighted < FORCE[1]
    mean_current = np.mean([t.currents[[1, 3]].sum() for t in levels(centres=(10e-6j, 10e-6j), middle=0.0)])
    naive = MASS * G / mean_current  # 10 um of offset are 7.5 N of 13.1 N
    assert naive / weighted > 1.3 or naive / weighted < 0.7


def test_gains_of_probes_count_in_the_ratio_and_not_in_the_zero() -> None:
    centres = (5e-6 + 0j, 5e-6 + 0j)
    r = estimates.result(levels(gains=(1.02, 1.0), centres=centres, lever=1.0), load_rig("lira"), None)
    assert r.estimates["pull_ratio", "x1"].value == pytest.approx(PULL[0] / FORCE[0] / 1.02, rel=1e-9)
    assert r.estimates["pull_ratio", "x2"].value == pytest.approx(PULL[1] / FORCE[1], rel=1e-9)
    assert r.estimates["current_free", "x1"].value == pytest.approx(5e-6 * 1.02, rel=1e-9)  # it is a reading


def test_the_stated_uncertainty_is_that_of_many() -> None:
    """Noise of the levels alone, of a short plan: errors over their standard uncertainty."""
    rig, short = load_rig("lira"), Plan.model_validate(SHORT)
    clean = levels(0.03, 0.99, centres=(4e-6 + 1e-6j, -3e-6j), plan=short)
    errors: dict[tuple[str, str], list[float]] = {}
    sure = estimates.result(clean, rig, None).estimates
    for seed in range(60):
        rng = np.random.default_rng(seed)
        noisy = [replace(t, currents=t.currents + rng.normal(0, 5e-3, 4)) for t in clean]
        for key, estimate in estimates.result(noisy, rig, None).estimates.items():
            u = math.hypot(*(c for i, c in estimate.contributions.items() if i.startswith("scatter")))
            errors.setdefault(key, []).append((estimate.value - sure[key].value) / u)
    assert len(errors) == 11
    for key, some in errors.items():
        assert np.std(some) == pytest.approx(1.0, abs=0.35), key
        assert abs(np.mean(some)) < 0.5, key


def test_offsets_and_gains_of_coils_move_what_the_budget_says() -> None:
    """One coil's reading off by 0.1 A, or by 1 %: as the firmware's transform of it, W'/2 and Park, has it."""
    rig, clean = load_rig("lira"), levels(0.0, 1.0, centres=(6e-6 + 0j, 0j))
    sure = estimates.result(clean, rig, None)
    coil, phase = "i_s2", math.radians(60)
    read_d, read_q = 2 / 6 * math.cos(phase), -2 / 6 * math.sin(phase)
    off = [replace(t, currents=t.currents + 0.1 * np.array([read_d, read_q, 0, 0])) for t in clean]
    moved = estimates.result(off, rig, None)
    u = rig.sensors[coil].offset.standard_uncertainty
    for where in ("x1", "y1", "x2", "y2"):
        share = sure.estimates["current_free", where].contributions.get(f"sensors/{coil}/offset", 0.0) / u
        found = moved.estimates["current_free", where].value - sure.estimates["current_free", where].value
        assert found == pytest.approx(-0.1 * share, rel=1e-6, abs=1e-12)
    carried = [math.cos(phase) * t.currents[0] - math.sin(phase) * t.currents[1] for t in clean]
    bent = [replace(t, currents=t.currents + 0.01 * c * np.array([read_d, read_q, 0, 0]))
            for t, c in zip(clean, carried, strict=True)]  # fmt: skip
    more = estimates.result(bent, rig, None)
    u = rig.sensors[coil].gain.standard_uncertainty
    for where in ("x1", "y1"):
        share = sure.estimates["pull_ratio", where].contributions[f"sensors/{coil}/gain"] / u
        found = more.estimates["pull_ratio", where].value - sure.estimates["pull_ratio", where].value
        assert found == pytest.approx(-0.01 * share, rel=0.02)


def test_levels_that_tell_nothing() -> None:
    with pytest.raises(AnalysisError, match="do not tell how"):
        fit.statics(np.zeros((20, 4)), np.zeros((20, 4)))
    still = fit.statics(np.random.default_rng(1).normal(0, 1e-6, (20, 4)), np.zeros((20, 4)))
    with pytest.raises(AnalysisError, match="do not go with the place"):
        fit.without_current(still)


def test_the_truth_is_recovered(tmp_path: Path) -> None:
    pole = simulated_run("unstable-pole", "lira", 3, {"shots": 12}, tmp_path / "pole.mcap", REDUCED).calibration()
    done = run(tmp_path, seed=3, calibration=pole, pole="calibration")
    assert codes(done) == set()
    truth, found = truth_of_motion(done), values(done)
    assert found.keys() == truth.keys()
    assert len(found) == 14
    for name, estimate in found.items():
        span = interval(estimate)
        assert abs(estimate.value - truth[name]) <= 1.5 * (span.high - span.low) / 2, name
    assert found["pull_ratio@x1"].u < 0.01 * found["pull_ratio@x1"].value
    figures = list(procedure.drawn(done.recording))
    assert [f.key for f in figures] == ["levels-x", "levels-y"]
    for figure in figures:
        assert draw_figure(figure)


@pytest.mark.parametrize(
    ("truth", "code", "least"),
    [({"factor_ki_b": 0.1}, "unsettled", Effect.INDETERMINATE), ({"x1.gain": 1.1}, "axes-unlike", Effect.INDETERMINATE),
     ({"geometry.sensor_plane": 0.055}, "levers-off", Effect.INDETERMINATE),
     ({"zero_off_ra": 0.1745}, "frame-turned", Effect.NOTE)],
)  # fmt: skip
def test_what_is_planted_is_found(tmp_path: Path, truth: dict[str, float], code: str, least: Effect) -> None:
    done = run(tmp_path, truth)
    assert code in codes(done, least)
    if code == "frame-turned":  # and costs nothing
        assert codes(done) == set()
        found, true = values(done)["pull_ratio@x1"], truth_of_motion(done)["pull_ratio@x1"]
        assert abs(found.value - true) < 2 * found.u * 1.2


@pytest.mark.parametrize(
    ("of", "code"),
    [({"readings": None}, "level-not-captured"), ({"states": ("FAULT",)}, "not-levitated"), ({"lost": 5}, "missing-samples"),
     ({"limited": 0.01}, "loop-limited"), ({"off": 1e-6}, "unsettled")],
)  # fmt: skip
def test_a_level_that_is_none(of: dict[str, Any], code: str) -> None:
    rig, plan, some = load_rig("lira"), Plan(), levels()
    assert list(checks.of_signals(some, rig, plan)) == []
    assert [f.code for f in checks.of_signals([*some, replace(some[0], **of)], rig, plan)] == [code]
    assert [f.code for f in checks.of_signals([], rig, plan)] == ["no-levels"]


def test_what_levels_say_against_themselves() -> None:
    """Friction that holds back by 20 mA, a pull that bends, signs, planes and constants that are exchanged."""
    from bench.uncertainty import Estimate

    rig, plan, clean = load_rig("lira"), Plan(), levels(lever=1.0)

    def said(some: list[Taken], poles: dict[str, Estimate] | None = None) -> list[str]:
        return sorted({f.code for f in checks.of_result(estimates.result(some, rig, poles), some, rig, plan)})

    ways = [replace(t, currents=t.currents + 0.01 * t.level.branch) for t in clean]
    bent = [
        replace(t, currents=t.currents - 0.5 * np.sign(t.level.level_m) * (t.level.level_m / 20e-6) ** 2) for t in clean
    ]
    swapped = [replace(t, currents=t.currents[[2, 3, 0, 1]]) for t in clean]
    against = [replace(t, currents=t.currents * np.array([-1, 1, 1, 1])) for t in clean]
    assert said(clean) == []
    assert said(ways) == ["ways-differ"]
    assert "misfit" in said(bent)
    assert said(swapped) == ["planes-linked"]
    assert said(against) == ["wrong-sign"]
    right = math.sqrt(sum(PULL) / MASS)
    assert said(clean, {"pole@x": Estimate.exact(right, "1/s")}) == []
    assert said(clean, {"pole@x": Estimate.exact(right * 1.05, "1/s")}) == ["constant-off"]


def test_order_is_against_drift_and_everything_comes_back() -> None:
    rig, sent = load_rig("lira"), list(order(load_rig("lira"), Plan()))
    assert len(sent) == step_count(Plan()) == 54
    assert [s.moved for s in sent[::9]] == [BOTH, "x1", "x2", BOTH, "y1", "y2"]
    for moved in range(6):
        some = sent[9 * moved : 9 * moved + 9]
        assert [s.level_m for s in some] == [s.level_m for s in reversed(some)]
        assert [s.branch for s in some] == [-1, 1, 1, 1, 1, -1, -1, -1, -1]
    assert asked(rig, Level("x", BOTH, 1e-5, 1)) == {"ref_x1": 1e-5, "ref_x2": 1e-5}
    assert asked(rig, Level("y", "y2", 1e-5, 1)) == {"ref_y1": 0.0, "ref_y2": 1e-5}


def test_what_the_rig_file_tells() -> None:
    """x1 needs 375 N/mm (20 + 5) um = 9.4 N; y1 half of 13.15 N more."""
    rig = load_rig("lira")
    assert [p.name for p in planes(rig)] == ["RA1", "RA2"]
    assert axes(rig) == {"x": ("x1", "x2"), "y": ("y1", "y2")}
    assert upwards(rig, "y1") == 1.0
    assert upwards(rig, "x2") == pytest.approx(0, abs=1e-12)
    assert needed_N(rig, "x1", 20e-6) == pytest.approx((9.375, 26.2))
    assert needed_N(rig, "y1", 20e-6)[0] == pytest.approx(9.375 + 0.67 * 9.81175)

    def wrong(**plan: Any) -> str:
        return "; ".join(check(rig, Plan.model_validate(plan)))

    assert wrong() == ""
    assert "both sides of zero" in wrong(levels_m=(0.0, 1e-5, 2e-5))
    assert "levels_m: y1 would need 21.6 N at 35 µm" in wrong(levels_m=(-35e-6, 0.0, 35e-6))
    assert "observer: found 'none'" in wrong(observer="none")
