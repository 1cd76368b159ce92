"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "allocations-compared": ("note", "what priority gains over static, by step"),
    "holding-torque": ("indeterminate", "the rotor takes more torque to hold than its loop explains"),
    "saturated-at-rest": ("indeterminate", "a segment was at its limit before the step"),
    "saturated-small-step": ("indeterminate", "a segment was at its limit in a small step"),
}
