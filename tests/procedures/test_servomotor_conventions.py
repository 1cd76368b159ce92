"""The servomotor's conventions are those of its rig file and of its telemetry, and of no other place."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bench.rigfile import load_rig
from bench.rigfile.roles import Status, bits
from procedures.servomotor.conventions import conventions, displacement, radial_currents, sensor_share

RIG = load_rig(Path("rigs/tsbs12.toml"))
PROCEDURES = Path("procedures")


def test_every_signal_and_lever_is_in_the_rig_file() -> None:
    machine = conventions(RIG)
    signals = {*machine.positions.values(), *machine.coils_of(*machine.coils), *machine.segments}
    assert signals <= set(RIG.channels)
    assert set(machine.levers) <= set(RIG.geometry)


def test_the_bits_are_those_of_the_dbc() -> None:
    told = re.search(r'CM_ SG_ 256 flags "bits: (.*?);', RIG.dbc_text)
    assert told
    meanings = dict(re.findall(r"(\d) ([^,]+)", told[1]))
    told_by = {1 << int(bit): text for bit, text in meanings.items()}
    assert {told_by[bit.mask or 0]: flag for flag, bit in bits(RIG).items()} == {
        "AMB amplifier at its limit": Status.CURRENT_LIMIT,
        "motor segment at its limit": Status.SEGMENT_LIMIT,
        "contact inboard": Status.CONTACT_NEAR,
        "contact outboard": Status.CONTACT_FAR,
    }
    assert conventions(RIG).contact == Status.CONTACT_NEAR | Status.CONTACT_FAR


def test_planes_are_between_the_sensors_and_beyond() -> None:
    assert [sensor_share(z, 0.1, 0.3) for z in (-0.1, 0.1, 0.3)] == pytest.approx([0.0, 0.5, 1.0])
    assert sensor_share(0.4, 0.1, 0.3) == pytest.approx(1.25)
    assert displacement(1e-6, 3e-6, 1.25) == pytest.approx(3.5e-6)
    l_is, l_os = (RIG.geometry[name].value for name in conventions(RIG).sensors)
    assert conventions(RIG).sensor_share(0.2, RIG) == sensor_share(0.2, l_is, l_os)


def test_radial_currents_undo_the_commutation() -> None:
    """(6.9): i_y to segment 1 and away from 3, i_x to 4 and away from 2, the torque current to all."""
    i_x, i_y, torque = 0.7, -1.3, 0.4
    found = radial_currents(torque + i_y, torque - i_x, torque - i_y, torque + i_x)
    assert found == pytest.approx((i_x, i_y))


@pytest.mark.parametrize("room", ["amb_calibration", "force_constant", "negative_stiffness", "force_coupling",
                                  "torque_constant", "spindown", "angle_step", "slew", "force_map"])  # fmt: skip
def test_procedures_name_no_signal_by_themselves(room: str) -> None:
    """What `requires` declares comes from the same place; a parameter or a result may be called like a current (i_y)."""
    for path in (PROCEDURES / room).glob("*.py"):
        named = re.findall(r"\"(?:i_[xy][io]_[pn]|i_m[1-4]|pos_[xy][io])\"", path.read_text(encoding="utf-8"))
        assert not named, f"{path}: {named}"
