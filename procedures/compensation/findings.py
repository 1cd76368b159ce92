"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "no-switch": ("error", "there is no capture about the switch"),
    "reduction-told": ("note", "a reduction that is not judged"),
    "runout-followed": ("note", "what the shaft still does: it follows the runout"),
}
