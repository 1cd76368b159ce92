"""Codes of findings that several procedures tell with one meaning."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "contact": (
        "note, indeterminate, error",
        "the controller reports contact with a touchdown bearing, a ring or a stop",
    ),
    "current-saturated": ("note, indeterminate", "an amplifier was at its current limit: the response is not linear"),
    "large-detent": ("indeterminate", "the rotor catches: its detent is larger than the plan allows"),
    "misfit": ("indeterminate", "the data are off the model by more than their scatter explains"),
    "missing-samples": ("indeterminate", "more samples of a step are missing than the plan allows"),
    "not-settled": ("indeterminate, error", "a response is still outside its band at the end of the record"),
    "speed-not-reached": ("error", "the shaft does not reach the speed of the plan"),
    "stuck-channel": ("error", "a channel does not move at all; a live sensor has noise"),
    "unsettled": ("indeterminate", "readings drift within a step"),
    "voltage-saturated": ("note, indeterminate", "an amplifier was at its voltage limit"),
    "wrong-sign": ("error", "forces come out the wrong way round: a sign of currents or positions"),
}
