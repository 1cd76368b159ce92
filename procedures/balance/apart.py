"""Whether the parts of a run say the same unbalance: each speed by itself, and by themselves the probes along y and along z.

Each part has two readings at least for two planes. What it says less what the whole says, times its share of the influence
coefficients' squares, is what the whole goes by it. A runout in bearings that are unlike by what nobody knows moves what the
probes along y say one way and those along z the other, so that the whole hardly moves: a difference has influences of its own.
Farther apart than these allow they are where the loop answers a runout otherwise than `loop` takes it to, or where the forces
are not those of the rig file's masses.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.balance import G_MM
from bench.analysis.vectors import Vectors, parts
from bench.findings import Effect, Finding
from bench.units import RPM
from procedures.balance.planes import Planes
from procedures.balance.solution import Solved
from procedures.synchronous.runout import times

Complex = npt.NDArray[np.complex128]
FALSE_ALARM = 1e-4  # of a part in a plane
APART = math.sqrt(-2 * math.log(FALSE_ALARM))  # standard uncertainties, of two components
MATTERS = 1.0  # standard uncertainty of the whole: what moves it by less is no matter
PROBES = {"y": [0, 2], "z": [1, 3]}


def parts_apart(apart: Mapping[str, tuple[Vectors, float]], whole: Vectors, planes: Planes) -> Iterator[Finding]:
    """By part how far it moves the `whole` (2,), kg m on the planes' scales, and its share of it."""
    for name, (moved, share) in apart.items():
        each = [moved.one(k) for k in range(len(planes))]
        far = [_far(m, m) if _far(m, whole.one(k)) > MATTERS else 0.0 for k, m in enumerate(each)]
        if max(far) > APART:
            worst = int(np.argmax(far))
            side, values = planes[worst].name, whole.values
            told = values[worst] + moved.values[worst] / share
            text = (f"{name} say {_polar(told)} for the {side} plane, all readings together {_polar(values[worst])}: farther "
                    "apart than their uncertainty. Suspect a controller that turns a push along y into one along z, a shaft "
                    "that bends, masses and lengths of the rig file, or a probe.")  # fmt: skip
            concerns = [
                f"{q}_{part}@{p.name}" for q in ("unbalance", "residual") for part in ("cos", "sin") for p in planes
            ]
            yield Finding("unbalances-apart", text, name, Effect.INDETERMINATE, tuple(concerns))


def parts_of(speeds: Sequence[float]) -> dict[str, Any]:
    """Which readings (s, 4) at `speeds` rad/s each part has, by its name."""
    groups: dict[str, Any] = {f"probes along {name}": np.s_[..., :, probes] for name, probes in PROBES.items()}
    if len(speeds) > 1:
        groups |= {f"readings at {w * RPM:.0f} r/min": np.s_[..., k : k + 1, :] for k, w in enumerate(speeds)}
    return groups


def said(solved: Solved, readings: Complex, part: Any) -> Complex:
    """The unbalance (..., 2) kg m from the mark that a part of the `readings` (..., s, 4) m over gain says."""
    a, read = solved.influence, solved.clean(readings)
    rows = np.stack([a[..., q][part] for q in (0, 1)], axis=-1)
    flat = rows.reshape(*rows.shape[:-3], -1, 2)
    return np.asarray(times(np.linalg.pinv(flat), read[part].reshape(*flat.shape[:-1])))


def share_of(solved: Solved, part: Any) -> float:
    """Of the influence coefficients' squares."""
    a = np.abs(solved.influence) ** 2
    return float(sum(a[..., q][part].sum() for q in (0, 1)) / a.sum())


def _far(moved: Vectors, of: Vectors) -> float:
    """How many standard uncertainties of another."""
    d = parts(moved.values)
    return math.sqrt(max(0.0, float(d @ np.linalg.pinv(of.covariance) @ d)))


def _polar(u: complex) -> str:
    return f"{abs(u) / G_MM:.2f} g mm at {math.degrees(np.angle(u)) % 360:.0f}°"
