"""What the AMB calibration hands on: K and K2 of each bearing at each angle, with what they share."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from identified import CALIBRATE, SEED, calibrated

from bench.calibration import Calibration
from bench.calibration.file import from_json, to_json
from bench.cli.virtual import Simulated
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, correlation
from procedures.amb_calibration.procedure import procedure
from sim_backend.machines.tsbs.quantities import eccentricity, own_weight
from sim_backend.truth import draw

BIAS_A, ANGLES = 3.0, CALIBRATE["angles"]


def true_by_angle(seed: int) -> Mapping[str, float]:
    """K = 2 b (A + B) and K2 = A - B at each angle, with A, B = beta / (gap -+ eccentricity)^2 (T 2.4); F0 = K2 b^2 less what
    the AMB carries of the bare rotor, as K u + K2 v + F0 = 0 and A i_p^2 - B i_n^2 = K u + K2 (v + b^2)."""
    plant = draw(load_rig("tsbs12"), seed, None, {"bias_i": BIAS_A, "bias_o": BIAS_A}).plant
    angles = 2 * np.pi * np.arange(ANGLES) / ANGLES
    xi, own = eccentricity(plant, angles), own_weight(plant, angles)
    beta, gap = (np.array(x)[:, None] for x in (plant.beta, plant.gap))
    near, far = beta / (gap - xi) ** 2, beta / (gap + xi) ** 2
    out = {}
    for b, bearing in enumerate("io"):
        for k in range(ANGLES):
            out[f"K_{bearing}@{k}"] = float(2 * BIAS_A * (near + far)[b, k])
            out[f"K2_{bearing}@{k}"] = float((near - far)[b, k])
            out[f"F0_{bearing}@{k}"] = float((near - far)[b, k] * BIAS_A**2 - own[b, k])
    return out


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    return calibrated(tmp_path_factory.mktemp("facts"))


@pytest.fixture(scope="module")
def calibration(done: Simulated) -> Calibration:
    return from_json(to_json(done.calibration()))


def test_the_settings_and_the_influences(calibration: Calibration) -> None:
    assert calibration.settings == {"bias_A": BIAS_A, "angles": ANGLES}
    invented = {i for i in calibration.influences if i.startswith("amb-calibration-sim-2026/")}
    assert len([i for i in invented if "/scatter/" in i]) == 6 * ANGLES
    assert set(calibration.influences) - invented == set(calibration.certificates)
    assert "sensors/i_yo_p/gain" in calibration.certificates


def test_values_by_angle_hold_the_truth(calibration: Calibration) -> None:
    """Seed fixed before any tuning; of 54 values of one rig none is off by four standard uncertainties."""
    true = true_by_angle(SEED)
    assert set(true) < set(calibration.values)
    for name, value in true.items():
        estimate = calibration.values[name]
        assert abs(estimate.value - value) < 4 * estimate.u, name
        assert estimate.unit == {"K2": "N/A^2", "F0": "N"}.get(name[:2], "N/A")


def by_scatter(e: Estimate) -> float:
    return float(np.hypot.reduce([c for name, c in e.contributions.items() if "/scatter/" in name]))


@pytest.mark.parametrize("i", [0.0, 0.2, 1.4])
def test_f0_scatters_with_k_as_the_fit_has_it(done: Simulated, calibration: Calibration, i: float) -> None:
    """Of F0 + K i + K2 i^2 at each angle, directly from the hangings' covariance: no root of its own is left out."""
    (a,), v = procedure.evaluated(done.recording).result, calibration.values
    for b, bearing in enumerate("io"):
        for k in range(ANGLES):
            load = v[f"F0_{bearing}@{k}"] + v[f"K_{bearing}@{k}"] * i + v[f"K2_{bearing}@{k}"] * i**2
            by_hanging = np.array([1, i, i**2, 0]) @ a.fit.solvers[b, k]
            expected = np.sqrt((by_hanging**2 * a.scatter.covariance[b, b, k]).sum())
            assert by_scatter(load) == pytest.approx(expected, rel=1e-5)


def test_the_mean_over_a_turn_is_the_result_and_knows_its_angles(done: Simulated, calibration: Calibration) -> None:
    results = {m.quantity.name: m.estimate for m in done.results if isinstance(m, Measured)}
    for name, result in results.items():
        assert calibration.values[name].value == pytest.approx(result.value, rel=1e-12)
        assert calibration.values[name].u == pytest.approx(result.u, rel=1e-6)
    mean = sum(
        (calibration.values[f"K_o@{k}"] * (1 / ANGLES) for k in range(1, ANGLES)), calibration.values["K_o@0"] / ANGLES
    )
    rest = calibration.values["K_o"] - mean
    assert rest.value == pytest.approx(0.0, abs=1e-9)
    left = {i.id.partition("/")[2] for i, c in rest.sensitivities.items() if abs(c * i.u) > 1e-9}
    assert left <= {"angle/K_o"}  # all else is the same by identity


def test_angles_share_certificates_and_not_their_scatter(calibration: Calibration) -> None:
    a, b = calibration.values["K_o@0"], calibration.values["K_o@4"]
    assert 0.1 < correlation(a, b) < 0.999
    own = [i for i in a.contributions if "/scatter/" in i]
    assert own
    assert not set(own) & set(b.contributions)
    both = [
        i
        for i in calibration.values["K_i@0"].contributions
        if "/scatter/" in i and i in calibration.values["K2_o@0"].contributions
    ]
    assert both  # one badly seated load moves both bearings
