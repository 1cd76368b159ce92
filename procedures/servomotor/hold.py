"""What procedures do to the rotor's angle: let it go, take it up again, and find out which way the encoder counts.

The angle is released by writing zero to all three gains of its controller: the motor then coasts, and the controller stands
ready to take over where the rotor is.
"""

from __future__ import annotations

from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder

GAINS = ("kp_theta", "kd_theta", "ki_theta")
PARAMETERS = (*GAINS, "angle_ref")
RELEASED = dict.fromkeys(GAINS, 0.0)
PROBE_RAD, PROBE_GAIN, PROBE_S = 0.2, 5.0, 0.3  # one ampere at first, a tenth of the amplifiers


def release(rig: Rig) -> None:
    """No torque from the motor: it coasts from here on."""
    for name in GAINS:
        rig.levitation.set(name, 0.0)


def hold(rig: Rig, ki_theta: float | None = None) -> None:
    """The controller takes the angle up again, with the rig file's gains; damping first, so that it never swings."""
    gains = {name: rig.file.parameters[name].default for name in ("kd_theta", "kp_theta", "ki_theta")}
    if ki_theta is not None:
        gains["ki_theta"] = ki_theta
    for name, gain in gains.items():
        rig.levitation.set(name, gain)


def probe(rig: Rig, record: Recorder) -> None:
    """Turn the released rotor a little with a weak proportional gain, to one side and to the other (it may rest at either
    already), recorded as steps "probe", and let it go again.

    A loop closed with full gains on an encoder that counts backwards runs away; this one cannot do harm. What it shows is
    judged in `procedures.servomotor.direction`.
    """
    for reference in (PROBE_RAD, -PROBE_RAD):
        rig.levitation.set("angle_ref", 0.0)
        with record.step("probe", reference_rad=reference):
            rig.levitation.set("kp_theta", PROBE_GAIN)
            rig.levitation.set("angle_ref", reference)
            rig.clock.sleep(PROBE_S)
        release(rig)
    rig.levitation.set("angle_ref", 0.0)
