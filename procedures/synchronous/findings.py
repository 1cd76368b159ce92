"""Codes of findings that the procedures of the turning AMB rotor tell."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "aliasing": ("indeterminate, error", "a higher order, or motion above half the sampling rate, shows as order 1"),
    "bearings": ("note", "what the bearings are taken for: the adopted model, or the plan's tolerances"),
    "contact-unreported": (
        "indeterminate",
        "by its positions the shaft is at a ring, and the controller reports no contact",
    ),
    "ellipse": ("note", "the greatest 95 % ellipse of a vector"),
    "forces-disagree": (
        "error",
        "two unbalances do not explain motion and forces: a channel is not what its name says",
    ),
    "hum": ("indeterminate", "a line that does not turn with the shaft may move a result by more than its U"),
    "no-slow-roll": ("indeterminate", "without a slow roll, runout is taken for unbalance"),
    "no-vectors": ("error", "nothing was recorded that vectors can be taken of"),
    "not-synchronous": ("indeterminate", "the captures show motion that does not turn with the shaft"),
    "pulse-doubled": ("error", "once-per-turn pulses are doubled"),
    "pulse-missing": ("error", "once-per-turn pulses are missing"),
    "response-changed": ("error", "the repeat differs from the first: a weight came loose, a shaft bent"),
    "sensor-clipped": ("error", "a position sensor stood at the end of its range"),
    "slow-roll": ("note", "what was subtracted as runout, and when"),
    "slow-roll-too-fast": ("indeterminate", "at slow roll unbalance already moves the shaft"),
    "speed-off": ("indeterminate, error", "the speed is not the plan's, or does not stay"),
    "voltage-not-certified": ("note", "the rig file has no certificates of the coil voltages"),
    "weight-not-carried": ("error", "by their currents an axis' coils do not carry their share of the weight"),
    "zone": ("note", "where the greatest value lies in its zones"),
}
