"""The comparison of T Table 2.2: what the nonlinear and the linear model leave of the same forces, by one definition.

Residual of a sample: what the model makes of its currents and position, less the force that carries there. Sums and the linear
model's numbers are of these data with the adjusted inputs, the same for both models: they describe the data, not the machine,
and scatter alone makes them uncertain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
import numpy.typing as npt

from bench.uncertainty import Estimate, Influence
from procedures.amb_rotor import magnetics
from procedures.amb_rotor.keys import gap_key
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.magnetics import AxisFit, Statics
from procedures.amb_rotor.places import Held

Array = npt.NDArray[np.float64]
COMPARED = ("k_linear", "stiffness_linear", "misfit", "misfit_linear", "misfit_ratio", "misfit_ratio_means")


@dataclass(frozen=True)
class Sums:
    """Residual sums of one axis, N^2, of the nonlinear and the linear model: `singles` over single samples, `means` over the
    batches' means. `noise_N` are the standard deviations of a sample's and of a batch's force within its step; `count`
    samples in all, `batches` in all; `dof` of the batches' deviation."""

    singles: tuple[float, float]
    means: tuple[float, float]
    noise_N: tuple[float, float]
    count: int
    batches: int
    dof: int

    @staticmethod
    def of(held: Held, values: dict[str, float], k: int, f: AxisFit) -> Sums:
        """Of axis `k`."""
        gap, steps = values[gap_key(held.machine, held.machine.axes[k])], len(held)
        one, two = residuals(magnetics.statics(held.samples(), values), k, f, gap)
        low, high = residuals(magnetics.statics(held.parts(), values), k, f, gap)
        own = np.bincount(held.of_step, one) / np.bincount(held.of_step)
        sample = math.sqrt(float(((one - own[held.of_step]) ** 2).sum()) / (len(one) - steps))
        batch = math.sqrt(float(low.reshape(steps, -1).var(axis=1, ddof=1).mean()))
        return Sums(
            (float(one @ one), float(two @ two)),
            (float(low @ low), float(high @ high)),
            (sample, batch),
            len(one),
            len(low),
            len(low) - steps,
        )

    def estimates(self, a: str) -> dict[str, Estimate]:
        """With what noise does to sums of squares S over n samples in batches of b, whose means scatter by s_b and samples by
        s: u^2 = 4 b s_b^2 (S - n s^2) + 2 n b s_b^2 s^2. The linear model's noise is taken as the nonlinear one's."""
        (sample, batch), n = self.noise_N, self.count
        each = n / self.batches

        def spread(total: float) -> float:
            return math.sqrt(each * batch**2 * (4 * max(total - n * sample**2, 0) + 2 * n * sample**2))

        def spread_of_means(total: float) -> float:
            return batch * math.sqrt(4 * max(total - self.batches * batch**2, 0) + 2 * self.batches * batch**2)

        (one, two), (low, high) = self.singles, self.means
        return {
            f"misfit_{a}": self._noisy(one, spread(one), f"misfit/{a}"),
            f"misfit_linear_{a}": self._noisy(two, spread(two), f"misfit_linear/{a}"),
            f"quiet_{a}": self._noisy(low, spread_of_means(low), f"quiet/{a}"),
            f"quiet_linear_{a}": self._noisy(high, spread_of_means(high), f"quiet_linear/{a}"),
        }

    def _noisy(self, value: float, u: float, identity: str) -> Estimate:
        """A sum with the influence of its noise."""
        name, dof = f"noise of the samples, {identity}", float(self.dof)
        noise = Influence(f"scatter/bearing-model/{identity}", name, u, "N^2", "A", "normal", dof, "batch means")
        return Estimate.of(value, noise)


def by_bearing(e: dict[str, Estimate], machine: AmbRotor) -> dict[str, Estimate]:
    """By AMB, as T Table 2.2: the linear model's slopes as means of both axes, sums of squares of both; of those that carry."""
    out = {}
    for where, pair in machine.planes.items():
        names = [machine.axes[k] for k in pair if f"misfit_{machine.axes[k]}" in e]
        if not names:
            continue
        for k in ("k_linear", "stiffness_linear"):
            out[f"{k}_{where}"] = _added([e[f"{k}_{a}"] for a in names]) * (1 / len(names))
        total = {
            k: _added([e[f"{k}_{a}"] for a in names]) for k in ("misfit", "misfit_linear", "quiet", "quiet_linear")
        }
        out |= {f"{k}_{where}": total[k] for k in ("misfit", "misfit_linear")}
        out[f"misfit_ratio_{where}"] = total["misfit_linear"] / total["misfit"]
        out[f"misfit_ratio_means_{where}"] = total["quiet_linear"] / total["quiet"]
    return out


def _added(estimates: list[Estimate]) -> Estimate:
    return reduce(add, estimates)


def residuals(s: Statics, k: int, f: AxisFit, gap: float) -> tuple[Array, Array]:
    """What the nonlinear and the linear model give more than the force that carries, N."""
    r, p, n, (beta, offset), (k_i, k_xi) = s.r[k], s.p[k], s.n[k], f.terms, f.linear.terms
    return magnetics.magnet(beta, offset, gap, r, p, n) - s.force[k], k_i * (p - n) / 2 + k_xi * r - s.force[k]
