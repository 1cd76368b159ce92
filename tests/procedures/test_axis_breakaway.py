"""Breakaway of a stage's axes: the bare model on made ramps, what a count delays by integration, planted troubles."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_figures import figures_drawn

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.recording import Recording
from bench.rigfile import load_rig
from bench.rigfile.stage import axes_of
from bench.uncertainty import interval
from procedures.axis_breakaway import checks, estimates, fit
from procedures.axis_breakaway.alone import alone, bearing
from procedures.axis_breakaway.estimates import Result
from procedures.axis_breakaway.moves import RAMP
from procedures.axis_breakaway.plan import Plan
from procedures.axis_breakaway.procedure import check, procedure, untold
from procedures.axis_breakaway.sequence import helix, pair, ramp, step_count
from procedures.axis_breakaway.steps import Ramp
from procedures.stages.map_bends import doubts
from sim_backend.machines.rlsrm.params import PlantParams
from sim_backend.machines.rlsrm.plant import rubbed

RIG = load_rig("rlsrm")
AXES = axes_of(RIG)
F_C, T_C = 1.5, 0.012
PULL, TURN = 2.4518, 0.036704  # N, N m of M2 with its hanger over a pulley, and of M1 on the disc
PLAN = Plan(repeats=4, helix=(1.0,))
NONE = np.zeros(len(doubts(RIG, 0.05)))


def made(
    plan: Plan = PLAN,
    up: float = 1.02,
    down: float = 0.97,
    path: bool = True,
    side: float = 0.0,
    crossed: float = 0.8e-3,
    rise: float = 0.0,
) -> list[Ramp]:
    """Ramps worked out without the fit: a newton of the map is `up` N pushing up and `down` N pushing down, 1 % more in every
    repeat; `side` N are needed both ways alike along; the map gives `crossed` N m for each newton along; with a `rise`, N/s, a
    count of x delays what is seen of it by three quarters of the greatest."""
    out = []

    def one(axis: str, k: int, load: str, way: int, turned: int, share: float, push: Mapping[str, float],
            pull: int = 0, beside: float = 0.0) -> None:  # fmt: skip
        force = {name: f / ((up if f > 0 else down) * (1 + 0.01 * k)) for name, f in push.items()}
        out.append(Ramp(axis, share, k, load, way, turned, pull, axis, 3.0, force, beside, dict.fromkeys(push, 0.0),
                        dict.fromkeys(push, NONE), False, ("HOLDING", "MOVING"), 0, 1000))  # fmt: skip

    for k in range(plan.repeats):
        for axis, friction, weight, names in (
            ("x", F_C, PULL, ("far", "near")),
            ("angle", T_C, TURN, ("left", "right")),
        ):
            for load, pull in (("", 0.0), (names[0], weight), (names[1], -weight)):
                for way in (1, -1):
                    if axis == "angle":
                        one(axis, k, load, way, 0, 0.0, {axis: way * friction - pull})
                        continue
                    for to in (-1, 0, 1):
                        given = to * 3e-3 + (k - 1) * 1e-3  # at another part of a count in every repeat
                        sticks = sticking(given, crossed, way, side - pull, path)
                        share = (given + crossed * sticks) / T_C
                        whole = 3.35 + 1.5e-3 * share**2 / (1 - share**2) / (T_C / F_C) ** 2
                        late = 0.75 * (6 * whole * 1e-6 * rise**2) ** (1 / 3)
                        one(axis, k, load, way, 0, 0.0, {axis: sticks + way * late}, to, given)
        for share in plan.helix:
            f, t = (share, 1.0) if not path else (share / np.hypot(share, 1), 1 / np.hypot(share, 1))
            for way in (1, -1):
                for turned in (1, -1):
                    one("x", k, "", way, turned, share, {"x": way * f * F_C, "angle": turned * t * T_C})
    return out


def sticking(given: float, crossed: float, way: int, other: float, path: bool) -> float:
    """The force that breaks x away beside a torque by the map and what is crossed of that force, by bisection: `other` N are
    needed besides friction."""
    low, high = 0.0, 3 * F_C
    for _ in range(60):
        middle = (low + high) / 2
        along = way * middle + other
        torque = (given + crossed * along) / T_C if path else 0.0
        low, high = (low, middle) if np.hypot(middle / F_C, torque) > 1 else (middle, high)
    return way * low + other


def told(ramps: list[Ramp], plan: Plan = PLAN) -> tuple[dict[str, Finding], Result]:
    found = [*checks.of_ramps(ramps, RIG, plan)]
    result = estimates.results(ramps, RIG, plan)
    return {f.code: f for f in (*found, *checks.of_result(result, plan))}, result


def test_friction_and_no_map() -> None:
    """Whatever a newton of the map is, either way and from place to place; what both ways need alike is none of it."""
    for side in (0.0, 0.1):
        found, r = told(made(side=side))
        assert not found
        assert r.estimates["breakaway", "x"].value == pytest.approx(F_C, rel=1e-3)
        assert r.estimates["breakaway_angle", "angle"].value == pytest.approx(T_C, rel=1e-3)
    assert r.shares[0] == pytest.approx(1.0, abs=0.01)


def test_what_acts_beside() -> None:
    """What the map crosses of a force is told by pulls, and taken off; it is a per cent without."""
    for crossed in (-1.5e-3, 0.0, 1.5e-3):
        _, r = told(made(crossed=crossed))
        assert r.estimates["breakaway", "x"].value == pytest.approx(F_C, rel=2e-3)
    late = [
        replace(r, rises={"x": 1.5}) if r.axis == "x" and not r.turned else r
        for r in made(up=1.0, down=1.0, crossed=1.5e-3, rise=1.5)
    ]
    assert told(late)[1].estimates["breakaway", "x"].value == pytest.approx(F_C, rel=2e-3)
    assert bearing(late, RIG, PLAN).bends["x", 1].limit == pytest.approx(T_C, rel=0.01)
    unpulled = [r for r in made(crossed=1.5e-3) if r.pull == 0]
    assert abs(told(unpulled)[1].estimates["breakaway", "x"].value - F_C) > 0.01 * F_C


def test_axes_that_rub_apart() -> None:
    """Each gives way by itself: both at their own breakaway are the square root of two of one friction along the path."""
    found, r = told(made(path=False))
    assert set(found) == {"axes-break-apart"}
    assert r.shares[0] == pytest.approx(2**0.5, rel=0.01)
    assert r.estimates["breakaway", "x"].value == pytest.approx(
        F_C, rel=1e-3
    )  # and nothing is added for a torque beside


def test_what_a_count_delays() -> None:
    """By integrating J a'' = R t in steps until a way is gone: the force is then as much more as is said."""
    inertia, count, per_s = 1.5e-3, 2.5e-3, 2.7e-3
    way = rate = t = 0.0
    step = 1e-5
    while way < count:
        rate += per_s * t / inertia * step
        way += rate * step
        t += step
    assert fit.beyond(inertia, count, per_s) == pytest.approx(per_s * t, rel=2e-3)
    shares = fit.beyond(inertia, count, per_s) * np.linspace(0, 1, 10001) ** (1 / 3)
    assert shares.mean() == pytest.approx(fit.MEAN * fit.beyond(inertia, count, per_s), rel=1e-3)
    assert shares.std() == pytest.approx(fit.DEVIATION * fit.beyond(inertia, count, per_s), rel=1e-3)


@pytest.mark.parametrize("share", [0.0, 0.4, -0.7])
def test_what_a_count_delays_beside_a_torque(share: float) -> None:
    """By the simulator's own friction, kicked in steps: x gives way at the circle, both go on along the path on which it broke,
    and the force is then as much more as (3) says."""
    machine = PlantParams(coulomb=F_C, bearing_radius=8e-3, viscous=(0.0, 0.0), along_path=1.0, coulomb_sides=0.0)
    rise, count, h = 0.54, 1e-6, 2e-5
    along, around = F_C * np.sqrt(1 - share**2), share * F_C * 8e-3
    rates, way, turned, t = np.zeros(2), 0.0, 0.0, 0.0
    assert not rubbed(machine, rates, np.array([0.999 * along, around]), h).any()
    while way < count:
        t += h
        rates = rubbed(machine, rates, np.array([along + rise * t, around]), h)
        way, turned = way + rates[0] * h, turned + rates[1] * h
    ratio = share / np.sqrt(1 - share**2) / 8e-3
    assert turned / way == pytest.approx(ratio, rel=0.1)
    whole = np.asarray(machine.mass + ratio**2 * machine.inertia)
    assert float(fit.passes(whole, count, np.asarray(rise))) == pytest.approx(t, rel=0.02)


def test_helices_are_delayed_by_what_is_seen_first() -> None:
    """x goes by a count long before the angle does; both set points creep. The same by hand, with the bearing's radius."""
    rates = {"x": 0.3, "angle": 0.3 * T_C / F_C}
    rising = [replace(r, rises=rates) if r.turned else r for r in made(up=1.0, down=1.0)]
    b = bearing(rising, RIG, PLAN)
    one = next(r for r in alone(rising, RIG, PLAN, b) if r.turned and r.repeat == 0)
    inertia = (3.35 + 1.5e-3 / (T_C / F_C) ** 2) / 2  # along a path of 45 degrees
    t = (6 * inertia * np.sqrt(2) * 1e-6 / (np.sqrt(2) * 0.3)) ** (1 / 3)
    held = np.sqrt(0.5)
    assert abs(one.force["x"]) == pytest.approx(held * F_C - 0.75 * 0.3 * t, rel=1e-3)
    assert abs(one.force["angle"]) == pytest.approx(held * T_C - 0.75 * rates["angle"] * t, rel=1e-3)


def test_what_a_count_leaves_is_a_force_in_the_budget() -> None:
    """By hand: of two ramps that are nearer by so much each, the breakaway is nearer by that; u is that of a cube root,
    in the mean of as many ramps."""
    rising = [replace(r, rises={"x": 2.0, "angle": 0.02}) for r in made()]
    _, r = told(rising)
    for (name, where), unit, ramps in ((("breakaway", "x"), "N", 24), (("breakaway_angle", "angle"), "N m", 8)):
        e = r.estimates[name, where]
        ((count, c),) = ((i, c) for i, c in e.sensitivities.items() if i.id == f"counts/{where}")
        assert (count.unit, count.u) == (unit, pytest.approx(r.beyond[where] * (3 / 80 / ramps) ** 0.5))
        assert abs(c) == pytest.approx(1.0, abs=0.05)


def test_when_a_reading_changes() -> None:
    still = np.zeros(200)
    assert fit.broke_away(still, 1.0) is None
    gone = still.copy()
    gone[10], gone[120:] = 1.0, 1.0  # one flicker before
    gone[123:130] = 0.0  # and thrown back by the loop
    assert fit.broke_away(gone, 1.0) == 120
    assert fit.broke_away(gone, 2.0) is None
    gone[:5] = 0.5  # it goes on the other way at first
    assert fit.broke_away(gone, 1.0) == 120
    t = np.arange(200) * 1e-3
    assert fit.rise(t, 2 + 3 * t, 150) == pytest.approx(3)


def test_planted() -> None:
    some = made()
    assert "never-broke-away" in {f.code for f in checks.of_ramps([replace(some[0], moved=""), *some[1:]], RIG, PLAN)}
    assert "did-not-stick" in {f.code for f in checks.of_ramps([replace(some[0], after=0.01), *some[1:]], RIG, PLAN)}
    assert "not-served" in {f.code for f in checks.of_ramps([replace(some[0], limited=True), *some[1:]], RIG, PLAN)}
    assert "axis-not-held" in {
        f.code for f in checks.of_ramps([replace(some[0], states=("READY",)), *some[1:]], RIG, PLAN)
    }
    assert "ramps-missing" in {f.code for f in checks.of_ramps([], RIG, PLAN)}
    sides = {"far": "near", "near": "far"}
    assert "load-not-seen" in told([replace(r, load=sides.get(r.load, r.load)) for r in some])[0]
    with pytest.raises(AnalysisError):
        estimates.results(some[1:], RIG, PLAN)


def test_what_is_asked() -> None:
    assert not [*check(RIG, Plan())]
    assert "axes" in " ".join(check(RIG, Plan(axes=("y",))))
    assert "helix" in " ".join(check(RIG, Plan(helix=(1.0, 1.0))))
    assert [*check(RIG, Plan(span_m=0.1))]
    assert step_count(RIG, PLAN) == len(made())
    both = pair(RIG, PLAN)
    assert both is not None
    for share in (0.5, 2.0):
        path = helix(RIG, PLAN, both, share)
        assert path.slide["x"] / (8e-3 * path.slide["angle"]) == pytest.approx(share)  # as the surface slides
        assert 5400 * path.ramp["x"] / F_C / (1.35 * path.ramp["angle"] / T_C) == pytest.approx(
            share
        )  # of what each is held by
        assert path.slid["x"] / path.slide["x"] == pytest.approx(path.slid["angle"] / path.slide["angle"])
    assert not untold(RIG)
    assert procedure.lacking(load_rig("tsbs12"))


def slid_before_each(recording: Recording[Plan]) -> None:
    """Between ramps the axis slides there and back, last the way it is to be pushed."""
    ramps = [*recording.steps(RAMP)]
    for former, one in itertools.pairwise(ramps):
        if former.labels["axis"] == one.labels["axis"]:
            axis, way = AXES[str(one.labels["axis"])], int(one.labels["way"])
            between = way * recording.read((axis.channel,), former.end_ns, one.start_ns)[axis.channel]
            last = between[np.argmin(between) :]
            assert np.ptp(last) > 0.4 * ramp(axis, recording.plan)[1]  # less both friction bands


@pytest.mark.long
def test_the_whole_path(tmp_path: Path) -> None:
    """On a drawn rig, through loops and telemetry."""
    done = simulated_run("axis-breakaway", "rlsrm", 1, {"repeats": 4, "helix": [1.0]}, tmp_path / "r.mcap")
    assert [f.code for f in done.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
    true, off = truth_of_motion(done), {}
    for r in done.results:
        if isinstance(r, Measured):
            i = interval(r.estimate)
            key = f"{r.quantity.name}@{r.where}"
            off[key] = (r.estimate.value - true[key]) / (0.5 * (i.high - i.low))
    assert set(off) == {"breakaway@x", "breakaway_angle@angle", "path_share@helix 1"}
    assert max(map(abs, off.values())) < 2, off
    slid_before_each(done.recording)
    assert figures_drawn(done) == ["circle", "breakaway-x", "beside-x", "breakaway-angle"]
