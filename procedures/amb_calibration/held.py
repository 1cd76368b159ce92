"""Where the controller holds the shaft along the axes that a pull loads, which is at zero once it has settled.

Four probes can all be brought to zero. More of them cannot: six probes with zeros of their own on the four motions of a shaft
differ by constants that no integrator takes away. A controller then holds either what all of them say together, the least
squares at each axis, or what the axes' own probes read; which of the two it is, nobody states.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from procedures.amb_calibration.pulls import Pull
from procedures.amb_rotor.stations import stations

Array = npt.NDArray[np.float64]


def held(rig: RigFile, pull: Pull, mean: Mapping[str, Array], further: tuple[str, ...]) -> dict[str, Array]:
    """Mean positions along the axes by the channels of their own probes, m: as these read, or at the axes by all probes, if
    there are `further` ones and that is nearer to zero in the worst step."""
    own = {axis.position: mean[axis.position] for axis in pull.axes}
    if not further:
        return own
    s = stations(rig)
    by_all = np.array([s.axes[axis.name].row for axis in pull.axes]) @ np.linalg.pinv(s.reads)
    at = np.tensordot(by_all, np.stack([mean[c] for c in s.channels]), axes=1)
    return min(own, dict(zip(own, at, strict=True)), key=_worst)


def _worst(position: Mapping[str, Array]) -> float:
    return max(float(np.abs(x).max()) for x in position.values())
