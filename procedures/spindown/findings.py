"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "braked": ("indeterminate", "a constant torque slows the rotor by more than a levitated one has"),
    "constant-torque": ("note, indeterminate", "a torque that acts the same way in both directions"),
    "direction-dependent": ("indeterminate", "the drag depends on the direction"),
    "drag-not-linear": ("indeterminate", "the deceleration is neither constant nor proportional to the speed"),
    "drive-brakes": ("indeterminate", "a constant torque acts only while the drive coasts"),
    "drive-not-off": ("indeterminate", "the drive's reading says that it is on while the rotor should coast"),
    "driven": ("indeterminate", "a constant torque drives the rotor in both directions"),
    "inertia-as-stated": ("note", "J_z is the rig file's"),
    "inertia-contradicted": ("indeterminate", "the ring's inertia contradicts the rig file's"),
    "not-released": ("indeterminate", "the motor carries torque current while the rotor should coast"),
    "not-repeatable": ("indeterminate", "repeats differ by more than the plan allows"),
    "repeats-disagree": ("note", "repeats differ by more than their fits explain"),
    "speed-and-angle-agree": ("note", "the results by the angle and by the speed agree"),
    "speed-and-angle-disagree": ("indeterminate", "the results by the angle and by the speed differ"),
    "speed-lowered": ("note", "the drive let go at a lower speed than the plan's"),
    "stopping-time": ("note", "how long the rotor takes to stop"),
}
