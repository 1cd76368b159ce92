"""A nudge of the lifted shaft tells whose currents answer it: exchanged coils of two axes and of two planes, by hand."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from bench.rigfile import load_rig
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.nudges import Nudge, judge

RIG = load_rig("examples/vertical-spindle/spindle.toml")
BIAS, ASKED = 2.0, 5e3  # A; A/m: the bias over a gap of 0.4 mm
LOWER, UPPER = -0.11, 0.125  # m from the centre of mass, of both bearings
WAYS = {"y": {"LowU": 1.0, "UppU": 1.0}, "theta": {"LowU": LOWER, "UppU": UPPER}}


def nudged(name: str, size: float, exchanged: Mapping[str, str]) -> Nudge:
    """The spindle, held by its coils as two like magnets ask; readings of `exchanged` axes' currents are each other's."""
    machine = conventions(RIG)
    moved = {axis: WAYS[name].get(axis, 0.0) * size for axis in machine.axes}
    column = {"y": 0, "theta": 3}[name]
    before = dict.fromkeys(machine.stations.channels, 0.0)
    after = {channel: placed.row[column] * size for channel, placed in machine.stations.probes.items()}
    for axis in machine.axes:
        p, n = machine.pair(axis)
        current = -ASKED * moved[exchanged.get(axis, axis)]
        before |= {p: BIAS, n: BIAS}
        after |= {p: BIAS + current, n: BIAS - current}
    return Nudge(name, size, before, after)


@pytest.mark.parametrize(
    ("exchanged", "where"),
    [
        ({}, set()),
        ({"LowU": "LowV", "LowV": "LowU"}, {"LowU"}),
        ({"UppU": "UppV", "UppV": "UppU"}, {"UppU"}),
        ({"LowU": "UppU", "UppU": "LowU", "LowV": "UppV", "UppV": "LowV"}, {"LowU", "UppU"}),
    ],
)
def test_currents_that_are_another_axis_s_are_told(exchanged: Mapping[str, str], where: set[str]) -> None:
    found = list(judge([nudged("y", 1e-5, exchanged), nudged("theta", 1e-4, exchanged)], RIG))
    assert {(f.code, f.where) for f in found} == {("coils-exchanged", axis) for axis in where}
