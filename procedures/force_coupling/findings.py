"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "as-printed": ("note", "what T (6.15) as printed would give"),
    "commutation-off": ("error", "the zero of the phase angle is off"),
    "gamma-scaled": ("indeterminate", "the force turns by more or less than the phase angle that was told"),
    "ripple": ("note", "the ripple that the fit sees"),
    "windings-differ": ("error", "the two windings' constants differ"),
    "zero-moved": ("indeterminate", "the zero of the phase angle has moved since the force constant was measured"),
}
