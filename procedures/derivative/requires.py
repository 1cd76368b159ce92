"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from procedures.one_axis.conventions import VELOCITY, conventions


def requires(rig: RigFile) -> Requires:
    """By the names that the rig's machine has."""
    machine = conventions(rig)
    points = (
        ()
        if machine.axis in machine.can.set_points.axes
        else ("capabilities.set_points.axes: found none for the axis",)
    )
    return Requires(
        lacks=points,
        channels=(machine.position, STATUS),
        capabilities=("injection", "settings.watched", "settings.rule", "settings.compensation", "model.degree",
                      "model.window", "model.harmonic_hz"),
        capture=(machine.position, VELOCITY),
    )  # fmt: skip
