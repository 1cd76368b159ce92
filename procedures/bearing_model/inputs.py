"""What the fits need besides the positions: numbers of the rig file as influences by identity."""

from __future__ import annotations

from collections.abc import Iterator

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.places import CENTRE, PlaceError, Places
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.keys import gap_key, number_key
from procedures.amb_rotor.lengths import in_words, lengths_by_name, named, summed
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.stations import stated
from procedures.shared.certificates import certified

LENGTHS = ("l_is", "l_os", "l_oa", "amb_span", "l_c", "gap")
MACHINE = ("mass", "radial_axes", "runout", "coupling_offset")
LOADED = 0.05  # of the greatest load of an axis: below it an axis tells no force constant


def as_printed(rig: RigFile) -> bool:
    """Whether each length is one number, and the table `machine` has the shaft's, as on the stand of the thesis."""
    machine = conventions(rig)
    told = {*LENGTHS, "clearance", "coupling"} <= lengths_by_name(rig).keys() and {*MACHINE} <= rig.machine.keys()
    return told and machine.probed and not machine.crooked and not machine.lacks and not machine.unweighed


def lacking(rig: RigFile) -> Iterator[str]:
    """What of the tables is missing, a line each."""
    machine = conventions(rig)
    yield from machine.stations.lacks
    up = machine.stations.up
    if max(map(abs, up)) < LOADED:
        yield "shaft.tilt: found a shaft that stands; there is no weight across it, and so no known force"
    if stated(rig, None if rig.shaft is None else rig.shaft.mass, "shaft.mass") is None:
        yield "shaft.mass: found none; its weight is the known force"
    for name, bearing in rig.bearings.items():
        if bearing.kind == "radial" and bearing.gap is None:
            yield f"bearings.{name}.gap: found none; expected the air gap, at which beta is told"
    if rig.coupling is not None and rig.coupling.stiffness is None:
        yield "coupling.stiffness: found none; what the coupling takes of the weight is not known"


def fit_inputs(rig: RigFile, coupled: bool) -> dict[str, Estimate]:
    """Every number that the positions depend on, by the names that `magnetics.statics` has for them."""
    return _printed(rig, coupled) if as_printed(rig) else _of_tables(rig, coupled)


def _printed(rig: RigFile, coupled: bool) -> dict[str, Estimate]:
    found, m, machine = lengths_by_name(rig), rig.machine, conventions(rig)
    inputs = {"mass": certified("machine/mass", m["mass"], "mass of the shaft"),
              "axes": certified("machine/radial_axes", m["radial_axes"], "angle of the axes to the vertical"),
              "gravity": certified("site/gravity", rig.site.gravity, "gravity")}  # fmt: skip
    inputs |= {name: named(found[name]) for name in LENGTHS}
    spring = certified(found["coupling"].identity, found["coupling"].number, "stiffness of the coupling")
    inputs["coupling"] = spring if coupled else Estimate.exact(0.0)
    for d in "yz":
        name = f"machine/coupling_offset/{d}"
        inputs[f"relaxed_{d}"] = certified(name, m["coupling_offset"], f"where the coupling is relaxed, {d}")
    for a in machine.axes:
        inputs |= _probe(rig, machine.position(a), a, f"machine/runout/{a}", m["runout"])
    return inputs | _coils(rig, machine)


def _of_tables(rig: RigFile, coupled: bool) -> dict[str, Estimate]:
    machine, s = conventions(rig), conventions(rig).stations
    assert rig.shaft is not None
    mass = Places(rig).number(rig.shaft.mass, "shaft.mass")  # type: ignore[arg-type]
    inputs = {"mass": certified(mass.identity, mass.number, "mass of the shaft"),
              "gravity": certified("site/gravity", rig.site.gravity, "gravity")}  # fmt: skip
    sums = [s.first, s.tilt, *(x for p in (*s.probes.values(), *s.axes.values()) for x in (p.arm, p.angle))]
    for term in (t for total in sums for t in total.terms):
        inputs[number_key(term.identity)] = certified(term.identity, term.number, in_words(term.identity))
    for axis, gap in s.gaps.items():
        inputs[gap_key(machine, axis)] = certified(gap.identity, gap.number, f"gap of {axis}")
    inputs |= _coupling(rig, coupled)
    runout = stated(rig, rig.shaft.runout, "shaft.runout")
    for channel in s.channels:
        inputs |= _probe(rig, channel, channel, f"shaft/runout/{channel}", runout)
    return inputs | _coils(rig, machine)


def _coupling(rig: RigFile, coupled: bool) -> dict[str, Estimate]:
    """Its place counts without tolerance: what it takes of the weight is small."""
    if rig.coupling is None or not coupled:
        return {"coupling": Estimate.exact(0.0)}
    stiffness = stated(rig, rig.coupling.stiffness, "coupling.stiffness")
    if stiffness is None:
        raise Lacking("coupling.stiffness: found none; what the coupling takes of the weight is not known")
    try:
        at = Places(rig).distance(CENTRE, "coupling")
    except PlaceError as error:
        raise Lacking(str(error)) from error
    offset = stated(rig, rig.coupling.offset, "coupling.offset")
    out = {
        "coupling": certified("coupling/stiffness", stiffness, "stiffness of the coupling"),
        "coupling_at": summed(at, "m"),
    }
    for d in "yz":
        identity = f"coupling/offset/{d}"
        out[f"relaxed_{d}"] = (Estimate.exact(0.0) if offset is None else
                               certified(identity, offset, f"where the coupling is relaxed, {d}"))  # fmt: skip
    return out


def _probe(rig: RigFile, probe: str, key: str, identity: str, runout: Toleranced | None) -> dict[str, Estimate]:
    sensor = rig.sensors[probe]
    return {
        f"gain_{key}": certified(f"sensors/{probe}/gain", sensor.gain, f"gain of {probe}"),
        f"zero_{key}": certified(f"sensors/{probe}/offset", sensor.offset, f"zero of {probe}"),
        f"runout_{key}": Estimate.exact(0.0) if runout is None else
        certified(identity, runout, f"runout of {probe} where the shaft rests"),
    }  # fmt: skip


def _coils(rig: RigFile, machine: AmbRotor) -> dict[str, Estimate]:
    inputs = {}
    for c, channel in ((f"{a}_{side}", channel) for a in machine.axes
                       for side, channel in zip("pn", machine.pair(a), strict=True)):  # fmt: skip
        sensor = rig.sensors[channel]
        inputs[f"gain_{c}"] = certified(f"sensors/{channel}/gain", sensor.gain, f"gain of {channel}")
        inputs[f"offset_{c}"] = certified(f"sensors/{channel}/offset", sensor.offset, f"offset of {channel}")
    return inputs
