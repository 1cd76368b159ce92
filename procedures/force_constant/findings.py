"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "axes-disagree": ("indeterminate", "the constants along both axes differ by more than their uncertainties"),
    "horizontal-assumed": ("note", "the AMBs' horizontal constants were not measured"),
    "load-moved": ("note, indeterminate", "the load at rest is not the calibration's"),
    "ripple-unresolved": ("indeterminate", "all angles stand at one phase of the ripple"),
    "rows-disagree": ("error", "force row and moment row contradict each other"),
    "segment-current": ("error", "a segment carries another current than the ramp asks for"),
    "shared-influences": ("note", "what the shared influences of calibration and run are worth"),
}
