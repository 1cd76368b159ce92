"""Constants of a mover's motors: the bare model by hand, the whole path against the drawn machine, plants, refusals."""

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
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence, interval
from procedures.actuator_constant import checks, estimates, fit
from procedures.actuator_constant.estimates import Looked, Result
from procedures.actuator_constant.plan import Plan
from procedures.actuator_constant.procedure import MEASURES, check, procedure, steps_on
from procedures.actuator_constant.sines import Place, frequencies, sine
from procedures.actuator_constant.steps import Added, Common, Taken
from procedures.position_loops.motors import cosine, off
from reports.figures import draw as draw_figure
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.truth_constants import along, around

RIG = load_rig("lira")
QUICK: dict[str, Any] = {"pairs": 3, "lines": 5, "record_s": 0.3, "settle_s": 0.5}
REDUCED = {"reduced": 1.0}
HZ = np.geomspace(30, 240, 7)


def run(folder: Path, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    path = folder / "recording.mcap"
    path.unlink(missing_ok=True)
    return simulated_run("actuator-constant", "lira", 1, {**QUICK, **plan}, path, {**REDUCED, **(truth or {})})


def values(done: Simulated) -> dict[str, Measured]:
    return {f"{r.quantity.name}@{r.where}": r for r in done.results if isinstance(r, Measured)}


def wrong(done: Simulated) -> dict[str, Finding]:
    return {r.code: r for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


# The bare model.


def answer(
    hz: np.ndarray, m: float = 1.34, k: float = 20.1e3, constant: float = 83.5, c: float = 2.0, delay: float = 15e-6
):
    w = 2 * np.pi * hz
    return (-m * w**2 + k + 1j * w * c) / constant * np.exp(1j * w * delay)


def test_the_fit_finds_what_made_the_lines() -> None:
    found = fit.response(HZ, answer(HZ), np.full(7, 1.0))
    assert found.inertial == pytest.approx(1.34 / 83.5, rel=1e-8)
    assert found.slope == pytest.approx(20.1e3 / 83.5, rel=1e-6)
    assert found.damping == pytest.approx(2.0 / 83.5, rel=1e-5)
    assert found.delay == pytest.approx(15e-6, rel=1e-6)
    assert np.allclose(found.at(HZ), answer(HZ), rtol=1e-9)


def test_without_cogging_in_the_model_the_constant_is_wrong() -> None:
    """At 30 Hz 20 N/mm against 1.34 kg are 42 %: a constant of |x| w^2/i alone would be that far off."""
    bare = 1.34 * (2 * np.pi * HZ) ** 2 / np.abs(answer(HZ))
    assert bare[0] / 83.5 == pytest.approx(1 / (1 - 20.1e3 / (1.34 * (2 * np.pi * 30) ** 2)), rel=1e-3)


def test_a_low_pass_is_bounded_by_the_fit_with_a_delay() -> None:
    w = 2 * np.pi * HZ
    lagged = answer(HZ, c=0, delay=0) * (1 + 1j * w * 20e-6)
    found = fit.response(HZ, lagged, np.abs(lagged) * 1e-4)
    off = abs(found.inertial / (1.34 / 83.5) - 1)
    assert 1e-5 < off < 1.05 * found.bend


def test_noise_that_the_machine_obeys_is_none() -> None:
    """Any true motion goes by the same equation: only what a sensor adds is in a line's uncertainty."""
    rng, n, periods = np.random.default_rng(1), 7000, 20
    x = 1e-5 * np.cos(2 * np.pi * periods * np.arange(n) / n) + 1e-6 * rng.normal(size=n)
    exact = fit.line(100.0, x, 0.3 * x / 1e-5, periods)
    assert exact.ratio == pytest.approx(3e4, rel=1e-9)
    assert exact.u < 1e-6 * abs(exact.ratio)
    u, ratios = [], []
    for _ in range(40):
        read = fit.line(100.0, x + 1e-6 * rng.normal(size=n), 0.3 * x / 1e-5, periods)
        u.append(read.u)
        ratios.append(read.ratio)
    assert np.mean(u) == pytest.approx(np.std([r.real for r in ratios]), rel=0.3)


def test_the_ratio_of_two_motors_by_hand() -> None:
    """K_1 i_1 + K_2 i_2 = k x + 0.02, with x left over."""
    k_1, k_2, k = 0.2, 0.215, 1.8
    i_1, x = np.array([0.5, -0.5, 0.52, -0.51, 0.49, -0.5]), np.array([1e-4, -2e-4, 0, 1e-4, 2e-4, 0])
    i_2 = (k * x + 0.02 - k_1 * i_1) / k_2
    value, u, dof = fit.shift_ratio(i_1, i_2, x, k / k_1)
    assert (value, dof) == (pytest.approx(k_1 / k_2, rel=1e-12), 4)
    assert u < 1e-12
    assert abs(fit.shift_ratio(i_1, i_2, x, 0.0)[0] / (k_1 / k_2) - 1) > 1e-5


def test_the_cosine_of_a_zero() -> None:
    zero = RIG.capabilities.force_currents["RA1"].stated
    assert zero.half_width is not None
    drawn = 1 / np.cos(np.linspace(-1, 1, 20001) * zero.half_width)
    found = cosine(RIG, "RA1")
    assert found.value == pytest.approx(drawn.mean(), abs=1e-6)
    assert found.u == pytest.approx(drawn.std(), rel=2e-3)


def test_the_cosine_of_a_zero_that_was_measured() -> None:
    """10 degrees electrical off the controller's parameter, with u of 0.1 degrees: 1/cos, and its slope."""
    zero = Estimate.of(math.radians(10), Influence("zero", "zero", math.radians(0.1), "rad", "A", "normal"))
    found = cosine(RIG, "LA", zero)
    assert found.value == pytest.approx(1.015427, abs=1e-6)
    assert found.u == pytest.approx(math.radians(0.1) * math.tan(math.radians(10)) * 1.015427, rel=1e-5)
    shifted = off(RIG, {"zero.la": math.radians(10)}, "LA", {"zero@LA": zero})
    assert shifted is not None
    assert shifted.value == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("motor", ["LA", "RA1"])
def test_offsets_along_the_field(motor: str) -> None:
    """(2/n) sum p_d o of a winding of n coils at a phase, by hand."""
    coils = RIG.motors[motor].currents
    n, u = len(coils), RIG.sensors[coils[0]].offset.standard_uncertainty
    phase = 0.3 + 2 * np.pi / 3 * np.arange(n)
    weights = np.sin(phase) ** 2 / (np.sin(phase) ** 2).sum()
    by_hand = 2 / n * math.sqrt((np.cos(phase) ** 2).sum()) * u
    assert estimates._offset(RIG, motor, weights) == pytest.approx(by_hand, rel=1e-9)


def test_the_truth_of_cogging_is_the_slope_of_its_force() -> None:
    p = replace(PlantParams(), cogging_force_2=1.5, zero_la=0.03, zero_ra=(0.02, -0.04))

    def force(z: float) -> float:
        theta = 2 * math.pi * z / p.pair_pitch - p.zero_la
        return p.cogging_force * math.sin(2 * theta) + p.cogging_force_2 * math.sin(4 * theta)

    def torque(angle: float) -> float:
        return sum(0.5 * p.cogging_torque * math.sin(6 * (8 * angle - zero)) for zero in p.zero_ra)

    for at in (9.375e-3, 11e-3):
        assert along(p, at) == pytest.approx((force(at + 1e-7) - force(at - 1e-7)) / 2e-7, rel=1e-6)
        assert around(p, at) == pytest.approx((torque(at + 1e-6) - torque(at - 1e-6)) / 2e-6, rel=1e-6)


# The whole path.


def test_a_drawn_machine_is_within_its_intervals(tmp_path: Path) -> None:
    done = run(tmp_path)
    assert wrong(done) == {}
    found, true = values(done), truth_of_motion(done)
    assert set(found) == set(true)
    assert len(found) == 9
    for name, m in found.items():
        i = interval(m.estimate)
        half = (i.high - i.low) / 2
        assert abs(m.estimate.value - true[name]) < 2 * half, name
        limit = {"K_force": 0.01, "K_torque": 0.025, "K_over_J": 0.004, "K_ratio": 0.007}.get(
            name.partition("@")[0], 0.1
        )
        assert half < limit * abs(m.estimate.value), name
    slopes = [found[f"cogging_stiffness@z, {z} mm"].estimate.value for z in ("9.375", "12.5")]
    assert slopes[0] < 0 < slopes[1]
    recording = done.recording
    for figure in procedure.figures(procedure.evaluated(recording).result, recording):
        assert draw_figure(figure)


def test_neither_zero_nor_mass_is_shown(tmp_path: Path) -> None:
    """A zero that is 10 degrees off reads as its cosine, another mass than the rig file's as its share."""
    plain = run(tmp_path, {"zero_la": 0.0, "machine.mass": 1.34}, loops="along")
    before = values(plain)["K_force@LA"].estimate.value
    turned = run(tmp_path, {"zero_la": math.radians(10), "machine.mass": 1.02 * 1.34}, loops="along")
    assert wrong(turned) == {}
    expected = math.cos(math.radians(10)) / 1.02
    assert values(turned)["K_force@LA"].estimate.value / before == pytest.approx(expected, rel=1e-3)


def test_a_loop_at_its_limit_is_told(tmp_path: Path) -> None:
    told = wrong(run(tmp_path, loops="along", amplitude={"z": 4e-4}))["loop-limited"]
    assert told.concerns == ("K_force@LA", "@z")


def test_motion_that_is_lost_in_noise_is_told(tmp_path: Path) -> None:
    assert {"loop-not-shown", "no-mass"} & set(wrong(run(tmp_path, loops="along", amplitude={"z": 1e-8})))


# Checks.

COMMON = Common("z", "12.5 mm", 0.0, ("LEVITATED",), 0, 100)
SOUND = Taken(COMMON, 100.0, 1e-5, 20, np.ones(10), {"LA": np.ones(10)}, {"LA": np.array([0.1, -0.2, 0.1])},
              {"LA": (0.2, 1e-5)}, 1.0)  # fmt: skip


def codes(*taken: Taken, added: tuple[Added, ...] = ()) -> list[str]:
    return [f.code for f in checks.of_signals(taken, added, RIG, Plan())]


def test_signals() -> None:
    assert codes(SOUND) == []
    assert codes() == ["no-sines"]
    assert codes(replace(SOUND, position=np.empty(0))) == ["sine-not-captured"]
    assert codes(SOUND, replace(SOUND, common=replace(COMMON, states=("LEVITATED", "LANDING")))) == ["not-levitated"]
    assert codes(replace(SOUND, wave=0.5)) == ["sine-wrong"]
    assert codes(replace(SOUND, common=replace(COMMON, limited=0.1))) == ["loop-limited"]
    assert codes(replace(SOUND, common=replace(COMMON, lost=1))) == ["missing-samples"]
    landed = Added(replace(COMMON, states=("LANDING",)), 1.0, 0.0, {})
    assert codes(SOUND, added=(landed,)) == ["not-levitated"]


def test_a_coil_that_is_read_wrongly() -> None:
    """sqrt(2/3) of the root of 0.01 + 0.04 + 0.01 is 0.2."""
    assert codes(replace(SOUND, said={"LA": (0.205, 1e-5)})) == []
    assert codes(replace(SOUND, said={"LA": (0.21, 1e-3)})) == []
    assert codes(replace(SOUND, said={"LA": (0.21, 1e-5)})) == ["currents-disagree"]


def looked(name: str, constant: float, scale: float = 1.0) -> Looked:
    response = fit.response(HZ, scale * answer(HZ), np.full(7, 1e-3))
    u = Influence(f"noise/{name}", "noise", 0.1, "", "A", "normal", 20)
    return Looked(Place(name, "ref_z", 0.0), [], [], response, {"LA": Estimate.of(constant, u)})


def test_places_that_disagree() -> None:
    told = lambda *some: [f.code for f in checks.of_results([Result("z", [*some])], RIG, Plan())]  # noqa: E731
    assert told(looked("a", 62.0), looked("b", 62.5)) == []
    assert told(looked("a", 62.0), looked("b", 62.7)) == ["places-disagree"]


def test_lines_off_the_curve() -> None:
    bent = fit.response(HZ, answer(HZ) * (1 + 0.01 * np.sin(np.arange(7))), np.abs(answer(HZ)) * 1e-4)
    told = [f.code for f in checks.of_results([Result("z", [replace(looked("a", 1.0), response=bent)])], RIG, Plan())]
    assert told == ["misfit"]


def test_an_exchanged_sign() -> None:
    exchanged = looked("a", 1.0, -1.0)
    with pytest.raises(AnalysisError, match="sign"):
        estimates._per_ampere("z", "a", exchanged.lines, exchanged.response)
    added = [
        Added(replace(COMMON, loop="gamma"), s, 0.0, {"RA1": s, "RA2": s + 0.001 * j})
        for j, s in enumerate((1.0, -1.0, 1.0, -1.0))
    ]
    with pytest.raises(AnalysisError, match="against each other"):
        estimates._read_ratio(added, ["RA1", "RA2"], 0.0, "gamma")


# Before the start.


def test_lines_end_where_there_are_too_few_counts() -> None:
    assert frequencies(RIG, Plan(), "z")[-1] == pytest.approx(240)
    top = frequencies(RIG, Plan(), "gamma")[-1]
    assert 80 < top < 95
    one = sine(RIG, Plan(), "gamma", top)
    assert RIG.capture is not None
    assert one.amplitude == pytest.approx(10 * RIG.capture.channels["gamma"].scale, rel=0.01)
    assert one.periods * 35e3 / one.samples == pytest.approx(one.hz)


def test_refusals() -> None:
    assert procedure.lacking(RIG) == ()
    assert list(check(RIG, Plan())) == []
    assert steps_on(RIG, Plan()) == 4 * 7 + 10
    one = RIG.capabilities.force_currents["LA"]
    alone = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"force_currents": {"LA": one}})})
    assert list(check(alone, Plan(loops="along"))) == []
    assert "loops: found 'around'" in next(iter(check(alone, Plan(loops="around"))))
    assert "ref_w" in next(iter(check(RIG, Plan(parameters={"ref_w": 1.0}))))
    assert "observer" in next(iter(check(RIG, Plan(observer="none"))))
    assert "high_hz" in next(iter(check(RIG, Plan(high_hz=12e3))))
    assert "ref_z" in next(iter(check(RIG, Plan(places_m=(0.01, 0.5)))))
    assert "added_A" in next(iter(check(RIG, Plan(added_A=9.0))))
    bare = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"force_currents": {}})})
    assert procedure.lacking(bare) == ("capabilities: found no force_currents",)
    assert procedure.untold(RIG) == ()
    assert len(MEASURES) == 7
