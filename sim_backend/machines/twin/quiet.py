"""A rig's twin as it truly floats: without noise and rounding, under the settings that its controller is given; and what its
readings are of the shaft."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from sim_backend.controller.parameters import Parameters
from sim_backend.controller.states import SETTLED_M
from sim_backend.core import LEVITATE, LIFT, READY, DriveLaw
from sim_backend.machine import Truth
from sim_backend.machines.twin.columns import Columns
from sim_backend.machines.twin.control import located
from sim_backend.machines.twin.layout import Geometry, layout_of
from sim_backend.machines.twin.nominal import nominal_of
from sim_backend.machines.twin.params import TwinParams
from sim_backend.machines.twin.plant import TwinPlant
from sim_backend.machines.twin.told import told_of

Array = npt.NDArray[np.float64]
REST_S, MOST_S = 0.1, 60.0  # before the lift; that a lift may take
STRAIGHT = 1e-9  # of a cosine: what rounding leaves of a right angle
STIFF_S, STRONG_RAD_S2 = 50.0, 1e4  # of the drive that holds the speed, over the polar inertia: 1/s and rad/s^2


@dataclass(frozen=True)
class Floating:
    """A machine that levitates, and its parameters by the rig's names."""

    plant: TwinPlant
    parameters: Parameters

    def write(self, values: Mapping[str, float]) -> None:
        """Parameters, SI, as a message writes them: planted factors act."""
        for name, value in values.items():
            self.parameters.set(name, value, True, True)


def quiet(p: TwinParams) -> TwinParams:
    """Without noise and rounding, and with a mark that gives every pulse."""
    return dataclasses.replace(
        p, position_noise=(0.0,) * len(p.position_noise), position_lsb=0.0, current_noise=0.0, current_lsb=0.0,
        hum_hz=0.0, pulse_missing=0.0, pulse_doubled=0.0, pulse_last=0.0,
    )  # fmt: skip


def floating(
    rig: RigFile, drawn: Truth, settings: Mapping[str, float], speed: float = 0.0, settle_s: float = 8.0,
    change: Callable[[TwinParams], TwinParams] = quiet,
) -> Floating:  # fmt: skip
    """Lifted as its controller begins, then with `settings` (every parameter, SI), at `speed` rad/s, its integrators at rest;
    what is told is told as wired. The plant is what `change` makes of the drawn one.

    Raises:
        AnalysisError: it does not lift.
    """
    p = dataclasses.replace(change(drawn.plant), names=told_of(rig, {}))
    plant = TwinPlant(p, drawn.noise)
    made = Floating(plant, Parameters(rig, drawn, plant, strict=False))
    plant.mode = READY
    plant.run(round(REST_S / p.tick))
    plant.mode = LIFT
    for _ in range(round(MOST_S / REST_S)):
        rows = plant.run(round(REST_S / p.tick))
        if plant.moved and (np.abs(rows[:, drawn.machine.radial]) < SETTLED_M).all():
            break
    else:
        raise AnalysisError(
            f"rig {rig.name}: found a shaft that does not lift without its noise; expected one that floats"
        )
    plant.mode = LEVITATE
    if speed:
        turn(plant, speed)
    made.write(settings)
    plant.run(round(settle_s / p.tick))
    return made


def turn(plant: TwinPlant, speed: float) -> None:
    """At once at a speed, rad/s, and held there."""
    inertia = plant.params.polar_inertia
    s = plant.state()["s"]
    s[11] = speed
    plant.set_state(s)
    plant.drive(None)  # or it would ramp on from where it was
    plant.drive(DriveLaw(STIFF_S * inertia, STRONG_RAD_S2 * inertia, STRONG_RAD_S2), speed)


class Sight:
    """What readings of the probes are of the shaft's centre line, y z psi theta x: as the rig file has the probes, which is how
    they are read, or as they stand and are, without their gains."""

    def __init__(self, rig: RigFile, p: TwinParams, v: Mapping[str, float]) -> None:
        layout, n = layout_of(rig), nominal_of(rig)
        names = [name for name, _ in p.names.ticks]
        self.looking = [names.index(rig.probes[name].channel) for name in layout.looking]
        self.along = [names.index(rig.probes[name].channel) for name in layout.along]
        many = len(self.looking)
        signs = np.array([rig.probes[name].sign for name in layout.probes], float)
        told = (np.array(p.position_sign) * np.array(p.position_gain))[: len(layout.probes)]
        nominal, drawn = (Columns(Geometry(rig, layout, values), n, values) for values in ({}, v))
        back, basis, _ = located(nominal)
        rows = np.array(p.probe).reshape(8, 16)[:4].T[:many] @ basis
        self._read = basis @ back * signs[:many], signs[many:]
        self._true = basis @ np.linalg.pinv(rows, rcond=1e-6) / told[:many], 1 / told[many:]
        square = _square(nominal)
        self._ways = square @ _ways(nominal), square @ _ways(drawn)
        stations = [nominal.geometry.station(f"probes/{name}") for name in layout.looking]
        self.arm = (max(stations) - min(stations)) / 2
        self._sense = layout.sense

    def shaft(self, trace: Array, true: bool) -> Array:
        """y, z and x of the centre of mass, y along the first axis of the bearing nearest to the near end and z across it, and
        what the tilts make at half of the probes' distance, (5, n) m."""
        (radial, axial), way = (self._true if true else self._read), self._ways[true]
        q = radial @ trace[:, self.looking].T
        along = self._sense * axial @ trace[:, self.along].T / len(self.along) if self.along else np.zeros(len(trace))
        y, z = way @ q[:2]
        return np.array([y, z, along, self.arm * q[3], -self.arm * q[2]])

    def centre(self, trace: Array) -> Array:
        """y, z, psi, theta (4, n), m and rad, of the centre of mass as it is, from where probes read zero: y along the first
        axis of the bearing nearest to the near end, z across it, to the side of its second axis."""
        q = self._true[0] @ trace[:, self.looking].T
        (c, s), second = self._ways[True]
        frame = np.array([[c, s], [-s, c]])
        frame[1] *= -1.0 if frame[1] @ second < 0 else 1.0
        (y, z), (theta, minus_psi) = frame @ q[:2], frame @ np.array([q[3], -q[2]])
        return np.array([y, z, -minus_psi, theta])


def _square(columns: Columns) -> Array:
    """(2, 2): y and z of displacements u and v along the first bearing's axes a apart, as these are meant to stand: y = u and
    z = (v - u cos a)/|sin a|, to the side of the second axis. What the axes are off from there is in z as it is in readings
    and set points of them."""
    (c, s), (c2, s2) = _ways(columns)
    lean, aside = c * c2 + s * s2, abs(c * s2 - s * c2)
    return np.eye(2) if abs(lean) < STRAIGHT else np.array([[1.0, 0.0], [-lean / aside, 1 / aside]])


def _ways(columns: Columns) -> Array:
    """(2, 2): directions of the first bearing's axes, or of one and a quarter turn on."""
    from bench.rigfile.supports import radial_supports

    nearest = radial_supports(columns.rig)[0].name
    angles = [columns.geometry.angle(a.part) for a in columns.layout.radial if a.bearing == nearest]
    one, two = (*angles, angles[0] + columns.layout.sense * np.pi / 2)[:2]
    return np.array([[np.cos(one), np.sin(one)], [np.cos(two), np.sin(two)]])
