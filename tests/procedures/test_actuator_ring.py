"""What turns by a ring that is put on it: the ratio by hand, the whole path against the drawn machine, rings that are not
there, are others or slip, refusals."""

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
from bench.rigfile import load_rig
from bench.uncertainty import Estimate, Influence, interval
from procedures.actuator_constant import checks, fit, ring
from procedures.actuator_constant.estimates import Looked, Result
from procedures.actuator_constant.plan import Plan
from procedures.actuator_constant.procedure import INERTIA, check, left_out, procedure, steps_on, untold
from procedures.actuator_constant.sines import Place
from reports.figures import draw as draw_figure

RIG = load_rig("lira")
QUICK: dict[str, Any] = {
    "added_inertia": True,
    "loops": "around",
    "pairs": 3,
    "lines": 5,
    "record_s": 0.3,
    "settle_s": 0.5,
}
HZ = np.geomspace(30, 87, 7)


def run(folder: Path, truth: Mapping[str, float] | None = None, **plan: Any) -> Simulated:
    path = folder / "recording.mcap"
    return simulated_run("actuator-constant", "lira", 1, {**QUICK, **plan}, path, {"reduced": 1.0, **(truth or {})})


def values(done: Simulated) -> dict[str, Measured]:
    return {f"{r.quantity.name}@{r.where}": r for r in done.results if isinstance(r, Measured)}


def wrong(done: Simulated) -> dict[str, Finding]:
    return {r.code: r for r in done.results if isinstance(r, Finding) and r.effect is not Effect.NOTE}


def half(m: Measured) -> float:
    i = interval(m.estimate)
    return (i.high - i.low) / 2


# By hand.


def noisy(value: float, name: str, u: float = 1e-3) -> Estimate:
    return Estimate.of(value, Influence(name, name, u * value, "", "A", "normal"))


def test_the_inertia_by_hand() -> None:
    """K 0.42 N m/A on 1.5e-3 kg m^2, on 2.26e-3 with the ring; both noises, 0.1 %, count (p, q)/(p - q) = 2.97 times."""
    k, j, r = 0.42, 1.5e-3, RIG.machine["ring_inertia"].value
    (found,) = ring.inertias([{"RA1": noisy(k / j, "p")}], [{"RA1": noisy(k / (j + r), "q")}], RIG)
    assert found.value == pytest.approx(j, rel=3e-6)  # m e^2 of 29 um: 2.5e-10
    times = (j + r) / r
    by = found.contributions
    assert abs(by["p"]) == pytest.approx(1e-3 * j * times, rel=1e-4)
    assert abs(by["q"]) == pytest.approx(1e-3 * j * times, rel=1e-4)
    assert by["machine/ring_inertia"] == pytest.approx(5e-4 * j, rel=1e-4)


def test_a_gain_of_the_currents_falls_out_of_the_inertia() -> None:
    gain = noisy(1.0, "gain", 0.01)
    p, q = Estimate.exact(280.0) * gain, Estimate.exact(186.0) * gain
    (found,) = ring.inertias([{"RA1": p}], [{"RA1": q}], RIG)
    assert abs(found.contributions.get("gain", 0.0)) < 1e-12 * found.value


def test_what_a_ring_off_the_axis_adds() -> None:
    """m (a^2/3) on average of a rectangle to a, and a^2 sqrt(4/45) of spread."""
    a, kg = 50e-6, RIG.machine["ring_mass"].value
    found = ring.added(RIG)
    assert found.value - RIG.machine["ring_inertia"].value == pytest.approx(kg * a**2 / 3, rel=1e-6)
    assert found.contributions["machine/ring_eccentricity/square"] == pytest.approx(
        kg * a**2 * math.sqrt(4 / 45), rel=1e-9
    )


def test_a_ring_that_makes_no_difference_is_none() -> None:
    with pytest.raises(ring.NotSeen, match="was it mounted"):
        ring.inertias([{"RA1": noisy(280.0, "p")}], [{"RA1": noisy(279.0, "q")}], RIG)


# The whole path.


def test_a_drawn_machine_is_within_its_intervals(tmp_path: Path) -> None:
    done = run(tmp_path)
    assert wrong(done) == {}
    found, true = values(done), truth_of_motion(done)
    assert set(found) == set(true)
    assert len(found) == 7
    for name, m in found.items():
        assert abs(m.estimate.value - true[name]) < 2 * half(m), name
    stated = RIG.machine["polar_inertia"].half_width
    assert stated is not None
    assert half(found["inertia@gamma"]) < stated / 3
    assert half(found["K_torque@RA1"]) < 0.007 * found["K_torque@RA1"].estimate.value
    for name in ("inertia@gamma", "K_torque@RA1", "K_torque@RA2"):
        assert "machine/polar_inertia" not in found[name].estimate.contributions
    assert touched(done) == ["approach", "mount ring", "approach", "mount "]
    figures = list(procedure.figures(procedure.evaluated(done.recording).result, done.recording))
    assert [f.key for f in figures] == ["constant-gamma", "constant-gamma-ring"]
    assert all(draw_figure(f) for f in figures)
    assert math.isclose(figures[1].lines[1][1], 1.45e-3 / (1.45e-3 + 7.6e-4), rel_tol=0.02)


def touched(done: Simulated) -> list[str]:
    """What was asked of the operator, and that the DC link was seen below its bound before."""
    events = [e for e in done.recording.events() if e["kind"] in ("approach", "operator")]
    return [f"{e['action']} {e['part']}" if e["kind"] == "operator" else e["kind"] for e in events]


def test_a_ring_that_is_not_on(tmp_path: Path) -> None:
    done = run(tmp_path, {"ring_missing": 1.0}, added_A=0.0)
    assert set(wrong(done)) == {"part-not-seen"}
    assert values(done) == {}


def test_another_ring_contradicts_the_rig_file(tmp_path: Path) -> None:
    told = wrong(run(tmp_path, {"ring_other": 0.06, "machine.polar_inertia": 1.45e-3}, added_A=0.0))
    assert set(told) == {"inertia-contradicted"}
    assert told["inertia-contradicted"].concerns == ("K_torque@RA1", "K_torque@RA2", "@gamma", "inertia@gamma")


def test_a_ring_that_slips(tmp_path: Path) -> None:
    """At the slow lines it goes along, at the fast ones it does not."""
    assert "misfit" in wrong(run(tmp_path, {"ring_grip": 0.05}, added_A=0.0))


# Checks.


def looked(name: str, j: float, slope: float = 1.8, u: float = 1e-3) -> Looked:
    w = 2 * np.pi * HZ
    response = fit.response(HZ, (-j * w**2 + slope + 1j * w * 1e-3) / 0.42, np.full(7, u))
    return Looked(
        Place(name, "ref_gamma", 0.0), [], [], response, {"RA1": noisy(0.21 / j, name), "RA2": noisy(0.21 / j, name)}
    )


def told(bare: Looked, ringed: Looked, inertia: float) -> list[str]:
    j = noisy(inertia, "j", 2e-3)
    result = Result("gamma", [bare], None, {("inertia", "gamma"): j}, [ringed], [j])
    return [f.code for f in checks.of_results([result], RIG, Plan(added_inertia=True))]


def test_nothing_but_the_inertia_changes() -> None:
    bare = looked("0", 1.45e-3)
    assert told(bare, looked("0 with the ring", 2.21e-3), 1.45e-3) == []
    assert told(bare, looked("0 with the ring", 2.21e-3, slope=1.83), 1.45e-3) == ["changed-with-ring"]


@pytest.mark.parametrize(
    ("share", "code"), [(1.027, []), (1.03, ["inertia-contradicted"]), (0.97, ["inertia-contradicted"])]
)
def test_the_rig_file_s_inertia_is_held_against_it(share: float, code: list[str]) -> None:
    """2.07 % of tolerance, and four standard uncertainties of 0.2 %."""
    assert told(looked("0", 1.45e-3), looked("0 with the ring", 2.21e-3), share * 1.45e-3) == code


# Before the start.


def test_refusals() -> None:
    assert list(check(RIG, Plan(added_inertia=True))) == []
    assert steps_on(RIG, Plan(added_inertia=True)) == steps_on(RIG, Plan()) + 2 * 7
    assert "loops = 'along'" in next(iter(check(RIG, Plan(added_inertia=True, loops="along"))))
    lean = RIG.model_copy(update={"machine": {k: v for k, v in RIG.machine.items() if k != "ring_mass"}})
    assert "machine: found no ring_mass" in next(iter(check(lean, Plan(added_inertia=True))))
    heavy = {**RIG.machine, "ring_mass": replace_value(RIG.machine["ring_mass"], 0.7)}
    assert "0.7 kg" in next(iter(check(RIG.model_copy(update={"machine": heavy}), Plan(added_inertia=True))))
    alone = RIG.model_copy(update={"devices": {"controller": RIG.devices["controller"]}})
    assert "role operator" in next(iter(check(alone, Plan(added_inertia=True))))


def replace_value(number: Any, value: float) -> Any:
    return number.model_copy(update={"value": value}) if hasattr(number, "model_copy") else replace(number, value=value)


def test_which_quantities_there_are() -> None:
    assert INERTIA in left_out(Plan())
    assert INERTIA not in left_out(Plan(added_inertia=True))
    assert untold(RIG) == ()
    none = RIG.model_copy(update={"machine": {k: v for k, v in RIG.machine.items() if k != "ring_inertia"}})
    assert untold(none) == (INERTIA,)
