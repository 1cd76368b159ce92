"""Codes of findings that the servomotor's procedures tell."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "drifting-sensor": ("indeterminate", "a current sensor's scale or zero drifts during the run"),
    "encoder-direction": ("error", "the encoder counts backwards"),
    "lever-slips": ("indeterminate", "the lever turns on the shaft under its load"),
    "load-inconsistent": (
        "indeterminate",
        "the loads contradict each other; the text says which mass would make them agree",
    ),
    "no-push": ("error", "a force current hardly moves the outboard AMB's currents"),
    "rotor-does-not-turn": ("error", "the released rotor does not turn for a torque current"),
    "rotor-off-edge": ("error", "a loaded rotor does not rest at the edge of an encoder count"),
    "segment-sign": ("error", "a segment's current sensor reads the wrong way"),
    "segments-exchanged": ("error", "two segments are exchanged"),
}
