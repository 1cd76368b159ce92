"""Whether a motor with a frame of its own answers the shaft in it, before it carries: it takes a tenth of the load, its set
point is moved, and the outboard AMB is watched.

Open-loop currents (`wiring`) show where they push. That the controller turns positions into its frame, and demands back into
currents, by the same frame is another matter: with the printed sign of T (7.6b) every push is right and the shaft is lost at
the hand-over. A tenth of the motor's stiffness is 4 % of the AMB's: of whatever sign it is, the AMB holds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from bench.findings import Effect, Finding
from bench.procedure.rig import Rig
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import stated, write
from procedures.shared import first_look

NEEDED = ("motor.share", "motor.share_slew", "motor.ref_across", "motor.ref_along")
SHARE, LEAN_M, LEAN_S = 0.1, 40e-6, 0.4
OWN_FRAME_RAD = math.radians(10)  # from the AMBs' axes; a motor that stands along them has nothing to turn
STEP, STEPS = "lean", 3
LEAST_A, CROSS = 0.05, 0.5  # A of the outboard AMB; a sound motor changes it by 0.3 A, and across by a tenth of that
WAYS = {"along": "upwards", "across": "sideways"}


def applies(rig: RigFile) -> bool:
    """Whether the motor's frame is another than the AMBs'."""
    return abs(math.remainder(conventions(rig).direction, math.pi / 2)) > OWN_FRAME_RAD


def sound(rig: Rig, record: Recorder) -> bool:
    """Lean on the motor with its set point at rest, then moved upwards and sideways; whether it answers along."""
    rest = _leaned(rig, record, "")
    up, side = (_leaned(rig, record, way) for way in WAYS)
    return not _wrong(up[1] - rest[1], up[0] - rest[0]) and not _wrong(side[0] - rest[0], side[1] - rest[1])


def _leaned(rig: Rig, record: Recorder, way: str) -> tuple[float, float]:
    """The outboard AMB's control currents (x, y) in A."""
    write(rig, {f"motor.ref_{key}": LEAN_M * (key == way) for key in WAYS})
    write(rig, {"motor.share": SHARE})
    rig.clock.sleep(SHARE / stated(rig.file, "motor.share_slew").default + LEAN_S)
    machine = conventions(rig.file)
    with record.step(STEP, way=way, moved_m=LEAN_M if way else 0.0):
        read = first_look.samples(rig, record, machine.coils_of("xo", "yo"), LEAN_S / 2)
    found = _control(read, machine)
    write(rig, {"motor.share": 0.0, "motor.ref_along": 0.0, "motor.ref_across": 0.0})
    rig.clock.sleep(LEAN_S)
    return found


def _wrong(own: float, across: float) -> bool:
    """A motor that pushes where its set point is relieves the AMB there, and across hardly."""
    return own > -LEAST_A or abs(across) > CROSS * abs(own)


def of_leans(recording: Recording[Any]) -> Iterator[Finding]:
    """Which way the motor answers its set point, by the force that the outboard AMB feels."""
    machine = conventions(recording.rig)
    means = {str(step.labels["way"]): _control(step.read(*machine.coils_of("xo", "yo")), machine)
             for step in recording.steps(STEP)}  # fmt: skip
    if len(means) < STEPS:
        return
    for way, own_axis in (("along", 1), ("across", 0)):
        change = [a - b for a, b in zip(means[way], means[""], strict=True)]
        own, other = change[own_axis], change[1 - own_axis]
        if _wrong(own, other):
            yield Finding(
                "motor-frame",
                f"with the motor's set point {LEAN_M * 1e6:.0f} µm {WAYS[way]} and a tenth of the load on it, the outboard "
                f"AMB's control current changes by {own:+.3f} A along that way and by {other:+.3f} A across; expected relief, "
                "and hardly anything across: a sign in the controller's own frame, of a coordinate (T 7.6), of a current (T "
                "7.13) or of its feedback (T 7.14). The motor was not given the shaft.",
                f"set point, {WAYS[way]}", Effect.ERROR,
            )  # fmt: skip
            return


def _control(data: Any, machine: Servomotor) -> tuple[float, float]:
    return tuple(float(machine.control(axis, data.__getitem__).mean()) for axis in ("xo", "yo"))  # type: ignore[return-value]
