"""The coil map: the winding and the bowl by hand, whole runs of the drawn machine, what is planted in its wiring."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.clock import Clock
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile, load_rig
from bench.rigfile.check_capabilities import problems_of
from bench.uncertainty import interval
from procedures.coil_map import decode, moving, winding
from procedures.coil_map.bowl import Bowl, fitted, rest_of
from procedures.coil_map.estimates import asked
from procedures.coil_map.plan import Plan
from procedures.coil_map.procedure import check, procedure
from procedures.coil_map.steps import ability, pulse_of, pulses
from reports.figures import draw as draw_figure
from sim_backend.machines.lira.plant import coils as of_machine

CAN = ability(load_rig("lira"))
AROUND = 2 * np.pi * np.arange(32) / 32
CURRENTS = 4.5 * np.column_stack([np.cos(AROUND), np.sin(AROUND)]).repeat(2, axis=0)
BESIDE = np.tile([2.0, -2.0], 32)
UP = np.array([0.3, -1.8])  # what acts at rest, A


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1) -> Simulated:
    return simulated_run("coil-map", "lira", seed, {"repeats": 2}, folder / "recording.mcap", truth)


def wrong(done: Simulated) -> dict[str, Finding]:
    return {r.code: r for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


def lying(s: np.ndarray, m: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Where a mover lies under the turned push, by the docstring's equation: 30 um, and 1 um of give at 4.5 A."""
    v = UP + CURRENTS @ s.T + np.outer(BESIDE, m)
    return np.array([3e-6, -2e-6]) + 30e-6 * v / np.linalg.norm(v, axis=1)[:, None] + 2e-7 * v


def bowl(s: np.ndarray, m: tuple[float, float] = (0.0, 0.0)) -> Bowl:
    return fitted(CURRENTS, BESIDE, lying(s, m))


def turn(degrees: float) -> np.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s], [s, c]])


def test_the_table_is_the_winding_of_the_machine() -> None:
    """i1 = aR + aB, i2 = bR - cB, ...: the rig file's phases against the machine's own winding, at any angle."""
    for phi in (0.0, 0.7, -2.1):
        for k, (name, way) in enumerate((n, w) for n in ("R1", "B1") for w in "dq"):
            dq = np.eye(4)[k]
            told = winding.of_way(CAN.systems[name], way, np.array([phi]))
            assert [float(x[0]) for x in told.values()] == pytest.approx(of_machine(dq, phi), abs=1e-12)


def test_a_coil_takes_its_share_away() -> None:
    """Reversed, one of six takes 2/3 of the push along its own axis; what torque current there is in it pushes along it."""
    system = CAN.systems["B1"]
    assert winding.taken_by(system, "i_s1", 0.0, -1.0) == pytest.approx(np.diag([1 / 3, 1.0]))
    assert winding.taken_by(system, "i_s1", 0.0, 1.0) == pytest.approx(np.eye(2))
    assert winding.beside(CAN, "B2") == "R2"
    assert winding.beside(CAN, "L") == ""


@pytest.mark.parametrize("angle", [0.0, 35.0, 180.0])
def test_a_bowl_tells_where_a_push_goes(angle: float) -> None:
    found = bowl(turn(angle))
    assert not found.mirrored
    assert abs((math.degrees(found.angle) - angle + 180) % 360 - 180) < 0.2
    assert found.roundness == pytest.approx(1.0, abs=0.01)
    assert found.g == pytest.approx(UP, abs=0.02)
    assert (found.c, found.rest) == (pytest.approx(30e-6, rel=0.02), pytest.approx(0.0, abs=2e-8))


def test_a_bowl_tells_a_mirror_and_a_push_beside() -> None:
    found = bowl(turn(-97.0) @ np.diag([1.0, -1.0]), (0.1, -0.2))
    assert found.mirrored
    assert math.degrees(found.angle) == pytest.approx(-97.0, abs=0.3)
    assert found.m == pytest.approx([0.1, -0.2], abs=0.005)


def test_a_push_that_is_known_leaves_nothing() -> None:
    s = winding.taken_by(CAN.systems["B1"], "i_s3", 0.4, -1.0)
    assert rest_of(CURRENTS @ s.T, lying(s)) < 1e-7
    assert rest_of(CURRENTS, lying(s)) > 2e-6


@pytest.mark.parametrize(
    ("rho", "pairs"),
    [
        (0, {("i_s2", "i_s6"), ("i_s3", "i_s5")}),
        (120, {("i_s1", "i_s3"), ("i_s4", "i_s6")}),
        (240, {("i_s1", "i_s5"), ("i_s2", "i_s4")}),
    ],
)
def test_exchanged_phases_are_named(rho: float, pairs: set[tuple[str, str]]) -> None:
    """By where the mirrored push stands at an electrical angle: alpha = rho - 2 phi."""
    phi = 1.1
    assert set(decode.exchanged_phases(CAN.systems["B1"], math.radians(rho + 7) - 2 * phi, phi)) == pairs


def test_what_a_thrust_may_be() -> None:
    """At theta = 0 the first coil has no q, nothing shows it; all three reversed are like the others exchanged."""
    system = CAN.systems["L"]
    backwards = decode.thrust(system, 0.0, -1.0, 0.0)
    assert backwards == ["every coil of it connected the other way round", "the cables of i_s14 and i_s15 exchanged"]
    assert decode.thrust(system, -1.0, 0.0, 0.0) == ["coil i_s14 connected the other way round"]


def test_what_should_move() -> None:
    rows = [("R1", "d"), ("R1", "q"), ("B2", "d"), ("B2", "q"), ("L", "q")]
    assert CAN.axes == ("gamma", "x1", "y1", "x2", "y2", "z")
    assert asked(CAN, rows).argmax(axis=1).tolist() == [0, 0, 3, 4, 5]
    assert asked(CAN, rows).sum(axis=1).tolist() == [0, 1, 1, 1, 1]


def test_nothing_pushes_aside_before_all_else_was_seen() -> None:
    given = [CAN.systems[name].gives for name, _, _, _ in pulses(CAN, Plan(repeats=2))]
    assert given.index("radial force") == len(given) - given.count("radial force")


def test_a_sound_machine(tmp_path: Path) -> None:
    done = run(tmp_path)
    truth = truth_of_motion(done)
    assert wrong(done) == {}
    measured = {f"share@{m.where}": m.estimate for m in done.results if isinstance(m, Measured)}
    assert measured.keys() == truth.keys()
    assert len(truth) == 15
    for name, estimate in measured.items():
        span = interval(estimate)
        assert abs(estimate.value - truth[name]) <= 1.3 * (span.high - span.low) / 2, name
    assert len(set(truth.values())) == 15
    figures = list(procedure.drawn(done.recording))
    assert [f.key for f in figures] == ["currents", "moves", "around-B1", "around-B2", "pushes"]
    for figure in figures[:4]:
        assert draw_figure(figure)  # type: ignore[arg-type]
    names = done.recording.rig.choices("state")
    states = {names[int(x)] for x in done.recording.channel("state")["state"]}
    assert states <= {"OFF", "IDLE", "CURRENT"}  # nothing is lifted


@pytest.mark.parametrize(
    ("truth", "seed", "code", "says"),
    [
        ({"exchange_phases": 1}, 1, "phases-exchanged", "i_s2 and i_s6, i_s3 and i_s5"),
        ({"exchange_actuators": 1}, 1, "actuators-exchanged", "i_s1 to i_s6 and i_s7 to i_s12"),
        ({"coil_reversed": 3}, 2, "coil-reversed", "coil i_s3"),
        ({"coil_reversed": 14}, 1, "moves-wrongly", "coil i_s14 connected the other way"),
        ({"weak_coil": 4, "weak_coil_gives": 0.5}, 0, "coil-weak", "coil i_s4 gives some 50%"),
        ({"actuator_reversed": 1}, 0, "system-reversed", "i_s1 to i_s6"),
        ({"actuator_reversed": 3}, 1, "moves-wrongly", "every coil of it"),
        ({"coil_dead": 5}, 2, "coil-dead", "coil i_s5"),
        ({"cables_exchanged": 203}, 1, "stars-do-not-close", "i_s2 and i_s3"),
        ({"cables_exchanged": 209}, 3, "stars-do-not-close", "i_s2 and i_s9"),
        ({"i_s5.gain": 0.8}, 0, "current-sensors-disagree", "rather i_s5"),
    ],
)
def test_wrong_wiring_is_named(tmp_path: Path, truth: dict[str, float], seed: int, code: str, says: str) -> None:
    found = wrong(run(tmp_path, truth, seed))
    assert code in found
    assert says in found[code].text


def test_after_a_run_the_controller_is_as_it_was(tmp_path: Path) -> None:
    """Position loops have their limits again, and it is off."""
    done = run(tmp_path, {"actuator_reversed": 2})
    last = {e["name"]: e["value"] for e in done.recording.events("parameter")}
    told = done.recording.rig.parameters
    assert {n: last[n] for n in ("sat.r", "sat.z", "fcogg", "tcogg")} == {
        n: told[n].default for n in ("sat.r", "sat.z", "fcogg", "tcogg")}  # fmt: skip
    assert all(last[f"step_{way}_{name}"] == 0 for way in "dq" for name in CAN.systems)


def test_plans_that_cannot_work_are_refused() -> None:
    rig = load_rig("lira")

    def said(**plan: Any) -> str:
        return "; ".join(check(rig, Plan(**plan)))

    assert said() == ""
    assert "half of hold_s" in said(rest_s=9e-3)


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        ('read_d = "i_d_R2"', 'read_d = "i_d_R3"', "systems.R2", "a channel of [capture]"),
        ('axes = ["x2", "y2"]', 'axes = ["x2"]', "systems.B2.axes", "2 of a radial force"),
        ('zero = "zero.la"\ncoils', 'zero = "zero.lb"\ncoils', "systems.L.zero", "a parameter of this file"),
        ('q = "step_q_B2"', 'q = "step_q_B1"', "systems.B2", "a parameter of its own"),
        ('d = "step_d_L"\nq', 'd = "ref_z"\nq', "systems.L", "a parameter in A"),
        ('"i_s12"], ["i_s13"', '"i_s12"], ["i_s16"', "stars", "a coil of a system"),
        ("still = { z =", "still = { zz =", "still", "an axis of a system"),
        ('i_s15 = "i_f15" }', 'i_s15 = "u_s15" }', "bridges", "a channel in A"),
    ],
)
def test_a_table_that_leads_nowhere_is_told(old: str, new: str, key: str, expected: str) -> None:
    toml, dbc = (Path(f"rigs/lira.{kind}").read_text("utf-8") for kind in ("toml", "dbc"))
    assert toml.count(old) == 1
    found = [str(p) for p in problems_of(RigFile.parse(toml.replace(old, new), dbc))]
    assert any(f"capabilities.coil_map.{key}" in line and expected in line for line in found), found


class Late:
    """The clock of a host that comes 40 ms late out of every sleep."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def now_ns(self) -> int:
        return self._clock.now_ns()

    def sleep(self, seconds: float) -> None:
        self._clock.sleep(seconds + 0.04)


def test_a_host_that_is_late_moves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The controller ends each pulse; those that miss their capture are taken again."""

    def late(rig: Rig, plan: Plan, record: Recorder) -> None:
        moving.moved(replace(rig, clock=Late(rig.clock)), plan, record)

    monkeypatch.setattr("procedures.coil_map.procedure.procedure", replace(procedure, acquire=late))
    done = run(tmp_path, {"reduced": 1.0})
    assert wrong(done).keys() == {"current-sensors-disagree"}  # the reduced machine has no half-bridges
    taken = {(s.labels["number"], s.labels["attempt"]) for s in done.recording.steps("pulse")}
    assert {attempt for number, attempt in taken if number == 0} == {0, 1}
    assert {attempt for number, attempt in taken if number > 0} == {0}


def test_a_pulse_is_as_long_as_it_was_meant() -> None:
    """One that is held on moves the mover on: by the capture's clock it is over; one that its capture cuts is none."""
    rig, plan, rate = load_rig("lira"), Plan(), 35_000.0
    labels = {"system": "R1", "way": "q", "size_A": 1.4, "repeat": 1}

    def shown(seconds: float, held_s: float) -> float | None:
        t = np.arange(round(seconds * rate)) / rate
        on, system = (t >= 5e-3) & (t < 5e-3 + held_s), CAN.systems["R1"]
        x = {c: on * 1.4 * winding.of_way(system, "q", np.zeros(1))[c][0] for c in system.coils}
        x |= {system.read_d: 0 * t, system.read_q: 1.4 * on, **dict.fromkeys(CAN.axes, 0 * t)}
        x["gamma"] = np.cumsum(on) / rate  # 1 rad/s for as long as it is pushed
        one = pulse_of(rig, plan, labels, x, rate)
        return None if one is None else one.moved["gamma"]

    assert shown(0.1, plan.hold_s) == pytest.approx(plan.hold_s - 1e-3, abs=1e-4)
    assert shown(0.1, 0.08) == pytest.approx(plan.hold_s - 1e-3, abs=1e-4)
    assert shown(0.1, 0.01) is None
    assert shown(0.015, 0.08) is None
