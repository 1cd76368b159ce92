"""Bearing constants by weights: the bare model, the whole path, what is planted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, flown, simulated_run
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import RigFile, load_rig
from bench.uncertainty import interval
from procedures.bearing_constant import checks, estimates
from procedures.bearing_constant.plan import Plan
from procedures.bearing_constant.procedure import check, left_out, procedure
from procedures.bearing_constant.stand import hooks, masses, planes, set_points, visits
from procedures.bearing_constant.steps import Visit, newtons
from reports.figures import draw as draw_figure

REDUCED = {"reduced": 1.0}
K = (3.78, 3.61)
HALF = 0.045


@cache
def rig() -> RigFile:
    return load_rig("lira")


class Recorded:
    """What `newtons` asks of a recording."""

    rig = rig()


def shares(at: float) -> np.ndarray:
    """Of a weight so far from the middle, by moments about either plane."""
    return np.array([(at + HALF) / (2 * HALF), (HALF - at) / (2 * HALF)])


def seen(plan: Plan | None = None, *, noise: float = 5e-4, turned: tuple[float, float] = (0.03, -0.02), seed: int = 1,
         error: Mapping[str, float] | None = None, at: Mapping[str, float] | None = None,
         drift: float = 0.02) -> list[Visit]:  # fmt: skip
    """Visits of a made machine, by statics."""
    plan, rng, out = plan or Plan(), np.random.default_rng(seed), []
    places = {"far": 0.0605, "near": -0.0597, **(at or {})}
    for number, (hook, load) in enumerate(visits(rig(), plan), start=1):
        weight = newtons(Recorded(), load)  # type: ignore[arg-type]
        true = weight * (1 + (error or {}).get(load, 0.0))
        carried = true * shares(places[hook]) / np.array(K)
        currents = []
        for k in (0, 1):
            q = 1.8 + drift * number + carried[k] * math.cos(turned[k])
            d = -0.3 + carried[k] * math.sin(turned[k])
            currents.append([d + rng.normal(0, noise), q + rng.normal(0, noise)])
        out.append(Visit(number, hook, load, weight, np.array(currents), np.zeros(4), 0.0, ("LEVITATED",), 0, 100))
    return out


def found(some: list[Visit], plan: Plan | None = None) -> estimates.Result:
    return estimates.result(some, rig(), plan or Plan())


def told(r: estimates.Result) -> dict[str, Effect]:
    return {f.code: f.effect for f in checks.of_result(r, Plan(), rig())}


def test_statics_are_turned_around() -> None:
    """Both constants, to the last digits: no lever, no drift and no turn of the field is in them."""
    r = found(seen(noise=1e-9))
    assert [r.estimates["K_B", m].value for m in ("RA1", "RA2")] == pytest.approx(K, rel=1e-7)
    assert [r.places[h][0] for h in ("far", "near")] == pytest.approx([0.0605, -0.0597], rel=1e-6)
    assert [a.turned for a in r.answers] == pytest.approx([0.03, -0.02], rel=1e-5)
    f = shares(0.0605)
    assert r.estimates["K_mean", "far"].value == pytest.approx(1 / (f[0] / K[0] + f[1] / K[1]), rel=1e-7)
    assert told(r) == {}


def test_one_place_tells_one_constant() -> None:
    plan = Plan(hooks=("far",))
    r = found(seen(plan, noise=1e-9), plan)
    f = shares(0.0605)
    assert {name for name, _ in r.estimates} == {"K_mean"}
    assert r.estimates["K_mean", "far"].value == pytest.approx(1 / (f[0] / K[0] + f[1] / K[1]), rel=1e-7)
    assert [q.name for q in left_out(plan)] == ["K_B"]
    with pytest.raises(AnalysisError, match="answered alike"):
        found(seen(at={"near": 0.058}))


def test_the_stated_scatter_is_that_of_many() -> None:
    """Of both constants over many runs, with noise that both planes have alike: their u is by what both carry."""
    errors = []
    for seed in range(200):
        some, rng = seen(noise=1e-4, seed=seed), np.random.default_rng(1000 + seed)
        for v in some:
            assert v.currents is not None
            v.currents[:] += rng.normal(0, 1e-3)
        r = found(some)
        row = []
        for k, motor in enumerate(("RA1", "RA2")):
            e = r.estimates["K_B", motor]
            u = math.hypot(*(c for name, c in e.contributions.items() if name.startswith("scatter")))
            row.append((e.value - K[k]) / u)
        errors.append(row)
    assert np.std(errors, axis=0) == pytest.approx([1.15, 1.15], rel=0.12)  # t of 8 degrees of freedom
    assert np.abs(np.mean(errors, axis=0)).max() < 0.3


def test_gains_are_those_of_the_coils_that_carry_it() -> None:
    """At no angle coils at 60, 120, 240 and 300 degrees carry q alike: each a quarter."""
    r = found(seen(turned=(0.0, 0.0), noise=1e-6))
    e = r.estimates["K_B", "RA1"]
    gains = {name: c / e.value for name, c in e.contributions.items() if name.startswith("sensors/")}
    u = 0.005 / math.sqrt(3)
    large = {name: c for name, c in gains.items() if abs(c) > 1e-6}
    assert large == pytest.approx({f"sensors/i_s{k}/gain": u / 4 for k in (2, 3, 5, 6)}, rel=1e-3)


def test_gains_of_an_answer_that_is_turned() -> None:
    """Coil at phase p carries sin(t) cos(p) - cos(t) sin(p) = -sin(p - t) of an answer
    turned by t, and counts by its square."""
    turn, u = 0.3, 0.005 / math.sqrt(3)
    e = found(seen(turned=(turn, 0.0), noise=1e-7)).estimates["K_B", "RA1"]
    for k in range(6):
        share = math.sin(math.radians(60 * k) - turn) ** 2 / 3
        assert e.contributions[f"sensors/i_s{k + 1}/gain"] / e.value == pytest.approx(share * u, rel=1e-3)


@pytest.mark.parametrize(
    ("made", "code"),
    [({"error": {"M1": 0.01}}, "masses-disagree"), ({"error": {"M2": -0.01}}, "masses-disagree"),
     ({"at": {"far": -0.06, "near": 0.06}}, "weight-misplaced"), ({"at": {"far": 0.068}}, "weight-misplaced"),
     ({"noise": 0.01}, "visits-disagree"), ({"turned": (0.1, 0.0)}, "weight-turned")],
)  # fmt: skip
def test_what_is_wrong_is_told(made: dict[str, Any], code: str) -> None:
    assert code in told(found(seen(**made)))


def test_one_mass_on_the_other_hook() -> None:
    """Both constants stay what they are; the visit is named."""
    some, wrong = seen(noise=5e-4), seen(at={"near": 0.0605})
    r = found([*some[:2], wrong[2], *some[3:]])
    assert [(f.code, f.where) for f in checks.of_result(r, Plan(), rig())] == [
        ("visits-disagree", "visit 3, M2 on near")
    ]
    assert r.estimates["K_B", "RA1"].value == pytest.approx(K[0], rel=2e-3)


def test_signals_that_tell_nothing() -> None:
    some, plan = seen(), Plan()

    def codes(*of: Visit) -> set[str]:
        return {f.code for f in checks.of_signals(of, plan, rig())}

    v = some[0]
    assert codes(*some) == set()
    assert codes() == {"no-visits"}
    changed = vars(v)
    assert codes(Visit(**{**changed, "currents": None})) == {"visit-not-captured"}
    assert codes(Visit(**{**changed, "states": ("CURRENT",)})) == {"visit-not-held"}
    assert codes(Visit(**{**changed, "limited": 0.1})) == {"visit-limited"}
    assert codes(Visit(**{**changed, "positions": np.array([0, 2e-7, 0, 0])})) == {"visit-unsettled"}


def test_what_the_rig_says() -> None:
    plan = Plan()
    assert [p.motor for p in planes(rig())] == ["RA1", "RA2"]
    assert hooks(rig(), plan) == ("far", "near")
    assert masses(rig(), plan) == ("M1", "M2")
    assert set_points(rig(), plan) == {"ref_z": pytest.approx(11e-3), "ref_gamma": 0.0}
    order = visits(rig(), plan)
    assert len(order) == 12
    assert all(sum((h, m) == (hook, mass) for h, m in order) == 2 for hook in ("far", "near") for mass in ("M1", "M2"))
    time = np.linspace(-1, 1, 12)
    for hook, mass in (("far", "M1"), ("far", "M2"), ("near", "M1"), ("near", "M2"), ("far", "")):
        assert sum(t for t, v in zip(time, order, strict=True) if v == (hook, mass)) == pytest.approx(0, abs=1e-12)
    for bad, said in (({"hooks": ("middle",)}, "hooks: found middle"), ({"masses": ("M1",)}, "masses: found M1 alone"),
                      ({"observer": "none"}, "observer: found"), ({"place_m": 0.1}, "ref_z"),
                      ({"hooks": ("far", "far")}, "each once")):  # fmt: skip
        assert any(said in problem for problem in check(rig(), Plan(**bad)))
    assert list(check(rig(), plan)) == []


def run(folder: Path, truth: Mapping[str, float] | None = None, seed: int = 1, **plan: Any) -> Simulated:
    return simulated_run(
        "bearing-constant", "lira", seed, plan, folder / "recording.mcap", {**REDUCED, **(truth or {})}
    )


def codes(done: Simulated) -> set[str]:
    return {r.code for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


def test_the_truth_is_recovered(tmp_path: Path) -> None:
    done = run(tmp_path, average_s=0.3)
    assert codes(done) == set()
    truth = truth_of_motion(done)
    measured = {f"{r.quantity.name}@{r.where}": r.estimate for r in done.results if isinstance(r, Measured)}
    assert measured.keys() == truth.keys() == {"K_B@RA1", "K_B@RA2", "K_mean@far", "K_mean@near"}
    for name, estimate in measured.items():
        span = interval(estimate)
        assert abs(estimate.value - truth[name]) <= (span.high - span.low) / 2, name
        assert estimate.u < 2.5e-3 * estimate.value
    told = list(done.recording.events("approach"))
    assert len(told) == 11  # one of twelve visits is as the one before
    figures = list(procedure.drawn(done.recording))
    assert [f.key for f in figures] == ["weights-RA1", "weights-RA2"]
    for figure in figures:
        assert draw_figure(figure)


@pytest.mark.parametrize(
    ("truth", "code"),
    [({"misplaced": 3.0}, "visits-disagree"),
     pytest.param({"places_exchanged": 1.0}, "weight-misplaced", marks=pytest.mark.long),
     pytest.param({"mass_error_M1": 0.02}, "masses-disagree", marks=[pytest.mark.long, pytest.mark.longer])],
)  # fmt: skip
def test_what_is_planted_is_found(tmp_path: Path, truth: dict[str, float], code: str) -> None:
    assert code in codes(run(tmp_path, truth, average_s=0.2))


def test_an_open_bleeder_ends_it_before_anybody_is_asked(tmp_path: Path) -> None:
    truth = {**REDUCED, "discharge_factor": 1e6}
    done = flown("bearing-constant", "lira", 1, {}, tmp_path / "recording.mcap", truth)
    assert [f.code for f in done.machine.ending.findings] == ["not-discharged"]
    assert "Nobody was asked to touch it" in done.machine.ending.findings[0].text
