"""What a machine is made of: its shaft, what supports, turns and watches it, and where weights go. Schema 2 of the rig file.

Places are along the shaft, in m, counted from where its `origin` is, positive towards its `far_end`. Directions are around it,
counter-clockwise for who looks at the far end from outside; 0 is up, or, on an upright shaft, what the rig file says is 0
(docs/reference/angles.md). What a machine does not have is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from bench.rigfile.numbers import Reference
from bench.rigfile.part import Part
from bench.rigfile.toleranced import Toleranced
from bench.schema import NAME

ORIGIN = "origin"
Name = Annotated[str, Field(pattern=NAME)]


class From(Part):
    """A place counted from another element's: `by` is how far towards the far end."""

    from_: str = Field(alias="from")
    by: Toleranced | Reference


class Of(Part):
    """A direction that is fixed to another axis' (or probe's): so many degrees on from it."""

    of: str
    plus_deg: float = Field(ge=-360, le=360)


FORMS = ("a number", "an identity", "a part")
"""What pydantic puts into the path of an error to say which form it took a value for."""


def _form(value: Any) -> str:
    if isinstance(value, str):
        return FORMS[1]
    named = isinstance(value, From | Of) or (isinstance(value, dict) and ("from" in value or "of" in value))
    return FORMS[2] if named else FORMS[0]


Stated = Annotated[Toleranced, Tag(FORMS[0])]
Referred = Annotated[Reference, Tag(FORMS[1])]
Number = Annotated[Stated | Referred, Discriminator(_form)]
"""A number with its tolerance, or the identity of one."""
Place = Annotated[Stated | Referred | Annotated[From, Tag(FORMS[2])], Discriminator(_form)]
Direction = Annotated[Stated | Referred | Annotated[Of, Tag(FORMS[2])], Discriminator(_form)]


class Shaft(Part):
    """What turns, or moves. `tilt` is how far its far end stands above the horizontal: 0 where it lies, 90 degrees where it
    stands with the far end up. `zero_at` says where directions have their 0 if that is not up, and `up` which of them is up
    then, where the shaft does not stand. `sense`: which way the speed counts, -1 for clockwise seen from outside the far end.
    `ends`: from where to where the shaft reaches. `hand_angle`: how far off an angle is to which somebody turns the shaft."""

    mass: Number | None = None
    polar_inertia: Number | None = None
    transverse_inertia: Number | None = None
    centre_of_mass: Place | None = None
    far_end: str
    near_end: str = ""
    tilt: Number | None = None
    zero_at: str = "up"
    up: Number | None = None
    sense: Literal[-1, 1] = 1
    ends: tuple[Place, Place] | None = None
    runout: Number | None = None
    hand_angle: Number | None = None


class Axis(Part):
    """A direction in which a bearing pulls: `coils` are the channels of the currents that pull to its positive and to its
    negative side, one where it pulls against gravity or a spring; `voltages` those of the same coils. An axial bearing's axis
    has no direction: positive is towards the far end."""

    direction: Direction | None = None
    coils: tuple[str, ...] = Field((), max_length=2)
    voltages: tuple[str, ...] = Field((), max_length=2)


class Bearing(Part):
    """A magnetic bearing. `gap` is its air gap, m; `voltage` the channel of its greatest coil voltage."""

    kind: Literal["radial", "axial"]
    at: Place | None = None
    gap: Number | None = None
    axes: Mapping[Name, Axis] = Field(min_length=1)
    asymmetry: Number | None = None
    voltage: str = ""


class Probe(Part):
    """What measures where the shaft is: `channel` grows when it moves in `direction`, or, with sign -1, against it; along the
    shaft where there is no direction."""

    channel: str
    at: Place | None = None
    direction: Direction | None = None
    sign: Literal[-1, 1] = 1


class Mark(Part):
    """Once a turn, or an encoder's zero: at `direction` of the stator when it passes. Channels of what tells it, each possibly
    absent: `pulses` counted, `edge` the device time of the last one, `angle` since, `speed`."""

    direction: Direction | None = None
    angle: str = ""
    speed: str = ""
    pulses: str = ""
    edge: str = ""


class Ring(Part):
    """A touchdown bearing, or an axial stop; `clearance` is how far the centred shaft is from it."""

    kind: Literal["radial", "axial"] = "radial"
    clearance: Number
    at: Place | None = None


class BalancingPlane(Part):
    """Where weights are fixed: at `radius`, in one of `positions` holes or anywhere. `zero` is where the scale begins, from the
    mark on the shaft; `weight_mass` and `weight_angle` are what is not known of each weight."""

    at: Place
    radius: Number
    positions: int | None = Field(None, ge=3)
    zero: Number | None = None
    sense: Literal[-1, 1] = 1
    weight_mass: Number | None = None
    weight_angle: Number | None = None


class Coupling(Part):
    """A flexible coupling to what turns the shaft: its radial stiffness, N/m; `offset` is how far off the rings' centre it
    holds the shaft when it is relaxed, m."""

    at: Place
    stiffness: Number | None = None
    offset: Number | None = None


class Pulley(Part):
    """Turns the weight of a mass into a side pull: what friction takes of it, and by how much its direction may be off."""

    friction: Number
    misalignment: Number


class Hook(Part):
    """Where a known force pulls at the shaft: down, or in `pull` by a pulley, or `along` it, to one of its ends."""

    at: Place
    pull: Direction | None = None
    along: Literal["far", "near"] | None = None
    pulley: Pulley | None = None


class Lever(Part):
    """An arm on the shaft on which masses hang for a torque: how far out, and on which side (1: counter-clockwise)."""

    length: Number
    side: Literal[-1, 1]
    at: Place | None = None


class Motor(Part):
    """What gives torque, and perhaps force. `currents` are the channels of its segments or phases, the first at `direction`:
    of each segment in turn the `components` of its current, q along the field and d across it. `asked`: what its controller can
    record of the currents that its law asks for, which give force along the first segment, across it (a right angle clockwise),
    and torque; and where amplitudes share the torque, how much of it those along have, T (6.19)."""

    kind: str
    at: Place | None = None
    direction: Direction | None = None
    currents: tuple[str, ...] = ()
    components: tuple[Literal["q", "d"], ...] = Field(("q",), min_length=1, max_length=2)
    asked: Mapping[Literal["along", "across", "torque", "share"], str] = {}
    gives: tuple[Literal["torque", "radial force", "axial force"], ...] = ("torque",)
    pole_pairs: Number | None = None
    stiffness: Number | None = None


class Encoder(Part):
    """What measures a coordinate of a machine that does not float: an angle over many turns, or a stroke. `counts` of a turn;
    `pitch` m or rad a count; `error`, how far it may read off by itself, beside that (m or rad: once a turn, along its
    scale)."""

    channel: str
    measures: Literal["angle", "stroke"]
    counts: int | None = Field(None, gt=0)
    pitch: Number | None = None
    error: Number | None = None


class Certificate(Part):
    """Where a number was certified. `date`, `due` as 2026-11-23."""

    number: str
    laboratory: str = ""
    date: str = Field("", pattern=r"^(\d{4}-\d{2}-\d{2})?$")
    due: str = Field("", pattern=r"^(\d{4}-\d{2}-\d{2})?$")


class MachineTables(Part):
    """The tables of a rig file that describe the machine; `spans` are lengths between two of its elements that were measured as
    such, by identity."""

    shaft: Shaft | None = None
    bearings: Mapping[Name, Bearing] = {}
    probes: Mapping[Name, Probe] = {}
    mark: Mark | None = None
    rings: Mapping[Name, Ring] = {}
    balancing: Mapping[Name, BalancingPlane] = {}
    coupling: Coupling | None = None
    hooks: Mapping[Name, Hook] = {}
    levers: Mapping[Name, Lever] = {}
    motors: Mapping[Name, Motor] = {}
    encoders: Mapping[Name, Encoder] = {}
    spans: Mapping[str, tuple[str, str]] = {}
    certificates: Mapping[str, Certificate] = {}
