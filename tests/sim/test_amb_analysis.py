"""The bench's analysis of what the simulated stand records, against the linearised closed form: noise, rounding and all."""

from __future__ import annotations

import numpy as np
import pytest
from amb_linear import Linear
from amb_plants import COLUMN, RPM, levitated, spun

from bench.analysis.orders import Track, synchronous
from bench.analysis.responses import clear_of_orders, lines, response, without_orders
from bench.analysis.sampling import Sampling
from bench.analysis.tachometer import age, counted, tachometer
from bench.analysis.vectors import contains
from sim_backend.machines.amb5dof.params import AmbControl
from sim_backend.machines.amb5dof.plant import TRACE

SETTLED = {"ki": 1e5, "k0": 1e7}
SPEED = 6000 * RPM
FULL, TELEMETRY = Sampling(1e-4), Sampling(1e-4, 10, 1e-4)


@pytest.fixture(scope="module")
def recorded() -> tuple[np.ndarray, Track, Track, float]:
    """Closed form of the four probes, the vectors by full-rate readings and by telemetry, and the speed."""
    plant = spun(levitated(0, e=5e-7, control=SETTLED), SPEED / RPM, 2.0)
    start = plant.tick
    rows, trace = plant.run(40_000, 1)
    omega = float(trace[:, TRACE.index("speed")].mean())
    expected = Linear(plant, AmbControl(law=0, **SETTLED), omega).unbalance()

    t = (start + np.arange(len(trace))) * 1e-4
    pulses = counted(t, trace[:, TRACE.index("pulses")], trace[:, TRACE.index("pulse_age")])
    full = synchronous(t, trace[:, :4].T, tachometer(*pulses), FULL)

    at = (start + 10 * np.arange(1, len(rows) + 1)) * 1e-4
    angle = (
        np.rint(np.mod(rows[:, COLUMN["angle"]] + np.pi, 2 * np.pi) / (2 * np.pi / 65536)) * 2 * np.pi / 65536 - np.pi
    )
    speed = np.rint(rows[:, COLUMN["speed"]] * 16) / 16
    told = counted(at - TELEMETRY.behind, rows[:, COLUMN["pulses"]] % 65536, age(angle, speed))
    means = synchronous(at, rows[:, :4].T, tachometer(*told), TELEMETRY)
    return np.asarray(expected), full, means, omega


@pytest.mark.parametrize("source", [1, 2], ids=["full-rate", "telemetry"])
def test_vectors_are_the_closed_forms(recorded: tuple[np.ndarray, Track, Track, float], source: int) -> None:
    expected, track, omega = recorded[0], recorded[source], recorded[3]
    assert track.speed[0] == pytest.approx(omega, rel=1e-4)  # type: ignore[union-attr]
    found = track.vectors(0, range(4))  # type: ignore[union-attr]
    assert np.abs(found.values - expected).max() < 0.01 * np.abs(expected).max() + 3 * found.u_amplitude.max()
    assert sum(contains(found.one(k), expected[k], 0.999) for k in range(4)) >= 3


def test_both_sources_agree_in_amplitude_and_lag(recorded: tuple[np.ndarray, Track, Track, float]) -> None:
    """A tick of confusion would be 3.6 degrees here."""
    full, means = recorded[1].vectors(0, range(4)), recorded[2].vectors(0, range(4))
    assert np.allclose(means.values / full.values, 1, atol=0.004)


def test_sensitivity_of_a_turning_rotor_with_unbalance_is_the_closed_form() -> None:
    """Twelve lines of 40 Hz in one axis, at 8 030 r/min: the synchronous part is not periodic with them."""
    control = {"inject_axis": 0, "inject_amplitude": 3e-3, "inject_hz": 40.0, "inject_lines": 12, "inject_step": 40.0}
    plant = spun(levitated(0, e=2e-6, control=SETTLED | control), 8030, 2.0)
    start, trace = plant.tick, plant.run(40_000, 1)[1]
    t = (start + np.arange(len(trace))) * 1e-4
    tacho = tachometer(*counted(t, trace[:, TRACE.index("pulses")], trace[:, TRACE.index("pulse_age")]))
    inside = np.isfinite(tacho.angle(t))
    data = trace[inside][:, [TRACE.index("inject"), TRACE.index("after")]].T
    clean = without_orders(data, tacho.angle(t[inside]))
    hz = 40.0 * np.arange(1, 13)
    found = response(lines(clean, 1e4, 1000, hz), 1, 0)
    linear = Linear(plant, AmbControl(law=0, **SETTLED), 8030 * RPM)
    expected = np.array([linear.sensitivity(2 * np.pi * f, 0) for f in hz])
    clear = clear_of_orders(hz, 8030 * RPM, 10.0)
    away = np.abs(found.values - expected)[clear]
    assert (away < 0.02 * np.abs(expected[clear]) + 4 * found.u_abs[clear]).all()
    assert found.coherence[clear].min() > 0.9
