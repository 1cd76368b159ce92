"""Margins of the gate and of the catch: bare numbers, the machine's own catch, the whole path, what is planted."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import RigFile, load_rig
from bench.rigfile.check_capabilities import problems_of
from bench.uncertainty import Estimate, Influence, interval
from procedures.gate_margin import checks, estimates, fit
from procedures.gate_margin.estimates import Looked, Results, stiffness
from procedures.gate_margin.place import Place, grid, planes
from procedures.gate_margin.plan import Plan
from procedures.gate_margin.procedure import check, needs, procedure
from procedures.gate_margin.steps import Taken, Trial
from reports.figures import draw as draw_figure
from sim_backend.machines.lira.params import ControlParams, PlantParams
from sim_backend.machines.lira.plant import TRACE, Plant, ideal
from sim_backend.machines.lira.truth_gate import largest

STEP_S = 1 / 35e3
WINDOW = 8750
LIRA = load_rig("lira")
SHORT: dict[str, Any] = {"places_m": (8e-3,), "angles_rad": (-1.5, 1.5)}
GATE = (20e-6, 0.25)


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1, **plan: Any) -> Simulated:
    folder.mkdir(exist_ok=True)
    return simulated_run(
        "gate-margin",
        "lira",
        seed,
        {**SHORT, **plan},
        folder / "recording.mcap",
        {"reduced": 1.0, **(truth or {})},
    )


def strong(done: Simulated) -> set[str]:
    return {r.code for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


def test_the_largest_of_normal_noise() -> None:
    """4.3 standard deviations of four probes in 250 ms; beside many draws; a mean adds nearly all of itself."""
    s = np.full(4, 1.0)
    assert fit.normal_largest(np.zeros(4), s, WINDOW) == pytest.approx(4.306, abs=0.005)
    rng = np.random.default_rng(1)
    drawn = np.mean([np.abs(rng.normal(0, 1, 4 * 1000)).max() for _ in range(2000)])
    assert fit.normal_largest(np.zeros(4), s, 1000) == pytest.approx(drawn, abs=0.03)
    beside = fit.normal_largest(np.array([5.0, 0, 0, 0]), s, WINDOW)
    assert beside == pytest.approx(5 + fit.normal_largest(np.zeros(1), s[:1], WINDOW // 2), abs=0.03)


def test_the_truth_of_a_largest_reading_is_that_of_many_windows() -> None:
    """With rounding, by the Poisson of what is beyond each count."""
    p = PlantParams()
    rng = np.random.default_rng(2)
    reads = np.round(rng.normal(0, p.position_noise[0], (400, 4 * WINDOW)) / p.position_lsb[0]) * p.position_lsb[0]
    drawn = np.abs(reads).max(axis=1)
    expected = largest(p, np.zeros((70, 4)), np.zeros(4), WINDOW)
    assert expected == pytest.approx(drawn.mean(), abs=4 * drawn.std() / 20)


@pytest.mark.parametrize("hz", [5.0, 150.0, 900.0])
def test_how_far_a_shaft_goes(hz: float) -> None:
    """|x| + |v|/lambda of a sine is A sqrt(1 + (w/lambda)^2) at most; of a slow one the reading tells it, of a fast one the
    current that drives it, under noise."""
    pole, per_ampere, size = 748.0, 5.5, 1e-6
    w, t = 2 * math.pi * hz, np.arange(4 * WINDOW) * STEP_S
    x = size * np.sin(w * t)
    current = -(w**2 + pole**2) * x / per_ampere  # x'' = lambda^2 x + k i
    noise = np.random.default_rng(3).normal(0, 0.3e-6, x.size)
    found = fit.excursions(x + noise, current, WINDOW, STEP_S, 6e-4, pole, per_ampere)
    assert found.mean() == pytest.approx(
        size * math.hypot(1, w / pole), abs=0.45e-6
    )  # noise that is left adds to a largest


def released(way: str, start: float, reduced: bool) -> bool:
    """Whether the nominal machine catches itself from rest."""
    control = ControlParams(observer=2.0, watchdog_s=10.0, lost_m=1.0)
    plant = Plant(ideal(PlantParams()), 1, control=control, reduced=reduced)
    for name in ("idle", "on"):
        plant.command(name)
    plant.run(0.05)
    plant.command("lift")
    for _ in range(60):
        if plant.state == "LEVITATED":
            break
        plant.beat()
        plant.run(0.05)
    plant.run(0.2)
    plant._s.fresh = 1  # the observers begin where it stands
    plant.put(**{way: start, f"{way}_rate": 0.0})
    rows = plant.run(0.06)
    return bool(abs(rows[-1, TRACE.index(f"true_{way}1")]) < 20e-6)


@pytest.mark.parametrize("reduced", [False, True])
def test_a_release_from_rest_is_caught_nearly_as_far_as_the_force_holds(reduced: bool) -> None:
    """Between 56 and 70 um in x; 26.2 N hold 69.9 um of 375 N/mm, and the loop's answer takes time."""
    limit = 26.2 / 375e3
    assert limit == pytest.approx(69.9e-6, abs=0.05e-6)
    assert released("x", 56e-6, reduced)
    assert released("x", 62e-6, reduced)
    assert not released("x", limit, reduced)


def test_margins_are_those_of_the_machine(tmp_path: Path) -> None:
    done = run(tmp_path)
    truth = truth_of_motion(done)
    told = {f"{r.quantity.name}@{r.where}": r.estimate for r in done.results if isinstance(r, Measured)}
    assert set(told) == set(truth) == {"gate_margin@8 mm, -85.94°", "gate_margin@8 mm, 85.94°",
                                       *(f"catch_margin@{p}" for p in ("x1", "x2", "y1", "y2"))}  # fmt: skip
    for name, estimate in told.items():
        assert abs(estimate.value - truth[name]) < 1.5 * interval(estimate).U, name
    assert 18e-6 < told["gate_margin@8 mm, 85.94°"].value < 19e-6  # 4.3 of 0.32 um below 20 um
    assert not strong(done)
    assert [f.key for f in done.procedure.figures(done.procedure.evaluated(done.recording).result, done.recording)] == [
        "gate", "readings", "catch"]  # fmt: skip
    for figure in done.procedure.figures(done.procedure.evaluated(done.recording).result, done.recording):
        assert draw_figure(figure)


@pytest.mark.parametrize(
    ("truth", "code", "where"),
    [({"gate_channels": 3.0}, "gate-unwatched", "y1"), ({"gate_lag_s": 0.05}, "gate-filtered", "y2")],
)
def test_a_gate_that_does_not_watch_every_reading_as_it_is(
    tmp_path: Path, truth: dict[str, float], code: str, where: str
) -> None:
    done = run(tmp_path, truth)
    (found,) = [r for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE]
    assert (found.code, found.where, found.concerns) == (code, where, ("gate_margin",))
    assert not strong(
        run(tmp_path / "untried", truth, trial=False)
    )  # nothing else shows it, and a note says that it was not tried


def test_a_probe_whose_zero_is_off_takes_from_the_catch_and_not_from_the_gate(tmp_path: Path) -> None:
    """Integrators bring its reading to zero wherever the shaft is; the current tells how far the magnets' middle is."""
    truth = {"x1.offset": 20e-6, "magnet_centre_x1": 0.0, "magnet_runout_1": 0.0, "target_runout": 0.0}
    found = {}
    for name, more in (("off", truth), ("sound", {**truth, "x1.offset": 0.0})):
        done = run(tmp_path / name, more)
        found[name] = {
            f"{r.quantity.name}@{r.where}": r.estimate.value for r in done.results if isinstance(r, Measured)
        }
    gone = {k: found["sound"][k] - found["off"][k] for k in found["off"]}
    assert gone["catch_margin@x1"] == pytest.approx(20e-6, abs=2.5e-6)
    assert gone["gate_margin@8 mm, 85.94°"] == pytest.approx(0, abs=0.2e-6)


def taken(place: Place, readings: np.ndarray, **of: Any) -> Taken:
    currents = {p.current: np.full(len(readings), 1.0) for p in planes(LIRA)}
    base = Taken(place, STEP_S, readings, currents, 1e-6, 0.0, ("LEVITATED",), 0, 1000)
    return replace(base, **of)


def noisy(seed: int, size: float = 0.3e-6) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, size, (10 * WINDOW, 4))


def test_the_catch_by_hand() -> None:
    """x at rest with 1 A: (26.2/3.7 - 1) 3.7/375e3; y carries 1.34 kg/2 by 1.776 A, of which 1 A says that it hangs high."""
    plan = Plan(places_m=(8e-3,), angles_rad=(0.0,))
    some = [taken(grid(plan)[0], noisy(1))]
    found = estimates.results(some, GATE, LIRA, plan, None)
    by = {c.plane.probe: c.reach[0] for c in found.caught}
    assert by["x1"] == by["x2"] == pytest.approx((26.2 - 3.7) / 375e3, rel=1e-9)
    weight = 1.34 / 2 * 9.81175 / 3.7
    assert by["y1"] == pytest.approx(3.7 * (26.2 / 3.7 - abs(1 - weight)) / 375e3, rel=1e-9)
    u = found.estimates["catch_margin", "x1"].u / by["x1"]
    assert u == pytest.approx(math.hypot(0.11 / 3.7, 22 / 375) / math.sqrt(3), rel=0.05)


def test_a_measured_pole_makes_the_stiffness_of_a_plane_better_known() -> None:
    """K_1 = (lambda^2 m + K_1' - K_2')/2: of two planes as stated nothing changes but the uncertainty, by 1/sqrt(2)."""
    pole = Estimate.of(748.13, Influence("pole", "pole", 1.0, "1/s", "A", "normal", 20.0))
    plane = planes(LIRA)[0]
    stated, found = stiffness(plane, LIRA, None), stiffness(plane, LIRA, {"pole@x": pole})
    assert found.value == pytest.approx(stated.value, rel=1e-3)
    assert found.u / stated.u == pytest.approx(1 / math.sqrt(2), rel=0.05)
    assert [n.procedure for n in needs(Plan(pole="calibration"))] == ["unstable-pole"]
    assert needs(Plan()) == ()


def test_without_a_capture_there_is_a_bound_and_no_margin() -> None:
    plan = Plan(places_m=(8e-3,), angles_rad=(0.0,))
    lost = taken(grid(plan)[0], np.empty((0, 4)), step_s=0.0, telemetry=3e-6)
    (found,) = checks.of_signals([lost], GATE, LIRA, plan)
    assert (found.code, found.effect) == ("windows-not-captured", Effect.ERROR)
    assert "17.00 µm is a bound of the margin from above" in found.text
    (missing,) = checks.of_signals([], GATE, LIRA, plan)
    assert missing.code == "places-missing"


def test_windows_that_are_not_alike() -> None:
    plan = Plan(places_m=(8e-3,), angles_rad=(0.0, 1.0, 2.0))
    places, sound = grid(plan), [noisy(k) for k in range(3)]
    found = estimates.results([taken(p, x) for p, x in zip(places, sound, strict=True)], GATE, LIRA, plan, None)
    assert {f.code for f in checks.of_results(found, LIRA)} == {"largest-reading"}
    knocked = sound[1].copy()
    knocked[WINDOW : WINDOW + 20] += 8e-6  # once in ten windows
    mixed = [taken(p, x) for p, x in zip(places, (sound[0], knocked, sound[2]), strict=True)]
    found = estimates.results(mixed, GATE, LIRA, plan, None)
    codes = {f.code: f for f in checks.of_results(found, LIRA)}
    assert codes["windows-differ"].concerns == (f"gate_margin@{places[1].name}",)
    drifting = taken(places[0], noisy(1) + np.linspace(0, 3e-6, 10 * WINDOW)[:, None])
    rest = [taken(p, x) for p, x in zip(places[1:], sound[1:], strict=True)]
    (found_drift,) = checks.of_signals([drifting, *rest], GATE, LIRA, plan)
    assert found_drift.code == "unsettled"


def test_a_force_at_its_limit_has_nothing_to_spare() -> None:
    plan = Plan(places_m=(8e-3,), angles_rad=(0.0,))
    (found,) = checks.of_signals([taken(grid(plan)[0], noisy(1), limited=0.01)], GATE, LIRA, plan)
    assert (found.code, found.concerns) == ("force-limited", ("gate_margin", "catch_margin"))


def test_readings_that_stand_out_of_normal_noise_are_told() -> None:
    """A filter of the mean hides them, and the gate sees them."""
    p, readings = Place(8e-3, 0.0), noisy(1)
    readings[:: WINDOW // 2, 2] += 2.5e-6
    n = fit.normal_largest(readings.mean(axis=0), readings.std(axis=0), WINDOW)
    look = Looked(taken(p, readings), fit.largest(readings, WINDOW), n)
    codes = [f.code for f in checks.of_results(Results(*GATE, [look], [], {}), LIRA)]
    assert codes == ["noise-not-normal", "largest-reading"]


def test_trials_that_tell_nothing() -> None:
    plan, sound = Plan(), Trial("x1", False, 23e-6, 26e-6, ("LIFT",))
    every = [replace(sound, probe=p) for p in ("x1", "x2", "y1", "y2")]
    pulsed = replace(sound, probe="y2", pulsed=True, nearest=0.0)
    assert not list(checks.of_trials([*every, pulsed], 20e-6, LIRA, plan))
    (short,) = checks.of_trials([replace(every[0], nearest=19e-6), *every[1:], pulsed], 20e-6, LIRA, plan)
    assert (short.code, short.where) == ("gate-trial-short", "x1")
    (weak,) = checks.of_trials([*every, replace(pulsed, farthest=15e-6)], 20e-6, LIRA, plan)
    assert weak.code == "gate-trial-short"
    (untried,) = checks.of_trials([], 20e-6, LIRA, Plan(trial=False))
    assert (untried.code, untried.effect) == ("gate-not-tried", Effect.NOTE)


@pytest.mark.parametrize(
    ("plan", "said"),
    [({"observer": "none"}, "observer"), ({"trial_share": 3.0}, "trial_share"), ({"pulses": 2, "pulse_s": 0.2}, "pulses"),
     ({"angles_rad": (1.0, 1.0)}, "twice"), ({"windows": 2000}, "keeps"), ({"places_m": (0.5,)}, "ref_z")],
)  # fmt: skip
def test_a_plan_that_cannot_work_is_refused(plan: dict[str, Any], said: str) -> None:
    assert any(said in line for line in check(LIRA, Plan(**plan)))
    assert not list(check(LIRA, Plan()))


def test_without_forces_there_is_no_catch() -> None:
    bare = LIRA.model_copy(update={"capabilities": LIRA.capabilities.model_copy(update={"hold": None})})
    assert [q.name for q in procedure.untold(bare)] == ["catch_margin"]
    assert not procedure.untold(LIRA)
    assert not planes(bare)


def test_set_points_of_no_probe_are_refused() -> None:
    text = Path(str(LIRA.path)).read_text(encoding="utf-8")
    off = RigFile.parse(re.sub(r'radial = \{ x1 = "ref_x1"', 'radial = { q1 = "ref_x1"', text), LIRA.dbc_text)
    assert any("motion.radial.q1" in str(p) for p in problems_of(off))
