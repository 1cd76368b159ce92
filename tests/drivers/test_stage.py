"""A machine that does not levitate, through its driver: zeros, moves, waves, what is refused, and how it is made safe."""

from __future__ import annotations

import math

import pytest
from hostile_controller import Bench, Telemetry, unchanged

from bench.cli.stage_safety import END_S
from bench.errors import InterlockError, StateContradicts, StateNotReached
from bench.procedure.roles import RigState
from bench.rigfile import RigFile, load_rig
from bench.rigfile.stage import axes_of

RIG = load_rig("rlsrm")
HOLDS = RigFile.parse(
    RIG.toml_text.replace("home_time = 30", 'make_safe = "hold"\nhome_time = 30').replace(
        "safe_holds = { index = 61, unit = \"1\", default = 0", "safe_holds = { index = 61, unit = \"1\", default = 1"
    ),
    RIG.dbc_text,
)  # fmt: skip


def stage(bench: Bench):  # type: ignore[no-untyped-def]
    found = bench.controller.stage
    assert found is not None
    return found


@pytest.fixture(scope="module")
def moved() -> Bench:
    """Held, and sent somewhere."""
    bench = Bench(RIG)
    stage(bench).move({"x": 4e-3, "angle": 1.0})
    return bench


def test_a_move_is_over_when_its_set_points_rest(moved: Bench) -> None:
    assert moved.state == "HOLDING"
    assert moved.controller.state is RigState.HELD
    assert moved.controller.reading("x_ref") == pytest.approx(4e-3, abs=1e-9)
    assert moved.controller.reading("angle_ref") == pytest.approx(1.0, abs=1e-3)
    begin = moved.machine.now_ns()
    stage(moved).move({"x": 4e-3})  # it is there
    assert moved.machine.now_ns() - begin < 0.1e9


def test_what_is_no_axis_or_out_of_travel_is_refused_before_anything_is_sent(moved: Bench) -> None:
    moved.link.commands.clear()
    with pytest.raises(InterlockError, match="axis z: the rig has none"):
        stage(moved).move({"z": 1.0})
    with pytest.raises(InterlockError, match=r"x_target: found 0\.02 m; the envelope allows -0\.0135 to 0\.0135 m"):
        stage(moved).move({"x": 0.02})
    assert moved.controller.reading("x_ref") == pytest.approx(4e-3, abs=1e-9)


def test_waves_play_until_they_are_stopped(moved: Bench) -> None:
    wave = axes_of(RIG)["angle"].wave
    assert wave is not None
    assert wave.sine is not None
    stage(moved).write({wave.kind: wave.sine, wave.amplitude: 0.5, wave.period: 1.0})
    stage(moved).play()
    assert moved.controller.state is RigState.MOVING
    told = []
    for _ in range(40):
        moved.controller.clock.sleep(0.05)
        told.append(moved.controller.reading("angle_ref"))
    assert (min(told), max(told)) == (pytest.approx(0.5, abs=0.02), pytest.approx(1.5, abs=0.02))
    stage(moved).stop()
    assert moved.state == "HOLDING"
    stage(moved).write({wave.kind: wave.off})


def test_zeros_that_are_known_are_not_looked_for_again(moved: Bench) -> None:
    stage(moved).let_go()
    moved.link.commands.clear()
    stage(moved).home()
    assert moved.said == []
    stage(moved).hold()
    assert moved.said == ["HOLD"]


def test_zeros_that_are_not_found_are_said() -> None:
    """With its brake on it never passes a mark."""
    bench = Bench.__new__(Bench)
    with pytest.raises(StateNotReached, match=r"knows no zeros: its state is READY; next: look at the marks"):
        Bench.__init__(bench, RIG, brake_angle=5.0)


def test_one_that_is_held_is_made_safe_at_once() -> None:
    bench = Bench(RIG)
    found, took_s = bench.made_safe(unchanged, 0.1)
    assert (found, bench.said[0], bench.state) == ((), "MAKE_SAFE", "OFF")  # and DISABLE, if READY was seen on its way
    assert took_s < 1.0


def test_one_that_moves_brakes_first() -> None:
    bench = Bench(RIG)
    wave = axes_of(RIG)["angle"].wave
    assert wave is not None
    stage(bench).write({wave.kind: wave.sine or 1.0, wave.amplitude: 2.0, wave.period: 2.0})
    stage(bench).play()
    bench.controller.clock.sleep(1.0)
    speed = abs(bench.controller.reading("speed"))
    found, took_s = bench.made_safe(unchanged, 0.0)
    assert speed > 3.0
    assert (found, bench.said, bench.state) == ((), ["MAKE_SAFE"], "OFF")
    assert 0.05 < took_s < 5.0


def test_one_that_is_to_be_held_stays_held() -> None:
    """After it was made safe it waits for no host."""
    bench = Bench(HOLDS)
    found, _ = bench.made_safe(unchanged, 0.1)
    assert (found, bench.said, bench.state) == ((), ["MAKE_SAFE"], "HOLDING")


def test_one_that_cannot_be_seen_is_left_to_its_watchdog() -> None:
    bench = Bench(RIG)
    code = next(c for c, name in RIG.choices("state").items() if name == "MOVING")
    found, took_s = bench.made_safe(Telemetry(RIG, {"state": code}, lost=("CommandReply",)))
    assert {*bench.said} <= {"MAKE_SAFE", "LET_GO", "DISABLE"}
    assert bench.said[0] == "MAKE_SAFE"
    assert not bench.base.renewing
    assert bench.state in ("OFF", "FAULT")
    assert "cannot be made safe" in found[-1].text
    assert took_s < 3 * END_S


def test_one_that_is_off_is_told_nothing() -> None:
    bench = Bench(RIG)
    stage(bench).let_go()
    stage(bench).disable()
    found, _ = bench.made_safe(unchanged, 0.1)
    assert (found, bench.said, bench.state) == ((), [], "OFF")


def test_a_turn_is_not_cut_short_by_a_set_point_that_has_yet_to_begin() -> None:
    """The state of before the write says HOLDING."""
    bench = Bench(RIG)
    stage(bench).move({"angle": 2 * math.pi})
    assert bench.controller.reading("angle") == pytest.approx(2 * math.pi, abs=0.02)


def test_axes_that_were_let_go_unasked_end_the_run() -> None:
    bench = Bench(RIG)
    code = next(c for c, name in RIG.choices("state").items() if name == "READY")
    bench.link.change = Telemetry(RIG, {"state": code}, frozen=(), stuck=False)
    with pytest.raises(StateContradicts, match="though it held the axes and nobody asked it to let them go"):
        bench.controller.clock.sleep(0.5)
