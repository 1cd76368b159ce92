"""What it needs of a rig, and what it reads of it."""

from __future__ import annotations

from bench.procedure.requires import Requires
from bench.rigfile import RigFile
from bench.rigfile.roles import STATUS
from procedures.amb_calibration import turns
from procedures.amb_calibration.pulls import channels, pulls


def requires(rig: RigFile) -> Requires:
    """By the rig file's tables."""
    found = pulls(rig)
    return Requires(
        lacks=tuple(turns.lacks(rig)),
        roles=("levitation", "operator"),
        channels=(*channels(rig), STATUS),
        sensors=tuple(dict.fromkeys(coil for pull in found for axis in pull.axes for coil in axis.coils)),
        parameters=turns.parameters(rig),
        capabilities=("bias",),
        masses=True,
        uses=("angle",),
    )
