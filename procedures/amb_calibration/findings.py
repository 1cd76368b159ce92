"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "bearings-exchanged": ("error", "the currents of the two bearings are exchanged"),
    "hysteresis": ("note", "half the difference of the branches, as a share of the range"),
    "loads-scatter": ("note", "what the masses say against each other is added to the uncertainty"),
    "masses-exchanged": ("error", "two labels look exchanged"),
    "no-response": ("error", "the control currents do not answer the masses"),
    "one-sided": ("error", "one coil carries all: K and K2 are one number; the text names the bias that would do"),
    "outlier": ("indeterminate", "one hanging is off the others"),
}
