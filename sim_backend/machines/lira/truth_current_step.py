"""What the machine's stepped currents truly do: the machine as it was drawn, with the gains and the late instants of the
sensors that its loops work with, but without noise, rounding and ripple. By a spline through every tick, and so by another way
than a procedure.

Where a step comes to rest is its reference: the loops integrate. A position loop that moves another current's reference
meanwhile works in the truth as it does in the run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from bench.rigfile import RigFile
from sim_backend.machine import Truth
from sim_backend.machines.lira.params import ControlParams, PlantParams
from sim_backend.machines.lira.plant import TICKS_S, TRACE, Plant, ideal
from sim_backend.machines.lira.settings import SETTINGS
from sim_backend.motion import CurrentAsked

Array = npt.NDArray[np.float64]
FALL_S, CALM_S = 0.5, 0.5
"""For the mover to lie still, and for the loops of z and of the angle to hold it."""
REST_S: Final = 0.06
"""After which a step has come to rest."""
MINUS_3_DB: Final = 2**-0.5


class Stepped:
    """A machine whose current loops are on, its mover at rest.

    Args:
        params: of the plant as drawn.
        control: the firmware's parameters.
        angle: at which the mover is held, rad.
        factors: planted in the firmware, as `Plant` has them.
    """

    def __init__(
        self,
        params: PlantParams,
        control: ControlParams,
        angle: float = 0.0,
        factors: Mapping[str, float] | None = None,
    ) -> None:
        self._plant = Plant(ideal(params), 0, control=control, factors=factors)
        self._plant.run(FALL_S, 0)
        self._plant.put(angle=angle, angle_rate=0.0)
        self._plant.run(1e-4, 0)  # it is held where it was read last
        for command in ("idle", "on"):
            self._plant.command(command)
        self._calm(CALM_S)

    @property
    def angle(self) -> float:
        """At which the mover is, rad."""
        return float(self._plant.place[5])

    def step(self, name: str, size: float) -> tuple[Array, Array]:
        """The currents along and across (n,) A of a step on, such as `d_R1`, less what they were; it goes on at rest."""
        other = ("q" if name[0] == "d" else "d") + name[1:]
        before = self._read(name, other, 0.001).mean(axis=0)
        self._plant.step(name, size)
        rows = self._read(name, other, REST_S) - before
        return rows[:, 0], rows[:, 1]

    def _read(self, name: str, other: str, seconds: float) -> Array:
        columns = [TRACE.index(f"i_{name}"), TRACE.index(f"i_{other}")]
        self._plant.beat()
        return np.asarray(self._plant.run(seconds, 1)[:, columns])

    def _calm(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.05)):
            self._plant.beat()
            self._plant.run(0.05, 0)


def rise(h: Array) -> float:
    """From 10 to 90 % of a response (n,), one sample a tick, s."""
    t = np.arange(len(h)) / TICKS_S
    curve = CubicSpline(t, h)
    times = []
    for level in (0.1, 0.9):
        k = int(np.argmax(h >= level))
        times.append(brentq(lambda x, level=level: float(curve(x)) - level, t[k - 1], t[k]))
    return float(times[1] - times[0])


def bandwidth(h: Array) -> float:
    """-3 dB of the Fourier transform of the derivative of a response (n,), of the spline through it, Hz."""
    fine = 8
    t = np.arange(fine * (len(h) - 1) + 1) / (fine * TICKS_S)
    slope = CubicSpline(np.arange(len(h)) / TICKS_S, h, bc_type="natural").derivative()(t)

    def gain(hz: float) -> float:
        return float(abs(np.trapezoid(slope * np.exp(-2j * np.pi * hz * t), t)))

    hz = np.geomspace(500.0, 20e3, 60)
    k = int(np.argmax(np.array([gain(f) for f in hz]) < MINUS_3_DB))
    return float(brentq(lambda f: gain(f) - MINUS_3_DB, hz[k - 1], hz[k]))


def _greatest(h: Array) -> float:
    """Of the spline through a response (n,), also between two ticks."""
    return float(CubicSpline(np.arange(len(h)), h)(np.arange(0, len(h) - 1, 0.05)).max())


def _half(h: Array) -> int:
    """The first tick beyond the half of a response."""
    return int(np.argmax(h >= 0.5))


def currents(rig: RigFile, drawn: Truth, asked: CurrentAsked) -> Mapping[tuple[str, str], float]:
    """Of every place its times, bands, overshoot and what goes across; the supply."""
    built = drawn.plant
    out: dict[tuple[str, str], float] = {("u_dc", ""): built.plant.supply}
    told = {s.field: rig.parameters[s.name].default for s in SETTINGS if s.name in rig.parameters}
    control = replace(built.control, **told)
    crept = Stepped(built.plant, control, asked.angle, built.factors).angle - asked.angle
    stepped = Stepped(
        built.plant, control, asked.angle - crept, built.factors
    )  # so that it steps at the angle of the run
    count = round(asked.response_s * TICKS_S)
    for place, name in asked.steps.items():
        along, across = (x / asked.size for x in stepped.step(name, asked.size))
        back = stepped.step(name, 0.0)[0] / -asked.size
        small = stepped.step(name, asked.small)[0] / asked.small
        stepped.step(name, 0.0)
        time = rise(along)
        shown = across[: _half(along) + round(3 * time * TICKS_S)]
        out |= {
            ("rise_time", place): time, ("rise_bandwidth", place): 1 / (3 * time), ("fall_time", place): rise(back),
            ("overshoot", place): max(_greatest(along[:count]) - 1, 0.0),
            ("across", place): max(_greatest(x) for x in (shown, -shown)),
            ("bandwidth_small", place): bandwidth(small),
        }  # fmt: skip
        if (inductance := _inductance(built.plant, name)) and place in asked.gains:
            out["bandwidth_design", place] = asked.gains[place] / (2 * np.pi * inductance)
    return out


def _inductance(p: PlantParams, name: str) -> float:
    """Mean of the coils of a system."""
    coils = {"1": slice(0, 6), "2": slice(6, 12), "L": slice(12, 15)}[name[-1]]
    return float(np.mean(p.coil_l[coils]))
