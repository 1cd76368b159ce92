"""What procedures ask for by what it is: readings of the mark and the status word, whatever channels and bits a rig has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_machine_tables import RIGS
from test_rigfile import changed

from bench.errors import Lacking
from bench.procedure.requires import Requires
from bench.rigfile import RigFile, load_rig
from bench.rigfile.roles import (
    AGE,
    ANGLE,
    EDGE,
    SPEED,
    STATUS,
    Status,
    answered,
    bits,
    edge_round_ns,
    read_now,
    resolved,
    whole_channels,
)
from bench.samples import TICKS

SPINDLE = str(Path(__file__).resolve().parent.parent / "examples/vertical-spindle/spindle.toml")


def rig(*changes: tuple[str, str], name: str = "amb5dof") -> RigFile:
    toml, dbc = RIGS[name]
    return RigFile.parse(changed(toml, *changes), dbc)


def test_a_role_is_read_from_the_channel_that_the_rig_binds() -> None:
    renamed = rig(('angle = "angle"', 'angle = "gamma"'), ("\nangle = { signal", "\ngamma = { signal"))
    assert resolved(renamed, (ANGLE, "pos_yi", SPEED)) == ("gamma", "pos_yi", "speed")
    samples = {"gamma": np.array([1.0, 2.0]), "pos_yi": np.array([3.0, 4.0]), "t_ns": np.array([0, 1])}
    told = answered(renamed, (ANGLE, "pos_yi"), samples)
    assert told.keys() == {ANGLE, "pos_yi", "t_ns"}
    assert told[ANGLE] is samples["gamma"]


def test_a_role_that_is_not_bound_is_lacking() -> None:
    with pytest.raises(Lacking, match="mark: found no channel for edge"):
        resolved(rig(), (EDGE,))
    assert Requires(channels=(EDGE, "pos_yi")).lacking(rig())[0] == "mark: found no channel for edge"


def test_the_status_word_is_made_of_the_bits_of_any_channels() -> None:
    """A mask of bits, a channel of its own that is not zero; ranges of the shipped rigs' own words by hand."""
    word = np.array([0.0, 1.0, 4.0, 2 + 8, 32 + 64, 16])
    said = answered(rig(), (STATUS,), {"flags": word})[STATUS]
    near, far, axial = Status.CONTACT_NEAR, Status.CONTACT_FAR, Status.CONTACT_AXIAL
    assert said.tolist() == [0, 1, near, Status.VOLTAGE_LIMIT | far, axial | Status.SENSOR_RANGE, 0]
    other = rig(('current_limit = { channel = "flags", mask = 1 }', 'current_limit = { channel = "pulses" }'))
    assert resolved(other, (STATUS,)) == ("pulses", "flags")
    told = answered(other, (STATUS,), {"flags": np.array([1.0, 4.0]), "pulses": np.array([0.0, 7.0])})[STATUS]
    assert told.tolist() == [0, near | Status.CURRENT_LIMIT]
    assert read_now(other, STATUS, {"flags": 0.0, "pulses": 2.0}) == Status.CURRENT_LIMIT


def test_the_servomotor_has_other_bits_for_the_same_meanings() -> None:
    said = answered(rig(name="tsbs12"), (STATUS,), {"flags": np.array([1.0, 2.0, 8.0])})[STATUS]
    assert said.tolist() == [Status.CURRENT_LIMIT, Status.SEGMENT_LIMIT, Status.CONTACT_FAR]


def test_a_controller_that_says_nothing_has_a_status_of_zeros() -> None:
    toml, dbc = RIGS["tsbs12"]
    begin, end = toml.index("[capabilities.status]"), toml.index("[parameters]")
    silent = RigFile.parse(toml[:begin] + toml[end:], dbc)
    assert bits(silent) == {}
    assert answered(silent, (STATUS,), {"pos_yi": np.zeros(3)})[STATUS].tolist() == [0, 0, 0]


def test_an_edge_is_as_old_as_both_clocks_say_however_often_they_came_round() -> None:
    """Ticks of 50 us in 24 bits, an edge in whole microseconds of 32 bits: after two hours the one came round eight times, the
    other once, and what was unwrapped since a bench listens began at no round. By hand: they share 2^25 us."""
    spindle = load_rig(SPINDLE)
    assert edge_round_ns(spindle) == 2**25 * 1000
    assert whole_channels(spindle) == {"MarkTime"}
    assert not whole_channels(rig()) | whole_channels(rig(name="tsbs12"))
    ticks = np.arange(144_000_000, 144_000_400, 10)  # two hours
    ages = np.linspace(0.0, 0.49, ticks.size)
    edge = np.floor((ticks * 5e-5 - ages) * 1e6) * 1e-6 % (2**32 * 1e-6)
    for heard in (ticks, ticks % 2**24, ticks - 3 * 2**24):
        said = answered(spindle, (AGE,), {"MarkTime": edge, TICKS: heard.astype(np.uint64)})
        assert said.keys() == {AGE, TICKS}
        assert np.abs(said[AGE] - ages).max() < 1.01e-6
    late = answered(spindle, (AGE,), {"MarkTime": ticks[:1] * 5e-5 % (2**32 * 1e-6) + 1e-6, TICKS: ticks[:1]})
    assert late[AGE][0] == pytest.approx(-1e-6, abs=1e-8)
