"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "band-widened": ("note", "noise widens the band that the response settles in"),
    "current-sign": ("error", "the control current answers the wrong way"),
    "no-oscillation": ("note", "the response has no oscillation"),
    "no-step": ("error", "the position does not answer its set point"),
    "no-steps": ("error", "there is no step"),
    "not-at-rest": ("indeterminate", "the shaft was not at rest before a step"),
    "settings-compared": ("note", "both settings side by side"),
    "turns-at-rest": ("indeterminate", "the shaft turns where it should stand"),
    "wrong-size": ("error", "the position moves by another size than its set point"),
    "wrong-way": ("error", "the position moves against its set point"),
}
