"""Repeatability and accuracy after ISO 230-2: errors of the instrument in its figures, the whole path, what is planted."""

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
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.uncertainty import interval
from procedures.positioning import estimates, fit
from procedures.positioning.figures import all_figures
from procedures.positioning.fit import Errors, by_report, shrunk, spread
from procedures.positioning.procedure import procedure
from procedures.positioning.standard import FIGURES, figures
from reports.figures import draw as draw_figure
from tests.procedures.positioned import ALONG, RLSRM, UM, taken, times, true_deviations

SHORT: dict[str, Any] = {"axes": ("x",), "repeats": 2}
FINE = Errors(gain=3e-6, flat=True, scale=0.05 * UM, noise=0.03 * UM, wander=3e-10, step=0.01 * UM)


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1, **plan: Any) -> Simulated:
    folder.mkdir(exist_ok=True)
    return simulated_run("positioning", "rlsrm", seed, {**SHORT, **plan}, folder / "recording.mcap", truth or {})


def strong(done: Simulated) -> set[str]:
    return {r.code for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


# The instrument's own errors


def test_without_errors_nothing_is_added() -> None:
    y = true_deviations(np.random.default_rng(1), 5, 5)
    found = spread(y, ALONG.at, times(5, 5), Errors())
    assert np.abs(found.added).max() < 1e-15
    assert shrunk(y, Errors()) == pytest.approx(y, abs=1e-18)


def test_a_gain_stretches_what_means_span() -> None:
    """A gain of 1 + g reads g L too much over a length of L; B and R hardly know of it."""
    y = ALONG.at[None, :, None] * np.ones((2, 5, 5)) * 1e-4
    slope = dict(zip(FIGURES, spread(y, ALONG.at, times(5, 5), Errors(gain=1e-5, flat=True)).slope, strict=True))
    assert slope["E"] == pytest.approx(np.ptp(ALONG.at), rel=1e-6)
    assert slope["M"] == pytest.approx(np.ptp(ALONG.at), rel=1e-6)
    assert slope["B"] == pytest.approx(0, abs=1e-9)


def test_each_error_does_what_it_can() -> None:
    """A scale's error is none of R or B; noise of a mean falls with the approaches: sqrt(2/n) u in B, mean of m in B_mean."""
    y = true_deviations(np.random.default_rng(3), 5, 5)
    at = dict(zip(FIGURES, range(12), strict=True))
    alone = spread(y, ALONG.at, times(5, 5), replace(FINE, step=0.0)).alone
    assert alone["error"][at["R"]] < 1e-12
    assert alone["error"][at["B_mean"]] < 1e-12
    assert alone["error"][at["E"]] == pytest.approx(math.sqrt(2) * FINE.scale, rel=0.1)
    assert alone["readings"][at["B_mean"]] == pytest.approx(FINE.noise * math.sqrt(2 / 25), rel=0.05)
    assert alone["drift"][at["E"]] > 0


def test_noise_is_taken_out_of_spreads_once() -> None:
    """On the mean over many axes."""
    r = np.random.default_rng(4)
    before, after, back = [], [], []
    for _ in range(40):
        x = true_deviations(r, 8, 5)
        y = x + 0.3 * UM * r.standard_normal(x.shape)
        for into, some in ((before, x), (after, y), (back, shrunk(y, Errors(noise=0.3 * UM)))):
            into.append(some.var(axis=-1, ddof=1).mean())
    assert np.mean(after) == pytest.approx(2 * np.mean(before), rel=0.1)
    assert np.mean(back) == pytest.approx(np.mean(before), rel=0.1)


def test_intervals_hold_the_true_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """120 axes, twelve figures of each, within what 95 % are of so many."""
    monkeypatch.setattr(fit, "DRAWS", 4000)
    r, held = np.random.default_rng(5), np.zeros(12)
    for k in range(120):
        x = true_deviations(r, 5, 5)
        gain, wander = FINE.gain * r.uniform(-1.73, 1.73), FINE.wander * r.uniform(-1.73, 1.73)
        scale, noise = FINE.scale * r.standard_normal((5, 1)), FINE.noise * r.standard_normal(x.shape)
        y = x + gain * ALONG.at[None, :, None] + scale + noise + wander * times(5, 5)
        y = np.round(y / FINE.step) * FINE.step
        lies = figures(y) - spread(y, ALONG.at, times(5, 5), FINE, seed=k).added
        low, high = np.quantile(lies, [0.025, 0.975], axis=0)
        held += (low <= figures(x)) & (figures(x) <= high)
    assert (held / 120 >= 0.95 - 3.3 * math.sqrt(0.95 * 0.05 / 120)).all()


def test_the_report_sums_in_squares() -> None:
    """By hand: a scale's error alone is sqrt(2) of it between two places; noise alone sqrt(2/n) in B, sqrt(1/n) in M."""
    u = by_report(Errors(scale=1.0), 1.0, 0.0, 5)
    assert (u["E"], u["B"], u["R"]) == pytest.approx((2 * math.sqrt(2), 0.0, 0.0))
    u = by_report(Errors(noise=1.0), 1.0, 0.0, 5)
    assert u["B"] == pytest.approx(2 * math.sqrt(2 / 5))
    assert u["M"] == pytest.approx(2 * math.sqrt(1 / 5))
    assert u["R"] == pytest.approx(4.0)
    assert u["A"] == pytest.approx(math.hypot(u["E"], u["R"]))


def test_estimates_are_the_draws_with_the_certificates_as_influences() -> None:
    result = estimates.results([taken(true_deviations(np.random.default_rng(6), 5, 5))])[0]
    a = result.estimates["A"]
    assert a.value == pytest.approx(figures(result.deviations)[0])
    assert {i.id.rpartition("/")[2] for i in a.sensitivities} == {"gain", "error", "drift", "readings"}
    found = interval(a)
    assert found.method == "monte-carlo"
    assert found.low < a.value < found.high
    assert pytest.approx(2 * a.u, rel=0.25) == found.U


# The whole path


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Simulated:
    return run(tmp_path_factory.mktemp("positioning") / "sound", axes=(), repeats=2)


def test_the_truth_lies_in_the_intervals(done: Simulated) -> None:
    assert strong(done) == set()
    truth = truth_of_motion(done)
    found = {f"{r.quantity.name}@{r.where}": r.estimate for r in done.results if isinstance(r, Measured)}
    assert set(found) == set(truth)
    assert len(found) == 24
    for name, estimate in found.items():
        i = interval(estimate)
        assert i.low - 0.5 * i.U <= truth[name] <= i.high + 0.5 * i.U, name


def test_figures_can_be_drawn(done: Simulated) -> None:
    shown = list(procedure.figures(procedure.evaluated(done.recording).result, done.recording))
    assert [f.key for f in shown][:2] == ["deviations-x", "deviations-angle"]
    assert all(draw_figure(f).svg for f in shown if not hasattr(f, "rows"))
    assert list(all_figures([], RLSRM)) == []


@pytest.mark.parametrize(("planted", "size", "code"), [
    ("reference_sign", -1.0, "reference-disagrees"), ("reference_unit", 1000.0, "reference-disagrees"),
    ("reference_mistyped", 3.0, "readings-far"),
])  # fmt: skip
def test_what_is_planted_in_the_instrument(tmp_path: Path, planted: str, size: float, code: str) -> None:
    assert code in strong(run(tmp_path / "p", {planted: size}, repeats=3 if planted == "reference_mistyped" else 2))


def test_a_scale_that_is_off_is_in_E_and_M(tmp_path: Path) -> None:
    """1 % of a count is 1 % of the travel: the axis goes where its scale says."""
    done = run(tmp_path / "scale", {"encoders.x.pitch": 1.01e-6})
    found = {r.quantity.name: r.estimate for r in done.results if isinstance(r, Measured)}
    assert found["M"].value == pytest.approx(0.01 * np.ptp(ALONG.at), rel=0.1)
    truth = truth_of_motion(done)
    assert abs(found["M"].value - truth["M@x"]) < 3 * interval(found["M"]).U


def test_a_channel_can_be_the_reference(tmp_path: Path) -> None:
    """The set point stands in for one here: it repeats to what its signal can tell, finer than any certificate."""
    rigs = Path(__file__).resolve().parents[2] / "rigs"
    toml = (rigs / "rlsrm.toml").read_text(encoding="utf-8")
    changed = toml.replace(
        'instrument = "the laser interferometer"\nunit = "um"', 'instrument = "a scale"\nchannel = "x_ref"'
    )
    (tmp_path / "rlsrm.dbc").write_bytes((rigs / "rlsrm.dbc").read_bytes())
    (tmp_path / "rig.toml").write_text(changed, encoding="utf-8")
    plan = {"axes": ("x",), "repeats": 2}
    done = simulated_run("positioning", str(tmp_path / "rig.toml"), 1, plan, tmp_path / "recording.mcap")
    assert not done.recording.events("reference-read")
    found = {r.quantity.name: r.estimate.value for r in done.results if isinstance(r, Measured)}
    assert found["A"] < 1e-6
    assert strong(done) == {"reference-coarse"}
