"""Whether the bearings can lift the shaft off its rings: the force that each axis must give against what its coils can.

From the rig file's numbers alone: the shaft's mass and places, gaps and clearances, and the defaults of the controller's
biases, force constants and magnetic offsets (`capabilities.model`) and greatest current. One coil pulls with
F = beta i^2 / (gap + x)^2, T (2.4b), where the shaft on its rings lies x from the magnets' middle, away from it (`lying`), i up
to twice the bias, where the other coil is off, or up to the greatest current.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.lying import NOTHING, carried, lies
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.stations import stated
from procedures.shared.limits import current_limit


@dataclass(frozen=True)
class Load:
    """What an axis of a bearing must give to carry the shaft at rest, `needed` N, and what it can, `available` N; None where
    the rig file does not say. `current` A is that of the one coil, `bias` the parameter that limits it, "" where none does.
    `away` m is how far beyond the magnets' middle, from that coil, the probes' zero is told to be; without that it can give
    `middle` N."""

    plane: str
    axis: str
    needed: float
    available: float | None
    current: float
    bias: str
    away: float = 0.0
    middle: float = 0.0


def mass(rig: RigFile) -> float | None:
    """Of the shaft, kg; None where it is not told."""
    found = stated(rig, None if rig.shaft is None else rig.shaft.mass, "shaft.mass")
    return None if found is None else found.value


def loads(rig: RigFile) -> list[Load]:
    """Of every radial axis that carries; none where the shaft's mass is not told or the axes do not tell who carries it."""
    machine = conventions(rig)
    kg, pulls = mass(rig), machine.stations.pulls
    if kg is None or machine.stations.helpers or abs(np.linalg.det(pulls)) < 1e-12:
        return []
    weight = kg * rig.site.gravity.value
    pull = carried(machine.stations, weight, {})
    force = np.abs(pull)
    planes = {k: name for name, pair in machine.planes.items() for k in pair}
    s = machine.stations
    return [
        _load(rig, machine, axis, planes[k], float(force[k]), lies(s, k), float(np.sign(pull[k])))
        for k, axis in enumerate(machine.axes)
        if force[k] > NOTHING * weight
    ]


def _load(rig: RigFile, machine: AmbRotor, axis: str, plane: str, needed: float, off: float, way: float) -> Load:
    """`off` m towards the coil that must pull the shaft lies, `way` 1 where that pulls to the positive side."""
    most, bias = current_limit(rig), machine.biases.get(axis, "")
    limited = bool(bias) and 2 * rig.parameters[bias].default < most
    current = 2 * rig.parameters[bias].default if limited else most
    beta, centre = machine.model_beta(axis), machine.model_offset(axis)
    if not beta or axis not in machine.pulls or axis not in machine.gaps or not np.isfinite(machine.clearance):
        return Load(plane, axis, needed, None, current, bias if limited else "")
    nearer = rig.parameters[centre].default * way if centre else 0.0
    force, middle = (
        float(rig.parameters[beta].default * current**2 / (machine.gaps[axis] - off - x) ** 2) for x in (nearer, 0.0)
    )
    return Load(plane, axis, needed, force, current, bias if limited else "", -nearer, middle)


def told(rig: RigFile) -> str:
    """For whoever looks at a lift that failed: which bearing cannot carry, or that none is shown to be too weak; "" where the
    rig file does not even say what must be carried."""
    found = loads(rig)
    if not found:
        return ""
    weak = [x for x in found if x.available is not None and x.available < x.needed]
    if weak:
        return "; ".join(map(_weak, weak))
    known = [x for x in found if x.available is not None]
    return _carried(known) if known else _unknown(rig, found)


def added(rig: RigFile) -> str:
    """The same, to be added to a sentence."""
    said = told(rig)
    return f"; {said}" if said else ""


def _weak(x: Load) -> str:
    no_bias = "the greatest current (capabilities.current_limit, envelope.max_current_A) is too small"
    way = (f"raise {x.bias}" if x.bias else no_bias) + or_a_zero(x.away, x.middle, x.needed)
    twice = f", twice {x.bias}," if x.bias else ""
    return (f"bearing {x.plane} cannot carry: from the ring {x.axis} must give {x.needed:.3g} N and one coil of "
            f"{x.current:.3g} A{twice} gives {x.available:.3g} N there: {way}")  # fmt: skip


def or_a_zero(away: float, middle: float, needed: float) -> str:
    """Where force is not all that explains it, to be added to what is to be done: a probe's zero that is told so far from the
    coil, `away` m beyond the magnets' middle, that without this it could give the `middle` N that are `needed`."""
    if middle < needed:
        return ""
    told = f", or look at its probe: its zero is told {1e6 * away:.0f} µm beyond the magnets' middle"
    return f"{told}, without which that coil can {middle:.3g} N, and a zero that is off explains it as well"


def _carried(found: Sequence[Load]) -> str:
    each = ", ".join(f"{x.axis} {x.available:.3g} N of {x.needed:.3g} N" for x in found)
    return f"by the rig file each axis can carry its share from the ring ({each})"


def _unknown(rig: RigFile, found: Sequence[Load]) -> str:
    each = ", ".join(f"{x.axis} must give {x.needed:.3g} N" + (f" with {x.current:.3g} A, twice {x.bias}" if x.bias else "")
                     for x in found)  # fmt: skip
    machine = conventions(rig)
    lacking = {
        "the rings' clearance": not np.isfinite(machine.clearance),
        "force constants (capabilities.model, beta_AXIS)": not all(machine.model_beta(x.axis) for x in found),
        "gaps": not all(x.axis in machine.gaps for x in found),
        "two coils to an axis": not all(x.axis in machine.pulls for x in found),
    }
    missing = " and ".join(name for name, lacks in lacking.items() if lacks)
    return f"to leave the rings {each}; the rig file does not tell {missing}, so that it is not known whether they can"
