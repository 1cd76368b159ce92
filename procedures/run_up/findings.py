"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "capture-missed": ("indeterminate", "a capture was not made at its speed"),
    "critical": ("note", "a critical speed, and what was taken off for the size of the orbit"),
    "critically-damped": ("note", "a resonance without a peak"),
    "half-power-outside": ("note", "a half-power speed lies outside the passage"),
    "large-amplitude": ("note", "the orbit is large for the linear model"),
    "no-critical": ("note", "no critical speed lies within the passage"),
    "no-passage": ("error", "the passage cannot be evaluated"),
    "passage-short": ("indeterminate", "the passage does not cover its speeds"),
    "passed": ("note", "how the speeds were passed"),
}
