"""Facts of a calibration by bearing, as the servomotor's equations call them: K_i of the near bearing, K_o of the far one."""

from __future__ import annotations

from collections.abc import Mapping

from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.servomotor.conventions import conventions

ENDS = "io"


def of_ends(rig: RigFile, values: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """`K@BEARING, 3` as `K_i@3` or `K_o@3`, beside what there is."""
    out = dict(values)
    for end, bearing in zip(ENDS, conventions(rig).bearings, strict=True):
        for key, value in values.items():
            kind, _, where = key.partition("@")
            place, _, left = where.partition(", ")
            if place == bearing:
                out[f"{kind}_{end}@{left}" if left else f"{kind}_{end}"] = value
    return out
