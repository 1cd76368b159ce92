"""Unbalance response and sensitivity of the core against the linearised closed form."""

from __future__ import annotations

import numpy as np
import pytest
from amb_linear import Linear
from amb_plants import RPM, levitated, spun, synchronous

from sim_backend.machines.amb5dof.params import AmbControl
from sim_backend.machines.amb5dof.plant import TRACE

QUIET = {"position_noise": 0.0, "current_noise": 0.0, "position_lsb": 0.0, "current_lsb": 0.0}
SETTLED = {"ki": 1e5, "k0": 1e7}
"""Integrators that bring the shaft to its set point within a test."""


@pytest.mark.parametrize("law", [0, 1], ids=["PID", "CCS"])
@pytest.mark.parametrize("rpm", [1000, 2500, 3500, 5000, 9000, 14000])
def test_unbalance_response_is_the_closed_form(law: int, rpm: float) -> None:
    """Complex, within 1e-3 of the vector, at an unbalance that is small enough to stay linear."""
    plant = spun(levitated(law, e=2e-8, control=SETTLED, **QUIET), rpm, 2.0)
    trace = plant.run(10000, 1)[1]
    omega = trace[-1, TRACE.index("speed")]
    expected = Linear(plant, AmbControl(law=law, **SETTLED), omega).unbalance()
    found = synchronous(trace, slice(0, 4))
    assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("law", [0, 1], ids=["PID", "CCS"])
@pytest.mark.parametrize("axis", [0, 3])
def test_sensitivity_is_the_closed_form(law: int, axis: int) -> None:
    """A multisine in one axis at 8 000 r/min without unbalance; V1/E by single bins over whole periods."""
    lines, step = 12, 40.0
    control = {
        "inject_axis": axis,
        "inject_amplitude": 1e-4,
        "inject_hz": step,
        "inject_lines": lines,
        "inject_step": step,
    }
    plant = spun(levitated(law, e=0.0, control=SETTLED | control, **QUIET), 8000, 2.0)
    trace = plant.run(10000, 1)[1]
    bins = np.fft.rfft(trace[:, [TRACE.index("inject"), TRACE.index("after")]], axis=0)[40 : 40 * lines + 1 : 40]
    linear = Linear(plant, AmbControl(law=law, **SETTLED), 8000 * RPM)
    expected = [linear.sensitivity(2 * np.pi * step * k, axis) for k in range(1, lines + 1)]
    np.testing.assert_allclose(2 * np.abs(bins[:, 0]) / 10000, 1e-4, rtol=1e-6)
    np.testing.assert_allclose(bins[:, 1] / bins[:, 0], expected, rtol=5e-3, atol=2e-3)
    before = trace[:, TRACE.index("after")] - trace[:, TRACE.index("inject")]
    np.testing.assert_allclose(trace[:, TRACE.index("before")], before, atol=1e-12)
