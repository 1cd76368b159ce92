"""How the shaft comes to the angles of a calibration, and what of the rig else it needs: by its controller, by a person's
hand to
the marks of a scale, or not at all."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from bench.findings import Effect, Finding
from bench.procedure.rig import Rig
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.places import PlaceError, Places
from bench.rigfile.roles import Status
from bench.rigfile.supports import two_planes
from procedures.amb_calibration.plan import Plan
from procedures.amb_calibration.pulls import pulls, unloaded
from procedures.shared.signals import Meaning

FEWEST = 8  # angles of a mean over a turn: orders up to four are resolved
EVEN_RAD = math.radians(
    5.0
)  # from equal spacing: what an order that eight angles resolve makes of it is 1 % of that order
UNEVEN, ONE_ANGLE, NO_FORCE = "angles-uneven", "one-angle", "no-known-force"


def by_hand(rig: RigFile) -> bool:
    """Whether a person turns the shaft: where no controller does."""
    roles = {role for device in rig.devices.values() for role in device.roles}
    return rig.capabilities.angle is None or "rotation" not in roles


def turn(rig: Rig, angle_rad: float, angles: int) -> float:
    """Have the shaft turned to an angle; where it stands then, rad. The only angle of a shaft that no motor turns is where it
    stands, called 0."""
    if not by_hand(rig.file):
        rig.rotation.point(angle_rad)
        return angle_rad
    return rig.operator.turn(angle_rad) if angles > 1 else angle_rad


def biases(rig: RigFile) -> tuple[str, ...]:
    """Parameters of both bearings' bias currents, each once."""
    known = rig.capabilities.bias
    return tuple(dict.fromkeys(known[plane.name] for plane in two_planes(rig) if plane.name in known))


def parameters(rig: RigFile) -> tuple[str, ...]:
    """What is written: biases, and the angle where the controller turns to it."""
    missing = tuple(f"bias.{plane.name}" for plane in two_planes(rig) if plane.name not in rig.capabilities.bias)
    angle = rig.capabilities.angle
    return (*biases(rig), *missing, *([angle.ref] if angle is not None and not by_hand(rig) else []))


def lacks(rig: RigFile) -> Iterator[str]:
    """What the tables do not say, a line each."""
    places = Places(rig)
    for plane in two_planes(rig):
        if rig.bearings[plane.name].gap is None:
            yield f"bearings.{plane.name}.gap: found none; it refers forces to where the probes read zero"
    if not pulls(rig):
        yield "hooks: found none of whose pull an axis of a bearing feels a quarter"
    for pull in pulls(rig):
        try:
            places.distance(f"bearings/{pull.bearings[1]}", f"hooks/{pull.hook}")
        except PlaceError as error:
            yield str(error)
        if pull.sideways and rig.hooks[pull.hook].pulley is None:
            yield f"hooks.{pull.hook}.pulley: found none; a pull to the side goes over one, whose friction takes part of it"


def limits(rig: RigFile) -> tuple[Meaning, ...]:
    """Bits of the status word that stand for a limit that was reached, with what they are called."""
    near, far = (plane.name for plane in two_planes(rig))
    return (
        (Status.CURRENT_LIMIT, "current-saturated", "an AMB amplifier was at its limit"),
        (Status.SEGMENT_LIMIT, "current-saturated", "a motor segment was at its limit"),
        (Status.CONTACT_NEAR, "contact", f"the rotor touched the {near} touchdown bearing"),
        (Status.CONTACT_FAR, "contact", f"the rotor touched the {far} touchdown bearing"),
        (Status.SENSOR_RANGE, "sensor-clipped", "a position sensor was beyond its range"),
    )


def findings(recording: Recording[Plan]) -> Iterator[Finding]:
    """Axes of which nothing known pulls, an angle that is the only one, angles that are not evenly spaced."""
    for axis in unloaded(recording.rig):
        text = (f"{axis.name} looks across every known pull: nothing says what force acts along it, and its force constant is "
                "not measured. A hook with a pulley (hooks.NAME.pull, hooks.NAME.pulley) would pull along it.")  # fmt: skip
        if by_hand(recording.rig):
            yield Finding(NO_FORCE, text, axis.name)
    if recording.plan.angles == 1:
        text = (
            "the shaft was not turned: the values hold for the angle at which it stood, and are no means over a turn."
        )
        yield Finding(ONE_ANGLE, text)
        return
    yield from _uneven(recording)


def _uneven(recording: Recording[Any]) -> Iterator[Finding]:
    from procedures.amb_calibration.steps import Hang

    stood = sorted({float(step.labels["angle_rad"]) % (2 * math.pi) for step in recording.steps(Hang.kind)})
    if len(stood) < 2:
        return
    even = 2 * math.pi / len(stood)
    first = stood[0]
    off = max(abs(angle - first - k * even) for k, angle in enumerate(stood))
    if off > EVEN_RAD:
        told = ", ".join(f"{math.degrees(angle):.0f}°" for angle in stood)
        text = (f"the shaft stood at {told}: {math.degrees(off):.0f}° from equal spacing, so that a mean over them is none "
                "over a turn.")  # fmt: skip
        yield Finding(UNEVEN, text, "", Effect.INDETERMINATE)
