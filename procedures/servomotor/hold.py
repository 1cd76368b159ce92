"""What procedures do to the rotor's angle: let it go, take it up again, and find out which way the encoder counts.

The angle is released by writing zero to all three gains of its controller: the motor then coasts, and the controller stands
ready to take over where the rotor is.
"""

from __future__ import annotations

from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.servomotor.parameters import stated, write

GAINS = ("angle.kp", "angle.kd", "angle.ki")
NEEDED = (*GAINS, "angle.ref")
RELEASED = dict.fromkeys(GAINS, 0.0)
PROBE_RAD, PROBE_GAIN, PROBE_S = 0.2, 5.0, 0.3  # one ampere at first, a tenth of the amplifiers


def speed_held(rig: RigFile) -> dict[str, float]:
    """What makes the controller hold the speed that it is asked for, in place of giving all its torque until then: who turns
    the rotor by it writes this first, for a run that was ended at the torque limit may have left the other."""
    known = rig.capabilities.settings.get("torque", {})
    return dict(known.get("held", {}))


def release(rig: Rig) -> None:
    """No torque from the motor: it coasts from here on."""
    write(rig, RELEASED)


def hold(rig: Rig, ki_theta: float | None = None) -> None:
    """The controller takes the angle up again, with the rig file's gains; damping first, so that it never swings."""
    gains = {key: stated(rig.file, key).default for key in ("angle.kd", "angle.kp", "angle.ki")}
    if ki_theta is not None:
        gains["angle.ki"] = ki_theta
    write(rig, gains)


def probe(rig: Rig, record: Recorder) -> None:
    """Turn the released rotor a little with a weak proportional gain, to one side and to the other (it may rest at either
    already), recorded as steps "probe", and let it go again.

    A loop closed with full gains on an encoder that counts backwards runs away; this one cannot do harm. What it shows is
    judged in `procedures.servomotor.direction`.
    """
    for reference in (PROBE_RAD, -PROBE_RAD):
        write(rig, {"angle.ref": 0.0})
        with record.step("probe", reference_rad=reference):
            write(rig, {"angle.kp": PROBE_GAIN, "angle.ref": reference})
            rig.clock.sleep(PROBE_S)
        release(rig)
    write(rig, {"angle.ref": 0.0})
