"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "correction-not-as-stated": ("indeterminate", "a correction acts as another mass, angle or plane than the sheet's"),
    "correction-refused": ("error", "the correction needs more in one place than the envelope allows"),
    "correction-sheet": ("note", "what is to stay on the shaft: mass, plane, angle and radius"),
    "influence": ("note", "the influence coefficients and their condition"),
    "no-dwells": ("error", "there is no dwell at the plan's speeds"),
    "no-trials": ("error", "the runs with trial weights were not completed"),
    "not-reached": ("indeterminate", "the permissible residual unbalance was not reached"),
    "planes-not-told-apart": ("error", "trial weights in the two planes have the same effect"),
    "reached": ("note", "what is left, against the permissible residual unbalance"),
    "speeds-differ": ("indeterminate", "runs that are compared were made at different speeds"),
    "still-mounted": ("note", "the run ended with weights on the shaft, which the text lists"),
    "trial-lighter": ("note", "a lighter trial weight was fixed than the plan's"),
    "trial-moved-nothing": ("error", "a trial weight has no effect that can be told"),
    "trial-refused": ("error", "the trial weight's predicted response would leave the plan's share of the clearance"),
    "verified": ("note", "how far the check runs are from their prediction"),
    "weight-angle": ("error", "a trial weight acts at another angle"),
    "weight-in-other-plane": ("error", "a trial weight acts in the other plane"),
    "weight-loose": ("error", "a weight moved during a run"),
    "weight-not-as-stated": ("error", "a trial weight acts as another mass"),
}
