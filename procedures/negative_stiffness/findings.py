"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "axes-coupled": ("error", "motion along one axis shows in the other"),
    "gap-inconsistent": ("indeterminate", "the AMB's lines give another gap than the rig file"),
    "methods-agree": ("note", "both methods agree within their uncertainties"),
    "methods-disagree": (
        "note, indeterminate",
        "both methods differ, by a little (a note) or by more than a sound rig in a thousand shows",
    ),
}
