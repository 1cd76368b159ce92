"""What the checks of set-point steps say: of planted defects, of results made on purpose, of plans that cannot work."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_step import A7, stepped

from bench.errors import BenchError
from bench.findings import Effect
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.rigfile.roles import Status
from bench.uncertainty import Estimate, Influence
from procedures.step import checks, estimates, oscillation, planes, settling, slewing
from procedures.step import steps as step_steps
from procedures.step.plan import Plan
from procedures.step.procedure import check, procedure

FAST = 300.0


@pytest.mark.parametrize(("rises", "told"), [((2.5e-3, 2.5e-3), 0), ((2.5e-3, 2.53e-3), 0), ((2.5e-3, 2.8e-3), 1)])
def test_rises_that_go_with_the_size_are_ramps(rises: tuple[float, float], told: int) -> None:
    noise = Influence(id="n", name="n", u=5e-6, unit="s", kind="A", distribution="normal")
    results = {}
    for size, rise in zip((10e-6, 20e-6), rises, strict=True):
        for way in (1, -1):
            case = step_steps.Case("A", 0.0, "y", size, way)
            settled = settling.Settling(0.0, 0.02, np.zeros(0))
            results[case] = estimates.Result(case, (), None, settled, 0.0, {"rise_time": Estimate.of(rise, noise)})
    found = list(slewing.of_sizes(results))
    assert len(found) == told
    if told:  # 20 µm in T: rise² has grown by 0.6 T² less that of 10 µm, a quarter of it
        rate = 20e-6 * math.sqrt(0.75 * 0.6 / (rises[1] ** 2 - rises[0] ** 2))
        assert f"some {rate * 1e3:.2g} mm/s" in found[0].text


@pytest.mark.parametrize(
    ("defect", "plan", "code"),
    [
        ({"factor_ref_y": 0.0}, {}, "no-step"),
        pytest.param({"factor_ref_y": 0.5}, {}, "wrong-size", marks=pytest.mark.long),
        pytest.param({"factor_ref_y": -1.0}, {}, "wrong-way", marks=pytest.mark.long),
        ({"current_sign_i": -1.0}, {}, "current-sign"),
        pytest.param({"told_planes": 1.0}, {}, "planes-exchanged", marks=pytest.mark.long),
        ({"told_planes": 1.0}, {"speeds_rad_s": (FAST,)}, "planes-exchanged"),
        pytest.param({"supply_V": 12.0, "inductance": 60e-3}, {}, "voltage-saturated", marks=pytest.mark.long),
        ({"pulse_missing": 3.0}, {"speeds_rad_s": (FAST,)}, "speed-off"),
        pytest.param({"drop_fraction": 0.005}, {}, "missing-samples", marks=pytest.mark.long),
    ],
)
def test_a_planted_defect_is_named_and_never_passes(
    tmp_path: Path, defect: Mapping[str, float], plan: Mapping[str, Any], code: str
) -> None:
    _, findings = stepped(tmp_path, 1, defect, **plan)
    found = [f for f in findings if f.code == code]
    assert found, [f.code for f in findings]
    assert found[0].effect is not Effect.NOTE
    assert list(procedure.drawn(Recording.open(tmp_path / "recording.mcap", Plan)))


def test_a_finding_about_one_axis_leaves_the_other_alone(tmp_path: Path) -> None:
    """The tail of one axis's case says nothing of its overshoot, and contact in one axis nothing of the other."""
    _, findings = stepped(tmp_path, 1, axes=("y", "z"), a={"law": 0.0})
    open_ones = [f for f in findings if f.code == "not-settled"]
    assert open_ones
    assert all(f.concerns == (f"settling_time@{f.where}",) for f in open_ones)
    recording = Recording.open(tmp_path / "recording.mcap", Plan)
    steps = step_steps.read_steps(recording)
    hit = [dataclasses.replace(d, flags=Status.CONTACT_AXIAL if d.case.axis == "z" else 0) for d in steps]
    (touch,) = (f for f in checks.of_steps(hit, recording.plan) if f.code == "contact")
    sizes = [f"{um} µm {way}" for um in (10, 20) for way in ("up", "down")]
    assert {*touch.concerns} == {"@A, z, 0 r/min", *(f"@A, z, 0 r/min, {size}" for size in sizes)}


@pytest.mark.parametrize(
    ("defect", "code"),
    [
        ({"geometry.clearance": 26e-6}, "ring-too-near"),
        pytest.param({"position_range": 30e-6}, "ring-too-near", marks=pytest.mark.long),
        ({"position_sign_yi": -1.0}, "sensor-polarity"),
        ({"exchange_planes": 1.0}, "planes-exchanged"),
    ],
)
def test_what_its_rest_or_its_lift_shows_ends_the_run_before_a_step(
    tmp_path: Path, defect: Mapping[str, float], code: str
) -> None:
    measured, findings = stepped(tmp_path, 1, defect)
    assert not measured
    assert code in {f.code for f in findings if f.effect is Effect.ERROR}


@pytest.mark.parametrize(
    ("defect", "named"),
    [
        ({"drive_fault_after_s": 8.0}, "EXTERNAL"),
        ({"drive_limit": 0.002}, "OVERLOAD"),
    ],
)
def test_what_cannot_turn_ends_the_run(tmp_path: Path, defect: Mapping[str, float], named: str) -> None:
    """The controller's own supervision or the drive's is first: the run is aborted and says what reported it."""
    with pytest.raises(BenchError, match=named):
        stepped(tmp_path, 1, defect, speeds_rad_s=(FAST,))


def test_plans_that_cannot_work_are_refused() -> None:
    rig = load_rig("amb5dof")
    assert list(check(rig, Plan())) == []
    assert list(check(rig, Plan(**A7))) == []
    assert "clearance" in next(iter(check(rig, Plan(sizes_m=(10e-6, 60e-6)))))
    assert "each once" in next(iter(check(rig, Plan(axes=("y", "y")))))
    assert "envelope" in next(iter(check(rig, Plan(speeds_rad_s=(2000.0,)))))
    assert "191 r/min" in next(iter(check(rig, Plan(speeds_rad_s=(5.0,)))))
    assert "found no spring" in next(iter(check(rig, Plan(a={"spring": 1.0}))))
    assert "at rest only" in next(iter(check(rig, Plan(b={"current_limit": 1.0}))))
    assert "twice" in next(iter(check(rig, Plan(names=("A", "A")))))
    bare = rig.model_copy(update={"devices": {k: d for k, d in rig.devices.items() if k != "drive"}})
    assert "nothing turns" in next(iter(check(bare, Plan(speeds_rad_s=(FAST,)))))


def test_planes_that_answer_alike_are_called_exchanged_by_chance_only() -> None:
    """Where neither plane is nearer, one in ten thousand; where the currents answer their own, or the other's, as it is."""
    rng = np.random.default_rng(3)

    def steps(own: float, other: float) -> list[np.ndarray]:
        x = rng.normal(size=(8, 2, 60))
        return [np.concatenate([a, own * a + other * a[::-1] + rng.normal(size=(2, 60))]) for a in x]

    assert not any(planes.is_crossed(steps(1.0, 1.0)) for _ in range(300))
    assert not planes.is_crossed(steps(1.0, 0.2))
    assert planes.is_crossed(steps(0.2, 1.0))
    assert not planes.is_crossed([x[:, :20] for x in steps(0.2, 1.0)])


@pytest.mark.parametrize(
    ("constant", "left", "named"), [(0.577, 0.39, "record_s of 2 s"), (67.0, 0.03, "controller's model")]
)
def test_a_step_that_has_not_settled_says_what_to_do(constant: float, left: float, named: str) -> None:
    """PID's integrator, of which a longer record is cured; a pole that no record outlasts."""
    t = np.arange(-20, 400) * 1e-3
    y = np.where(t > 0, 1 + left * np.exp(-t / constant), 0.0)
    settled = settling.Settling(math.inf, 0.02, np.zeros(0))
    case = step_steps.Case("A", 0.0, "y", 10e-6, 1)
    one = oscillation.One(t, np.array([y, 0 * y]))
    result = estimates.Result(case, (one,), None, settled, float(y[-100:].mean() - 1), {})
    (finding,) = checks.of_results({case: result}, {}, Plan())
    assert finding.code == "not-settled"
    assert named in finding.text
    result = dataclasses.replace(result, settled=dataclasses.replace(settled, open=True))
    (finding,) = checks.of_results({case: result}, {}, Plan())
    assert finding.code == "not-settled"
    assert "along the edge" in finding.text
