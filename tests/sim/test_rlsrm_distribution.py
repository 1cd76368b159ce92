"""Torque and force shared out: R (17), (18) as corrected and as printed, its Table 2, what two of six phases can serve."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rlsrm_bench import TYPICAL, column, flown, sine

from sim_backend.core.plant import Array
from sim_backend.machines.rlsrm import reference
from sim_backend.machines.rlsrm.params import DEG, PHASES, ControlParams, Map, PlantParams
from sim_backend.machines.rlsrm.plant import LIMITED, NO_PAIR, Plant, distribute, slopes

ANY, EACH = ControlParams(), ControlParams(rule=1)
TABLE = ControlParams(rule=2)
S2 = Map().saturation ** 2


def q_of(current: Array) -> Array:
    return S2 * (np.sqrt(1 + current**2 / S2) - 1)


def served(control: ControlParams, x: float, ways: int = 36, *, toward: bool | None = None, torque: int = 0) -> float:
    """Share of (angle, direction of 50 N to 1 N m) that a pair serves; `toward` the centre or away, by the torque's sign."""
    found = []
    for step in range(90):
        for k in range(ways):
            way = 2 * math.pi * (k + 0.5) / ways
            f, t = 0.05 * math.cos(way), 0.001 * math.sin(way)
            if (toward is None or (f * x < 0) == toward) and t * torque >= 0:
                found.append(not distribute(control, x, (step + 0.5) * DEG, f, t)[3] & NO_PAIR)
    return sum(found) / len(found)


def test_two_of_six_are_the_least_of_all_six() -> None:
    """The linear programme knows no pairs: q of six phases, none below zero, with the least sum."""
    rng = np.random.default_rng(5)
    for _ in range(60):
        x, angle = rng.uniform(-0.014, 0.014), rng.uniform(-4, 4)
        force, torque = rng.normal(0, 1), rng.normal(0, 0.02)
        current, given, _, flags = distribute(ANY, x, angle, force, torque)
        assert flags == 0
        assert given == pytest.approx([force, torque], abs=1e-12)
        _, along, around = slopes(ANY.map, x, angle)
        assert [along @ q_of(current), around @ q_of(current)] == pytest.approx([force, torque], abs=1e-12)
        least = reference.least_q(along, around, force, torque)
        assert least is not None
        assert q_of(current).sum() == pytest.approx(least.sum(), rel=1e-9)


@pytest.mark.parametrize(("mm", "share"), [(0, 1.0), (3, 0.956), (5, 0.889), (6, 0.802), (10, 0.696), (14, 0.593)])
def test_what_one_phase_of_each_stator_can_serve(mm: int, share: float) -> None:
    """For a force away from the centre the outer stator must give little torque a force and the inner one more."""
    assert served(EACH, mm * 1e-3) == pytest.approx(share, abs=0.0006)


@pytest.mark.parametrize("mm", [0, 5, 10, 14, -14])
def test_any_two_phases_serve_every_demand(mm: int) -> None:
    assert served(ANY, mm * 1e-3) == 1


def test_where_the_papers_rule_ends_by_hand() -> None:
    """Teeth as triangles of 40 degrees without an unaligned part: torque a force goes with overlap/(40 - d). At 10
    degrees A was passed 10 degrees ago and C comes in 20. A force +F without torque: A of stator 1 draws, and C of stator 0
    turns back what A turns, which costs less force than A gives while (o + x)/(40 - 10) < (o - x)/(40 - 20), x < 2.8 mm. The
    smooth map of this machine serves it until a little farther, and not beyond."""
    angle, limit = 10 * DEG, 2.8e-3
    assert (14e-3 + limit) / (40 - 10) == pytest.approx((14e-3 - limit) / (40 - 20))
    for rule, x, flags in ((EACH, 2e-3, 0), (EACH, 6e-3, NO_PAIR), (ANY, 6e-3, 0)):
        assert distribute(rule, x, angle, 0.05, 0.0)[3] & NO_PAIR == flags


def test_table_2_centres() -> None:
    """With stator I at +x and the sign of x as its key; A 0, C 30, B 60 degrees. It serves what goes to the centre, not what
    goes away from it; two of its cells are misprinted: rows 40 to 60 degrees, T < 0, x < 0."""
    printed = replace(TABLE, corrected=0.0)
    for x in (7e-3, -7e-3):
        assert served(TABLE, x, 24, toward=True, torque=1) == pytest.approx(0.93, abs=0.006)
        assert served(TABLE, x, 24, toward=True, torque=-1) == 1
        assert served(TABLE, x, 24, toward=False) == pytest.approx(0.25, abs=0.02)
    assert served(printed, 7e-3, 24, toward=True, torque=-1) == 1
    assert served(printed, -7e-3, 24, toward=True, torque=-1) == pytest.approx(0.86, abs=0.006)
    assert served(replace(TABLE, turned=0.0), 7e-3, 24, toward=True) < 0.5  # stator I at -x: another machine


def test_table_2_reads_as_printed() -> None:
    """R's own example: positive position, 10 to 20 degrees, negative torque: phase A of stator I and C of stator II."""
    literal = replace(TABLE, corrected=0.0, turned=0.0, clipped=1.0)

    def pair(x: float, angle: float, torque: float, control: ControlParams = literal) -> list[str]:
        return [PHASES[k] for k in distribute(control, x, angle * DEG, 0.1, torque)[2]]

    assert pair(5e-3, 15, -0.01) == ["A1", "C2"]
    assert pair(5e-3, 15, 0.01) == ["C1", "A2"]
    assert pair(-5e-3, 45, -0.01) == ["C1", "B2"]
    assert pair(-5e-3, 45, -0.01, replace(literal, corrected=1.0)) == ["B1", "C2"]
    assert pair(-5e-3, 55 + 90, -0.01, replace(literal, corrected=1.0)) == ["B1", "C2"]
    assert pair(-5e-3, 85 - 90, 0.01) == ["A1", "C2"]
    assert pair(5e-3, 15, -0.01, replace(literal, turned=1.0)) == ["C1", "A2"]  # stator I at +x is our stator 1


def test_17_and_18_hold_with_index_n_and_not_as_printed() -> None:
    """Every pair, by hand: q of (18) put into (17). With m in stator II's torque gradient most torques are far off."""
    rng, wrong, pairs = np.random.default_rng(2), 0, 0
    for _ in range(200):
        x, angle = rng.uniform(-0.012, 0.012), rng.uniform(0, 2 * math.pi)
        force, torque = rng.normal(0, 10), rng.normal(0, 0.5)
        _, g, t = slopes(Map(), x, angle)
        for m in range(3):
            for n in range(3):
                for tn, right in ((t[3 + n], True), (t[3 + m], False)):
                    d = t[m] * g[3 + n] - g[m] * tn
                    if abs(d) < 1e-4:
                        continue
                    a, b = (torque * g[3 + n] - force * tn) / d, (force * t[m] - torque * g[m]) / d
                    off = abs(t[m] * a + t[3 + n] * b - torque)
                    if right:
                        assert off < 1e-9
                        assert g[m] * a + g[3 + n] * b == pytest.approx(force, abs=1e-9)
                    elif m != n:
                        pairs += 1
                        wrong += off > 0.05 * abs(torque)
    assert wrong / pairs > 0.85
    for control, index_n in ((EACH, True), (replace(EACH, printed_index=1.0), False)):  # and so does the controller
        given = [distribute(control, 1e-3, step * 4 * DEG, 0.1, 0.01)[1] for step in range(23)]
        assert np.allclose(given, [0.1, 0.01]) == index_n


def angle_error(params: PlantParams, control: ControlParams, x: float) -> float:
    """Largest error of a sine of 200 degrees in 5 s, its second period, at a place x; degrees."""
    control = replace(sine(control, 1, 200 * DEG), offset=(x, 0.0))
    rows = flown(params, control, 10, (x, 0.0))[5000:]
    return float(abs(column(rows, "ref_angle") - column(rows, "true_angle")).max() / DEG)


def test_the_printed_index_follows_nothing() -> None:
    for x in (0.0, 3e-3, 8e-3):
        assert angle_error(PlantParams(), replace(EACH, printed_index=1.0), x) > 20
        assert angle_error(PlantParams(), EACH, x) < 1


def test_table_2_follows_off_the_centre_only_and_literally_nowhere() -> None:
    literal = replace(TABLE, corrected=0.0, turned=0.0, clipped=1.0)
    assert angle_error(PlantParams(), TABLE, 0.0) > 300  # both gradients alike: singular pairs
    for x in (3e-3, 8e-3):
        assert angle_error(PlantParams(), TABLE, x) < 1
    for x in (0.0, 3e-3, 8e-3):
        assert angle_error(PlantParams(), literal, x) > 150
        assert angle_error(PlantParams(), replace(literal, by_force=1.0), x) > 150


def test_both_axes_at_once_cost_twice_the_copper_by_the_papers_rule() -> None:
    def copper(control: ControlParams) -> float:
        rows = flown(
            PlantParams(), replace(control, wave=(1.0, 1.0), amplitude=(0.01, 200 * DEG), cut=(60.0, 60.0)), 10
        )
        i = np.array([column(rows, f"i_{n}") for n in PHASES])
        return float(7.8 * (i**2).sum(axis=0).mean())

    assert 1.6 < copper(EACH) / copper(ANY) < 3


def test_a_load_towards_the_centre_is_lost_by_the_papers_rule_at_15_degrees() -> None:
    """4 N at x = 10 mm: held at any angle by two of six, at 0 degrees by one of each, and not at 15."""

    def place(control: ControlParams, degrees: float) -> float:
        at = (0.01, degrees * DEG)
        plant = Plant(replace(PlantParams(), along_path=0.0), replace(control, offset=at))
        plant.put(*at)
        plant.switch(on=True, x=True, angle=True)
        for load, seconds in ((0.0, 1.6), (-1.5, 0.7), (-4.0, 2.7)):
            plant.push(load)
            plant.run(seconds, 0)
        return float(plant.place[0])

    assert [place(ANY, d) for d in (0, 10, 15)] == pytest.approx([0.01] * 3, abs=3e-5)
    assert place(EACH, 0) == pytest.approx(0.01, abs=3e-5)
    assert place(EACH, 15) < 0


def test_a_limit_takes_off_both_or_the_axis_that_matters_less() -> None:
    asked = (9.0, 0.6)
    for x, angle in ((0.0, 0.3), (0.005, 1.0), (-0.008, 2.2)):
        both = distribute(ANY, x, angle, *asked)
        assert both[3] == LIMITED
        assert both[0].max() == pytest.approx(6)
        assert both[1][0] / both[1][1] == pytest.approx(asked[0] / asked[1])
        force = distribute(replace(ANY, priority=1.0), x, angle, *asked)
        assert force[1][0] == pytest.approx(9)
        assert 0 <= force[1][1] < 0.6
        assert force[0].max() <= 6 + 1e-9
        torque = distribute(replace(ANY, priority=2.0), x, angle, 9.0, 0.4)
        assert torque[1][1] == pytest.approx(0.4)
        assert torque[0].max() <= 6 + 1e-9


def test_what_6_A_can_give() -> None:
    """Least over the angle, the other axis zero: where a phase is aligned it acts alone: 16.19 A^2 times 0.7855 H/m."""

    def most_force(x: float, angle: float) -> float:
        _, g, t = slopes(Map(), x, angle)
        top, best = float(q_of(np.array(6.0))), 0.0
        for a in range(6):
            for b in range(a + 1, 6):
                q = np.array([-t[b], t[a]]) * (1 if t[a] * g[b] - g[a] * t[b] > 0 else -1)
                if (q >= 0).all() and q.max() > 0:
                    best = max(best, top / q.max() * float(g[[a, b]] @ q))
        return best

    assert min(most_force(0.0, d * DEG) for d in range(90)) == pytest.approx(16.19 * 0.7855, abs=0.01)
    for degrees in range(0, 90, 7):
        asked = distribute(replace(ANY, priority=2.0), 0.0, degrees * DEG, 50.0, 0.0)
        assert asked[1][0] <= most_force(0.0, degrees * DEG) * (1 + 1e-9)
        assert abs(asked[1][1]) < 1e-9


def test_the_share_of_the_other_axis_is_the_largest_there_is() -> None:
    """By trying: a hair more than the share that priority gives needs more than 6 A in every pair."""
    x, angle, top = 0.004, 0.7, float(q_of(np.array(6.0)))
    _, given, _, _ = distribute(replace(ANY, priority=1.0), x, angle, 9.0, 0.6)
    _, g, t = slopes(Map(), x, angle)

    def possible(torque: float) -> bool:
        for a in range(6):
            for b in range(a + 1, 6):
                q = np.linalg.solve(np.array([[g[a], g[b]], [t[a], t[b]]]), [9.0, torque])
                if (q >= 0).all() and (q <= top).all():
                    return True
        return False

    assert possible(given[1] * 0.9999)
    assert not any(possible(x) for x in np.linspace(given[1] * 1.0001, 0.6, 400))


def test_a_pair_stays_until_another_is_a_tenth_cheaper() -> None:
    def pairs(hysteresis: float) -> int:
        kept, changes = (-1, -1), 0
        for step in range(900):
            former = kept
            control = replace(ANY, hysteresis=hysteresis)
            kept = distribute(control, 0.002, 0.1 * step * DEG, 0.3, 0.02, former)[2]
            changes += kept != former
        return changes

    current, given, pair, _ = distribute(ANY, 0.002, 0.1, 0.3, 0.02)
    keeping = replace(ANY, hysteresis=9.0)
    others = [distribute(keeping, 0.002, 0.1, 0.3, 0.02, (a, b)) for a in range(6) for b in range(a + 1, 6)]
    dear = [o for o in others if o[2] != pair]
    assert dear
    for other in dear:  # a hysteresis of 9 keeps any pair that serves and costs up to ten times as much
        assert other[1] == pytest.approx(given)
        assert q_of(current).sum() < q_of(other[0]).sum() <= 10 * q_of(current).sum()
    assert pairs(0.3) <= pairs(0.0)


def test_the_demand_that_no_pair_serves_gets_its_force() -> None:
    current, given, _, flags = distribute(EACH, 0.01, 10 * DEG, 0.5, 0.0)
    assert flags == NO_PAIR
    assert given[0] == pytest.approx(0.5)
    assert np.count_nonzero(current) == 1
    assert current[3:].max() > 0  # stator 1 draws towards +x


def test_the_controller_takes_the_map_it_is_given() -> None:
    """With the machine's own map the cross force of a turning mover falls to what counts and lag leave."""
    control = replace(sine(ControlParams(), 1, 200 * DEG), offset=(4e-3, 0.0))

    def cross(taught: bool) -> float:
        known = replace(control, map=TYPICAL.map) if taught else control
        rows = flown(replace(TYPICAL, along_path=0.0), known, 10, (4e-3, 0.0))[5000:]
        return float(np.sqrt((column(rows, "force") ** 2).mean()))

    assert cross(True) < 0.8 * cross(False)
