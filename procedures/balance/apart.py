"""Whether the parts of a run say the same unbalance: each speed by itself, and by themselves the probes along y and along z.

Each part has two readings at least for two planes. What it says less what the whole says, times its share of the influence
coefficients' squares, is what the whole goes by it. A sound machine's parts are .4 U apart so, at most. Farther apart they are
where the loop answers a runout otherwise than `loop` takes it to, or where the forces are not those of the rig file's masses.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.balance import G_MM
from bench.analysis.vectors import Vectors, parts
from bench.findings import Effect, Finding
from bench.units import RPM
from procedures.balance.planes import Planes
from procedures.balance.solution import Solved

Complex = npt.NDArray[np.complex128]
APART = 3.0  # standard uncertainties of the whole, by what a part moves it
PROBES = {"y": [0, 2], "z": [1, 3]}


def parts_apart(
    solved: Solved, readings: Complex, speeds: Sequence[float], whole: Vectors, planes: Planes
) -> Iterator[Finding]:
    """Of `readings` (s, 4) m over gain at `speeds` rad/s, whose unbalance is `whole` (2,) kg m on the planes' scales."""
    for name, said, share in _said(solved, readings, speeds):
        told = np.array([p.told(complex(said[k])) for k, p in enumerate(planes)])
        far = [_far(whole.one(k), share * (told[k] - whole.values[k])) for k in range(len(planes))]
        if max(far) > APART:
            worst = int(np.argmax(far))
            side, values = planes[worst].name, whole.values
            text = (f"{name} say {_polar(told[worst])} for the {side} plane, all readings together {_polar(values[worst])}: "
                    "farther apart than their uncertainty. Suspect a controller that turns a push along y into one along z, "
                    "a shaft that bends, masses and lengths of the rig file, or a probe.")  # fmt: skip
            concerns = [
                f"{q}_{part}@{p.name}" for q in ("unbalance", "residual") for part in ("cos", "sin") for p in planes
            ]
            yield Finding("unbalances-apart", text, name, Effect.INDETERMINATE, tuple(concerns))


def _said(solved: Solved, readings: Complex, speeds: Sequence[float]) -> Iterator[tuple[str, Complex, float]]:
    a = solved.influence
    clean = readings - solved.beside - np.einsum("spq,sq->sp", a, solved.taken)
    groups: dict[str, Any] = {f"probes along {name}": np.s_[:, probes] for name, probes in PROBES.items()}
    if len(speeds) > 1:
        groups |= {f"readings at {w * RPM:.0f} r/min": np.s_[k : k + 1, :] for k, w in enumerate(speeds)}
    for name, part in groups.items():
        rows = a[part].reshape(-1, 2)
        share = float((np.abs(rows) ** 2).sum() / (np.abs(a) ** 2).sum())
        yield name, np.linalg.pinv(rows) @ clean[part].ravel(), share


def _far(of: Vectors, by: complex) -> float:
    """How many standard uncertainties."""
    d = parts(np.array([by]))
    return math.sqrt(max(0.0, float(d @ np.linalg.pinv(of.covariance) @ d)))


def _polar(u: complex) -> str:
    return f"{abs(u) / G_MM:.2f} g mm at {math.degrees(np.angle(u)) % 360:.0f}°"
