"""The load at rest against that of the AMBs' calibration, on exact statics: quiet where nothing moved, and who moved it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.findings import Effect
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence
from procedures.force_constant import estimates, fit, load_at_rest
from procedures.force_constant.checks import load_moved
from procedures.force_constant.fit import DIRECT, Ramps
from procedures.force_constant.load_at_rest import Rest
from tests.procedures.force_statics import BIAS, L_OA, SPAN, WEIGHT, Machine, parameters, ramps

MACHINE = Machine()
CARRIED = np.array([WEIGHT * L_OA / SPAN, WEIGHT * (1 - L_OA / SPAN)])  # inboard, outboard, N
HANGER = np.array([-2.94, 5.39])  # 0.25 kg 0.15 m beyond the outboard AMB
U_N = 5e-3


def facts(carried: np.ndarray = CARRIED) -> dict[str, Estimate]:
    """F0 of a calibration that knows each load to 5 mN: F = A i_p^2 - B i_n^2 is K u + K2 (v + b^2) (T 2.4)."""
    out = {f"hanger_{b}": Estimate.exact(x) for b, x in zip("io", HANGER, strict=True)}
    for b, name in enumerate("io"):
        common = Influence(f"scatter/{name}", "scatter", U_N, "N", "A", "normal", 30)
        for k in range(9):
            k2 = MACHINE.constants("y", b, 2 * np.pi * k / 9)[1]
            out[f"F0_{name}@{k}"] = Estimate.of(k2 * BIAS**2 - carried[b], common)
    return out


def compared(r: Ramps, known: dict[str, Estimate] | None = None) -> Rest | None:
    inputs = {name: Estimate.exact(value) for name, value in parameters(MACHINE).items()}
    return load_at_rest.compared(r, inputs, facts() if known is None else known, load_rig("tsbs12"), 1.0, BIAS)


def constant(r: Ramps) -> float:
    p = parameters(MACHINE)
    terms = fit.fit(r, p, estimates.constants(r, p, BIAS), BIAS).terms
    return float(terms[0, :, DIRECT].mean())


def read_by(bearing: int, coil: int, gain: float) -> Ramps:
    r = ramps(MACHINE)
    coils = r.coils.copy()
    coils[bearing, coil] *= gain
    return replace(r, coils=coils)


def test_the_shaft_that_was_calibrated_is_carried_by_the_same_force() -> None:
    rest = compared(ramps(MACHINE))
    assert rest is not None
    np.testing.assert_allclose(rest.moved, 0, atol=2e-3)
    np.testing.assert_allclose(rest.u, U_N, rtol=0.1)
    assert rest.causes == ()
    assert list(load_moved(rest, 0.03)) == []


@pytest.mark.parametrize(("bearing", "coil", "name"), [(0, 1, "i_yi_n"), (1, 0, "i_yo_p"), (1, 1, "i_yo_n")])
def test_a_current_sensor_is_named_with_what_its_gain_does(bearing: int, coil: int, name: str) -> None:
    """By hand, a gain of 0.3 % on i_yo_p: 2 A i_p^2 of 0.003, with A = K/(4 b) = 6.2 N/A^2 and i_p = 4.2 A about 0.66 N."""
    r = read_by(bearing, coil, 1.003)
    rest = compared(r)
    assert rest is not None
    assert list(rest.beyond) == [bearing == 0, bearing == 1]
    if name == "i_yo_p":
        assert rest.moved[1] == pytest.approx(0.66, abs=0.1)
    cause = {c.sensors[0]: c for c in rest.causes}[name]
    assert cause.amounts[0] == pytest.approx(0.003, rel=0.02)
    assert cause.shift == pytest.approx(constant(r) - constant(ramps(MACHINE)), rel=0.05)
    found = list(load_moved(rest, 0.03))
    assert [(f.code, f.where) for f in found] == [("load-moved", ("inboard", "outboard")[bearing])]
    assert f"{name} changed by +0.30%" in found[0].text
    assert next(iter(load_moved(rest, 10.0))).effect is Effect.NOTE  # of a result that knows no better


def test_the_gains_of_all_sensors_together_are_a_cause_of_their_own() -> None:
    """0.3 %: both AMBs carry 0.6 % more, and so does the motor by them."""
    r = replace(ramps(MACHINE), coils=ramps(MACHINE).coils * 1.003)
    rest = compared(r)
    assert rest is not None
    np.testing.assert_allclose(rest.moved, 0.006 * CARRIED, rtol=0.2)
    (cause,) = rest.causes
    assert cause.sensors == (load_at_rest.ALL,)
    assert cause.shift == pytest.approx(constant(r) - constant(ramps(MACHINE)), rel=0.05)
    assert cause.shift == pytest.approx(0.006 * constant(ramps(MACHINE)), rel=0.05)


def test_a_zero_that_wandered_moves_both_and_is_a_note() -> None:
    """Both probes by 1 µm: the shaft stands 1 µm higher, and the sensors read as before."""
    moved = ramps(Machine(shift=1e-6))
    r = replace(moved, positions=0 * moved.positions, motor_m=0 * moved.motor_m)
    rest = compared(r)
    assert rest is not None
    (cause,) = rest.causes
    assert cause.sensors == ("pos_yi", "pos_yo")
    assert cause.amounts == pytest.approx((1e-6, 1e-6), rel=0.05)
    assert cause.shift == pytest.approx(constant(r) - constant(ramps(MACHINE)), rel=0.1)
    (found,) = load_moved(rest, 0.03)
    assert found.effect is Effect.NOTE
    assert "pos_yi by +1.0" in found.text


def test_a_hanger_that_is_still_on_is_no_finding() -> None:
    rest = compared(ramps(MACHINE), facts(CARRIED - HANGER))  # the shaft alone is what the run carries less the hanger
    assert rest is not None
    np.testing.assert_allclose(rest.moved, 0, atol=2e-3)
    assert list(load_moved(rest, 0.03)) == []


def test_a_calibration_without_it_is_used_as_it_is() -> None:
    assert compared(ramps(MACHINE), {}) is None
    assert list(load_moved(None, 0.03)) == []
