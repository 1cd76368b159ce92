"""Codes of findings before the shaft turns or follows anything, of all procedures of the AMB stand."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "axes-exchanged": ("error", "readings or coils of two axes are exchanged"),
    "coils-exchanged": ("error", "the coils of an axis, or their current sensors, are exchanged"),
    "gravity-reversed": ("error", "the shaft lies on the other side of its rings than gravity has it"),
    "lift-lost": ("error", "the shaft was lost while it was lifted"),
    "planes-exchanged": ("error", "readings or coils of the two planes are exchanged"),
    "ring-too-far": (
        "error",
        "on its rings the shaft lies farther from the sensors' zero than the rig file can have it",
    ),
    "ring-too-near": ("error", "on its rings the shaft lies nearer to the sensors' zero than the rig file can have it"),
    "sensor-polarity": ("error", "a probe reads the wrong way"),
}
