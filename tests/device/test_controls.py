"""Which controls of a simulated plant the parameters of a rig file set."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bench.rigfile import RigFile, load_rig
from sim_backend.controller.controls import OWN, controls
from sim_backend.machines.amb5dof.machine import AMB5DOF
from sim_backend.machines.tsbs.machine import TSBS

MADE = replace(AMB5DOF, name="made", columns=lambda rig: tuple(rig.channels))
ROOT = Path(__file__).resolve().parents[2]


def test_parameters_of_the_machines_are_controls_of_their_own_names() -> None:
    for name, machine in (("tsbs12", TSBS), ("amb5dof", AMB5DOF)):
        rig = load_rig(name)
        assert {n: [c.name for c in chosen] for n, chosen in controls(rig, machine).items()} == {
            n: [n] for n in rig.parameters
        }


def test_a_machine_made_of_the_rig_file_takes_what_capabilities_bind() -> None:
    found = controls(load_rig("amb5dof"), MADE)
    names = {n: tuple(c.name for c in chosen) for n, chosen in found.items()}
    assert names["bias"] == ("bias.inboard", "bias.outboard")
    assert names["ref_theta"] == ("ref.shaft.theta",)
    assert set(names["kp"]) == {"kp.yi", "kp.zi", "kp.yo", "kp.zo", "kp.x"}
    assert (names["ellipse_on"], names["inject_amplitude"], names["slew"]) == (
        ("path.on",),
        ("inject.amplitude",),
        ("slew",),
    )
    assert names["watchdog_s"] == ("watchdog_s",)
    assert "watchdog_s" in OWN
    assert names["law"] == ("law",)  # nothing that the capabilities bind: by its own name, where the plant has that


def test_the_axis_of_an_injection_is_told_by_its_place_among_the_axes() -> None:
    text = (ROOT / "rigs" / "amb5dof.toml").read_text(encoding="utf-8")
    text = text.replace("axes = { yi = 0, zi = 1, yo = 2, zo = 3, x = 4 }", "axes = { zo = 5, yi = 2 }")
    dbc = (ROOT / "rigs" / "amb5dof.dbc").read_text(encoding="utf-8")
    rig = RigFile.parse(text, dbc)
    (axis,) = controls(rig, MADE)["inject_axis"]
    order = [a for b in rig.bearings.values() for a in b.axes]
    assert [axis.of(v) for v in (2.0, 5.0, -1.0, 0.0)] == [order.index("yi"), order.index("zo"), -1.0, -1.0]
