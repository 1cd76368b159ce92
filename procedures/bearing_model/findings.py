"""Codes of findings that this procedure alone tells."""

from __future__ import annotations

from bench.findings import Codes

CODES: Codes = {
    "adjusted": ("note", "by how much the adjustment moves what was certified"),
    "certificate-contradicted": ("indeterminate", "the positions contradict a certificate"),
    "linear-suffices": ("indeterminate", "the linear model explains the data as well as the nonlinear one"),
    "model-fails": ("error", "the forces at rest do not fit any wiring"),
    "models-compared": ("note", "how both models do"),
    "offset-against-load": ("indeterminate", "a magnetic offset contradicts the load"),
    "set-point-not-followed": ("error", "a reading does not follow the set points"),
}
