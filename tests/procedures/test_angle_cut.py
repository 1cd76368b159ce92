"""How long amplifiers of twelve phases cut what the law asks for in a step of the angle: ticks, not samples."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.procedure import Measured
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.rigfile.roles import STATUS, Status
from bench.uncertainty import interval
from procedures.angle_step import bounds, estimates
from procedures.angle_step.bounds import Swing
from procedures.angle_step.plan import Plan
from procedures.angle_step.steps import STEP, read_moves

SIZE = math.radians(12)
STATIC, PRIORITY = (f"{a}, 12°, 200 Hz" for a in ("static", "priority"))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    plan = {"repeats": 2, "standstill_s": 0.3, "record_s": 0.8, "settle_s": 1.5, "steps_rad": (SIZE,)}
    return simulated_run("angle-step", "tsbs12", 1, plan, tmp_path_factory.mktemp("cut") / "recording.mcap")


def swing(i_x: float, i_y: float, torque: float, share: float) -> Swing:
    """200 ticks of which the second half is asked for."""
    told = dict(zip(("across", "along", "torque", "share"), (i_x, i_y, torque, share), strict=True))
    asked = {key: np.where(np.arange(200) >= 100, value, 0.0) for key, value in told.items()}
    still = np.zeros((2, 200))
    return Swing(np.arange(200) * 1e-4, asked, np.zeros((4, 1, 200)), 10.0, still[0], still, still, 1.0)


def test_how_long_amplitudes_are_cut_by_hand() -> None:
    """T (6.19) at (i_x, i_y) = (1, 4): 6.1 A of torque at lambda 0.5 ask segment 1 for 10.1 A; at 0.3 it is asked for 7.7 and
    segment 2 for 9.5, at 0.2 that for 10.8; and 6 A for 10 A, rounded when told."""
    asked = [(6.1, 0.5), (-6.1, 0.5), (6.1, 0.3), (6.1, 0.2), (6.0 + 1e-6, 0.5)]
    assert [swing(1.0, 4.0, *each).cut for each in asked] == pytest.approx([0.01, 0.01, 0.0, 0.01, 0.0])
    assert [swing(-4.0, 1.0, *each).cut for each in asked[:2]] == pytest.approx([0.01, 0.01])


def test_ticks_are_in_the_samples_that_the_controller_flags(run: Simulated) -> None:
    """Its flags are the amplifiers' own, of whole samples: one cut in n of them lasts more than n - 2 ms and no more than n."""
    recording: Recording[Plan] = run.recording
    for done, step in zip(read_moves(recording), recording.steps(STEP), strict=True):
        flagged = int((step.read(STATUS)[STATUS].astype(np.int64) & Status.SEGMENT_LIMIT != 0).sum())
        assert done.swing is not None
        assert done.swing.cut is not None
        assert (flagged > 0) is (done.case.allocation == "static")
        assert flagged - 2 < 1e3 * done.swing.cut < flagged or done.swing.cut == flagged == 0


def test_what_is_measured_is_how_long_a_cut_lasts(run: Simulated) -> None:
    """14.2 ms; the samples that it fell in are 15, told with 0.2 ms."""
    measured = {(m.quantity.name, m.where): m.estimate for m in run.results if isinstance(m, Measured)}
    truth = truth_of_motion(run)
    for where, by_hand in ((STATIC, 14.2e-3), (PRIORITY, 0.0)):
        found = measured["saturated", where]
        assert truth[f"saturated@{where}"] == pytest.approx(by_hand, abs=0.15e-3)
        assert abs(found.value - truth[f"saturated@{where}"]) < 2.6 * found.u
        assert found.u < 0.1e-3


def test_samples_alone_tell_it_within_their_bounds(run: Simulated) -> None:
    plan, truth = run.recording.plan, truth_of_motion(run)
    bare = [replace(done, swing=None) for done in read_moves(run.recording)]
    found = estimates.by_case(bare, run.recording.rig, plan.band, 2 * math.pi / plan.encoder_counts, plan.kp_theta)
    for case, result in found.items():
        told = interval(result.estimates["saturated"])
        assert told.low <= truth[f"saturated@{case.where}"] <= told.high
        assert told.U < 8e-3


def test_a_controller_that_does_not_tell_the_share_tells_no_cut() -> None:
    rig = load_rig("tsbs12")
    motor = rig.motors["motor"]
    other = rig.model_copy(update={"motors": {"motor": motor.model_copy(update={"asked": {k: v for k, v in motor.asked.items()
                                                                                         if k != "share"}})}})  # fmt: skip
    assert bounds.told(rig) == {"across": "demand_x", "along": "demand_y", "torque": "torque_given", "share": "lambda"}
    assert bounds.told(other) == {}
    assert set(bounds.captured(rig)) - set(bounds.captured(other)) == set(bounds.told(rig).values())
