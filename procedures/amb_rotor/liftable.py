"""Before the lift: whether the bearings can carry the shaft at all, were every number as kind as its tolerance lets it be.

Held where its probes read zero, an axis gives at most beta i^2 / (gap - offset)^2 with the coil of its positive side, T (2.8),
and with + with the other; i is the most that the controller lets it have: twice the bias, where the other coil is off, or its
greatest current. At a ring it is less, but a shaft that swings may pass there where it could not stay, so that the middle
decides.

Nothing is found where the rig file does not say enough, nor where one corner of the tolerances lets the bearing carry.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.calibration import Calibration
from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.numbers import Sum, Term
from bench.rigfile.places import CENTRE, Places
from bench.rigfile.toleranced import Toleranced
from procedures.amb_rotor.carrying import or_a_zero
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.lying import NOTHING, carried, number, placed
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.stations import halved, row, stated
from procedures.shared import first_look
from procedures.shared.limits import current_limit

Array = npt.NDArray[np.float64]
TOO_WEAK = "bearing-too-weak"
MODEL = 0.15  # of the controller's force constants, that they may be off: three times what `unbalance` takes them for
SURE = 3.0  # standard uncertainties of one that was calibrated
OFF_CENTRE_M = 30e-6  # that the magnetic centre may be elsewhere than the controller has it, the same way
NEAREST_M = 1e-5  # of a coil: no force grows without end


@dataclass(frozen=True)
class Magnet:
    """What is known of an axis' coils: force constant `beta` and the greatest that it may be, N m^2/A^2; `offset` from the
    magnetic centre to where the probes read zero, and how far `off` that may be, m."""

    beta: float
    most: float
    offset: float
    off: float


@dataclass(frozen=True)
class Weak:
    """An `axis` of bearing `plane` that cannot carry its share: the force that it must give at least, `needed` N, and what its
    coil gives at most, `available` N, with `current` A; by the numbers as they are stated, `stated` (both, N). `away` is how
    far from that coil the probes' zero is told to lie beyond the magnets' middle, m, and `middle` what the coil gives at most
    there, N. `bias` is the parameter that limits the current, "" where none does."""

    plane: str
    axis: str
    needed: float
    available: float
    stated: tuple[float, float]
    away: float
    middle: float
    current: float
    bias: str

    @property
    def text(self) -> str:
        """For whoever is about to lift the shaft."""
        by = f", twice {self.bias}," if self.bias else ""
        way = f"raise {self.bias}" if self.bias else "its greatest current is too small"
        needed, available = self.stated
        return (
            f"bearing {self.plane} cannot carry the shaft: {self.axis} must give {needed:.3g} N, and where its probes read "
            f"zero its coil of {self.current:.3g} A{by} gives {available:.3g} N; with every tolerance in its favour it must "
            f"give {self.needed:.3g} N and can {self.available:.3g} N: {way}{or_a_zero(self.away, self.middle, self.needed)}"
        )


def weak(
    rig: RigFile, calibrations: Iterable[Calibration] = (), written: Mapping[str, float] | None = None
) -> list[Weak]:
    """The axes that cannot carry their share, with the controller's parameters as they are `written`, else by default; none
    where the rig file does not say enough of the shaft and its magnets.

    Raises:
        Lacking: it is not a shaft in two bearings of two axes each.
    """
    machine = conventions(rig)
    mass = stated(rig, None if rig.shaft is None else rig.shaft.mass, "shaft.mass")
    s = machine.stations
    if mass is None or s.helpers or abs(np.linalg.det(s.pulls)) < 1e-12:
        return []
    values = {name: p.default for name, p in rig.parameters.items()} | dict(written or {})
    magnets, out = _magnets(machine, values, calibrations), list[Weak]()
    for k, axis in enumerate(machine.axes):
        if axis not in magnets or axis not in s.gaps or axis not in machine.pulls:
            continue
        current, bias = _current(rig, machine, axis, values)
        found = _of_axis(machine, k, rig, mass, magnets[axis], current)
        if found is not None:
            plane = next(name for name, pair in machine.planes.items() if k in pair)
            out.append(Weak(plane, axis, *found, current=current, bias=bias))
    return out


def judge(
    rig: RigFile, calibrations: Iterable[Calibration] = (), written: Mapping[str, float] | None = None
) -> Iterator[Finding]:
    """A finding for each bearing that cannot carry its share; each forbids the lift, unless somebody says to go on."""
    told = set[str]()
    for x in weak(rig, calibrations, written):
        if x.plane not in told:
            told.add(x.plane)
            yield Finding(TOO_WEAK, f"{x.text}. The shaft was not lifted.", x.plane, Effect.ERROR)


def of_recording(recording: Recording[Any]) -> list[Finding]:
    """What a run found so and ended by."""
    return [f for f in first_look.with_first(recording, ()) if f.code == TOO_WEAK]


def _current(rig: RigFile, machine: AmbRotor, axis: str, values: Mapping[str, float]) -> tuple[float, str]:
    """The most that a coil may have, A, and the parameter of the bias that limits it."""
    most, bias = values.get(rig.capabilities.current_limit, current_limit(rig)), machine.biases.get(axis, "")
    return (2 * values[bias], bias) if bias and 2 * values[bias] < most else (most, "")


def _magnets(machine: AmbRotor, values: Mapping[str, float], calibrations: Iterable[Calibration]) -> dict[str, Magnet]:
    """By axis, as calibrated, else as the controller has it."""
    out = {}
    for axis in machine.axes:
        known = {kind: c.values[name] for c in calibrations for kind in ("beta", "offset")
                 for name in (f"{kind}@{axis}", f"{kind}_{axis}") if name in c.values}  # fmt: skip
        told = machine.model_offset(axis)
        centre = (values[told], OFF_CENTRE_M) if told else (0.0, max(OFF_CENTRE_M, min(machine.clearance, 1.0)))
        if "offset" in known:
            centre = (known["offset"].value, SURE * known["offset"].u)
        if "beta" in known:
            out[axis] = Magnet(known["beta"].value, known["beta"].value + SURE * known["beta"].u, *centre)
        elif model := machine.model_beta(axis):
            out[axis] = Magnet(values[model], values[model] * (1 + MODEL), *centre)
    return out


def _of_axis(
    machine: AmbRotor, k: int, rig: RigFile, mass: Toleranced, magnet: Magnet, current: float
) -> tuple[float, float, tuple[float, float], float, float] | None:
    """Force needed and available in the kindest corner, and both as stated; how far beyond the middle that is, and what is
    available there. None where that corner can carry, or where there is nothing to be carried."""
    s, axis = machine.stations, machine.axes[k]
    gap, weight = s.gaps[axis], (Term("mass", mass), Term("gravity", rig.site.gravity))
    sensor = rig.sensors.get(machine.pulls[axis][0])
    most = current if sensor is None else current * (1 + halved(sensor.gain)) + halved(sensor.offset)

    def forces(v: Mapping[str, float], beta: float, i: float, near: float) -> tuple[float, float]:
        force = float(carried(s, number(Sum(weight[:1]), v) * number(Sum(weight[1:]), v), v)[k])
        across = abs(number(Sum((gap,)), v)) - math.copysign(1.0, force) * magnet.offset - near
        return abs(force), beta * i**2 / max(across, NEAREST_M) ** 2

    as_stated = forces({}, magnet.beta, current, 0.0)
    if as_stated[0] <= NOTHING * mass.value * rig.site.gravity.value:
        return None
    numbers = {t.identity: t.number for t in (*weight, gap, *placed(s))}

    def margin(v: Mapping[str, float]) -> float:
        needed, available = forces(v, magnet.most, most, magnet.off)
        return available - needed

    best = _kindest(margin, numbers)
    needed, available = forces(best, magnet.most, most, magnet.off)
    needed -= float(_coupled(rig, machine)[k])
    if available >= needed:
        return None
    away = -magnet.offset * math.copysign(1.0, float(carried(s, 1.0, best)[k]))
    return needed, available, as_stated, away, forces(best, magnet.most, most, magnet.off + away)[1]


def _coupled(rig: RigFile, machine: AmbRotor) -> Array:
    """The most that a coupling takes of each axis' load with the shaft in the middle, (4,) N: by its stiffness and how far off
    it is relaxed, as far as the rings where that is not told."""
    s, coupling, places = machine.stations, rig.coupling, Places(rig)
    stiffness = None if coupling is None else stated(rig, coupling.stiffness, "coupling.stiffness")
    if coupling is None or stiffness is None:
        return np.zeros(4)
    offset = stated(rig, coupling.offset, "coupling.offset")
    off = machine.clearance if offset is None else abs(offset.value) + halved(offset)
    arm = places.distance(CENTRE, "coupling").value
    pull = (stiffness.value + halved(stiffness)) * off
    each = [np.linalg.solve(s.pulls.T, pull * np.array(row(arm, angle))) for angle in (0.0, math.pi / 2)]
    return np.asarray(np.abs(each).sum(axis=0))


def _kindest(margin: Callable[[Mapping[str, float]], float], numbers: Mapping[str, Toleranced]) -> dict[str, float]:
    """Every number at that end of its tolerance, by itself, at which the margin is greater."""
    best = {}
    for identity, n in numbers.items():
        ends = (n.value - halved(n), n.value + halved(n))
        best[identity] = max(ends, key=lambda x: margin({identity: x}))
    return best
