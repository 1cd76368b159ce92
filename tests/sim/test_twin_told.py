"""What a truth is told of a twin acts: no name is taken and does nothing, and what is said is not drawn anew."""

from __future__ import annotations

import math
from fnmatch import fnmatch
from pathlib import Path

import pytest
from twin_rigs import HUNG, ROOT, STAND, TOP, column, levitated, number, plant_of, rig

from bench.rigfile import RigFile, load_rig
from sim_backend.core import DriveLaw
from sim_backend.machines.table import machine_of
from sim_backend.machines.twin.operator import Fitter
from sim_backend.truth import draw
from sim_backend.unspoken import unspoken

EXAMPLES = ("plain-stand/stand.toml", "vertical-spindle/spindle.toml")
# Of who works on it, of the air, of the drive and of the controller's messages; and lengths that a rule of another number asks
# for, which a drawn machine does not move.
ELSEWHERE = (
    "shaft.ends.*", "shaft.runout", "site.air_density", "geometry.haken_bis_vorn", "masses.*", "mass_density", "hanger",
    "hook_seat", "hand_angle", "balancing.*", "drive_*", "pulse_angle", "loose_*", "weight_*", "hum_hz", "hum_probe",
    "hanger_off_at_zero", "drop_fraction", "dead_after_s", "*fault_after_s", "mass_error_*", "reading.*", "factor_*",
)  # fmt: skip


@pytest.mark.parametrize("path", EXAMPLES)
def test_every_name_of_the_truth_acts(path: str) -> None:
    """In the parameters of the plant: noise, limits and gains of `[simulation]`, which nothing draws, did nothing."""
    r = load_rig(str(Path(ROOT) / "examples" / path))
    base, inert = draw(r, 1), set()
    for table in (base.values, base.defects):
        for name, value in table.items():
            if not any(fnmatch(name, other) for other in ELSEWHERE):
                moved = draw(r, 1, {name: 1.03 * value if value else 0.37})
                inert |= {name} if moved.plant == base.plant and moved.quantities == base.quantities else set()
    assert inert == set()


def test_a_number_of_the_simulation_leaves_what_was_drawn() -> None:
    r = load_rig(str(Path(ROOT) / "examples" / EXAMPLES[0]))
    base, noisy = draw(r, 3), draw(r, 3, {"position_noise": 5e-6})
    assert noisy.plant.position_noise[:4] == (5e-6,) * 4
    assert {k: v for k, v in noisy.values.items() if v != base.values[k]} == {"position_noise": 5e-6}
    assert noisy.plant.control == base.plant.control
    slow = draw(r, 3, {"integrator_factor": 0.5}).plant.control
    assert slow.ki == pytest.approx([0.5 * k for k in base.plant.control.ki])
    assert slow.kp == base.plant.control.kp


def test_seats_and_weights_that_are_told_are_not_drawn_anew() -> None:
    seat = number(0, "mm", 0.2)
    r = rig("told", (*STAND, *HUNG), hung=2.0, top=TOP.replace(number(0, "mm"), seat))
    stations = []
    for told in ({}, {"hook_seat": 2e-4}):
        t = draw(r, 3, told)
        plant, seen = plant_of(t), []
        fitter = Fitter(r, plant, t)
        for line in ("hang M1", "hang -", "hang M1"):
            assert fitter.request(line).startswith("ok")
            plant.run(5000)
            load = plant._s.load
            seen.append(math.hypot(load[3], load[4]) / math.hypot(load[1], load[2]))
        stations.append(seen)
    drawn, fixed = stations
    assert max(fixed) - min(fixed) < 1e-12
    assert max(drawn) - min(drawn) > 1e-6
    spindle = load_rig(str(Path(ROOT) / "examples" / EXAMPLES[1]))
    t = draw(spindle, 3, {"balancing.lower.weight_mass": 1e-4})
    plant = plant_of(t)
    Fitter(spindle, plant, t).request("attach lower 1e-3 0")
    radius = t.values["balancing.lower.radius"]
    assert math.hypot(plant._s.weight_c[0], plant._s.weight_s[0]) == pytest.approx(1.1e-3 * radius)


def without_mark() -> RigFile:
    """A rig on registers' drive whose file has a channel for the speed and nothing of the mark that gives it."""
    path = Path(ROOT) / "tests/strangers/lento.toml"
    inside, kept = "", []
    for line in path.read_text(encoding="utf-8").split("\n"):
        inside = line if line.startswith("[") else inside
        if inside != "[mark]" and not line.startswith(("turns = {", "edge = {")):
            kept.append(line.replace("rpm = {", "speed = {"))
    return RigFile.parse("\n".join(kept), path.with_suffix(".dbc").read_text(encoding="utf-8"), "lento.toml")


def test_a_speed_is_told_without_a_mark() -> None:
    r = without_mark()
    assert r.mark is None
    assert [*unspoken(r, machine_of(r))] == []
    plant = levitated(draw(r, 1), 0.1)
    plant.drive(DriveLaw(5.0, 100.0, 1e6), 100.0)
    rows = plant.run(round(3.0 / plant.tick_s))
    assert column(plant, rows, "speed")[-1] == pytest.approx(100.0, rel=0.01)
    assert plant.speed == pytest.approx(100.0, rel=0.01)  # by which the controller lands it
