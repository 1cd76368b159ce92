"""The greatest current of a segment during a step, q and d together, by true currents.

Where both segments reach their limit, their sensors read the same, and true currents differ by what their gains do: the
greatest is that of the segment whose sensor reads too little. In the mean it lies above either by a third of a gain's half
width, 10 mA at 0.3 % of 10 A. To take each step's greatest reading for it is as if chance chose one of both: then 19 % of rigs
are above their interval.

Noise raises the largest of n readings. Those within three of its standard deviations s of the largest are taken to be as far
apart as noise leaves them, a_i = mean + sqrt(1 - s^2/S^2) (x_i - mean) with their own standard deviation S (James and Stein):

    E max = integral of x d prod_i Phi((x - a_i)/s).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.angle_step.bounds import Swing, noise_of
from procedures.angle_step.budget import within
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.shared.certificates import certified_sensors
from procedures.shared.greater import greater

Array = npt.NDArray[np.float64]
NEAR = 3.0  # standard deviations of noise below the largest reading: any of these may truly be the largest
GRID = np.linspace(-6.0, 7.0, 261)  # of them, about the largest: where the largest of some may be


@dataclass(frozen=True)
class Largest:
    """The greatest amplitude of a segment in one step, A, less what noise raises it by; q and d (2,) A there; and how far `off`
    that is, A, were all readings near the largest alike."""

    amplitude: float
    vector: Array
    off: float


def estimates(where: str, swings: Sequence[Swing], rig: RigFile) -> dict[str, Estimate]:
    """`amplitude`, A, a mean over the steps of a case; nothing of a motor whose segments carry no vectors."""
    if not all(s.whole for s in swings):
        return {}
    machine = conventions(rig)
    sensors = certified_sensors(rig, {name: name for name in machine.segments})
    noise = noise_of(rig, machine.segments, 1 / float(swings[0].t[1]))
    found = [largest(s, machine, sensors, noise) for s in swings]
    each = [
        functools.reduce(greater, [_sensed(f, pair, sensors) for f, pair in zip(of, machine.vectors, strict=True)])
        for of in found
    ]
    values = [e.value for e in each]
    u = float(np.std(values, ddof=1)) / math.sqrt(len(values))
    scatter = Influence(id=f"scatter/amplitude/{where}", name="scatter of the repeats", u=u, unit="A", kind="A",
                        distribution="normal", dof=float(len(values) - 1), source=f"{len(values)} steps")  # fmt: skip
    off = float(np.mean([max(of, key=lambda f: f.amplitude).off for of in found]))
    mean = functools.reduce(lambda a, b: a + b, each) * (1 / len(each))
    out = (
        mean
        + Estimate.of(0.0, scatter)
        + within(f"noise/amplitude/{where}", "noise in the greatest amplitude", off, "A")
    )
    return {"amplitude": Estimate(out.value, "A", out.sensitivities, out.sampler)}


def largest(swing: Swing, machine: Servomotor, sensors: dict[str, Estimate], noise: float) -> list[Largest]:
    """Of each segment, by the certified values of its sensors. Samples are taken as they are: the derivative of an encoder's
    counts makes currents jump from tick to tick. `noise` A of a reading."""
    out = []
    for read, pair in zip(swing.vectors, machine.vectors, strict=True):
        gain, offset = (np.array([[sensors[f"{key}_{c}"].value] for c in pair]) for key in ("gain", "offset"))
        true = (read - offset) / gain
        size = np.hypot(true[0], true[1])
        k = int(np.argmax(size))
        by, alike = raised(size[size >= size[k] - NEAR * noise], noise)
        out.append(Largest(float(size[k]) - by, true[:, k], max(alike - by, 0.0)))
    return out


def raised(near: Array, noise: float) -> tuple[float, float]:
    """By how much noise raises the largest of some readings (n,) A that are near it; and were they alike."""
    if noise <= 0:
        return 0.0, 0.0
    spread = float(near.var(ddof=1)) if len(near) > 1 else 0.0
    kept = math.sqrt(max(1 - noise**2 / spread, 0.0)) if spread > 0 else 0.0
    level = near.mean() + kept * (near - near.mean())
    return _above(level, noise), _above(np.zeros(len(near)), noise)


def _above(level: Array, noise: float) -> float:
    """By how much the largest of normal numbers of means `level` (n,) is above the greatest of these, in the mean."""
    from scipy import special

    x = level.max() + noise * GRID
    below = special.ndtr((x[:, None] - level) / noise).prod(axis=1)
    return float(x[-1] - level.max() - np.trapezoid(below, x))


def _sensed(found: Largest, pair: Sequence[str], sensors: dict[str, Estimate]) -> Estimate:
    """With what gains and offsets of its sensors do: da = -(q (q dg_q + do_q) + d (d dg_d + do_d))/(a g)."""
    parts: dict[Influence, float] = {}
    for at, channel in zip(found.vector, pair, strict=True):
        gain, offset = sensors[f"gain_{channel}"], sensors[f"offset_{channel}"]
        by = -float(at) / max(found.amplitude, 1e-300) / gain.value
        parts |= {i: c * by * float(at) for i, c in gain.sensitivities.items()}
        parts |= {i: c * by for i, c in offset.sensitivities.items()}
    return Estimate(found.amplitude, "A", parts)
