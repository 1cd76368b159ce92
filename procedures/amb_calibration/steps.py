"""From the recorded steps of a mass-hanging calibration to arrays: the hangings, and a table of their steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.recording.steps import Steps
from bench.rigfile import RigFile
from bench.rigfile.places import CENTRE, Places
from bench.rigfile.supports import two_planes
from procedures.amb_calibration.fit import Hangings, hung_shares
from procedures.amb_calibration.held import held
from procedures.amb_calibration.plan import Plan
from procedures.amb_calibration.pulls import Loaded, Pull, channels, further, pulls
from procedures.servomotor.conventions import displacement
from procedures.servomotor.loads import load_index
from procedures.shared.step_table import Labels, StepTable, by_angle, tabulate

Array = npt.NDArray[np.float64]
SAME_RAD = math.radians(1.0)  # a probe that looks so near to an axis' direction reads what moves along it


@dataclass(frozen=True)
class Hang(Labels):
    """What hangs ("" for nothing but the hanger), reached by loading (+1) or unloading (-1)."""

    kind: ClassVar[str] = "hang"
    angle_rad: float
    load: str
    branch: int

    def __str__(self) -> str:
        way = "loading" if self.branch > 0 else "unloading"
        return f"{np.degrees(self.angle_rad):.0f}°, {self.load or 'no load'}, {way}"


@dataclass(frozen=True)
class HangOn(Hang):
    """The same where there are several hooks: on which one."""

    hook: str


@dataclass(frozen=True)
class HangingData:
    """`hangings` for the fit, and the `table` (A, P) of their steps; `hung`, the nominal share of a mass at the near and at the
    far bearing; `held`, by the channels of the loaded axes' probes where the shaft was held (`held.held`)."""

    hangings: Hangings
    table: StepTable[Hang]
    masses: tuple[str, ...]
    hung: tuple[float, float]
    held: dict[str, Array]


def read_hangings(recording: Recording[Plan], pull: Pull | None = None) -> HangingData:
    """Read every "hang" step of a pull (that of the only hook), in the order of its angle and time.

    Raises:
        AnalysisError: there are no steps, an angle lacks some, or what hung is no mass of the plan.
    """
    rig, masses = recording.rig, recording.plan.masses
    several = len(pulls(rig)) > 1
    pull = pull or pulls(rig)[0]
    taken = [s for s in recording.steps(Hang.kind) if not several or s.labels["hook"] == pull.hook]
    steps, shape = by_angle(Steps(tuple(taken)), "hangings")
    table: StepTable[Hang] = tabulate(steps, HangOn if several else Hang, channels(rig), shape=shape)
    currents, at, at_motor = _means(rig, pull, table)
    hangings = Hangings(
        currents,
        at,
        at_motor,
        load_index([hang.load for hang in table.labels], masses, "hanger").reshape(shape),
        table.each(lambda hang: hang.branch),
        table.each(lambda hang: hang.angle_rad)[:, 0].copy(),
        pull,
    )
    return HangingData(hangings, table, masses, hung(rig, pull.hook), held(rig, pull, table.mean, further(rig)))


def arrays(
    recording: Recording[Plan], pull: Pull, steps: Steps, shape: tuple[int, int]
) -> tuple[tuple[Array, Array, Array], StepTable[Hang]]:
    """Currents, positions and motor displacements of some hangings, shaped (..., A, P), as `Hangings` has them; their table."""
    kind = HangOn if len(pulls(recording.rig)) > 1 else Hang
    table: StepTable[Hang] = tabulate(steps.items, kind, channels(recording.rig), shape=shape)
    return _means(recording.rig, pull, table), table


def _means(rig: RigFile, pull: Pull, table: StepTable[Hang]) -> tuple[Array, Array, Array]:
    at_motor, at = _displacements(rig, pull, table)
    return np.stack([table.stack(axis.coils) for axis in pull.axes]), at, at_motor


def hung(rig: RigFile, hook: str) -> tuple[float, float]:
    """Share of a mass on a hook that the near and the far bearing carry, by the rig file's values."""
    places, (near, far) = Places(rig), (f"bearings/{plane.name}" for plane in two_planes(rig))
    return hung_shares(places.distance(far, f"hooks/{hook}").value, places.distance(near, far).value)


def _displacements(rig: RigFile, pull: Pull, table: StepTable[Hang]) -> tuple[Array, Array]:
    """Along each axis: displacement at the motor, zero without one, and at its bearing (T 6.7)."""
    planes = [plane.name for plane in two_planes(rig)]
    motor = next((f"motors/{name}" for name, m in rig.motors.items() if m.at is not None), "")
    at, at_motor = [], []
    for axis in pull.axes:
        names = _looking(rig, axis)
        readings = [table.mean[rig.probes[name].channel] * rig.probes[name].sign for name in names]
        at.append(_displacement(rig, names, readings, f"bearings/{planes[axis.plane]}"))
        at_motor.append(_displacement(rig, names, readings, motor) if motor else np.zeros_like(at[-1]))
    return np.stack(at_motor), np.stack(at)


def _looking(rig: RigFile, axis: Loaded) -> tuple[str, ...]:
    """The probes that look the way of an axis, the one nearest to the near end and the one farthest from it."""
    places, bearing = Places(rig), two_planes(rig)[axis.plane].name
    own = places.direction(f"bearings/{bearing}/{axis.name}").value
    found = sorted(
        (places.distance(CENTRE, f"probes/{name}").value, name)
        for name, probe in rig.probes.items()
        if probe.direction is not None
        and abs(math.remainder(places.direction(f"probes/{name}").value - own, 2 * math.pi)) < SAME_RAD
    )
    return tuple(dict.fromkeys((found[0][1], found[-1][1])))


def _displacement(rig: RigFile, names: Sequence[str], readings: Sequence[Array], part: str) -> Array:
    """At a part of the shaft, by the straight line through two probes; what the only one reads."""
    if len(names) == 1:
        return readings[0]
    places = Places(rig)
    near, far = (places.distance(CENTRE, f"probes/{name}").value for name in names)
    share = (places.distance(CENTRE, part).value - near) / (far - near)
    return displacement(readings[0], readings[1], share)
