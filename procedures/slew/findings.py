"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "detent-not-resolved": ("note", "the detent is below what the run resolves"),
    "friction": ("indeterminate", "the friction is larger than the plan allows"),
    "reference-scaled": ("indeterminate", "the angle follows a reference of another size than was told"),
}
