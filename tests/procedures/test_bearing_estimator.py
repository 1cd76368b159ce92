"""Force constant and offset from positions: exact on exact data, with the signs of T (2.6) corrected, the errata, what the
adjustment makes of certificates, and what a shaft that lies on its rings tells."""

from __future__ import annotations

import math

import numpy as np
import pytest
from amb_stand import AMB_ROTOR

from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence
from procedures.amb_rotor import magnetics, pressed
from procedures.amb_rotor.magnetics import Positions
from procedures.amb_rotor.rings import EXCHANGES, of_readings
from procedures.bearing_model.adjustment import Adjusted, adjust

GAP, BETA, BIAS = 5.25e-4, 6.95e-7, 1.0
G = 9.81
PLANE = {
    "mass": 0.98,
    "gravity": G,
    "axes": math.pi / 4,
    "l_is": 0.078,
    "l_os": 0.1,
    "l_oa": 0.081,
    "amb_span": 0.178,
    "l_c": 0.155,
    "coupling": 1200.0,
    "relaxed_y": 0.0,
    "relaxed_z": 0.0,
    "gap": GAP,
}
COILS = tuple(f"{a}_{side}" for a in AMB_ROTOR.axes for side in "pn")
SOUND = (PLANE | {f"{k}_{a}": v for a in AMB_ROTOR.axes for k, v in (("gain", 1.0), ("zero", 0.0), ("runout", 0.0))}
         | {f"{k}_{c}": v for c in COILS for k, v in (("gain", 1.0), ("offset", 0.0))})  # fmt: skip
PLACES = np.array(
    [(y, z) for y in np.linspace(-80e-6, 80e-6, 9) for z in np.linspace(-80e-6, 80e-6, 9) if math.hypot(y, z) < 82e-6]
).T


def currents(force: np.ndarray, xi: np.ndarray, bias: float = BIAS) -> tuple[np.ndarray, np.ndarray]:
    """Coil currents of a constant sum that give the force, by bisection: nothing of the estimators is in it."""
    low, high = np.full_like(force, -bias), np.full_like(force, bias)
    for _ in range(80):
        d = (low + high) / 2
        less = BETA * (((bias + d) / (GAP - xi)) ** 2 - ((bias - d) / (GAP + xi)) ** 2) < force
        low, high = np.where(less, d, low), np.where(less, high, d)
    return bias + d, bias - d


def positions(
    offsets: tuple[float, ...],
    gravity: float = -G,
    bias: float = BIAS,
    relaxed: tuple[float, float] = (0.0, 0.0),
    axes: float = math.pi / 4,
) -> Positions:
    """The shaft without tilt on a grid, carried by magnets and a spring: forces from a 2 x 2 balance of force and moment."""
    y, z = PLACES
    weight, spring = (0.98 * gravity * math.cos(axes), 0.98 * gravity * math.sin(axes)), 1200.0
    read, p, n = np.array([y, z, y, z]), np.zeros((4, y.size)), np.zeros((4, y.size))
    for first, at in ((0, y), (1, z)):
        load = -weight[first] + spring * (at - relaxed[first])  # F_i + F_o
        moment = -0.155 * spring * (at - relaxed[first])  # -l_ia F_i + l_oa F_o, the spring pulls at -l_c
        both = np.linalg.solve([[1, 1], [-0.097, 0.081]], np.array([load, moment]))
        for b in (0, 1):
            k = first + 2 * b
            p[k], n[k] = currents(both[b], offsets[k] + at, bias)
    return Positions(read, p, n)


OFFSETS = (115e-6, 100e-6, 130e-6, 90e-6)


def test_exact_data_give_the_truth() -> None:
    d = positions(OFFSETS)
    fits = magnetics.fits(d, SOUND)
    for axis, offset in zip(AMB_ROTOR.axes, OFFSETS, strict=True):
        assert fits[axis].beta == pytest.approx(BETA, rel=1e-7)
        assert fits[axis].offset == pytest.approx(offset, abs=1e-11)


def test_gains_and_zeros_are_taken_off() -> None:
    d = positions(OFFSETS)
    p = dict(SOUND)
    gains = {a: 1 + 0.01 * (k - 1.5) for k, a in enumerate(AMB_ROTOR.axes)}
    for k, a in enumerate(AMB_ROTOR.axes):
        p[f"gain_{a}"], p[f"runout_{a}"] = gains[a], 1e-6 * (k + 1)
        d.read[k] = gains[a] * (d.read[k] + p[f"runout_{a}"])
        for s, c in (("p", d.p), ("n", d.n)):
            p[f"gain_{a}_{s}"], p[f"offset_{a}_{s}"] = 1.004, 3e-3 * (k - 2)
            c[k] = 1.004 * c[k] + 3e-3 * (k - 2)
    for axis, offset in zip(AMB_ROTOR.axes, OFFSETS, strict=True):
        fit = magnetics.fits(d, p)[axis]
        assert (fit.beta, fit.offset) == (pytest.approx(BETA, rel=1e-3), pytest.approx(offset, abs=1e-7))


def test_erratum_the_sign_of_the_offset_goes_with_gravity() -> None:
    """T (2.6) with g_y above zero and an offset of -115 um is g_y below zero with +115 um: the same machine seen from below."""
    down, up = positions((115e-6,) * 4), positions((-115e-6,) * 4, gravity=G)
    mirrored = magnetics.fits(Positions(-down.read, down.n, down.p), SOUND | {"gravity": -G})
    for axis in AMB_ROTOR.axes:
        literal = magnetics.fits(up, SOUND | {"gravity": -G})[axis]
        assert literal.offset == pytest.approx(-115e-6, abs=1e-10)
        assert mirrored[axis].offset == pytest.approx(-115e-6, abs=1e-10)
        wrong = magnetics.fits(down, SOUND | {"gravity": -G})[axis]
        assert wrong.beta < 0  # gravity with the wrong sign makes no magnet


def test_erratum_the_linear_column_of_table_2_2_is_no_slope() -> None:
    """With the corrected sign the no-intercept model returns five times the bearing's slopes, with the other it does not."""
    same = magnetics.fits(positions((115e-6,) * 4), SOUND)["yi"]
    k, stiffness = magnetics.slopes(same.terms, GAP, BIAS)
    assert (
        pytest.approx(10.1, rel=0.01),
        pytest.approx(1.92e4, rel=0.01),
    ) == (4 * BETA * BIAS / GAP**2, 4 * BETA * BIAS**2 / GAP**3)
    assert k == pytest.approx(11.7, rel=0.02)  # at the offset they are a little steeper
    assert same.linear.terms[0] > 4 * k
    assert same.linear.terms[1] > 4 * stiffness
    against = magnetics.fits(positions((-115e-6,) * 4), SOUND)["yi"]
    k, stiffness = magnetics.slopes(against.terms, GAP, BIAS)
    assert against.linear.terms[0] < 1.5 * k


def test_what_the_linear_model_misses_is_the_curvature_of_the_control_current() -> None:
    """F |c| sd(r^2) / rms(a + c r^2), with the control current a - b r + c r^2 that carries F."""
    r = np.array([*PLACES[0]])
    for bias, load in ((1.0, 3.1), (1.1, 3.7), (1.2, 3.1), (1.2, 3.7)):
        p, n = currents(np.full_like(r, load), 115e-6 + r, bias)
        c, _, a = np.polyfit(r, (p - n) / 2, 2)
        predicted = load * abs(c) * (r**2).std() / math.sqrt(((a + c * r**2) ** 2).mean())
        left = magnetics.linear(r, p, n, np.full_like(r, load)).residuals
        assert math.sqrt((left**2).mean()) == pytest.approx(predicted, rel=0.02)


TOLERANCES = {"gap": 5.8e-6, "coupling": 35.0, "relaxed_y": 29e-6, "relaxed_z": 29e-6, "mass": 3e-3, "gain_yi": 5e-3,
              "gain_yi_p": 3e-3, "offset_zo_n": 3e-3, "runout_zi": 1.7e-6}  # fmt: skip


def certificates(**wrong: float) -> dict[str, Estimate]:
    """Inputs with tolerances; `wrong` is what a certificate says too much."""
    out = {}
    for name, value in SOUND.items():
        given = Influence(name, name, TOLERANCES.get(name, 0.0), "1", "B", "normal")
        out[name] = Estimate.of(value + wrong.get(name, 0.0), given) if given.u else Estimate.exact(value)
    return out


def adjusted(relaxed: tuple[float, float] = (0.0, 0.0), **wrong: float) -> Adjusted:
    """From positions without noise at two biases."""
    both = [positions(OFFSETS, bias=b, relaxed=relaxed) for b in (1.2, 0.8)]
    means = Positions(*(np.concatenate([getattr(d, x) for d in both], axis=1) for x in ("read", "p", "n")))
    return adjust(means, certificates(**wrong), np.full(4, 5e-4), np.full(4, 5e-4), np.array([(6.5e-7, 1e-4)] * 4))


def test_the_adjustment_of_exact_data_is_the_truth_and_moves_nothing() -> None:
    found = adjusted()
    np.testing.assert_allclose(found.terms[:, 0], BETA, rtol=1e-6)
    np.testing.assert_allclose(found.terms[:, 1], OFFSETS, atol=1e-10)
    assert max(abs(v) for v in found.moved.values()) < 1e-3
    assert np.abs(found.residuals).max() < 1e-6


def test_each_certificate_acts_as_its_influence_says() -> None:
    """A certificate that is wrong by one u moves every result by that influence's share in the budget."""
    sound = adjusted()
    for name, u in TOLERANCES.items():
        moved = adjusted(**{name: u})
        for key in ("beta_yi", "offset_yi", "beta_zo", "offset_zi", "gap"):
            e = sound.estimates[key]
            share = sum(slope * i.u for i, slope in e.sensitivities.items() if i.id == name)
            assert moved.estimates[key].value - e.value == pytest.approx(share, abs=0.05 * e.u), (name, key)


def test_positions_at_two_biases_correct_a_wrong_gap_but_not_the_runout() -> None:
    found = adjusted(gap=10e-6)
    assert found.values["gap"] == pytest.approx(GAP, abs=2e-6)
    assert found.terms[0, 0] == pytest.approx(BETA, rel=0.01)
    shifted = adjusted(runout_zi=1.7e-6).terms[1, 1] - OFFSETS[1]
    assert shifted == pytest.approx(1.7e-6 * (1 + 0.019 / 0.178), rel=0.02)  # at the AMB's plane


def test_a_coupling_out_of_line_acts_on_the_force_constants_as_another_weight_would() -> None:
    """K d (l_oa + l_c) / span inboard and K d (l_ia - l_c) / span outboard; the offsets do not take it up."""
    aside = 29e-6
    found = magnetics.fits(positions(OFFSETS, relaxed=(aside, 0.0)), SOUND)
    weight = 0.98 * G / math.sqrt(2)
    inboard = 1200 * aside * (0.081 + 0.155) / (weight * 0.081)
    outboard = 1200 * aside * (0.097 - 0.155) / (weight * 0.097)
    assert found["yi"].beta / BETA - 1 == pytest.approx(
        inboard, rel=0.3
    )  # a little more: the spring is a part of the load
    assert found["yo"].beta / BETA - 1 == pytest.approx(outboard, rel=0.15)
    for axis, offset in zip(AMB_ROTOR.axes, OFFSETS, strict=True):
        assert found[axis].offset == pytest.approx(offset, abs=0.6e-6)


def test_the_spring_tells_a_part_of_how_far_its_coupling_is_out_of_line() -> None:
    """Its force over the displacement is a known one: at two biases it weighs beta a little, and so the constant part."""
    e = adjusted().estimates["beta_yi"]
    alone = 1200 * TOLERANCES["relaxed_y"] * (0.081 + 0.155) / (0.98 * G / math.sqrt(2) * 0.081) * BETA
    left = next(abs(s) * i.u for i, s in e.sensitivities.items() if i.id == "relaxed_y")
    assert 0.02 * alone < left < 0.9 * alone


def test_an_axis_that_carries_little_is_not_made_weaker_to_make_its_noise_less() -> None:
    """Axes at 80 degrees to the vertical, known to 2: y carries a sixth of the weight, known to a fifth of it; eight runs with
    a ten thousandth of noise in the currents. Over the noise of the start, beta of y was 2 u too low in the mean, and
    a certificate contradicted by nine standard deviations."""
    axes = math.radians(80.0)
    both = [positions(OFFSETS, bias=b, axes=axes) for b in (1.2, 0.8)]
    read, p, n = (np.concatenate([getattr(d, x) for d in both], axis=1) for x in ("read", "p", "n"))
    told = certificates() | {
        "axes": Estimate.of(axes, Influence("axes", "axes", math.radians(2.0), "rad", "B", "normal"))
    }
    noise = np.full(4, 2e-4 * BETA / GAP**2 * math.sqrt((p**4 + n**4).mean()))
    off, pulls = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        noisy = (c * (1 + 1e-4 * rng.standard_normal(c.shape)) for c in (p, n))
        found = adjust(Positions(read, *noisy), told, noise, noise, np.array([(BETA, x) for x in OFFSETS]))
        off.append([(found.terms[k, 0] - BETA) / found.estimates[f"beta_{a}"].u for k, a in enumerate(AMB_ROTOR.axes)])
        pulls.extend(found.pulls.values())
    assert np.abs(np.mean(off, axis=0)).max() < 0.4
    assert max(map(abs, pulls)) < 3


def on_rings(**changed: float) -> dict[str, float]:
    return {f"pos_{a}": -70.7e-6 for a in AMB_ROTOR.axes} | {f"pos_{a}": v for a, v in changed.items()}


def test_readings_on_the_rings_forbid_the_lift() -> None:
    rig = load_rig("amb5dof")
    assert list(of_readings(on_rings(yi=-75e-6, zi=-66e-6), rig)) == []
    assert [(f.code, f.where) for f in of_readings(on_rings(zo=70e-6), rig)] == [("sensor-polarity", "pos_zo")]
    near = on_rings(yi=-57e-6, zi=-57e-6)
    assert [(f.code, f.where) for f in of_readings(near, rig)] == [("ring-too-near", "inboard")]
    far = on_rings(yo=-121e-6)
    assert [(f.code, f.where) for f in of_readings(far, rig)] == [("ring-too-far", "outboard")]


def test_where_a_failed_lift_presses_the_shaft_tells_the_exchange() -> None:
    """Outboard the upper coils of y pull it up, inboard the lower ones pull it down, each against its ring."""
    rig = load_rig("amb5dof")
    known = pressed.known(rig)
    assert known is not None
    p, n = np.array([0.0, 1.0, 2.0, 1.0]), np.array([2.0, 1.0, 0.0, 1.0])
    truth = np.array([-99e-6, -10e-6, 99e-6, 3e-6])
    left = {e.told(("yi", "zi", "yo", "zo")): pressed.unexplained(truth[list(e.order)], p, n, known) for e in EXCHANGES}
    assert left[""] < 0.5
    assert min(left, key=lambda k: left[k]) == ""
    assert left["yi with yo"] > 4


@pytest.mark.parametrize("control", [-0.02, 0.0, 0.02])
def test_equal_currents_that_carry_the_load_leave_no_second_magnet(control: float) -> None:
    """A magnet of -beta at -offset pulls as much where both coils carry the same: in a row of offsets 22 um apart it may fit
    better, but not at the bottom of its valley."""
    r = np.linspace(-80e-6, 80e-6, 9)
    for offset in np.arange(100e-6, 160e-6, 1e-6):
        load = BETA * (((BIAS + control) / (GAP - offset)) ** 2 - ((BIAS - control) / (GAP + offset)) ** 2)
        force = np.full_like(r, load) - 190 * r  # the coupling's part
        fit = magnetics.nonlinear(r, *currents(force, offset + r), force, GAP)
        assert fit.terms == pytest.approx([BETA, offset], rel=1e-6)
