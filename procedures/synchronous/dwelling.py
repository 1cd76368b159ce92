"""How a shaft is turned for its response to unbalance: laws and settings of the controller, slow roll, stop."""

from __future__ import annotations

from collections.abc import Iterator

from bench.findings import Finding
from bench.procedure.rig import Rig
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from procedures.amb_rotor import lift
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import Law, Variant
from procedures.synchronous.dwells import SLOW, TELLS, can_capture, telemetry_period_s, uncapturable


def roll_slowly(rig: Rig, record: Recorder, law: Law, rad_s: float, seconds: float, settle_s: float) -> bool:
    """Lift and nudge the shaft, put it under a law, and roll it slowly for some time where the speed is not 0; False where the
    run ends here."""
    if not lift.lift_and_nudge(rig, record):
        return False
    select(rig, law)
    if rad_s:
        if not lift.bring_to_speed(rig, record, rad_s, settle_s):
            stop(rig)
            return False
        with record.step(SLOW, **step_labels(rig, rad_s, "off")):
            rig.clock.sleep(seconds)
    return True


def step_labels(rig: Rig, speed: float, variant: Variant, number: int = 0) -> dict[str, float | str | bool]:
    """Of the `number`-th dwell at a speed in rad/s, or of the slow roll; below zero it is a repeat."""
    driven = rig.drive.speed_rad_s if rig.drive is not None else 0.0
    return {"speed_rad_s": speed, "variant": variant, "driven_rad_s": driven, "number": number, "again": number < 0}


def uncaptured(rig: RigFile) -> Iterator[Finding]:
    """What is not stated where the controller records nothing at its full rate."""
    if not can_capture(rig):
        hz = TELLS / telemetry_period_s(rig)
        which = f" ([capture.channels] has no {', '.join(uncapturable(rig))})" if rig.capture is not None else ""
        text = (f"the controller captures nothing of the turning shaft{which}: nothing is stated above {hz:.0f} Hz, "
                f"{TELLS:g} of its telemetry's rate; no spectra, no needs of the coils, and D_max without motion that does not "
                "turn with the shaft.")  # fmt: skip
        yield Finding("telemetry-alone", text)


def left_out(rig: RigFile) -> Iterator[Finding]:
    """Probes beside those of the axes: the balance of forces tells runout where an axis has a probe, and nowhere else."""
    own = conventions(rig).positions
    names = [name for name, probe in rig.probes.items() if probe.direction is not None and probe.channel not in own]
    if names:
        planes = ", ".join(name for name, probe in rig.probes.items() if probe.channel in own)
        text = (f"nothing is stated of what {', '.join(names)} read: vectors, orbits, D_max and runout are those of {planes}, "
                "which look along the bearings' axes. Elsewhere the shaft may move more, beyond both bearings most of all. "
                "What they read is recorded, runout included.")  # fmt: skip
        yield Finding("planes-left-out", text, ", ".join(names))


def stop(rig: Rig) -> None:
    """Compensate nothing, stop the drive, and leave the shaft standing under the PID."""
    machine = conventions(rig.file)
    lift.write(rig, machine.variants["off"])
    if rig.drive is not None:
        rig.drive.stop()
        rig.drive.coast()
    lift.write(rig, machine.select(machine.plain_law))
    rig.clock.sleep(machine.stands_s)


def select(rig: Rig, law: Law) -> None:
    """Have the controller go by a law, nothing compensated."""
    machine = conventions(rig.file)
    lift.write(rig, {**machine.select(law), **machine.variants["off"]})
