"""The truth of a rig's twin that turns: what its shaft does once in a turn and how far it goes, without noise and rounding.

A probe's reading without its zero, over its gain and less the runout that passes it, is the shaft's centre where it stands and
along it. Angles count from the once-per-turn mark, in the sense of the speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.twin.layout import layout_of
from sim_backend.machines.twin.params import TwinParams
from sim_backend.machines.twin.plant import TwinPlant
from sim_backend.machines.twin.quiet import floating, turn
from sim_backend.motion import Whirl

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
ORDERS = (1.0, 2.0, 3.0, 4.0)
LOOKED_S, SETTLE_S = 0.5, 5.0


class Turning:
    """A machine that turns under settings of its controller, seen by the probes of `channels`, two for each plane."""

    def __init__(
        self, rig: RigFile, drawn: Truth, settings: Mapping[str, float], speed: float, channels: Sequence[str]
    ) -> None:
        self.plant: TwinPlant = floating(rig, drawn, settings, speed, SETTLE_S).plant
        p = self.plant.params
        by_channel = {rig.probes[name].channel: k for k, name in enumerate(layout_of(rig).probes)}
        self._k = [by_channel[channel] for channel in channels]
        names = [name for name, _ in p.names.ticks]
        self._columns = [names.index(channel) for channel in channels]
        told = np.array(p.position_sign)[self._k] * np.array(p.position_gain)[self._k]
        self._zero = (np.array(p.position_sign) * np.array(p.position_offset))[self._k]
        self._told = told

    def at(self, speed: float, settle_s: float) -> None:
        """Go to another speed, rad/s, at once."""
        turn(self.plant, speed)
        self.plant.run(round(settle_s / self.plant.tick_s))

    def seen(self, seconds: float = LOOKED_S) -> tuple[Complex, Array]:
        """Of the shaft's centre along each probe: means and vectors of ORDERS, (5, n) m with the means first."""
        plant = self.plant
        begin = float(plant.state()["s"][5])
        trace = plant.run(round(seconds / plant.tick_s), 1)[1][:, self._columns]
        end = float(plant.state()["s"][5])
        angle = begin + (end - begin) * np.arange(len(trace)) / len(trace)
        whole = len(trace) if abs(end - begin) < 2 * np.pi else int(
            np.searchsorted(angle - begin, 2 * np.pi * np.floor((angle[-1] - begin) / (2 * np.pi)))
        )  # fmt: skip
        angle, trace = angle[:whole], trace[:whole]
        read = (trace - self._zero) / self._told - _runout(plant.params, angle)[:, self._k]
        phi = angle + plant.params.pulse_angle
        waves = np.exp(1j * np.outer(ORDERS, phi))
        design = np.vstack([np.ones(whole), waves.real, -waves.imag]).T
        fitted = np.linalg.lstsq(design, read, rcond=None)[0]
        return fitted[1 : 1 + len(ORDERS)] + 1j * fitted[1 + len(ORDERS) :], fitted[0]

    def across(self, values: Array, pair: slice) -> Array:
        """Displacements along the two probes of a plane, (2, n), as ones at right angles."""
        ways = np.array(self.plant.params.probe).reshape(8, 16)[:2, self._k[pair]].T
        return np.asarray(np.linalg.solve(ways, values))


def whirl(rig: RigFile, drawn: Truth, settings: Mapping[str, float], speed: float, channels: Sequence[str]) -> Whirl:
    """At `speed` rad/s, its integrators at rest."""
    turning = Turning(rig, drawn, settings, speed, channels)
    vectors, means = turning.seen()
    around = np.linspace(0, 2 * np.pi, 721)
    shaft = means[:, None] + sum(
        (v[:, None] * np.exp(1j * n * around)).real for n, v in zip(ORDERS, vectors, strict=True)
    )
    pairs = [slice(k, k + 2) for k in range(0, len(channels), 2)]
    far = tuple(float(np.hypot(*turning.across(shaft[pair], pair)).max()) for pair in pairs)
    least = min(drawn.plant.clearance[: drawn.plant.rings])
    return Whirl(vectors[0], far, (least,) * len(pairs))


def _runout(p: TwinParams, angle: Array) -> Array:
    """Of every probe at the shaft's angles (n,), (n, probes) m."""
    rows = np.zeros((len(angle), 16))
    for n in range(4):
        rows += np.outer(np.cos((n + 1) * angle), p.runout_c[16 * n : 16 * n + 16])
        rows += np.outer(np.sin((n + 1) * angle), p.runout_s[16 * n : 16 * n + 16])
    return rows
