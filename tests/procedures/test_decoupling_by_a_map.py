"""Decoupling by a map that the controller is given: what is refused before anything starts, what is written and when, that the
machine's own map takes the cross force off and another machine's does not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from bench.calibration import Calibration
from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import Unfit
from bench.procedure import Measured
from bench.rigfile import RigFile, load_rig
from bench.uncertainty import Estimate, interval
from procedures.decoupling.plan import Plan
from procedures.decoupling.procedure import check, foresees, needs, procedure
from procedures.stages import map_model
from procedures.static_characteristics.procedure import procedure as cells
from sim_backend.machines.rlsrm.params import ControlParams
from sim_backend.machines.rlsrm.truth_map import of_map
from sim_backend.truth import draw

RIG = load_rig("rlsrm")
GIVEN = Plan(model="inductance-map")
FORCE, EXCURSION = "cross_force@x while angle", "excursion@x while angle"


@cache
def own_map(seed: int) -> Calibration:
    """What `inductance-map` would find on a virtual rig, exactly: what its readings make of the drawn map."""
    true = of_map(RIG, draw(RIG, seed))
    values = {f"{name}@{where}" if where else name: Estimate.exact(value) for (name, where), value in true.items()}
    return Calibration(
        "inductance-map", values, rig="rlsrm", uut="SIM-0019", seed=seed, run_id=f"map-{seed}", sha256="0" * 64
    )


def given_of(seed: int) -> Mapping[str, float]:
    return map_model.identified(RIG, "inductance-map", {"inductance-map": own_map(seed)})


def crossed(folder: Path, given: Calibration | None, seed: int = 6) -> tuple[Simulated, Mapping[str, Estimate]]:
    plan = {"periods": 4, "nudges": 2, "moved": "angle", "model": "default" if given is None else given.procedure}
    known = {} if given is None else {given.procedure: given}
    path = folder / f"{given.run_id if given else 'default'}.mcap"
    done = simulated_run("decoupling", "rlsrm", seed, plan, path, calibrations=known)
    return done, {f"{r.quantity.name}@{r.where}": r.estimate for r in done.results if isinstance(r, Measured)}


def test_every_parameter_of_the_map_has_its_quantity() -> None:
    told = map_model.expected(RIG, "inductance-map")
    assert set(told) == {name for name in RIG.parameters if name.startswith(("map_", "current_zero_"))}
    assert {q for _, q in told.values()} <= set(own_map(2).values)
    nominal = ControlParams().map
    assert {name: RIG.parameters[name].default for name in ("map_slope", "map_saturation", "map_gain_6")} == {
        "map_slope": nominal.slope, "map_saturation": nominal.saturation, "map_gain_6": nominal.gain[5]}  # fmt: skip


def test_a_map_is_needed_where_one_is_to_be_given() -> None:
    assert needs(Plan()) == ()
    (need,) = needs(GIVEN)
    assert (need.procedure, need.optional, need.told) == ("inductance-map", False, True)


def test_a_map_by_load_cells_has_leakage_and_zeros_of_currents_by_the_pulses() -> None:
    told = map_model.expected(RIG, "static-characteristics")
    assert set(told) == set(map_model.expected(RIG, "inductance-map"))
    assert told["map_gain_4"] == ("static-characteristics", "static_gain@A2")
    assert told["map_zero_2"] == ("static-characteristics", "static_zero@stator2")
    assert told["map_leakage"] == ("inductance-map", "leakage")
    assert told["current_zero_6"] == ("inductance-map", "current_zero@C2")
    by_cells = {q.partition("@")[0] for procedure, q in told.values() if procedure == "static-characteristics"}
    assert by_cells <= {q.name for q in cells.measures}
    assert [n.procedure for n in needs(Plan(model="static-characteristics"))] == [
        "static-characteristics",
        "inductance-map",
    ]


def test_a_map_that_is_not_whole_or_beyond_its_ranges_is_refused() -> None:
    """Half of a map beside half of another is none; 0.12 rad is no zero of a stator."""
    whole = own_map(2)
    assert not [*foresees(RIG, GIVEN, {"inductance-map": whole})]
    without = replace(whole, values={n: e for n, e in whole.values.items() if n != "gain@B2"})
    (line,) = foresees(RIG, GIVEN, {"inductance-map": without})
    assert line == "model: map-2 holds no gain@B2; expected all that the controller has"
    far = replace(whole, values={**whole.values, "zero@stator2": Estimate.exact(0.12)})
    (line,) = foresees(RIG, GIVEN, {"inductance-map": far})
    assert "map_zero_2" in line
    assert "0.12" in line
    with pytest.raises(Unfit, match="map_zero_2"):
        procedure.refuse_by(RIG, GIVEN, [far])


def test_a_controller_without_a_map_cannot_be_given_one() -> None:
    without = {k: v for k, v in RIG.capabilities.model.items() if k != "map_centre"}
    rig: RigFile = RIG.model_copy(update={"capabilities": RIG.capabilities.model_copy(update={"model": without})})
    assert not [*check(rig, Plan())]
    assert [*check(rig, GIVEN)] == [
        "model: capabilities.model: found no map_centre; expected the controller's map of inductances"
    ]


def test_the_machines_own_map_takes_the_cross_force_off_and_anothers_does_not(tmp_path: Path) -> None:
    """Written at rest, after homing, each of 24 parameters once; what is told is what the machine does."""
    _, before = crossed(tmp_path, None)
    done, after = crossed(tmp_path, own_map(6))
    _, wrong = crossed(tmp_path, own_map(3))
    written = {e["name"]: e for e in done.recording.events("parameter") if e["name"].startswith(("map_", "current_"))}
    assert {name: e["value"] for name, e in written.items()} == {
        name: pytest.approx(value, rel=1e-6) for name, value in given_of(6).items()
    }
    assert done.recording.calibration("inductance-map").run_id == "map-6"
    assert after[FORCE].value < before[FORCE].value / 5
    assert after[EXCURSION].value < before[EXCURSION].value
    assert wrong[FORCE].value > before[FORCE].value
    true = truth_of_motion(done)
    for name, estimate in after.items():
        assert abs(estimate.value - true[name]) < 1.5 * interval(estimate).U, (name, estimate.value, true[name])
