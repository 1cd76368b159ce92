"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "arms-disagree": ("indeterminate", "the two arms of the lever contradict each other"),
    "current-drift": ("indeterminate", "a drift of the torque current lies along the loads"),
    "detent": ("note", "the detent at home, which was taken off"),
    "drifting-scale": ("indeterminate", "the scale of the torque current drifts"),
    "not-a-cosine": ("indeterminate", "the torque does not follow the cosine of the phase angle"),
    "not-held": ("indeterminate, error", "the rotor does not hold its angle under the load"),
    "segment-unequal": ("indeterminate", "a segment carries another current than the others"),
    "wiring-unclear": ("indeterminate", "segments differ in a way that no exchange explains"),
}
