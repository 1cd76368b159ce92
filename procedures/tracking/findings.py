"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "contact-not-seen": ("indeterminate", "the controller reports contact, and the positions show none"),
    "laws-compared": ("note", "the laws side by side"),
    "lower-coils-on": ("indeterminate", "the lower coils carry current where the law has them off"),
    "reference-frequency": ("error", "the reference's frequency is not the plan's"),
    "reference-missing": ("error", "the shaft does not follow the reference at all"),
    "start-not-seen": ("error", "the start of the reference cannot be told from the currents"),
}
