"""Responses of position loops through the whole path: nominal figures, truth, a linear model, planted troubles, refusals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_figures import figures_drawn
from scipy.linalg import expm

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.loop_response.fit import falls_at
from procedures.loop_response.injection import REFERENCE, SENSOR, amplitude
from procedures.loop_response.plan import Plan
from procedures.loop_response.procedure import check, procedure
from sim_backend.machines.lira import truth_loops
from sim_backend.motion import LoopsAsked
from sim_backend.truth import draw, nominal

MIDDLE = {"ref_z": 0.011}  # where both planes' levers are equal, as the rig file states it
QUICK: dict[str, Any] = {"parameters": MIDDLE, "lines": 6, "refined": 7, "refined_s": 0.4, "survey_s": 0.1}


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1, **plan: Any) -> Simulated:
    return simulated_run("loop-response", "lira", seed, {**QUICK, **plan}, folder / "recording.mcap", truth)


def values(done: Simulated) -> dict[str, Measured]:
    return {f"{r.quantity.name}@{r.where}": r for r in done.results if isinstance(r, Measured)}


def wrong(done: Simulated) -> dict[str, Finding]:
    return {r.code: r for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


def true_loops(
    truth: Mapping[str, float], axes: tuple[str, ...], sensitive: tuple[str, ...] = (), **settings: float
) -> Any:
    rig = load_rig("lira")
    drawn = draw(rig, 0, {**nominal(rig), **truth})
    known = {name: p.default for name, p in rig.parameters.items()} | settings
    seconds = {"x1": 0.6, "z": 0.4, "gamma": 2.5}
    asked = LoopsAsked(known, MIDDLE, {a: seconds[a] for a in axes}, sensitive, 5.0, 1500.0)
    return truth_loops.loops(rig, drawn, asked)


@pytest.mark.long
@pytest.mark.parametrize(
    ("observer", "bearing", "rotary", "linear", "s_max"),
    [(1.0, 623, 94, 148, 5.2), pytest.param(2.0, 900, 93, 144, None, marks=pytest.mark.longer)],
)
def test_the_nominal_machine(
    observer: float, bearing: float, rotary: float, linear: float, s_max: float | None
) -> None:
    """Sensors without lag, as these figures are. L prints 625, 137 and 93: with the last two in that order it fails."""
    sensitive = ("x1",) if s_max is not None else ()
    found = true_loops({"filter_delay": 0.0}, ("x1", "gamma", "z"), sensitive, observer=observer)
    assert found["bandwidth", "x1"] == pytest.approx(bearing, rel=0.02)
    assert found["bandwidth", "gamma"] == pytest.approx(rotary, rel=0.02)
    assert found["bandwidth", "z"] == pytest.approx(linear, rel=0.02)
    assert found["bandwidth", "gamma"] < found["bandwidth", "z"]
    if s_max is not None:
        assert found["s_max", "x1"] == pytest.approx(s_max, rel=0.02)


def linear_gain(hz: np.ndarray, inertia: float, law: tuple[float, float, float], l11: float, l22: float) -> np.ndarray:
    """|y/r| of one loop without stiffness: its PID, observer 1, a lag of second order and the mass, sampled at 35 kHz. States
    place, rate, current, its rate, observer's place and rate, integral, last reading: sixth order and two memories."""
    kp, ki, kd = law
    step, omega, damping = 1 / 35e3, truth_loops.PlantParams().lag_rate, truth_loops.PlantParams().lag_damping
    a = np.zeros((5, 5))
    a[0, 1], a[1, 2], a[2, 3] = 1, 1 / inertia, 1
    a[3] = [0, 0, -(omega**2), -2 * damping * omega, omega**2]
    held = expm(a * step)[:4]
    out = []
    z = np.exp(2j * np.pi * hz * step)
    # unknowns X = [p v f f' | sp sv | s | was | F]; one period: read y = p; observe; F; then the plant runs
    for turn, at in zip(z, hz, strict=True):
        rate = 2j * np.pi * at
        m, b = np.zeros((9, 9), complex), np.zeros(9, complex)
        m[:4, :4] = turn * np.eye(4) - held[:, :4]
        m[:4, 8] = -held[:, 4]
        # sp = (1-l11)(sp- + T sv-) + l11 y, with sp- = sp/turn; sv = (1-l22)(sv- + T F-/M) + l22 (y - was)/T
        m[4, 4], m[4, 5], m[4, 0] = 1 - (1 - l11) / turn, -(1 - l11) * step / turn, -l11
        m[5, 5], m[5, 8] = 1 - (1 - l22) / turn, -(1 - l22) * step / inertia / turn
        m[5, 0], m[5, 7] = -l22 / step, l22 / step
        m[6, 6], m[6, 0], b[6] = turn - 1, ki * step, ki * step
        m[7, 7], m[7, 0] = turn, -1
        m[8, 8], m[8, 0], m[8, 6], m[8, 5], b[8] = 1, kp, -1, kd, kp + kd * rate
        out.append(abs(np.linalg.solve(m, b)[0]))
    return np.array(out)


def test_a_linear_model_of_the_reduced_machine() -> None:
    """The truth of the experiment against a model that shares no code with it."""
    quiet = {"reduced": 1.0, "filter_delay": 0.0, "cogging_torque": 0.0, "cogging_force": 0.0}
    found = true_loops(quiet, ("gamma", "z"), fcogg=0.0, tcogg=0.0)
    gamma = falls_at(lambda f: linear_gain(f, 1.45e-3, (25.0, 99.0, 0.8), 1.0, 0.005), 60, 150)
    along = falls_at(lambda f: linear_gain(f, 1.34, (125e3, 5862e3, 1000.0), 0.02, 0.09), 90, 250)
    assert found["bandwidth", "gamma"] == pytest.approx(gamma, rel=1e-3)
    assert found["bandwidth", "z"] == pytest.approx(along, rel=1e-3)


def test_two_planes_hold_one_shaft() -> None:
    """With J_t = m l^2 and equal levers the planes are two masses of m/2; with the rig file's inertia one plane's loop is that
    of the mean and of the tilt together, 6 % slower: both are 623 and 662 Hz of the full machine."""
    alone = true_loops({"reduced": 1.0, "filter_delay": 0.0, "machine.transverse_inertia": 1.34 * 0.045**2}, ("x1",))
    both = true_loops({"reduced": 1.0, "filter_delay": 0.0}, ("x1",))
    assert alone["bandwidth", "x1"] / both["bandwidth", "x1"] == pytest.approx(662 / 623, rel=0.015)


def test_the_truth_is_of_the_gains_that_the_firmware_has() -> None:
    """0.3 of the integral gain that it was told is the loop of one that was told 0.3 of it."""
    told = load_rig("lira").parameters["ki.b"].default
    planted = true_loops({"reduced": 1.0, "factor_ki_b": 0.3}, ("x1",))
    assert planted == true_loops({"reduced": 1.0}, ("x1",), **{"ki.b": 0.3 * told})
    assert planted != true_loops({"reduced": 1.0}, ("x1",))


@pytest.mark.long
@pytest.mark.longer
def test_the_reduced_model_is_faster() -> None:
    """Its currents lag more: its bandwidths are not the machine's, and campaigns of them use the full one."""
    axes = ("x1", "gamma", "z")
    full, reduced = true_loops({}, axes), true_loops({"reduced": 1.0}, axes)
    shares = [reduced["bandwidth", a] / full["bandwidth", a] for a in axes]
    assert shares == pytest.approx([1.069, 1.0155, 1.027], abs=0.01)


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_drawn_machine_is_within_its_intervals(tmp_path: Path) -> None:
    done = run(tmp_path, axes=("x1", "z"), refined=9)
    assert wrong(done) == {}
    found, true = values(done), truth_of_motion(done)
    assert set(found) == {
        *(f"{n}@{a}" for n in ("bandwidth", "bandwidth_ideal") for a in ("x1", "z")),
        "s_max@x1",
        "s_max_hz@x1",
    }
    for name, m in found.items():
        i = interval(m.estimate)
        half = (i.high - i.low) / 2
        assert abs(m.estimate.value - true[name]) < 2 * half, name
        assert half < 0.03 * m.estimate.value, name
    assert figures_drawn(done)


def test_a_loop_at_its_limit_is_told(tmp_path: Path) -> None:
    done = run(tmp_path, {"reduced": 1.0}, axes=("z",), amplitude={"z": 4e-4}, lines=4)
    assert wrong(done)["loop-limited"].concerns == ("bandwidth@z",)
    true = truth_of_motion(done)["bandwidth@z"]
    assert values(done)["bandwidth@z"].estimate.value < 0.98 * true


def test_a_loop_that_is_not_shown_is_told(tmp_path: Path) -> None:
    done = run(tmp_path, {"reduced": 1.0}, axes=("gamma",), amplitude={"gamma": 1e-7}, lines=4)
    assert {"loop-not-shown", "no-crossing"} & set(wrong(done))


def test_amplitudes_keep_below_the_limit() -> None:
    rig = load_rig("lira")
    for axis, limit, kd in (("x1", 26.2, 2550), ("z", 166, 1000), ("gamma", 0.839, 0.8)):
        for hz in (5.0, 90.0, 620.0, 1500.0):
            size = amplitude(rig, Plan(), axis, REFERENCE, hz)
            assert kd * 2 * np.pi * hz * size < 0.36 * limit
            assert amplitude(rig, Plan(), axis, SENSOR, hz) < size * 1.0001
    assert amplitude(rig, Plan(), "x1", REFERENCE, 5.0) == pytest.approx(16 * 0.25e-6)


def test_refusals() -> None:
    rig = load_rig("lira")
    assert procedure.lacking(rig) == ()
    assert list(check(rig, Plan())) == []
    assert "found x9" in next(iter(check(rig, Plan(axes=("x9",)))))
    assert "refined: found 5 lines; expected 6 or more" in next(iter(check(rig, Plan(axes=("x1",), refined=5))))
    assert list(check(rig, Plan(axes=("z",), refined=5))) == []
    assert "ref_w" in next(iter(check(rig, Plan(parameters={"ref_w": 1.0}))))
    assert "high_hz" in next(iter(check(rig, Plan(high_hz=12e3))))
    assert "inject_amplitude" in next(iter(check(rig, Plan(axes=("z",), amplitude={"z": 1e3}))))
    bare = rig.model_copy(update={"capabilities": rig.capabilities.model_copy(update={"loop_injection": None})})
    assert procedure.lacking(bare) == ("capabilities: found no loop_injection",)


def test_not_levitated(tmp_path: Path) -> None:
    from procedures.loop_response.checks import of_signals
    from procedures.loop_response.fit import Line
    from procedures.loop_response.steps import Taken

    rig, line = load_rig("lira"), Line(0.7, 0.001, 40.0, 1.0, 1e-6, 1e-7)
    sound = Taken("x1", REFERENCE, "refined", 600.0, 1e-6, 100, line, 1e-6, 0.0, ("LEVITATED",), 0, 100)
    codes = lambda *t: [f.code for f in of_signals(t, rig, Plan())]  # noqa: E731
    assert codes(sound) == []
    assert codes(sound, replace(sound, states=("LEVITATED", "LANDING"))) == ["not-levitated"]
    assert codes() == ["no-sines"]
    assert codes(replace(sound, line=None)) == ["sine-not-captured"]
    assert codes(replace(sound, line=replace(line, wave=0.5))) == ["sine-wrong"]
    assert codes(replace(sound, line=replace(line, u=0.1))) == ["loop-not-shown"]
    assert codes(replace(sound, limited=0.1)) == ["loop-limited"]
