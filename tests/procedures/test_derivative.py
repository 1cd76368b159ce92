"""The response of an algebraic derivative through the whole path: bands, sidebands, a constant, noise; plants."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.signal import butter, lfilter

from bench.cli.motion_truth import truth_of_motion
from bench.cli.unfit import unfit
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import coverage_factor
from procedures.derivative import fit
from procedures.derivative.plan import Plan
from procedures.derivative.procedure import BY_LINE, MEASURES, WHOLE, check, procedure, step_count
from procedures.one_axis.bank import LITERAL, aligned, bank, literal
from reports.figures import draw as draw_figure

Array = npt.NDArray[np.float64]
QUICK = {"lines_hz": (7.3, 16.3, 53.3, 90.7), "record_s": 2.0, "periods": 12}
TABLE = [  # degree, spacing in ms, band by Euler, upper edge exact, noise gain, false derivative by Euler
    (5, 6, (15, 90), 99, 2474, 27.8), (6, 6, (3, 117), 127, 3785, 1.75), (6, 9, (0.5, 80), 84, 2468, 0.52),
    (7, 6, (25, 146), 154, 5428, 56.7), (7, 9, (13, 99), 103, 3512, 25.4), (7, 12, (8, 75), 77, 2594, 14.4),
    (7, 18, (4, 50), 51, 1703, 6.4), (8, 9, (4, 118), 121, 4772, 2.0), (8, 12, (1, 89), 90, 3509, 0.85),
    (9, 9, (18, 138), 139, 6272, None), (9, 12, (12, 104), 104, 4586, None),
]  # fmt: skip


def derived(folder: Path, seed: int = 1, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    return simulated_run("derivative", "amb1dof", seed, {**QUICK, **plan}, folder / "recording.mcap", truth)


def wrong(run: Simulated) -> dict[str, Finding]:
    return {r.code: r for r in run.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


@pytest.mark.parametrize(("degree", "ms", "band", "high", "noise", "false"), TABLE)
def test_bands_of_the_grid(
    degree: int, ms: int, band: tuple[float, float], high: float, noise: float, false: float
) -> None:
    """The grid behind T Fig. 4.2, to the whole Hz that it is read with: the lower edge is Euler's alone."""
    hz = np.concatenate([[0.1, 0.2, 0.5], np.arange(1.0, 201.0)])
    euler, exact = (bank(degree, 10 * ms, rule, 1e-4) for rule in ("euler", "exact"))
    inside, far = (hz[b.error(hz) < 0.293] for b in (euler, exact))
    assert (inside[0], inside[-1]) == band
    assert (far[0], far[-1]) == (0.1, high)
    assert euler.noise_gain == pytest.approx(noise, abs=1)
    assert false is None or euler.false_derivative == pytest.approx(false, rel=0.02)


def test_literal_equations_are_off_by_more_than_the_derivative() -> None:
    hz = np.array([10.0, 40.0, 80.0])
    right = bank(7, 120, "exact", 1e-4).error(hz)
    assert right == pytest.approx([0, 0.012, 0.334], abs=1e-3)
    for which, error in zip(LITERAL, ((13.17, 3.30, 1.50), (79.02, 19.75, 10.05)), strict=True):
        assert literal(7, 120, "exact", 1e-4, which).error(hz) == pytest.approx(error, abs=0.01)


def test_places_of_a_known_estimator() -> None:
    """A sine through weights, without noise: every response by its place, the gain and the error to rounding."""
    weights, hz = bank(6, 90, "euler", 1e-4), 23.7
    t = np.arange(20000) * 1e-4
    y = 1e-4 * np.sin(2 * np.pi * hz * t + 0.4)
    v = weights.applied(y, 17)
    found = fit.places(y[179:], v, hz, 40.0, 90, 1e-4, 4)
    own = weights.responses(np.array([hz]))[:, 0]
    assert found.gain == pytest.approx(np.full(4, own.mean()), abs=1e-9)
    assert found.error[0] == pytest.approx(float(weights.error(np.array([hz]))[0]), rel=1e-9)
    assert aligned(weights.rows, y[179 - 179 :], np.concatenate([np.zeros(179), v])) == pytest.approx(
        (17, 0.0), abs=1e-9
    )


def test_the_exciter_is_found_where_it_is() -> None:
    """Half a hertz beside a bin, and beside what the controller takes it for; the body that rings by its own noise is none."""
    rng, t = np.random.default_rng(4), np.arange(20000) * 1e-4
    noise = 1e-7 * rng.normal(size=20000)
    y = 3e-6 + 4e-7 * np.sin(2 * np.pi * 42.23 * t + 1) + noise
    assert fit.exciter_hz(y, 40.0, 1e-4) == pytest.approx(42.23, abs=0.01)
    k = np.arange(2000) * 1e-4
    body = 92500 / 300 * 1e-4 * np.exp(-50 * k) * np.sin(300 * k)  # poles -50 +- 300 i
    for none in (noise - np.convolve(noise, body)[:20000], np.zeros(20000), noise[:100]):
        assert fit.exciter_hz(none, 40.0, 1e-4) == 40.0


def test_an_exciter_that_turns_faster_is_no_noise(tmp_path: Path) -> None:
    """42 Hz instead of 40: what the compensation leaves of it was taken for noise, 60 U of it."""
    run = derived(tmp_path, 3, {"harmonic_rate": 84 * np.pi}, lines_hz=(16.3, 53.3))
    noise = next(m.estimate for m in run.results if isinstance(m, Measured) and m.quantity.name == "noise_gain")
    assert wrong(run) == {}
    assert abs(noise.value - truth_of_motion(run)["noise_gain"]) < coverage_factor(7) * noise.u
    assert coverage_factor(7) * noise.u < 50


def watched(position: Array, spacing: int = 120) -> tuple[Array, Array]:
    """Positions (n,) m from where the filters of degree 7 are full on, and their velocity."""
    rows = bank(7, spacing, "euler", 1e-4)
    first = 2 * spacing - 1
    return position[first:], rows.applied(position, first % spacing)


@pytest.mark.parametrize("low_pass_hz", [None, 3000.0, 1000.0])
def test_the_noise_gain_knows_no_colour(low_pass_hz: float | None) -> None:
    """Noise of a sensor with a low-pass, and a body that follows it (poles -50 +- 300 i): taken as white from the upper half
    of the spectrum, 3 kHz made it 17 % too great and 1 kHz 45 %, by U of 2 %."""
    rng, own = np.random.default_rng(6), bank(7, 120, "euler", 1e-4)
    off, k = [], np.arange(2000) * 1e-4
    body = 92500 / 300 * 1e-4 * np.exp(-50 * k) * np.sin(300 * k)
    for _ in range(6):
        noise = 1.3e-7 * rng.normal(size=40239)
        if low_pass_hz is not None:
            noise = np.asarray(lfilter(*butter(1, low_pass_hz, fs=1e4), noise))
        y, v = watched(noise - np.convolve(noise, body)[: len(noise)])
        each = fit.noise(y, v, 40.0, 120, 1e-4, 8, own.power)
        u = float(each.std(ddof=1)) / np.sqrt(8)
        assert u < 0.015 * own.noise_gain
        off.append((float(each.mean()) - own.noise_gain) / (coverage_factor(7) * u))
    assert max(map(abs, off)) < 1.6
    assert np.sqrt(np.mean(np.square(off))) < 0.75


def test_a_velocity_that_is_noisier_than_its_weights_has_more_noise_gain() -> None:
    """As much again, from elsewhere: root 2 of it."""
    rng, own = np.random.default_rng(7), bank(7, 120, "euler", 1e-4)
    y, v = watched(1.3e-7 * rng.normal(size=40239))
    more = 1.3e-7 * own.noise_gain * rng.normal(size=len(v))
    found = float(fit.noise(y, v + more, 40.0, 120, 1e-4, 8, own.power).mean())
    assert found == pytest.approx(np.sqrt(2) * own.noise_gain, rel=0.01)


def test_the_truth_is_recovered(tmp_path: Path) -> None:
    run = derived(tmp_path)
    truth = truth_of_motion(run)
    assert wrong(run) == {}
    measured = {
        f"{m.quantity.name}@{m.where}".removesuffix("@"): m.estimate for m in run.results if isinstance(m, Measured)
    }
    assert {name.partition("@")[0] for name in measured} == {q.name for q in MEASURES}
    assert measured.keys() == truth.keys()
    off = {name: (e.value - truth[name]) / (coverage_factor(7) * e.u) for name, e in measured.items()}
    assert max(map(abs, off.values())) < 1.4
    assert np.sqrt(np.mean(np.square([*off.values()]))) < 0.7
    assert measured["false_derivative"].value == pytest.approx(14.37, abs=0.1)
    assert truth["edge_high"] == pytest.approx(75.6, abs=0.1)
    figures = list(procedure.drawn(run.recording))
    assert [f.key for f in figures] == ["error", "gain", "sidebands"]
    for figure in figures:
        assert draw_figure(figure)


@pytest.mark.parametrize(
    ("truth", "code", "looks", "plan"),
    [
        ({"literal_sign": 1}, "not-this-estimator", "degree 7 with + in (4.11)", {}),
        ({"estimate_late": 1}, "not-this-estimator", "a sample late", {}),
        ({"filters_swapped": 1}, "not-this-estimator", "the wrong way round", {}),
        pytest.param({"factor_rule": 0}, "not-this-estimator", "rule euler", {"rule": "exact"}, marks=pytest.mark.long),
        pytest.param(
            {"literal_weights": 1}, "not-this-estimator", "degree 7 without the sign", {}, marks=pytest.mark.long
        ),
        pytest.param({"factor_window_s": 121 / 120}, "not-this-estimator", "12.1 ms", {}, marks=pytest.mark.long),
        pytest.param({"factor_degree": 8 / 7}, "not-this-estimator", "degree 8", {}, marks=pytest.mark.long),
        pytest.param(
            {"sample_factor": 1.0003}, "not-this-estimator", "Nor is it any other", {}, marks=pytest.mark.long
        ),
        pytest.param({"factor_watched": 0}, "not-this-estimator", "Nor is it any other", {}, marks=pytest.mark.long),
        ({"factor_inject_hz": 1.001}, "line-detuned", "another frequency", {}),
        ({"factor_inject_amplitude": 0}, "no-line", "at the injected line", {}),
        (
            {"harmonic_rate": 92 * np.pi},
            "line-not-clear",
            "at 46 Hz. lines_hz: found 47.5 Hz",
            {"lines_hz": (16.3, 47.5)},
        ),
        pytest.param({"factor_inject_hz": 1.1}, "no-line", "at the injected line", {}, marks=pytest.mark.long),
    ],
)
def test_planted_defects_do_not_pass(
    tmp_path: Path, truth: dict[str, float], code: str, looks: str, plan: dict[str, Any]
) -> None:
    run = derived(tmp_path, 2, truth, **{"lines_hz": (16.3, 53.3), "record_s": 1.5, **plan})
    assert code in wrong(run)
    assert looks in wrong(run)[code].text


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        ({"lines_hz": (41.6, 60.0)}, "half a multiple of 1/eps"),
        ({"lines_hz": (43.3, 60.0)}, "the harmonic or its image"),
        ({"lines_hz": (15.1, 60.0)}, "the harmonic and two lines"),
        ({"lines_hz": (16.0, 83.0)}, "a multiple of 1/eps"),
        ({"lines_hz": (38.0, 60.0)}, "the harmonic"),
        ({"lines_hz": (30.0, 15.0)}, "in order"),
        ({"window_s": 0.01205}, "whole ticks"),
        ({"lines_hz": (0.5, 60.0), "periods": 40}, "memory holds"),
        ({"lines_hz": (0.05, 60.0)}, "0.1 to 2000, the range of inject_hz"),
        ({"offset_m": 4e-4}, "offset_m: found 0.0004 m; expected -0.0001 to 0.0001, the range of ref"),
        ({"amplitude_A": 0.5}, "amplitude_A: found 0.5 A; expected 0 to 0.25, the range of inject_amplitude"),
        ({"amplitude_A": 0.3}, "amplitude_A: found 0.3 A; the envelope allows 0.25 A"),
    ],
)
def test_a_plan_that_cannot_work_is_told(plan: dict[str, Any], said: str) -> None:
    assert any(said in line for line in check(load_rig("amb1dof"), Plan(**plan)))


def test_an_estimator_out_of_range_is_told_before_anything_starts() -> None:
    said = [*unfit(procedure, load_rig("amb1dof"), Plan(degree=12))]
    assert len(said) == 1
    assert "degree: found 12" in said[0]


def test_no_title_names_what_the_plan_sets() -> None:
    assert not any(character.isdigit() for q in procedure.measures for character in q.title)


def test_the_default_plan_fits() -> None:
    assert [*check(load_rig("amb1dof"), Plan())] == []
    assert step_count(Plan()) == 11
    assert {q.name for q in (*BY_LINE, *WHOLE)} == {q.name for q in procedure.measures}
