"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "all-excluded": ("indeterminate", "all lines lie at orders of the speed"),
    "coherence-low": ("indeterminate", "the response is not that of the injection"),
    "grid-too-coarse": ("indeterminate", "the lines are too far apart for the peak"),
    "injection": ("note", "what was injected"),
    "injection-clipped": ("indeterminate", "the reference was cut at a limit"),
    "injection-wrong": ("error", "what was injected is not what was asked for"),
    "margins": ("note", "gain and phase margins"),
    "no-capture": ("error", "there is no capture of an injection"),
    "no-injection": ("error", "nothing was injected"),
    "not-explained": ("indeterminate", "the curve does not fit a closed loop"),
    "not-linear": ("indeterminate", "the response depends on the amplitude"),
    "orders-excluded": ("note", "lines at orders of the speed were left out"),
    "peak-not-refined": ("indeterminate", "the peak was not looked at more closely"),
    "scope": ("note", "for what the figures hold"),
    "wrong-axis": ("error", "another axis answers the injection"),
}
