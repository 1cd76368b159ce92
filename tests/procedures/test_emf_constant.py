"""Fluxes by emf: the bare fit on made moves, the drawn machine's through the whole path, planted troubles, refusals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn_figures import figures_drawn

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import RigFile, load_rig
from bench.rigfile.check_capabilities import problems_of
from bench.uncertainty import Estimate, Influence, interval
from procedures.emf_constant import checks, estimates, fit
from procedures.emf_constant.fit import Move
from procedures.emf_constant.moves import captured, lines, windings
from procedures.emf_constant.nameplate import compared, conventions
from procedures.emf_constant.plan import Plan
from procedures.emf_constant.procedure import check, procedure
from procedures.emf_constant.steps import Taken

RIG = load_rig("lira")
WINDING = windings(RIG)
RATE_HZ, RATE = 35e3, 8.0
OHM, HENRY = np.array([1.8, 1.85, 1.75, 1.79, 1.83, 1.78]), 2.4e-3 * np.array([1, 1.01, 0.99, 1.005, 0.995, 1])


def made(there: int = 1, psi: float = 8.75e-3, off: float = 0.05, links: Mapping[int, float] | None = None,
         gains: Mapping[int, float] | None = None, noise: float = 0.0, seed: int = 0) -> Move:  # fmt: skip
    """A turn of the first rotary motor by 1.5 rad, worked out without the fit: currents of both systems, each coil with its own
    R and L, a common voltage of each star, a mover 20 um off its middle (0.025 mWb by the bearing's phases)."""
    one, rng = WINDING["RA1"], np.random.default_rng(seed)
    t = np.arange(0, 0.15, 1 / RATE_HZ)
    share = t / t[-1] - np.sin(2 * np.pi * t / t[-1]) / (2 * np.pi)
    gamma = 1.5 * (share if there > 0 else 1 - share)
    phi = RATE * gamma
    i_q, bearing = there * 0.5 * np.sin(2 * np.pi * t / t[-1]) + 0.15 * np.sin(48 * gamma), (0.4, 1.8)
    volts, amperes = [], []
    for k, (p, b) in enumerate(zip(one.phases.values(), one.others[0].values(), strict=True)):
        i = -i_q * np.sin(phi + p) + bearing[0] * np.cos(phi + b) - bearing[1] * np.sin(phi + b)
        flux = (links or {}).get(k, 1.0) * (psi * np.cos(phi + p - off) + 2.5e-5 * np.cos(phi + b + 0.7))
        e = np.gradient(HENRY[k] * i + flux, t, edge_order=2)
        common = 0.3 * np.cos(3 * phi) + (0.5 if k % 2 else -0.4)
        volts.append((gains or {}).get(k, 1.0) * (OHM[k] * i + e + common) + noise * rng.normal(size=t.size))
        amperes.append(i + 0.02 * (k - 2) + noise / 20 * rng.normal(size=t.size))
    return Move(t, gamma, np.array(volts), np.array(amperes))


def fitted(*moves: Move) -> fit.Rows:
    one = WINDING["RA1"]
    phases, others = np.array(list(one.phases.values())), [np.array(list(p.values())) for p in one.others]
    stars = [[one.coils.index(c) for c in star] for star in one.stars]
    return fit.together([fit.rows(m, one.per, phases, others, stars, 5e-3) for m in moves])


def test_the_bare_fit() -> None:
    rows = fitted(made(1), made(-1))
    found = fit.flux(rows)
    assert found.size == pytest.approx(8.75e-3, rel=2e-4)
    assert found.angle == pytest.approx(0.05, abs=2e-4)
    assert found.resistance == pytest.approx(OHM, rel=5e-3)
    assert found.inductance == pytest.approx(HENRY, rel=1e-2)
    assert found.shares.sum() == pytest.approx(1, abs=1e-6)
    assert fit.by_coil(rows, found) == pytest.approx(np.full(6, 8.75e-3), rel=4e-3)


def test_the_voltage_of_a_star_is_in_nothing() -> None:
    """Stars taken for none: their common voltage is in the flux."""
    one = WINDING["RA1"]
    phases, others = np.array(list(one.phases.values())), [np.array(list(p.values())) for p in one.others]
    alone = fit.together([fit.rows(made(way), one.per, phases, others, [], 5e-3) for way in (1, -1)])
    rms = fit.flux(alone).rms
    assert rms > 20 * fit.flux(fitted(made(1), made(-1))).rms


def test_a_gain_counts_by_its_share() -> None:
    """By hand: voltages of one coil in six that read 6 % more make the flux about 1 % more."""
    sound, wrong = (fit.flux(fitted(made(1, gains=g), made(-1, gains=g))) for g in ({}, {2: 1.06}))
    assert wrong.size / sound.size - 1 == pytest.approx(0.06 * sound.shares[2], rel=0.05)
    assert sound.shares == pytest.approx(np.full(6, 1 / 6), abs=0.03)


def test_a_place_that_stands_while_the_rest_is_read() -> None:
    """A coordinate that grows by 4 a reading, read at each fourth sample from the third on: 4 k + 1.5 in the middle of four."""
    t = np.arange(42.0)
    at = np.floor((t - 2) / 4) * 4 + 2
    move = fit.averaged(t, at, np.array([t]), np.array([2 * t]), 4)
    assert move.at == pytest.approx(move.t)
    assert move.voltages[0] == pytest.approx(move.t)
    assert move.t[0] == 3.5
    assert len(move.t) == 9


def test_each_coil() -> None:
    rows = fitted(made(1, links={3: -1.0}), made(-1, links={3: -1.0}))
    found = fit.by_coil(rows, fit.flux(rows)) / 8.75e-3
    assert found[3] < -0.5  # the angle that all have together is off, too
    assert np.delete(found, 3).min() > 0.5


def taken(plan: Plan, **changes: Any) -> list[Taken]:
    return [
        Taken(
            "RA1",
            repeat,
            way,
            made(way, noise=0.2, seed=10 * repeat + way + 1, **changes),
            ("LEVITATED",),
            0,
            100,
        )
        for repeat in range(plan.repeats)
        for way in (1, -1)
    ]


def told(some: list[Taken], plan: Plan, constants: Mapping[str, Estimate] | None = None) -> dict[str, Finding]:
    found = [*checks.of_signals(some, RIG, plan)]
    if not any(f.effect is Effect.ERROR for f in found):
        found += checks.of_results(estimates.results(some, RIG, plan), RIG, plan, constants or {})
    return {f.code: f for f in found}


def loud(found: Mapping[str, Finding]) -> set[str]:
    return {code for code, f in found.items() if f.effect is not Effect.NOTE}


PLAN = Plan(motors=("RA1",), repeats=4)


def test_what_findings_need() -> None:
    sound = taken(PLAN)
    assert loud(told(sound, PLAN)) == set()
    assert loud(told([], PLAN)) == {"no-moves"}
    assert loud(told([replace(sound[0], move=None), *sound[1:]], PLAN)) == {"move-not-captured"}
    assert loud(told([replace(sound[0], states=("LEVITATED", "LANDING")), *sound[1:]], PLAN)) == {"not-levitated"}
    assert loud(told([replace(sound[0], lost=50), *sound[1:]], PLAN)) == {"missing-samples"}
    assert loud(told(sound[:6], PLAN)) == {"too-few-moves"}
    assert loud(told(sound, PLAN.model_copy(update={"max_u": 1e-5}))) == {"flux-not-shown"}
    assert told(taken(PLAN, links={3: 0.9}), PLAN)["coil-differs"].where == "i_s4"
    assert loud(told(taken(PLAN, gains={3: 1.005}), PLAN)) == set()


def test_reciprocity() -> None:
    """3 P Psi = 24 * 8.75 mWb = 0.21 N m/A."""
    sound = taken(PLAN)

    def known(value: float) -> dict[str, Estimate]:
        return {"K_torque@RA1": Estimate.of(value, Influence("k", "k", 0.01 * value, "N m/A", "B", "normal"))}

    (one,) = estimates.results(sound, RIG, PLAN)
    assert one.estimates["K_emf_angle"].value == pytest.approx(0.21, rel=3e-3)
    assert one.estimates["K_emf_angle"].unit == "N m/A"
    assert "8.75" in told(sound, PLAN, known(0.21))["reciprocity-holds"].text
    assert loud(told(sound, PLAN, known(0.21 * 2.37))) == {"reciprocity-broken"}


def test_what_a_nameplate_means() -> None:
    """20.7 mWb against 8.75: 2.366 of a coil, 1.18 of a phase of two, neither; 110 against 110.7 is a coil's."""
    assert conventions(6)["a phase of 2 coils, peak"] == 2
    assert "a phase of 1 coils, peak" not in conventions(3)
    rotary = compared(WINDING["RA1"], Estimate.exact(8.75e-3, "Wb"), RIG, Plan())
    assert rotary is not None
    assert rotary.ratio == pytest.approx(2.366, abs=1e-3)
    assert (rotary.nearest, rotary.fits) == ("a phase of 2 coils, peak", False)
    assert rotary.off == pytest.approx(0.183, abs=1e-3)
    linear = compared(WINDING["LA"], Estimate.exact(0.1107, "Wb"), RIG, Plan())
    assert linear is not None
    assert (linear.nearest, linear.fits) == ("a coil, peak", True)
    assert "no convention fits" in told(taken(PLAN), PLAN)["nameplate-flux"].text


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1, **plan: Any) -> Simulated:
    return simulated_run("emf-constant", "lira", seed, {"repeats": 4, **plan}, folder / "recording.mcap", truth)


def off(done: Simulated) -> dict[str, float]:
    """Errors in U, by name."""
    out, true = {}, done.truth | truth_of_motion(done)
    for r in done.results:
        if isinstance(r, Measured):
            i = interval(r.estimate)
            name = f"{r.quantity.name}@{r.where}"
            out[name] = (r.estimate.value - true[name]) / ((i.high - i.low) / 2)
    return out


def test_the_linear_motor(tmp_path: Path) -> None:
    """Of a machine whose encoder is 10 degrees off, which takes 1.5 % of the force of an ampere: none of the flux."""
    done = run(tmp_path, {"zero_off_la": math.radians(10)}, motors=["LA"])
    assert {r.code for r in done.results if isinstance(r, Finding)} == {"nameplate-flux"}
    assert set(off(done)) == {"flux@LA", "K_emf@LA", "resistance@LA"}
    assert all(abs(x) < 1.5 for x in off(done).values()), off(done)
    assert figures_drawn(done)


@pytest.mark.long
def test_all_motors(tmp_path: Path) -> None:
    done = run(tmp_path, seed=2)
    assert not loud({r.code: r for r in done.results if isinstance(r, Finding)})
    assert len(off(done)) == 9
    assert all(abs(x) < 1.5 for x in off(done).values()), off(done)


@pytest.mark.long
def test_a_coil_that_has_lost_turns(tmp_path: Path) -> None:
    done = run(tmp_path, {"weak_coil": 4.0, "weak_coil_gives": 0.9}, motors=["RA1"])
    found = {r.code: r for r in done.results if isinstance(r, Finding)}
    assert loud(found) == {"coil-differs"}
    assert found["coil-differs"].where == "i_s4"


def test_refusals() -> None:
    assert procedure.lacking(RIG) == ()
    assert list(check(RIG, Plan())) == []
    assert "found LB" in next(iter(check(RIG, Plan(motors=("LB",)))))
    assert "observer" in next(iter(check(RIG, Plan(observer="other"))))
    assert "electrical radian" in next(iter(check(RIG, Plan(places_m=(8e-3, 9e-3)))))
    assert "ref_z" in next(iter(check(RIG, Plan(places_m=(8e-3, 30e-3)))))
    assert [line.motor for line in lines(RIG, Plan())] == ["LA", "RA1", "RA2"]
    assert [len(captured(RIG, line.motor)) for line in lines(RIG, Plan())] == [7, 13, 13]  # 16 at most
    assert lines(RIG, Plan())[0].seconds == pytest.approx(6e-3 / 0.3 + 0.3 / 40)  # by hand
    bare = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"current_steps": {}})})
    assert any("current_steps" in line for line in procedure.lacking(bare))


@pytest.mark.parametrize("flux", ["kp.z", "psi.none"])
def test_a_flux_that_is_none(flux: str) -> None:
    toml, dbc = (Path("rigs") / "lira.toml").read_text(), (Path("rigs") / "lira.dbc").read_text()
    changed = toml.replace('flux = "psi.lin"', f'flux = "{flux}"')
    assert changed != toml
    assert "capabilities.force_currents.LA.flux" in [p.key for p in problems_of(RigFile.parse(changed, dbc))]
