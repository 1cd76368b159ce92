"""Static force and torque by load cells: on readings that the readable reference made, planted errors, through the whole
path."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_figures import figures_drawn
from statics import SHORT, Cells, exchanged, taken

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.certificates import certified_numbers
from bench.rigfile.check_load_cells import problems_of
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate, interval
from procedures.shared.certificates import share_of
from procedures.static_characteristics import checks, estimates, fit
from procedures.static_characteristics.beside import by_flux, of_controller
from procedures.static_characteristics.estimates import Result
from procedures.static_characteristics.known import _share
from procedures.static_characteristics.model import MAP, Terms
from procedures.static_characteristics.plan import Plan
from procedures.static_characteristics.procedure import check, procedure
from procedures.static_characteristics.steps import Taken
from sim_backend.machines.rlsrm.params import PHASES, PlantParams

sys.path.insert(0, str(Path(__file__).parents[1] / "sim"))
from rlsrm_bench import drawn

RIG = load_rig("rlsrm")


def told(t: Taken, plan: Plan = SHORT) -> tuple[dict[str, Finding], Result | None]:
    found = [*checks.of_signals(t, RIG, plan)]
    if not found:
        found += checks.of_order(t, RIG)
    if any(f.effect is Effect.ERROR for f in found):
        return {f.code: f for f in found}, None
    result = estimates.result(t, RIG, max(plan.levels_A), of_controller(RIG, t.phases))
    found += [*checks.of_readings(t, plan), *checks.of_results(result, plan)]
    return {f.code: f for f in found}, result


def loud(found: Mapping[str, Finding]) -> set[str]:
    return {code for code, f in found.items() if f.effect is not Effect.NOTE}


MACHINE = replace(drawn(3), once=0.0)


@pytest.fixture(scope="module")
def sound() -> tuple[dict[str, Finding], Result]:
    found, result = told(taken(RIG, MACHINE))
    assert result is not None
    return found, result


def truth(p: PlantParams) -> dict[tuple[str, str], float]:
    m, mean, edge = p.map, float(np.mean(p.map.gain)), p.edge[1] * p.pitch[1]
    out = {("slope", ""): m.slope * mean, ("c2", ""): m.c2, ("c3", ""): m.c3, ("unaligned", ""): m.unaligned,
           ("length", ""): m.length, ("overlap", ""): m.overlap, ("fringe", ""): m.fringe, ("saturation", ""): m.saturation,
           ("centre", ""): m.centre, ("zero", "stator1"): m.zero[0] + edge, ("zero", "stator2"): m.zero[1] + edge,
           ("uneven", "cosine"): m.uneven * math.cos(m.uneven_phase + edge)}  # fmt: skip
    return out | {("gain", name): g / mean for name, g in zip(PHASES, m.gain, strict=True)}


def test_the_map_of_a_drawn_machine(sound: tuple[dict[str, Finding], Result]) -> None:
    found, result = sound
    assert loud(found) == set()
    off = {}
    for (name, where), value in truth(MACHINE).items():
        e = result.estimates[f"static_{name}", where]
        off[name, where] = (e.value - value) / e.u
    assert max(map(abs, off.values())) < 4, off
    assert np.sqrt(np.mean(np.square(list(off.values())))) < 1.6, off
    assert result.estimates["static_slope", ""].u < 2.5e-3
    assert result.estimates["held_angle", ""].value == pytest.approx(0.01, rel=0.01)
    assert result.estimates["reciprocity", ""].value == pytest.approx(1, abs=4 * result.estimates["reciprocity", ""].u)


def test_a_budget_has_certificates_as_the_rig_file_states_them(sound: tuple[dict[str, Finding], Result]) -> None:
    """An arm of 100 mm with u 0.05 mm, not a share of 5e-4: the same number in every budget that it enters."""
    stated = certified_numbers(RIG)
    found = {i.id: i for e in sound[1].estimates.values() for i in e.sensitivities if i.id in stated}
    assert {
        "geometry/torque_arm",
        "capabilities/load_cells/angle/give",
        "sensors/i_a1/offset",
        "encoders/x/pitch",
    } <= set(found)
    for name, i in found.items():
        assert (i.u, i.unit) == (pytest.approx(stated[name].standard_uncertainty, rel=1e-12), stated[name].unit), name
    torque = sound[1].estimates["torque", "A1"]
    (by_arm,) = (c * i.u for i, c in torque.sensitivities.items() if i.id == "geometry/torque_arm")
    assert (
        abs(by_arm) < 5e-4 * torque.value
    )  # of a torque by an arm that is off by 5e-4, less what the force's map tells


def test_both_cells_tell_one_field(sound: tuple[dict[str, Finding], Result]) -> None:
    """By hand: an arm that is 1 % longer makes the torque cell read 1 % less, and dT/dx over dF/da with it."""
    _, before = sound
    found, after = told(taken(RIG, MACHINE, Cells(arm=1.01)))
    assert {"cells-disagree"} <= loud(found)
    assert after is not None
    ratio = after.estimates["reciprocity", ""].value / before.estimates["reciprocity", ""].value
    assert ratio == pytest.approx(1 / 1.01, abs=2e-4)


@pytest.mark.parametrize(("of", "code"), [
    (Cells(gain=(1.01, 1.0)), "cells-disagree"), (Cells(cross=(0.03, 0.0)), "cells-cross"),
    (Cells(cross=(0.0, 0.03)), "cells-cross"),
    (Cells(give=(2e-6, 12e-3)), "cell-gives-way"), (Cells(gain=(-1.0, 1.0)), "cell-reversed"),
    (Cells(gain=(1.0, 0.0)), "cell-does-not-hold"), (Cells(rubs=(0.1, 0.3)), "friction-hides-load"),
])  # fmt: skip
def test_planted(of: Cells, code: str) -> None:
    found, _ = told(taken(RIG, MACHINE, of))
    assert code in loud(found)


@pytest.mark.parametrize("of", [Cells(zero=(50.0, -50.0)), Cells(drift=0.002), Cells(rubs=(2.0, 0.02))])
def test_what_is_taken_off(of: Cells, sound: tuple[dict[str, Finding], Result]) -> None:
    """Zeros, their drift, and friction of twice the bearing's are in no result."""
    _, before = sound
    found, after = told(taken(RIG, MACHINE, of))
    assert after is not None
    assert loud(found) - {"friction-hides-load"} == set()
    for name in ("static_slope", "static_saturation", "reciprocity"):
        one, other = before.estimates[name, ""], after.estimates[name, ""]
        assert abs(other.value - one.value) < 0.5 * one.u + 2e-4 * abs(one.value)


def test_phases_that_are_exchanged_and_signals() -> None:
    some = taken(RIG, MACHINE)
    found, _ = told(exchanged(some, 1, 2, len(SHORT.levels_A)))
    assert loud(found) == {"phase-elsewhere"}
    assert found["phase-elsewhere"].where == "C1"
    assert loud(told(replace(some, states=("HOLDING",)))[0]) == {"not-let-go"}
    assert loud(told(replace(some, loads=np.full_like(some.loads, np.nan)))[0]) == {"readings-missing"}
    assert loud(told(replace(some, currents=-some.currents))[0]) == {"sign-reversed"}
    assert "current-not-reached" in loud(told(replace(some, currents=0.7 * some.currents))[0])
    one = some.loads.copy()
    one[3, 4, 0, 0] *= 10
    assert "reading-far" in loud(told(replace(some, loads=one))[0])


def test_what_r_prints_of_force_does_not_fit(sound: tuple[dict[str, Finding], Result]) -> None:
    """R (9): i^2/2 dL/dx, which takes iron for linear, leaves residuals of seven times the size up to 5 A, and a slope that is
    10 % small."""
    _, r = sound
    t = estimates.start(r.rows, RIG, r.known)
    t[MAP.index("saturation")] = 1e4
    linear = [*r.known, fit.Known(MAP.index("saturation"), 1e4, 1.0, "linear")]
    found = fit.fitted(r.rows, t, linear)
    assert found.size > 5 * r.found.size
    assert found.terms[0] < 0.92 * r.estimates["static_slope", ""].value


def test_the_other_map_stands_beside(sound: tuple[dict[str, Finding], Result]) -> None:
    """By hand: a map whose inductance is 2 % small makes force and torque 2 % more than it says; certain ones are told
    apart."""
    _, r = sound
    terms, at = r.found.terms, Terms(len(r.rows.x))
    zeros = {"zero_1": "zero@stator1", "zero_2": "zero@stator2", "cosine": "uneven@cosine", "sine": "uneven@sine"}
    values = {zeros.get(n, n): Estimate.exact(float(v)) for n, v in zip(MAP, terms, strict=False)}
    values |= {
        f"gain@{p.name}": Estimate.exact(float(g)) for p, g in zip(r.phases, terms[at.each("gain")], strict=True)
    }
    values["slope"] = values["slope"] / 1.02
    other = by_flux(values, r.phases)
    assert other is not None
    told_by = estimates.beside_of(r.found, r.known, r.rows, other)
    assert told_by["force_ratio", ""].value == pytest.approx(1.02, rel=1e-9)
    assert told_by["torque_ratio", ""].value == pytest.approx(1.02, rel=1e-9)
    assert 1e-3 < told_by["force_ratio", ""].u < 5e-3
    pitch = RIG.encoders["x"].pitch
    assert isinstance(pitch, Toleranced)
    scale = share_of(
        "encoders/x/pitch", pitch
    )  # by hand: what the map has of the encoder's scale, the ratio has less of
    other = by_flux(values | {"slope": values["slope"] * scale}, r.phases)
    assert other is not None
    also = estimates.beside_of(r.found, r.known, r.rows, other)["force_ratio", ""]
    before, after = (e.contributions["encoders/x/pitch"] for e in (told_by["force_ratio", ""], also))
    assert after == pytest.approx(before - 1.02 * scale.u, rel=1e-3)
    assert by_flux({}, r.phases) is None


@pytest.mark.long
def test_the_whole_path(tmp_path: Path) -> None:
    """On a drawn rig, through operator, core and recording, beside the map by flux of the same machine."""
    flux = simulated_run("inductance-map", "rlsrm", 1, {}, tmp_path / "m.mcap").calibration()
    plan = {"angles_per_position": 2, "levels_A": (2.0, 5.0)}
    done = simulated_run(
        "static-characteristics", "rlsrm", 1, plan, tmp_path / "r.mcap", calibrations={"inductance-map": flux}
    )
    found = [r for r in done.results if isinstance(r, Finding)]
    assert [f.code for f in found if f.effect is not Effect.NOTE] == []
    true, off = truth_of_motion(done), {}
    for r in done.results:
        if isinstance(r, Measured) and (key := f"{r.quantity.name}@{r.where}" if r.where else r.quantity.name) in true:
            i = interval(r.estimate)
            off[key] = (r.estimate.value - true[key]) / (0.5 * (i.high - i.low))
    every = {(r.quantity.name, r.where) for r in done.results if isinstance(r, Measured)}
    assert {name for name, where in every if (f"{name}@{where}" if where else name) not in off} == {
        "held",
        "held_angle",
    }
    assert len(off) == 36
    one, other = (next(r.estimate for r in done.results if isinstance(r, Measured) and r.quantity.name == name).contributions
                  for name in ("static_slope", "force_ratio"))  # fmt: skip
    assert {i for i in {*flux.influences, *one, *other} if i.endswith("encoders/x/pitch")} == {"encoders/x/pitch"}
    assert sum(abs(v) > 1 for v in off.values()) <= 5, off
    assert max(map(abs, off.values())) < 2, off
    ratio = next(r.estimate for r in done.results if isinstance(r, Measured) and r.quantity.name == "force_ratio")
    assert abs(ratio.value - 1) < 3 * ratio.u < 0.02
    assert figures_drawn(done) == ["torque", "force"]


def test_a_cell_that_reads_the_other_way_is_as_uncertain() -> None:
    """The share of a gain of either sign, and its derivative by the gain's own unit."""
    for size in (1.01, -1.01):
        number = Toleranced(value=size, unit="1", half_width=0.01, distribution="rectangular", source="C")
        one = _share(0, number, "capabilities/load_cells/x/gain")
        assert (one.u, one.stated, one.per) == (pytest.approx(0.01 / 1.01 / 3**0.5), number.standard_uncertainty, size)
        (i,), (c,) = zip(*share_of(one.identity, number).sensitivities.items(), strict=True)
        assert (c * i.u, one.stated / one.per) == (pytest.approx(math.copysign(one.u, size)),) * 2


def test_refused() -> None:
    assert not [*check(RIG, Plan())]
    assert "levels_A" in " ".join(check(RIG, Plan(levels_A=(5.0, 2.0))))
    assert [*check(RIG, Plan(levels_A=(2.0, 7.0)))]
    assert [*check(RIG, Plan(positions_m=(-13e-3, 0.0, 20e-3)))]
    assert procedure.lacking(load_rig("tsbs12"))
    bare = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"load_cells": {}})})
    assert "load_cells" in " ".join(procedure.lacking(bare))


@pytest.mark.parametrize(("axis", "change", "key"), [
    ("x", {"channel": "nowhere"}, "channel"), ("x", {"channel": "supply"}, "channel"), ("x", {"unit": "deg"}, "unit"),
    ("x", {"arm": "geometry/torque_arm"}, "arm"), ("angle", {"arm": "geometry/none"}, "arm"), ("angle", {"arm": ""}, "unit"),
    ("y", {}, ""),
])  # fmt: skip
def test_cells_that_lead_nowhere(axis: str, change: Mapping[str, str], key: str) -> None:
    own = RIG.capabilities.load_cells
    cells = {**own, axis: own.get(axis, own["x"]).model_copy(update=dict(change))}
    rig = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"load_cells": cells})})
    found = [line[0] for line in problems_of(rig)]
    assert f"load_cells.{axis}" + (f".{key}" if key else "") in found
    assert not [*problems_of(RIG)]
