"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "no-torque-current": ("error", "the load on the lever makes no torque current"),
    "term-not-identified": ("note", "a term that the points cannot tell"),
    "terms-selected": ("note", "the terms that predicting points left out needs"),
}
