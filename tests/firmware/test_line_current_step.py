"""`bench run current-step` against the C controller with a command line: what it finds is what its law is in closed form."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from line_programs import MACHINE, NATURAL, NOISE_A, PATIENT_MS, TICKS_S, ZETA, controller, law, rise_time, run_bench

INDETERMINATE = 5
REPEATS, SIZE_A, SMALL_A, RESPONSE_S = 6, 3.0, 0.3, 2e-3
PLAN = ("spare_s=0.3", f"repeats={REPEATS}", f"small_repeats={REPEATS}", f"size_A={SIZE_A}", f"small_A={SMALL_A}",
        f"response_s={RESPONSE_S}")  # fmt: skip
"""Its two writes may take a third of a second on a busy machine."""
FAR = 5.0
"""Standard deviations of a result. Of its own uncertainty, which six repeats tell, one run in sixty had a result beyond four:
Student's t of four and five degrees of freedom."""
LIMITED = "limit-untouched"
"""This plant has no limit that a large step could touch; the procedure says so and leaves the decision."""

OF_MEAN = NOISE_A / SIZE_A / math.sqrt(REPEATS)
"""Standard deviation of a sample of the mean response, by the noise of a reading."""


def rise_time_sd() -> float:
    """Standard deviation of the rise time of the mean, s: the noise over the slopes where it passes a tenth and nine tenths."""
    t = np.linspace(0, math.pi / NATURAL, 20_001)
    h = law(t)
    slopes = np.gradient(h, t)[[int(np.argmax(h > level)) for level in (0.1, 0.9)]]
    return OF_MEAN * math.hypot(*(1 / slopes))


def bandwidth() -> tuple[float, float]:
    """Of the law, Hz, and its standard deviation by the mean of all small steps, up and back.

    |H|^-2 = (1 - x^2)^2 + (2 zeta x)^2 at x times the natural frequency; |H|' at -3 dB is -2^-1/2 x (x^2 - 1 + 2 zeta^2).
    Noise e_k of n samples gives H(f) the sum of (e_k+1 - e_k) z^k: |1 - z| sqrt(n/2) times as much along H.
    """
    inner = 1 - 2 * ZETA**2
    x = math.sqrt(inner + math.sqrt(inner**2 + 1))
    natural_hz = NATURAL / (2 * math.pi)
    noise = OF_MEAN * SIZE_A / SMALL_A / math.sqrt(2)
    along = noise * 2 * math.sin(math.pi * x * natural_hz / TICKS_S) * math.sqrt(RESPONSE_S * TICKS_S / 2)
    return natural_hz * x, natural_hz * along / (2**-0.5 * x * (x**2 - inner))


@pytest.mark.parametrize(("kind", "place"), [("lira", "tcp"), pytest.param("north", "pty", marks=pytest.mark.long)])
def test_the_step_response_of_a_law(line_program: Path, rig_folder: Path, kind: str, place: str) -> None:
    given = ("run", "current-step", "--rig", kind, "--backend", "live", "--operator", "console", "--no-report")
    with controller(line_program, place, kind, PATIENT_MS) as there:
        settings = (x for setting in PLAN for x in ("--plan", setting))
        done = run_bench(rig_folder, *given, *settings, "--link", f"controller={there.url}", real=True)
    assert done.returncode == INDETERMINATE, done.stderr
    record = json.loads((rig_folder / done.stdout.strip() / "record.json").read_text())
    assert {f["code"] for f in record["findings"]} <= {LIMITED, *MACHINE}
    found = {m["name"]: (m["value"], m["expanded_uncertainty"]) for m in record["measurements"]}
    rise, rise_sd = rise_time(), rise_time_sd()
    overshoot = math.exp(-math.pi * ZETA / math.sqrt(1 - ZETA**2))
    expected = {"rise_time": (rise, rise_sd), "fall_time": (rise, rise_sd), "overshoot": (overshoot, OF_MEAN),
                "bandwidth_small": bandwidth()}  # fmt: skip
    for name, (value, sd) in expected.items():
        assert abs(found[name][0] - value) < FAR * sd, name
    assert found["rise_time"][1] < 0.01 * rise
