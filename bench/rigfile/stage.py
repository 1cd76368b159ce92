"""Axes of a machine that does not levitate, as a rig file has them: what procedures ask for by an axis' name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from bench.rigfile.capabilities_of_stages import Wave
from bench.rigfile.model import RigFile
from bench.rigfile.numbers import Term
from bench.rigfile.places import Places
from bench.rigfile.toleranced import Toleranced


@dataclass(frozen=True)
class StageAxis:
    """One axis by the name of its encoder; "" or None where something is not bound. Lengths are in m, angles in rad.

    Attributes:
        unit: of its place, "m" or "rad"; `force` that of what moves it, "N" or "N m".
        channel, reference, asked, given, speed: channels: what the encoder reads, the set point, what the loop asks for, what
            the controller gives by its own map, the rate.
        target, rate, rise, stiffness, integral, damping, limit: parameters (`capabilities_of_stages.PositionedAxis`).
        pitch, error: of the encoder; exact where a turn has so many counts.
        low, high: the travel.
    """

    name: str
    measures: str
    unit: str
    force: str
    channel: str
    reference: str
    asked: str
    given: str
    speed: str
    target: str
    rate: str
    rise: str
    stiffness: str
    integral: str
    damping: str
    limit: str
    wave: Wave | None
    pitch: Toleranced | None
    error: Toleranced | None
    low: float
    high: float


def is_stage(rig: RigFile) -> bool:
    """Whether a controller positions axes, and levitates nothing."""
    roles = {role for device in rig.devices.values() for role in device.roles}
    return "motion" in roles and "levitation" not in roles


def axes_of(rig: RigFile) -> Mapping[str, StageAxis]:
    """The axes that the controller positions, by name, in the file's order; none where it positions nothing."""
    can = rig.capabilities.positioning
    return {} if can is None else {name: _axis(rig, name) for name in can.axes if name in rig.encoders}


def _axis(rig: RigFile, name: str) -> StageAxis:
    can = rig.capabilities.positioning
    assert can is not None
    bound, encoder = can.axes[name], rig.encoders[name]
    travel = rig.parameters.get(bound.target)
    turns = encoder.measures == "angle"
    return StageAxis(
        name=name, measures=encoder.measures, unit="rad" if turns else "m", force="N m" if turns else "N",
        channel=encoder.channel, pitch=pitch_of(rig, name), error=_number(rig, encoder.error, name, "error"),
        low=-math.inf if travel is None else travel.low, high=math.inf if travel is None else travel.high,
        **{key: getattr(bound, key) for key in type(bound).model_fields},
    )  # fmt: skip


def pitch_of(rig: RigFile, name: str) -> Toleranced | None:
    """What a count of an encoder is, m or rad; None where the rig file does not say."""
    encoder = rig.encoders[name]
    if encoder.pitch is None and encoder.counts:
        return Toleranced.model_validate(
            {"value": 2 * math.pi / encoder.counts, "unit": "rad", "half_width": 0, "distribution": "rectangular",
             "source": f"{encoder.counts} counts a turn"}
        )  # fmt: skip
    return _number(rig, encoder.pitch, name, "pitch")


def _number(rig: RigFile, stated: Toleranced | str | None, name: str, key: str) -> Toleranced | None:
    return None if stated is None else term_of(rig, stated, name, key).number


def term_of(rig: RigFile, stated: Toleranced | str, name: str, key: str) -> Term:
    """A number of an encoder with its identity.

    Raises:
        PlaceError: a reference that leads nowhere.
    """
    return Places(rig).number(stated, f"encoders.{name}.{key}")
