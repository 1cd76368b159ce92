"""Currents by which motors give force, as rig files bind them: what leads nowhere is told."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from bench.rigfile import RigFile, load_rig
from bench.rigfile.check_force_currents import problems_of

RIG = load_rig("lira")


def bound(motor: str = "LA", **changes: Any) -> RigFile:
    """The rig with one motor's current bound otherwise."""
    one = RIG.capabilities.force_currents["LA"].model_copy(update=changes)
    capabilities = RIG.capabilities.model_copy(update={"force_currents": {motor: one}})
    return RIG.model_copy(update={"capabilities": capabilities})


def test_the_rig_is_sound() -> None:
    assert list(problems_of(RIG)) == []


@pytest.mark.parametrize(
    ("changes", "key", "expected"),
    [
        ({"motor": "LB"}, "force_currents.LB", "a motor"),
        ({"loop": "w"}, "force_currents.LA.loop", "loop_injection.loops"),
        ({"current": "i_q_M"}, "force_currents.LA.current", "a channel"),
        ({"current": "z"}, "force_currents.LA.current", "in A"),
        ({"added": "ref_z"}, "force_currents.LA.added", "in A"),
        ({"period": "machine/pitch"}, "force_currents.LA.period", "the place of a number"),
        ({"period": "machine/mass"}, "force_currents.LA.period", "a length"),
        ({"along": "L_x"}, "force_currents.LA.along", "current_steps"),
        ({"zero": "kp.z"}, "force_currents.LA.zero", "in rad"),
        ({"feedforward": "ref_z"}, "force_currents.LA.feedforward", "in N or N m"),
    ],
)
def test_what_leads_nowhere(changes: dict[str, Any], key: str, expected: str) -> None:
    found = list(problems_of(bound(**changes)))
    assert found
    assert {k for k, _, _ in found} == {key}
    assert all(expected in text for _, _, text in found)


def test_a_zero_is_an_angle() -> None:
    stated = RIG.capabilities.force_currents["LA"].stated.model_copy(update={"unit": "m"})
    assert [k for k, _, _ in problems_of(bound(stated=stated))] == ["force_currents.LA.stated"]


def test_a_constant_is_force_or_torque_per_ampere() -> None:
    one = RIG.capabilities.force_currents["LA"]
    assert one.constant is not None
    constant = one.constant.model_copy(update={"unit": "N"})
    assert [k for k, _, _ in problems_of(bound(constant=constant))] == ["force_currents.LA.constant"]


def test_constants_are_what_the_simulation_draws() -> None:
    drawn = {"LA": "force_constant", "RA1": "torque_constant_1", "RA2": "torque_constant_2"}
    for motor, name in drawn.items():
        stated, told = RIG.capabilities.force_currents[motor].constant, RIG.simulation[name]
        assert stated is not None
        assert (stated.value, stated.half_width, stated.unit) == (told.value, told.half_width, told.unit)


def test_zeros_and_pitch_are_what_the_simulation_draws() -> None:
    """A budget with another tolerance than the drawn machine's would be too wide or too narrow."""
    drawn = {"LA": "zero_la", "RA1": "zero_ra1", "RA2": "zero_ra2"}
    for motor, name in drawn.items():
        zero, told = RIG.capabilities.force_currents[motor].stated, RIG.simulation[name]
        assert zero.unit == "rad"
        assert (zero.value, zero.half_width, zero.distribution) == (told.value, told.half_width, told.distribution)
        assert zero.half_width is not None
        assert zero.half_width < math.radians(3)
    assert RIG.machine["pair_pitch"].value == RIG.simulation["pair_pitch"].value


def test_a_rig_file_says_where(tmp_path: Path) -> None:
    """Through the whole check of a file."""
    for name in ("lira.toml", "lira.dbc"):
        text = (Path("rigs") / name).read_text(encoding="utf-8")
        (tmp_path / name).write_text(
            text.replace('period = "machine/pair_pitch"', 'period = "machine/pitch"'), encoding="utf-8"
        )
    with pytest.raises(Exception, match=r"force_currents\.LA\.period"):
        load_rig(str(tmp_path / "lira.toml"))
