"""Force constants of two radial AMBs from known weights at a hook (thesis 6.6.1, corrected signs of 6.11).

Static equilibrium about the outboard AMB, with d from hook to outboard AMB and s from AMB to AMB, gives the change of
the bearing forces under a hung weight W (T 6.11, the moment row with its sign corrected)

    dF_i = -W d / s          dF_o = +W (1 + d / s)

Each bearing is a pair of opposing coils (T 2.4) with currents i_p, i_n:  F = A i_p^2 - B i_n^2. At the stated bias b,
with K = 2 b (A + B) the slope at zero control current and K2 = A - B,

    F = F_0 + K u + K2 v,   u = (i_p^2 - i_n^2) / (4 b),   v = (i_p^2 + i_n^2) / 2 - b^2

which is F_0 + K i + K2 i^2 when the sum of the currents is exactly 2 b, and stays right when the current sensors
disagree and it is not. An axis that does not stand upright feels the share c of that (`pulls`). A branch term H (+1 loading,
-1 unloading) takes hysteresis and linear drift out of K and K2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from procedures.amb_calibration.pulls import SERVOMOTOR, Pull, leans
from procedures.shared.weight import weight

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Hangings:
    """Step means of one calibration. A = angles, P = hangings per angle; the K axes of the `pull` first.

    currents (K, 2, A, P): A, [axis, coil p or n]; as the current sensors read them
    positions (K, A, P): m, along the axes at the AMB planes, from the sensor readings
    motor_m (A, P) or (K, A, P): m, along the axes at the motor plane
    load (A, P): index into the masses, -1 for nothing besides the hanger
    branch (A, P): +1 reached by loading, -1 by unloading
    angles (A,): rad
    """

    currents: Array
    positions: Array
    motor_m: Array
    load: Ints
    branch: Array
    angles: Array
    pull: Pull = SERVOMOTOR


@dataclass(frozen=True)
class Fit:
    """Per axis of the `pull` and angle: `terms` (K, A, 4) = F_0 N, K N/A, K2 N/A^2, H N; `residuals` (K, A, P) N;
    `solvers` (K, A, 4, P) maps forces to terms; `forces` (K, A, P) N; `control` (K, A, P) the control current A."""

    terms: Array
    residuals: Array
    solvers: Array
    forces: Array
    control: Array
    pull: Pull = SERVOMOTOR


def shares(pull: Pull, p: Mapping[str, float]) -> list[float]:
    """Share of a hung weight that each axis answers: its bearing's, leant to the axis."""
    of_plane = hung_shares(p["hook_to_outboard"], p["amb_span"])
    return [of_plane[plane] * (1.0 if c is None else c) for plane, c in zip(pull.planes, leans(pull, p), strict=True)]


def gap(axis_plane: int, p: Mapping[str, float]) -> float:
    """The air gap of a bearing, m."""
    return p[f"gap_{axis_plane}"] if f"gap_{axis_plane}" in p else p["amb_gap"]


def hung_shares(hook_to_outboard: float, span: float) -> tuple[float, float]:
    """Share of a hung weight that the inboard and the outboard AMB carry (T 6.11, corrected): -d/s, 1 + d/s."""
    return -hook_to_outboard / span, 1 + hook_to_outboard / span


def fit(h: Hangings, p: Mapping[str, float], bias_A: float, masses: int, *, top_branch: float = 1.0) -> Fit:
    """Fit F_0, K, K2 and H per axis and angle, by least squares on the force.

    `p` holds: gravity, air_density, mass_density, hook_to_outboard (from the bearing nearer to the far end, towards that end),
    amb_span, amb_gap (or gap_0, gap_1 of the two bearings), mass_0 .. mass_{n-1}, and gain_bc, offset_bc for axis b by its key
    and coil c in "pn"; motor_to_outboard and motor_stiffness where a motor pulls at the shaft; what `leans` asks for.
    `top_branch` is the branch assumed for the heaviest load, where loading turns into unloading.

    The forces are referred to a rotor exactly at the sensors' zero: what the residual displacement adds by the
    stiffness of the bearing (K b / gap, T 2.4) and of the motor (T 6.5) is taken off, in a second pass that uses the
    first one's K.
    """
    ip, i_n = _true_currents(h.currents, p, h.pull.keys)
    design = terms_of(h, p, bias_A, masses, top_branch=top_branch)
    solvers = np.asarray(np.linalg.pinv(design), np.float64)
    applied = _applied_forces(h, p, masses)
    terms = np.einsum("bafp,bap->baf", solvers, applied)
    forces = _referred(h, p, bias_A, masses, terms)
    terms = np.einsum("bafp,bap->baf", solvers, forces)
    residuals = forces - np.einsum("bapf,baf->bap", design, terms)
    return Fit(terms, residuals, solvers, forces, (ip - i_n) / 2, h.pull)


def left_over(h: Hangings, f: Fit, p: Mapping[str, float], bias_A: float, masses: int) -> Array:
    """Residuals (K, A, P) in N that hangings leave by the terms of a fit, of these or of others at the same angles."""
    design = terms_of(h, p, bias_A, masses)
    out: Array = _referred(h, p, bias_A, masses, f.terms) - np.einsum("bapf,baf->bap", design, f.terms)
    return out


def terms_of(h: Hangings, p: Mapping[str, float], bias_A: float, masses: int, *, top_branch: float = 1.0) -> Array:
    """What F_0, K, K2 and H are multiplied by, (K, A, P, 4)."""
    ip, i_n = _true_currents(h.currents, p, h.pull.keys)
    u = (ip**2 - i_n**2) / (4 * bias_A)
    v = (ip**2 + i_n**2) / 2 - bias_A**2
    branch = np.where(h.load == masses - 1, top_branch, h.branch)
    out: Array = np.stack([np.ones_like(u), u, v, np.broadcast_to(branch, u.shape)], axis=-1)
    return out


def _referred(h: Hangings, p: Mapping[str, float], bias_A: float, masses: int, terms: Array) -> Array:
    """Forces (K, A, P) in N referred to the sensors' zero, by the K of the `terms`."""
    stiffness = terms[:, :, 1].mean(axis=1) * bias_A / np.array([gap(plane, p) for plane in h.pull.planes])
    out: Array = _applied_forces(h, p, masses) + _motor_forces(h, p) - stiffness[:, None, None] * h.positions
    return out


def _true_currents(currents: Array, p: Mapping[str, float], keys: tuple[str, ...]) -> tuple[Array, Array]:
    """Coil currents (K, A, P) freed of the sensors' offsets and gains."""
    out = [
        np.stack([(currents[b, c] - p[f"offset_{key}{coil}"]) / p[f"gain_{key}{coil}"]
                  for b, key in enumerate(keys)])
        for c, coil in enumerate("pn")
    ]  # fmt: skip
    return out[0], out[1]


def _applied_forces(h: Hangings, p: Mapping[str, float], masses: int) -> Array:
    """Force (K, A, P) in N that each axis adds to carry the hung masses; the hanger is on for every point."""
    kg = np.array([p[f"mass_{k}"] for k in range(masses)] + [0.0])  # index -1 is nothing
    newtons = np.asarray(weight(kg[h.load], p["gravity"], p["air_density"], p["mass_density"]))
    return np.stack([share * newtons for share in shares(h.pull, p)])


def _motor_forces(h: Hangings, p: Mapping[str, float]) -> Array:
    """Force (K, A, P) in N that the axes add against the motor's pull off centre (T 6.5, alpha_x)."""
    if "motor_stiffness" not in p:
        return np.zeros((len(h.pull.axes), *h.load.shape))
    lever = p["motor_to_outboard"] / p["amb_span"]
    pull = p["motor_stiffness"] * np.broadcast_to(h.motor_m, (len(h.pull.axes), *h.load.shape))
    by_plane = lever, -(1 + lever)
    return np.stack([by_plane[plane] * pull[k] for k, plane in enumerate(h.pull.planes)])


def tangents(terms: Array, share: Array, hanger_N: float) -> Array:
    """dF/di in N/A at the current that carries the rotor's own weight without the hanger, (K, A).

    On F_0 + K i + K2 i^2 = L the slope is sqrt(K^2 + 4 K2 (L - F_0)); L = -hanger_N * share, because the fit's zero
    of force has the hanger on. `share` (K,) is that of `shares`.
    """
    f0, k, k2 = terms[:, :, 0], terms[:, :, 1], terms[:, :, 2]
    own = -hanger_N * share[:, None]
    slope: Array = np.sign(k) * np.sqrt(np.maximum(k**2 + 4 * k2 * (own - f0), 0.0))
    return slope


def over_a_turn(f: Fit, p: Mapping[str, float]) -> dict[str, float]:
    """Means over the angles, by the axis' key: K_i, K_o N/A; K2_i, K2_o N/A^2; Kw_i, Kw_o N/A (the tangent at own weight)."""
    share = np.array(shares(f.pull, p))
    hanger = float(weight(p["hanger"], p["gravity"], p["air_density"], p["mass_density"]))
    slope = tangents(f.terms, share, hanger)
    mean = f.terms.mean(axis=1)
    out: dict[str, float] = {}
    for b, key in enumerate(f.pull.keys):
        out |= {f"K_{key}": mean[b, 1], f"K2_{key}": mean[b, 2], f"Kw_{key}": float(slope[b].mean())}
    return {name: float(x) for name, x in out.items()}


def by_angle(f: Fit) -> dict[str, float]:
    """K in N/A and K2 in N/A^2 of each axis at each angle k: `K_i@k`, `K2_i@k`, `K_o@k`, `K2_o@k`."""
    return {
        f"{name}_{key}@{k}": float(f.terms[b, k, term])
        for b, key in enumerate(f.pull.keys)
        for name, term in (("K", 1), ("K2", 2))
        for k in range(f.terms.shape[1])
    }


def carried(f: Fit, p: Mapping[str, float]) -> dict[str, float]:
    """F_0 of each axis at each angle k, N, as `F0_i@k` and `F0_o@k`, with the shaft alone as the zero of force; and what the
    hanger adds to each, N, as `hanger_i` and `hanger_o`.

    The fit's zero of force has the hanger on, so that F_0 + K u + K2 v = -hanger without it (see `tangents`). With F0 = F_0 +
    hanger the shaft alone, at rest at the sensors' zero, is carried by currents of F0 + K u + K2 v = 0: the rotor's weight, the
    motor's pull and the journal's place in the magnet are in F0, each as it is at that angle and that bias.
    """
    hanger = float(weight(p["hanger"], p["gravity"], p["air_density"], p["mass_density"]))
    out: dict[str, float] = {}
    for b, share in enumerate(shares(f.pull, p)):
        key = f.pull.keys[b]
        out |= {f"F0_{key}@{k}": float(f0) + share * hanger for k, f0 in enumerate(f.terms[b, :, 0])}
        out[f"hanger_{key}"] = share * hanger
    return out
