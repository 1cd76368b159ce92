"""What the rig file says of a shaft that turns: its mass and inertias, where it is held, watched and loaded, its clearance.

All by the machine's tables. Where each length is one number, with a table `machine` as the AMB stand has it, they are taken as
they are printed; on every other rig as rows of places and angles.
"""

from __future__ import annotations

from collections.abc import Iterator

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.places import CENTRE, PlaceError, Places
from bench.rigfile.supports import two_planes
from bench.uncertainty import Estimate
from bench.uncertainty.estimate import merged
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.lengths import lengths_by_name, named, number, summed
from procedures.amb_rotor.stations import stations
from procedures.shared.certificates import certified

LENGTHS = ("gap", "coupling", "l_ia", "l_oa", "l_is", "l_os", "l_iu", "l_ou", "l_c")
SHAFT = (("mass", "mass"), ("inertia", "transverse_inertia"), ("polar", "polar_inertia"))


def stated(rig: RigFile) -> bool:
    """Whether each length is one number, and the table `machine` has the shaft's, as on the AMB stand, which is not crooked."""
    said = {key for _, key in SHAFT} | {"runout", "radial_axes"} <= rig.machine.keys()
    return said and {*LENGTHS} <= lengths_by_name(rig).keys() and not conventions(rig).crooked


def collect_lengths(rig: RigFile) -> dict[str, Estimate]:
    """Lengths from the centre of mass, gaps, the coupling, mass and inertias, by the names of `runout.Stand`.

    Raises:
        Lacking: the tables do not say enough.
    """
    if stated(rig):
        found = lengths_by_name(rig)
        out = {name: named(found[name]) for name in LENGTHS}
        return out | {name: shaft_number(rig, key) for name, key in SHAFT}
    if lines := tuple(missing(rig)):
        raise Lacking(*lines)
    return _by_tables(rig)


def missing(rig: RigFile) -> Iterator[str]:
    """What the tables do not say, a line each."""
    s, machine = stations(rig), conventions(rig)
    yield from (f"shaft.{key}: found none" for _, key in SHAFT if not _says(rig, key))
    if not _says(rig, "runout"):
        yield "shaft.runout: found none; expected what the probes read at most of a shaft that stands still in its turning"
    if not [r for r in rig.rings.values() if r.kind == "radial"]:
        yield "rings: found no radial one; D_max is over the least clearance"
    yield from (f"bearings.{p.name}.gap: found none" for p in two_planes(rig) if rig.bearings[p.name].gap is None)
    yield from s.lacks
    yield from (f"probes: found none that looks along {a}" for a in machine.axes if a not in machine.probes)
    if rig.coupling is not None and rig.coupling.stiffness is None:
        yield "coupling.stiffness: found none"


def _says(rig: RigFile, key: str) -> bool:
    return key in rig.machine or (rig.shaft is not None and getattr(rig.shaft, key) is not None)


def shaft_number(rig: RigFile, key: str) -> Estimate:
    """A number of the shaft: of `machine`, as the AMB stand has it, or of the table `shaft`."""
    if key in rig.machine:
        return certified(f"machine/{key}", rig.machine[key], key.replace("_", " "))
    assert rig.shaft is not None
    return number(rig, getattr(rig.shaft, key), f"shaft.{key}", key.replace("_", " "))


def _by_tables(rig: RigFile) -> dict[str, Estimate]:
    s, machine, places = stations(rig), conventions(rig), Places(rig)
    out = {name: shaft_number(rig, key) for name, key in SHAFT}
    for k, axis in enumerate(machine.axes):
        pull, look = s.axes[axis], s.probes[machine.position(axis)]
        out[f"at_axis_{k}"], out[f"turn_axis_{k}"] = summed(pull.arm, "m"), summed(pull.angle, "rad")
        out[f"at_probe_{k}"], out[f"turn_probe_{k}"] = summed(look.arm, "m"), summed(look.angle, "rad")
    for plane, (first, second) in machine.planes.items():
        gap = rig.bearings[plane].gap
        assert gap is not None  # `missing` says so
        found = number(rig, gap, f"bearings.{plane}.gap", f"air gap, {plane}")
        out[f"gap_{first}"] = out[f"gap_{second}"] = found
    for name, part in zip(("l_iu", "l_ou"), unbalance_planes(rig), strict=True):
        found = summed(places.distance(CENTRE, part), "m")
        out[name] = Estimate(-found.value, "m", merged([(-1.0, found)])) if name == "l_iu" else found
    for name, total in (("l_ia", s.axes[machine.axes[0]].arm), ("l_oa", s.axes[machine.axes[2]].arm),
                        ("l_is", s.probes[machine.position(machine.axes[0])].arm),
                        ("l_os", s.probes[machine.position(machine.axes[2])].arm)):  # fmt: skip
        out[name] = summed(-total if name in ("l_ia", "l_is") else total, "m")
    out["hand"] = Estimate.exact(float(s.spin), "1")
    return out | _coupling(rig, places)


def _coupling(rig: RigFile, places: Places) -> dict[str, Estimate]:
    if rig.coupling is None:
        return {"coupling": Estimate.exact(0.0, "N/m"), "l_c": Estimate.exact(0.0, "m")}
    assert rig.coupling.stiffness is not None  # `missing` says so
    stiffness = number(rig, rig.coupling.stiffness, "coupling.stiffness", "coupling stiffness")
    return {"coupling": stiffness, "l_c": summed(-places.distance(CENTRE, "coupling"), "m")}


def unbalance_planes(rig: RigFile) -> tuple[str, str]:
    """Two planes in which unbalance is told: the outermost balancing planes, or, without two, the radial bearings.

    Raises:
        Lacking: the place of one cannot be told.
    """
    places = Places(rig)
    try:
        at = {part: places.place(part).value for part in (f"balancing/{name}" for name in rig.balancing)}
    except PlaceError as error:
        raise Lacking(str(error)) from error
    if len(at) < 2:
        near, far = two_planes(rig)
        return f"bearings/{near.name}", f"bearings/{far.name}"
    ends = sorted(at, key=lambda part: at[part])
    return ends[0], ends[-1]


def clearance(rig: RigFile) -> Estimate:
    """The least of the radial rings, m."""
    rings = {n: r for n, r in rig.rings.items() if r.kind == "radial"}
    found = [number(rig, r.clearance, f"rings.{n}.clearance", "least clearance") for n, r in rings.items()]
    return min(found, key=lambda e: e.value)


def least_gap(rig: RigFile) -> float:
    """Air gap of the radial bearings, m; the least of them."""
    if stated(rig):
        return lengths_by_name(rig)["gap"].number.value
    lengths = _by_tables(rig)
    return min(lengths[f"gap_{k}"].value for k in range(4))


def runout_u(rig: RigFile) -> float:
    """What a probe may read of a journal, rms over a turn, m."""
    if "runout" in rig.machine:
        return rig.machine["runout"].standard_uncertainty
    assert rig.shaft is not None
    assert rig.shaft.runout is not None
    return Places(rig).number(rig.shaft.runout, "shaft.runout").number.standard_uncertainty
