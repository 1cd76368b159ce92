"""What the probes of a shaft are like."""

from __future__ import annotations

import numpy as np

from bench.rigfile import RigFile
from bench.rigfile.supports import once_per_rig
from procedures.amb_rotor.conventions import conventions

ALIKE = 1e-6  # of a cosine


@once_per_rig
def is_plain(rig: RigFile) -> bool:
    """Whether there are four probes, which look the same two ways at both bearings, each so that it grows along its axis."""
    machine = conventions(rig)
    if not machine.probed or len(machine.stations.channels) > len(machine.axes):
        return False
    near, far = (
        np.array([machine.stations.probes[machine.positions[k]].row[:2] for k in pair])
        for pair in machine.planes.values()
    )
    return bool(np.allclose(near, far, rtol=0, atol=ALIKE))
