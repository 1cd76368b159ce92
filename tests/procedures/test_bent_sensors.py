"""Current sensors whose readings bend over the current: what the assumptions on page 1 say of them, on exact statics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize
from tsbs_statics import Shaft, parameters, sweep_data

from procedures.amb_calibration import fit as amb_calibration_fit
from procedures.amb_calibration.fit import Hangings
from procedures.force_coupling import fit as force_coupling_fit
from procedures.shared import assumptions
from procedures.shared.weight import weight

BIAS, PAIR = 3.0, (1.0, -1.0)
CERTIFICATES = {
    "gravity": 9.81, "air_density": 1.2, "mass_density": 8000.0, "hook_to_outboard": 0.15, "amb_span": 0.2, "hanger": 0.3,
    "motor_to_outboard": 0.1, "amb_gap": 0.5e-3, "motor_stiffness": 250e3, **{f"mass_{k}": 1.0 + k for k in range(4)},
    **{f"gain_{b}{c}": 1.0 for b in "io" for c in "pn"}, **{f"offset_{b}{c}": 0.0 for b in "io" for c in "pn"},
}  # fmt: skip
LOADS = np.array([-1, 0, 1, 2, 3, 2, 1, 0, -1])
SIZE = 12e-3  # A, at 3 A off the bias: 0.1 % of 12 A
BEND = SIZE / 3**2  # A per A^2


def hung(bend: tuple[float, float], k: float = 75.0, k2: float = -0.5, f0: float = -60.0) -> Hangings:
    """What a controller that keeps the sum of its readings at twice the bias reads, of coils F = A i_p^2 - B i_n^2; a sensor
    reads i + bend (i - bias)^2."""
    a, b = k / (4 * BIAS) + k2 / 2, k / (4 * BIAS) - k2 / 2

    def true(read: float, q: float) -> float:
        return float(optimize.brentq(lambda i: i + q * (i - BIAS) ** 2 - read, 0.0, 10.0))

    def force(i: float) -> float:
        return f0 + a * true(BIAS + i, bend[0]) ** 2 - b * true(BIAS - i, bend[1]) ** 2 - (a - b) * BIAS**2

    kg = np.array([*(CERTIFICATES[f"mass_{j}"] for j in range(4)), 0.0])[LOADS]
    newtons = np.asarray(weight(kg, 9.81, 1.2, 8000.0))
    shares = amb_calibration_fit.hung_shares(0.15, 0.2)
    control = np.array([[optimize.brentq(lambda i, f=f: force(i) - f, -2.9, 2.9) for f in s * newtons] for s in shares])
    currents = np.stack([BIAS + control, BIAS - control], axis=1)[:, :, None, :]
    nought = np.zeros((1, len(LOADS)))
    branch = np.array([-1.0, 1, 1, 1, 1, -1, -1, -1, -1])[None]
    return Hangings(currents, np.zeros((2, 1, len(LOADS))), nought, LOADS[None], branch, np.zeros(1))


@pytest.mark.parametrize("sign", PAIR)
def test_opposite_bends_of_two_coils_are_a_k2(sign: float) -> None:
    """dK2 = -K q and dKw = -2 K q i, and the residuals are what they were to a ten thousandth of the load."""
    straight, bent = (
        amb_calibration_fit.fit(hung(q), CERTIFICATES, BIAS, 4) for q in ((0.0, 0.0), (sign * BEND, -sign * BEND))
    )
    for b in range(2):
        k, k2 = straight.terms[b, 0, 1:3]
        assert (k, k2) == pytest.approx((75.0, -0.5), rel=1e-6)
        assert bent.terms[b, 0, 2] - k2 == pytest.approx(-sign * k / 750, rel=0.1)
        assert np.abs(bent.residuals[b]).max() < 1e-4 * np.abs(bent.forces[b]).max()
    before, after = (amb_calibration_fit.over_a_turn(f, CERTIFICATES) for f in (straight, bent))
    current = (before["Kw_o"] - before["K_o"]) / (2 * before["K2_o"])
    assert after["Kw_o"] - before["Kw_o"] == pytest.approx(-sign * 75.0 / 375 * current, rel=0.1)
    assert any(
        "K_2 changes by -K/750 A and K_w by -K/375 A for each ampere" in text for text in assumptions.AMB_CALIBRATION
    )


@pytest.mark.parametrize("sign", PAIR)
def test_a_bend_of_the_segments_sensors_is_a_ratio(sign: float) -> None:
    """6 mA at 3 A with the cube of the current: some tenths of a per cent of alpha_ratio, and a gamma that looks scaled."""
    shaft = Shaft(gamma_0=np.radians(0.3))
    data = sweep_data(shaft, np.arange(-2.5, 3.6, 0.5))
    fit = force_coupling_fit.fit_sweep(
        replace(data, segments=data.segments + sign * 6e-3 / 27 * data.segments**3), parameters(shaft)
    )
    assert fit.term("r") / (12.1 / 14.3) - 1 == pytest.approx(-sign * 2e-3, abs=1e-3)
    assert abs(fit.turn[0] - 1) > 1e-4
    assert any("change alpha_ratio by -0.1 to -0.3 %" in text for text in assumptions.FORCE_COUPLING)
