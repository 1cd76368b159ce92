"""Load balancing: the printed 26 % on the stated rig, drawn rigs against their own prediction, and what must not pass."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from balancing import codes, run, values
from drawn_figures import figures_drawn

from bench.cli.loading import load_procedure
from bench.cli.motion_truth import truth_of_motion
from bench.errors import InterlockError
from bench.findings import Finding
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.load_balancing import fit
from procedures.load_balancing.estimates import extreme
from procedures.load_balancing.fit import Law
from procedures.load_balancing.plan import Plan
from sim_backend.truth import nominal

P = {f"gain_m{k}": 1.0 for k in range(1, 5)} | {f"offset_m{k}": 0.0 for k in range(1, 5)}
P |= {"alpha_d": 12.1, "chi": 1.0, "ratio": 12.1 / 14.3, "gamma_0": 0.0, "pole_pairs": 8.0}
TURN = np.arange(4000) * 2 * math.pi / 4000
NO_BOUND = Law(0.25, 1e4, 1.0, -1)


def circle(across: float) -> fit.Complex:
    """The load of the design: 34.43 N around a constant one of 48.55 N down and `across`."""
    return np.asarray(across - 48.55j + 34.43 * np.exp(1j * TURN), np.complex128)


@pytest.mark.parametrize(("across", "printed"), [(0.0, -0.339), (22.0, -0.264), (32.0, -0.215), (40.0, -0.172)])
def test_the_quasi_static_formula_by_another_ones_table(across: float, printed: float) -> None:
    """Figures of a design that has them from its own formula, gamma without a bound."""
    load = circle(across)
    after = fit.balanced(load, NO_BOUND, P)
    np.testing.assert_allclose(np.abs(after.current.real), np.abs(after.current.imag), rtol=1e-9)
    assert np.abs(after.current.imag).max() / (np.abs(load.imag).max() / 12.1) - 1 == pytest.approx(printed, abs=6e-4)


def test_the_force_that_balanced_currents_give_is_the_load() -> None:
    """T (6.5) with the field at gamma: F_x = a_d c i_x - a_c s i_y, F_y = a_d c i_y + a_c s i_x; bound 8 degrees."""
    load, law = circle(5.0), Law(0.25, math.radians(25), math.radians(8), 1)
    found = fit.balanced(load, law, P)
    c, s = np.cos(8 * found.gamma), np.sin(8 * found.gamma)
    x = 12.1 * c * found.current.real - 14.3 * s * found.current.imag
    y = 12.1 * c * found.current.imag + 14.3 * s * found.current.real
    np.testing.assert_allclose(x + 1j * y, -load, atol=1e-9)
    assert np.abs(found.gamma).max() == pytest.approx(math.radians(8))


def test_a_peak_is_no_maximum_of_noise() -> None:
    """Noise of 0.1 on a cosine: the largest of 400 is 0.2 too large, the parabola's top is not."""
    draws = np.random.default_rng(3)
    x = [5 + np.cos(TURN[::10] - 1.0) + 0.1 * draws.standard_normal(400) for _ in range(200)]
    assert np.mean([v.max() for v in x]) > 6.15
    assert np.mean([fit.peak(v) for v in x]) == pytest.approx(6.0, abs=0.09)
    assert np.mean([fit.peak(v, 64) for v in x]) == pytest.approx(6.0, abs=0.006)


def test_the_printed_reduction_on_the_stated_rig(tmp_path: Path) -> None:
    """T 6.7.3: the largest i_y falls by 26 %, on the machine whose motor is 91 um off centre."""
    done = run("tsbs12-offset", 1, tmp_path, {"ways": ["forward", "backward"]}, nominal(load_rig("tsbs12-offset")))
    assert codes(done) == set()
    found, true = values(done), truth_of_motion(done)
    for way in ("forward", "backward"):
        assert found[f"reduction@{way}"].estimate.value == pytest.approx(-0.26, abs=0.02)
        assert found[f"unbalance_ratio@{way}"].estimate.value < 1 / 45
        assert found[f"peak_i_y@before, {way}"].estimate.value == pytest.approx(6.86, abs=0.05)
    assert set(found) == set(true)
    for name, m in found.items():
        i = interval(m.estimate)
        wide = 2 if name.startswith("error_radius") else 1.5  # the truth's own noise; nanometres
        assert abs(true[name] - (i.low + i.high) / 2) < wide * i.U + 3e-10, name
    assert figures_drawn(done)


@pytest.mark.parametrize(("rig", "seed"), [("tsbs12", 3), ("tsbs12-offset", 5)])
def test_drawn_rigs_do_what_their_loads_say(tmp_path: Path, rig: str, seed: int) -> None:
    done = run(rig, seed, tmp_path)
    assert codes(done) <= {"branch-undecided"}
    found = {name: m.estimate.value for name, m in values(done).items()}
    for source in ("from the loads", "from the facts"):
        assert found["reduction@forward"] == pytest.approx(found[f"predicted_reduction@{source}, forward"], abs=0.02)
    cut = found["gamma_extreme@forward"] > math.radians(7.99)
    assert found["unbalance_ratio@forward"] < 1 / (1.5 if cut else 2.5)
    assert (rig == "tsbs12") == cut


def test_a_phase_angle_that_stands_at_another_bound_than_was_asked_is_read_there() -> None:
    """A top of 8.2 degrees with noise of 0.1 mrad, and cut off at 6.8: a parabola through the flat part has 0.02 more."""
    phase, noise = 2 * math.pi * np.arange(400) / 400, np.random.default_rng(3)
    free = math.radians(8.2) * np.sin(phase) + 1e-4 * noise.standard_normal((8, 400)).mean(axis=0)
    assert extreme(free, math.radians(9)) == pytest.approx(math.radians(8.2), abs=5e-5)
    cut = np.clip(free, -math.radians(6.8), math.radians(6.8))
    assert extreme(cut, math.radians(9)) == pytest.approx(math.radians(6.8), abs=1e-7)


@pytest.mark.parametrize(
    ("planted", "code"),
    [
        ({"factor_balance": 2.0}, "side-changes"),
        ({"factor_gamma_slew": 0.0}, "phase-limits-differ"),
        ({"factor_model_alpha_d": 1.05}, "observer-differs"),
        ({"gamma_zero": math.radians(0.3)}, "load-turned"),
        ({"factor_gamma_max": 0.7}, "gamma-differs"),
        ({"alpha_d": 11.0}, "stiffness-differs"),
        ({"segment_sign_1": -1.0}, "segment-sign"),
        ({"exchange_segments": 1.0}, "segments-exchanged"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, planted: dict[str, float], code: str) -> None:
    sound = nominal(load_rig("tsbs12-offset"))
    assert code in codes(run("tsbs12-offset", 1, tmp_path, truth={**sound, **planted}, sound=sound))


def test_a_wrong_sign_of_phi_ends_by_the_envelope(tmp_path: Path) -> None:
    truth = {**nominal(load_rig("tsbs12-offset")), "factor_balance": 3.0}
    with pytest.raises(InterlockError, match="reached"):
        run("tsbs12-offset", 1, tmp_path, truth=truth)


BEYOND = {"radius_m": 118e-6, "gamma_max_rad": math.radians(12), "beyond_torque": True}


def test_a_bound_of_12_degrees_ends_in_a_trip_where_no_friction_holds_the_angle(tmp_path: Path) -> None:
    """Beyond 11.25 degrees the angle's loop has the wrong sign: cos(8 12 deg) 2.87 N m/A 50 A/rad = -15 N m/rad."""
    truth = {**nominal(load_rig("tsbs12")), "coulomb": 0.0}
    with pytest.raises(InterlockError, match="speed reached"):
        run("tsbs12", 1, tmp_path, BEYOND, truth)


def test_a_bound_of_12_degrees_trips_the_nominal_machine_where_gamma_stays_long(tmp_path: Path) -> None:
    with pytest.raises(InterlockError, match="speed reached"):
        run("tsbs12", 1, tmp_path, {**BEYOND, "circle_hz": 0.1}, nominal(load_rig("tsbs12")))


def test_where_gamma_is_back_in_time_the_run_says_how_far_the_rotor_turned(tmp_path: Path) -> None:
    """Half a second beyond 11.25 degrees at a turn in 4 s."""
    truth = {**nominal(load_rig("tsbs12")), "motor_offset_x": 5e-6}
    done = run("tsbs12", 1, tmp_path, BEYOND, truth)
    (told,) = [r.text for r in done.results if isinstance(r, Finding) and r.code == "torque-reversed"]
    turned = float(told.split("turned by up to ")[1].split("°")[0])
    assert turned > 30


def check(**changes: object) -> list[str]:
    return list(load_procedure("load-balancing").check(load_rig("tsbs12"), Plan.model_validate(changes)))


def test_plans_that_would_trip_are_refused() -> None:
    assert check() == []
    assert check(radius_m=115e-6) == []
    assert "80% of the envelope allows 120 µm" in check(radius_m=130e-6)[0]
    assert "beyond it turns the rotor the other way" in check(gamma_max_rad=math.radians(10.5))[0]
    assert check(gamma_max_rad=math.radians(12), beyond_torque=True) == []
    assert "the controller allows" in check(gamma_max_rad=math.radians(13), beyond_torque=True)[0]
    assert "expected each once" in check(ways=["forward", "forward"])[0]
