"""What a rig file calls its places: where a quantity may be measured."""

from __future__ import annotations

from bench.rigfile.model import RigFile

COORDINATES = ("x", "y", "z", "psi", "theta")
"""Directions of the shaft's motion, which every rig has."""


def places_named(rig: RigFile) -> tuple[str, ...]:
    """Axes, bearings, probes and the other parts, the shaft's ends, and the coordinates of its motion."""
    tables = (rig.bearings, rig.probes, rig.rings, rig.balancing, rig.hooks, rig.levers, rig.motors, rig.encoders)
    axes = (axis for bearing in rig.bearings.values() for axis in bearing.axes)
    names = (name for table in tables for name in table)
    ends = () if rig.shaft is None else (rig.shaft.near_end, rig.shaft.far_end)
    return tuple(dict.fromkeys(name for name in (*axes, *names, *ends, *COORDINATES) if name))
