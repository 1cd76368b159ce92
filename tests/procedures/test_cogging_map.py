"""The map of cogging: the bare model by hand, the whole path against the drawn machine, what is planted, refusals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence, interval
from procedures.cogging_map import checks, estimates, fit
from procedures.cogging_map.estimates import Result
from procedures.cogging_map.plan import Plan
from procedures.cogging_map.procedure import check, procedure, steps_on
from procedures.cogging_map.steps import Pass, read_passes
from procedures.cogging_map.sweeps import fed, way
from procedures.position_loops.lines import unwound
from reports.figures import draw as draw_figure
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.truth_cogging import cogging

RIG = load_rig("lira")
REDUCED = {"reduced": 1.0}
QUICK: dict[str, Any] = {"speed_m_s": 0.01, "speed_rad_s": 0.9, "settle_s": 0.3}


def run(folder: Path, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    path = folder / "recording.mcap"
    path.unlink(missing_ok=True)
    return simulated_run("cogging-map", "lira", 1, {**QUICK, **plan}, path, {**REDUCED, **(truth or {})})


def values(done: Simulated) -> dict[str, Estimate]:
    return {f"{r.quantity.name}@{r.where}": r.estimate for r in done.results if isinstance(r, Measured)}


def wrong(done: Simulated) -> set[str]:
    return {r.code for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


# The bare model.

MASS, CONSTANT, FORCE, FIRST = 1.45e-3, 0.42, 0.0376, 48
TURN = 2 * math.pi


def swung(size: float = 4.75e-3, speed: float = 0.4) -> tuple[fit.Array, fit.Array, fit.Array]:
    """Times, places and currents of a turn in which the shaft swings about steady progress by two harmonics of the time."""
    t = np.arange(0, TURN / speed, 2e-3)
    w = FIRST * speed
    x = speed * t + size * np.sin(w * t + 0.4) + 0.05 * size * np.cos(2 * w * t)
    rising = -(w**2) * (size * np.sin(w * t + 0.4) + 4 * 0.05 * size * np.cos(2 * w * t))
    b = FIRST * x - 0.7
    force = FORCE * (np.sin(b) + 0.06 * np.sin(2 * b) - 0.02 * np.cos(2 * b))
    return t, x, (force + MASS * rising) / CONSTANT + 1e-3


def test_what_the_mass_takes_to_swing_is_taken_off() -> None:
    t, x, i = swung()
    inside = (x >= 0) & (x < TURN)
    found = fit.swept(x[inside], t[inside], x[inside], i[inside], (48, 96, 144, 1), FIRST)
    whole = found.corrected(MASS / CONSTANT)
    shape = fit.shape(whole[0], whole[1], 48)
    assert found.rate == pytest.approx(0.4, rel=1e-3)
    assert found.swung == pytest.approx(4.75e-3, rel=1e-2)
    assert shape.amplitude == pytest.approx(FORCE / CONSTANT, rel=2e-4)
    assert (shape.phase * 48, shape.sine, shape.cosine) == pytest.approx((0.7, 0.06, -0.02), abs=3e-4)


def test_without_it_the_current_alone_is_seven_per_cent_off() -> None:
    """(k w)^2 M e = 19.2^2 1.45e-3 4.75e-3 = 2.5e-3 N m of 0.0376; and in the place half of 48 e of that at twice as many."""
    t, x, i = swung()
    found = fit.swept(x, t, x, i, (48, 96, 144, 1), FIRST)
    off = abs(MASS * found.rising[0]) / FORCE
    assert off == pytest.approx(19.2**2 * MASS * 4.75e-3 / FORCE, rel=0.04)
    assert abs(found.rising[1]) > 0.08 * abs(found.rising[0])


@pytest.mark.parametrize("phase", [-0.7, 0.0, 0.3, 1.5])
def test_a_shape_is_what_made_it(phase: float) -> None:
    p = np.linspace(0, TURN, 4000, endpoint=False)
    b = 2 * (p - phase)
    y = 0.24 * (np.sin(b) + 0.1 * np.sin(2 * b) + 0.05 * np.cos(2 * b))
    first, second = (2 / p.size * np.sum(y * np.exp(-1j * k * p)) for k in (2, 4))
    shape = fit.shape(complex(first), complex(second), 2)
    assert (shape.amplitude, shape.phase, shape.sine, shape.cosine) == pytest.approx((0.24, phase, 0.1, 0.05), abs=1e-9)
    assert np.allclose(shape.at(p), y, atol=1e-9)
    peak = shape.amplitude * (np.array([1, shape.sine, shape.cosine]) @ shape.peak)
    assert peak == pytest.approx(np.abs(y).max(), rel=1e-5)


def test_a_phase_turns_within_half_a_period() -> None:
    assert fit.shape(-1j * np.exp(-1j * 3.2), 0j, 6).phase == pytest.approx((3.2 - TURN) / 6)


def test_an_angle_goes_on_over_its_half_turn() -> None:
    true = np.linspace(-0.3, TURN + 0.3, 500)
    read = (true + math.pi) % TURN - math.pi
    assert np.allclose(unwound(read, math.pi), true)
    assert np.allclose(unwound(read[::-1], math.pi), true[::-1])


def test_the_truth_by_forces_over_a_period() -> None:
    """Both rotary actuators have half the torque, each by its own zero: three times their difference is lost by its cosine."""
    p = replace(PlantParams(), cogging_force_2=1.5, zero_la=0.03, zero_ra=(0.04, -0.03))
    drawn: Any = type("Drawn", (), {"plant": type("Built", (), {"plant": p})})
    found = cogging(RIG, drawn, 0.4, 8e-3)
    angle = np.linspace(0, TURN / 48, 20001)
    torque = sum(0.5 * p.cogging_torque * np.sin(6 * (8 * angle - zero)) for zero in p.zero_ra)
    assert found["cogging_torque", "gamma"] == pytest.approx(torque.max(), rel=1e-6)
    assert found["cogging_torque", "gamma"] == pytest.approx(p.cogging_torque * math.cos(3 * 0.07), rel=1e-9)
    assert found["cogging_phase", "gamma"] == pytest.approx(0.005, abs=1e-9)
    theta = np.linspace(0, TURN, 20001) - p.zero_la
    force = p.cogging_force * np.sin(2 * theta) + p.cogging_force_2 * np.sin(4 * theta)
    assert found["peak_force", "z"] == pytest.approx(np.abs(force).max(), rel=1e-6)
    assert found["cogging_current", "z"] == pytest.approx(20 / 83.5, rel=1e-9)


# The whole path.


def test_a_drawn_machine_is_within_its_intervals(tmp_path: Path) -> None:
    done = run(tmp_path, {"cogging_force_2": 1.6})
    assert wrong(done) == set()
    found, true = values(done), truth_of_motion(done)
    assert set(found) == set(true)
    assert len(found) == 18
    for name, e in found.items():
        i = interval(e)
        half = (i.high - i.low) / 2
        assert abs(e.value - true[name]) < 1.5 * half, name
        if name.split("_")[0] in ("cogging", "peak") and "phase" not in name:
            assert half < (0.01 if name.endswith("current@gamma") else 0.05) * e.value, name
    shown = found["second_share@z, sine"]
    assert shown.value > 5 * shown.u
    for figure in procedure.figures(procedure.evaluated(done.recording).result, done.recording):
        assert draw_figure(figure)


@pytest.mark.parametrize("of", [{"fcogg": 0.0, "tcogg": 0.0}, {"fcogg": 30.0, "tcogg": 0.06}])
def test_what_is_fed_forward_changes_nothing(tmp_path: Path, of: dict[str, float]) -> None:
    """The whole current is read. As it is: alone it would be the integrator's that changes."""
    plain, other = (values(run(tmp_path, parameters=p, feedforward="as it is")) for p in ({}, of))
    for name in ("cogging_current@z", "cogging_current@gamma", "cogging_phase@z", "cogging_phase@gamma"):
        a, b = plain[name], other[name]
        u = math.sqrt(2) * math.hypot(*(c for i, c in a.contributions.items() if i.startswith("scatter/")))
        assert abs(a.value - b.value) < 5 * u + 2e-3 * abs(a.value), name


def test_currents_without_what_is_fed_forward_are_told(tmp_path: Path) -> None:
    done = run(tmp_path, {"current_unfed": 1.0}, loops="along")
    assert wrong(done) == {"feedforward-not-read"}
    told = next(r for r in done.results if isinstance(r, Finding) and r.code == "feedforward-not-read")
    assert "cogging_force@z" in told.concerns


def test_neither_constant_nor_zero_is_shown(tmp_path: Path) -> None:
    """A current is measured; its force is by the constant that is stated, and by the cosine of the encoder's zero."""
    before = values(run(tmp_path, {"force_constant": 83.5, "zero_la": 0.0}, loops="along"))
    done = run(tmp_path, {"force_constant": 90.0, "zero_la": 0.0, "zero_off_la": 0.3}, loops="along")
    assert wrong(done) == set()
    after = values(done)
    assert after["cogging_force@z"].value / before["cogging_force@z"].value == pytest.approx(
        83.5 / 90 / math.cos(0.3), rel=0.02
    )
    assert after["cogging_phase@z"].value == pytest.approx(0.3, abs=0.02)


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Simulated, list[Pass]]:
    done = run(tmp_path_factory.mktemp("swept"), loops="along")
    return done, read_passes(done.recording)


def fact(value: float, u: float = 0.1, name: str = "x") -> Estimate:
    return Estimate.of(value, Influence(f"other-run/{name}", "of another run", u, "", "A", "normal", 30))


def adopted(passes: list[Pass], facts: dict[str, Estimate]) -> Result:
    return estimates.results(passes, RIG, Plan(constants="calibration", zeros="calibration"), facts)[0]


def test_constants_and_zeros_that_were_measured(swept: tuple[Simulated, list[Pass]]) -> None:
    facts = {"K_force@LA": fact(85.0, 0.01), "zero@LA": fact(0.2, 1e-4, "zero")}
    plain = estimates.results(swept[1], RIG, Plan(), {})[0].estimates
    found = adopted(swept[1], facts).estimates
    assert found["cogging_current", "z"].value / plain["cogging_current", "z"].value == pytest.approx(
        math.cos(0.2), rel=1e-3
    )
    assert found["cogging_force", "z"].value == pytest.approx(85.0 * found["cogging_current", "z"].value, rel=1e-9)
    assert found["cogging_force", "z"].u < 0.8 * plain["cogging_force", "z"].u


def test_a_slope_that_was_adopted_is_compared(swept: tuple[Simulated, list[Pass]]) -> None:
    done, passes = swept
    p = done.drawn.plant.plant
    theta = TURN * 9.375e-3 / p.pair_pitch - p.zero_la
    true = (
        TURN / p.pair_pitch * (2 * p.cogging_force * math.cos(2 * theta) + 4 * p.cogging_force_2 * math.cos(4 * theta))
    )
    known = {"K_force@LA": fact(p.force_constant, 0.2), "zero@LA": fact(p.zero_la, 1e-3, "zero")}
    for factor, expected in ((1.0, []), (1.3, ["slopes-disagree"]), (-1.0, ["slopes-disagree"])):
        facts = known | {"cogging_stiffness@z, 9.375 mm": fact(factor * true, 0.02 * abs(true), "slope")}
        r = adopted(passes, facts)
        assert estimates.slope(r, 9.375e-3).value == pytest.approx(true, rel=0.12)
        assert [f.code for f in checks.of_results([r], RIG, Plan(), facts)] == expected


# Checks.


def codes(passes: list[Pass]) -> list[str]:
    return [f.code for f in checks.of_signals(passes, RIG, Plan())]


def test_signals(swept: tuple[Simulated, list[Pass]]) -> None:
    passes = swept[1]
    first, rest = passes[0], passes[1:]
    assert codes(passes) == []
    assert codes([]) == ["no-sweeps"]
    assert codes(passes[:3]) == ["no-sweeps"]
    assert codes([p for p in passes if p.sign > 0]) == ["no-sweeps"]
    assert codes([replace(first, states=("LEVITATED", "LANDING")), *rest]) == ["not-levitated"]
    assert codes([replace(first, limited=0.1), *rest]) == ["loop-limited"]
    assert codes([replace(first, lost=20), *rest]) == ["missing-samples"]
    half = slice(0, first.position.size // 2)
    assert codes([replace(first, position=first.position[half], times=first.times[half]), *rest]) == ["way-not-covered"]
    assert codes([replace(first, times=1.2 * first.times), *rest]) == ["way-not-covered"]


def test_results(swept: tuple[Simulated, list[Pass]]) -> None:
    r = estimates.results(swept[1], RIG, Plan(), {})[0]

    def told(**changes: Any) -> list[str]:
        return [f.code for f in checks.of_results([replace(r, **changes)], RIG, Plan(), {})]

    size = r.shape.amplitude
    assert told() == []
    assert told(u=size / 5) == ["cogging-not-shown"]
    assert told(third=complex(0.2 * size)) == ["more-harmonics"]
    assert told(lag=0.2) == ["ways-apart"]
    assert told(unfed=complex(-size)) == ["feedforward-not-read"]


def test_friction_is_half_the_difference(swept: tuple[Simulated, list[Pass]]) -> None:
    rubbed = [replace(p, currents={n: i + 0.02 * p.sign for n, i in p.currents.items()}) for p in swept[1]]
    before, after = (estimates.results(x, RIG, Plan(), {})[0].estimates for x in (swept[1], rubbed))
    gained = after["friction_current", "z"].value - before["friction_current", "z"].value
    assert gained == pytest.approx(0.02, rel=1e-3)
    assert after["cogging_current", "z"].value == pytest.approx(before["cogging_current", "z"].value, rel=1e-12)


def test_samples_that_are_means_lose_their_share(swept: tuple[Simulated, list[Pass]]) -> None:
    """A mean over T takes (pi f T)^2/6 of a sine: of 1.6 Hz and 20 ms 0.17 %."""
    late = [replace(p, mean_s=0.02) for p in swept[1]]
    plain, found = (
        estimates.results(x, RIG, Plan(), {})[0].estimates["cogging_current", "z"] for x in (swept[1], late)
    )
    share = (found.contributions["sweep/z"] - plain.contributions["sweep/z"]) / found.value * math.sqrt(3)
    assert share == pytest.approx((math.pi * 1.6 * 0.02) ** 2 / 6, rel=0.02)


# Before the start.


def test_ways() -> None:
    along, around = (way(RIG, Plan(), loop) for loop in ("z", "gamma"))
    assert (along.first, along.signals, along.orders) == (2, (2, 4, 6), (2, 4, 6, 1))
    assert (around.first, around.turns, around.orders) == (48, 8, (48, 96, 144, 1, 2, 8, 16))
    assert along.ends == pytest.approx((5.375e-3, 19.125e-3))
    assert fed(Plan(), along) == (True, False)
    assert steps_on(RIG, Plan()) == 16


def test_refusals() -> None:
    assert procedure.lacking(RIG) == ()
    assert list(check(RIG, Plan())) == []
    assert "ref_z" in next(iter(check(RIG, Plan(from_m=0.015))))
    assert "observer" in next(iter(check(RIG, Plan(observer="none"))))
    assert "ref_w" in next(iter(check(RIG, Plan(parameters={"ref_w": 1.0}))))
    assert "sweep slower" in next(iter(check(RIG, Plan(min_samples=500))))
    one = RIG.capabilities.force_currents["LA"]
    for changed, told in (({"constant": None}, "constant"), ({"cogging": 0}, "cogging")):
        motors = {"LA": one.model_copy(update=changed)}
        alone = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"force_currents": motors})})
        assert told in procedure.lacking(alone)[0]
    alone = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"force_currents": {"LA": one}})})
    assert "loops" in next(iter(check(alone, Plan(loops="around"))))
    assert {q.name for q in procedure.untold(alone)} == {"cogging_torque", "peak_torque", "friction_torque"}
