"""Calibrations: results of runs adopted as facts of a rig, kept beside it and looked up before a run."""

from bench.calibration.calibration import (
    Backend,
    Calibration,
    Need,
    Used,
    adopted,
    certificate,
    certificates_of,
    changed_certificates,
    number,
    of_a_day,
    of_the_rig,
    settings_differ,
    stands,
)

__all__ = [
    "Backend",
    "Calibration",
    "Need",
    "Used",
    "adopted",
    "certificate",
    "certificates_of",
    "changed_certificates",
    "number",
    "of_a_day",
    "of_the_rig",
    "settings_differ",
    "stands",
]
