"""What a stage's axes move: the bare model on made sines, the drawn machine's through the whole path, planted troubles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from drawn_figures import figures_drawn

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.stage import axes_of
from bench.uncertainty import interval
from procedures.axis_inertia import checks, estimates, fit
from procedures.axis_inertia.plan import Plan
from procedures.axis_inertia.procedure import check, procedure, untold
from procedures.axis_inertia.sequence import among_phases, chosen, known, order, part, step_count, tones
from procedures.axis_inertia.steps import Sine
from procedures.stages.map_bends import doubts, moves
from procedures.stages.spread import stands

Array = npt.NDArray[np.float64]
RIG = load_rig("rlsrm")
AXES = axes_of(RIG)
PLAN = Plan(repeats=4, delay_s=0.0)
MOVED = {"x": 3.35, "angle": 1.5e-3}
ADDED = {"x": 2.0, "angle": 1.2e-3}
RUBS = {"x": 1.5, "angle": 0.012}
NONE = np.zeros((len(doubts(RIG, 0.05)), 2))


def motion(inertia: float, coulomb: float, viscous: float, hz: float, amplitude: float) -> tuple[Array, Array, Array]:
    """Times, places and forces of a sine with friction, worked out without the fit, the force a bit more than the sine's."""
    t = np.arange(0, 2.6, 1e-3)
    w = 2 * math.pi * hz
    x = amplitude * (np.sin(w * t) + 0.03 * np.sin(3 * w * t + 0.5))
    v = amplitude * w * (np.cos(w * t) + 0.09 * np.cos(3 * w * t + 0.5))
    a = -amplitude * w**2 * (np.sin(w * t) + 0.27 * np.sin(3 * w * t + 0.5))
    return t, x, inertia * a + viscous * v + coulomb * np.sign(v) + 0.03


def test_friction_is_no_part_of_inertia() -> None:
    """Even where the speed turns elsewhere than its first harmonic does."""
    t, x, force = motion(3.35, 1.5, 4.0, 2.0, 6e-3)
    went, per, rubs = fit.operators(t, x, 2.0)
    assert went == pytest.approx(6e-3, rel=1e-6)
    assert per[0] @ force == pytest.approx(3.35, rel=1e-5)
    assert rubs[0] @ force == pytest.approx(1.5, rel=1e-4)
    w = 2 * math.pi * 2.0
    assert np.exp(-1j * w * t) @ force / (np.exp(-1j * w * t) @ x) / -(w**2) != pytest.approx(
        3.35, rel=0.01
    )  # by its first


def test_how_many_harmonics_rounding_leaves() -> None:
    """By hand: 0.8 rad by 2.51 mrad, 2667 samples: (30 * 1e-3 * 2667 * 318.3^2)^(1/5) = 24.08; 7 mm by 1 um would have 83."""
    assert fit.harmonics_of(2667, 0.8, 2.513e-3) == 24
    assert fit.harmonics_of(2778, 7e-3, 1e-6) == fit.MOST
    assert fit.harmonics_of(2778, 1e-3, 1e-3) == fit.FEWEST


def test_a_force_that_comes_late() -> None:
    """By hand: two milliseconds later is one that was given two milliseconds before."""
    t, x, _ = motion(3.35, 1.5, 4.0, 2.0, 6e-3)
    later = motion(3.35, 1.5, 4.0, 2.0, 6e-3)[2]
    given = np.roll(later, -2)[:-2]
    _, per, rubs = fit.operators(t[:-2], x[:-2], 2.0)
    assert per[1] @ given == pytest.approx(3.35, rel=2e-3)
    assert rubs[1] @ given == pytest.approx(1.5, rel=2e-3)


def rounded(hz: float, amplitude: float, inertia: float, offset: float) -> float:
    """What a sine of four periods that repeat tells of its inertia, read in counts of 2.5 mrad."""
    t, x, force = motion(inertia, 0.012, 2e-3, hz, amplitude)
    t, x, force = (values[: round(4 / hz * 1e3)] for values in (t, x, force))
    count = math.radians(0.144)
    _, per, _ = fit.operators(t, count * np.round(x / count + offset), hz, count)
    return float(per[0] @ force) / inertia - 1


def test_rounding_of_the_reading_makes_inertia_no_less() -> None:
    """Periods repeat, and so does their rounding. By least squares 20 offsets of the counts told 0.6 % less on average."""
    for inertia in (1.5e-3, 2.7e-3):
        told = [rounded(1.6, 0.88, inertia, offset) for offset in np.arange(20) / 20]
        assert np.mean(told) == pytest.approx(0.0, abs=5e-4)
        assert np.std(told) < 1e-3


def made(plan: Plan = PLAN, added: Mapping[str, float] = ADDED, rubs: float = 1.0, noise: float = 3e-4) -> list[Sine]:
    """Sines by a map whose newton is another at every place and sine."""
    rng, out = np.random.default_rng(2), []
    for on, axes in order(RIG, plan):
        for axis in axes:
            for k in range(plan.repeats):
                for tone in tones(axis, plan):
                    scale = 1.03 + 0.01 * k - 0.02 * tone.number
                    per = (MOVED[axis.name] + (added[axis.name] if on else 0.0)) / scale * (1 + noise * rng.normal())
                    friction = RUBS[axis.name] / scale * (rubs if on else 1.0)
                    out.append(Sine(axis.name, tone.number, tone.hz, tone.amplitude, k, on, 1.1, np.full(2, per),
                                    np.full(2, friction), NONE, 0.0, ("MOVING",), 0, 100))  # fmt: skip
    return out


def told(sines: list[Sine], plan: Plan = PLAN) -> dict[str, Finding]:
    found = list(checks.of_sines(sines, RIG, plan))
    if not any(f.effect is Effect.ERROR for f in found):
        r = estimates.results(sines, RIG, plan)
        found += checks.of_parts(r, plan)
        if not any(f.effect is Effect.ERROR for f in found):
            found += checks.of_result(r, plan)
    return {f.code: f for f in found}


def loud(found: Mapping[str, Finding]) -> set[str]:
    return {code for code, f in found.items() if f.effect is not Effect.NOTE}


def test_the_map_is_in_nothing() -> None:
    """By the map it would be some 4 % less."""
    e = estimates.results(made(), RIG, PLAN).estimates
    assert e["mass", "x"].value == pytest.approx(3.35, rel=2e-3)
    assert e["inertia", "angle"].value == pytest.approx(1.5e-3, rel=2e-3)
    assert e["inertia", "angle"].contributions["machine/ring_inertia"] == pytest.approx(1.5e-3 * 5e-4, rel=0.01)
    assert "by the map alone it would be 3.2" in told(made())["map-scale"].text or "map-scale" in told(made())


def test_what_findings_need() -> None:
    sound = made()
    assert loud(told(sound)) == set()
    assert loud(told([])) == {"sines-missing"}
    assert loud(told([replace(sound[0], states=("FAULT",)), *sound[1:]])) == {"axis-not-held"}
    assert loud(told([replace(sound[0], lost=5), *sound[1:]])) == {"missing-samples"}
    assert loud(told([replace(sound[0], limited=0.5), *sound[1:]])) == {"sine-not-followed"}
    assert loud(told([replace(sound[0], went=0.1), *sound[1:]])) == {"sine-not-followed"}
    assert loud(told(made(added={"x": 0.0, "angle": 0.0}))) == {"part-not-seen"}
    assert loud(told(made(rubs=1.5))) == {"friction-changed"}
    assert loud(told(sound, PLAN.model_copy(update={"max_u": 1e-7}))) == {"inertia-not-shown"}
    apart = [replace(s, per=s.per * 1.05) if s.part and s.tone else s for s in sound]
    assert loud(told(apart)) == {"sines-apart"}
    with pytest.raises(AnalysisError, match="1 sines are missing"):
        estimates.results(sound[1:], RIG, PLAN)


def test_what_goes_around_among_the_phases_is_no_scatter() -> None:
    """Eight places lie at eighths between two of twelve phases in a turn: 3 % that go around add nothing to the mean. Of noise
    its standard uncertainty is told, by five degrees of freedom."""
    at = np.array(among_phases(RIG, AXES["angle"], PLAN.model_copy(update={"repeats": 8})))
    assert sorted(np.round(at / (np.pi / 4)) % 8) == pytest.approx(range(8))
    noise = 1.5e-3 * 3e-3 * np.random.default_rng(5).normal(size=(4000, 8))
    around = 1.5e-3 * (1 + 0.03 * np.cos(at + 0.4))
    told = [fit.scatter(row, at) for row in noise + around]
    assert {dof for _, dof in told} == {5.0}
    assert np.mean([u**2 for u, _ in told]) == pytest.approx((1.5e-3 * 3e-3) ** 2 / 8, rel=0.05)
    assert (noise + around).mean() == pytest.approx(1.5e-3, rel=1e-4)
    plain = (float(noise[0].std(ddof=1)) / 8**0.5, 7.0)
    assert fit.scatter(noise[0], np.zeros(8)) == pytest.approx(plain)
    assert fit.scatter(noise[0][:5], np.zeros(5))[1] == 4
    assert not any(among_phases(RIG, AXES["x"], PLAN))


@pytest.mark.parametrize("repeats", range(4, 21))
def test_no_place_around_comes_again(repeats: int) -> None:
    """Nor does one a quarter of a turn on, or a twelfth; they lie evenly over each. Five of 15 twelfths stood alike."""
    at = np.array([stands(AXES["angle"], k, repeats, 0.0) for k in range(repeats)])
    for each in (1, 4, 12):
        assert len(set(np.round(each * at * 12 * repeats / (2 * math.pi)) % (12 * repeats))) == repeats
    assert np.sort(np.round(12 * at * repeats / (2 * math.pi)) % repeats) == pytest.approx(range(repeats))
    assert stands(AXES["angle"], 1, 8, 0.0) == 2 * math.pi * 1.25 / 8


def test_sines_with_a_part_ask_for_little_more_force() -> None:
    """By hand: (1.5 + 1.2) 0.8^2 is 1.73 for 1.5, (3.35 + 2) 0.8^2 is 3.42 for 3.35; as fast it would be 2.7 and 5.35."""
    for name, axis in AXES.items():
        for bare, on in zip(tones(axis, Plan()), tones(axis, Plan(), part(axis, Plan())), strict=True):
            assert 1 < (MOVED[name] + ADDED[name]) * on.hz**2 / (MOVED[name] * bare.hz**2) < 1.2
            assert (on.number, on.amplitude) == (bare.number, bare.amplitude)


def test_what_bends_the_map_by_hand() -> None:
    """One phase alone gives 1.56 N at 2 A: 2 F/i = 1.56 N less per ampere of its offset, and F i^2/(2 i_s^2) more per share."""
    i = {c: np.array([2.0 if c == "i_a1" else 0.0]) for c in ("i_a1", "i_b1", "i_c1", "i_a2", "i_b2", "i_c2")}
    rows = moves(RIG, i, np.array([1.56]))
    assert rows[0] == pytest.approx([-1.56])
    assert rows[1:6] == pytest.approx(np.zeros((5, 1)))
    assert rows[6] == pytest.approx([1.56 * 4 / (2 * 8.5**2)])
    assert [d.id for d in doubts(RIG, 0.05)][-1] == "map/saturation"


def test_refusals() -> None:
    assert procedure.lacking(RIG) == ()
    assert list(check(RIG, Plan())) == []
    assert "found y" in next(iter(check(RIG, Plan(axes=("y",)))))
    assert "x_amplitude" in next(iter(check(RIG, Plan(tones_m=((0.0136, 1.8), (1e-3, 4.0))))))
    bare = RIG.model_copy(update={"machine": {k: v for k, v in RIG.machine.items() if k != "added_mass"}})
    assert "found no added_mass" in next(iter(check(bare, Plan())))
    assert untold(RIG) == ()
    assert step_count(RIG, Plan()) == 2 * 8 * 4
    assert [(part(a, Plan()), known(a, Plan())) for a in chosen(RIG, Plan())] == [
        ("bar", "added_mass"),
        ("ring", "ring_inertia"),
    ]
    assert [(on, [a.name for a in axes]) for on, axes in order(RIG, Plan())] == [
        ("", ["x", "angle"]), ("ring", ["angle"]), ("bar", ["x"]),
    ]  # fmt: skip


def run(folder: Path, seed: int, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    return simulated_run("axis-inertia", "rlsrm", seed, {"repeats": 4, **plan}, folder / "recording.mcap", truth)


def off(done: Simulated) -> dict[str, float]:
    """Errors in U, by name."""
    out, true = {}, truth_of_motion(done)
    for r in done.results:
        if isinstance(r, Measured):
            i = interval(r.estimate)
            name = f"{r.quantity.name}@{r.where}"
            out[name] = (r.estimate.value - true[name]) / ((i.high - i.low) / 2)
    return out


def test_a_drawn_machine(tmp_path: Path) -> None:
    done = run(tmp_path, 3)
    assert {r.code for r in done.results if isinstance(r, Finding)} == {"map-scale"}
    assert set(off(done)) == {"mass@x", "inertia@angle"}
    assert all(abs(x) < 1.5 for x in off(done).values()), off(done)
    assert len(figures_drawn(done)) == 2


@pytest.mark.long
def test_a_single_axis(tmp_path: Path) -> None:
    done = run(tmp_path, 4, axes=["angle"])
    assert set(off(done)) == {"inertia@angle"}
    assert all(abs(x) < 1.5 for x in off(done).values()), off(done)
