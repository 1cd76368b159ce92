"""The synthetic operating points that show term selection: the recipe of `procedures/force_map/data/tsbs-synthetic.csv`."""

from __future__ import annotations

from importlib.resources import files

import numpy as np

from procedures.force_map.fit import FORCE_TERMS, TORQUE_TERMS, Array, Points, force_design, predict, torque_design
from procedures.force_map.table import parse_constants

POLES = 16
COUNT, SEED = 175, 0
FORCE_NOISE, TORQUE_NOISE = 0.2, 0.0114  # N, N m: T Table 5.2, sqrt(0.0791 / 2) and sqrt(1.31e-4)
HEAD = f"""\
# Synthetic: {COUNT} operating points of T (5.25) with beta_4 and the constants of T Table 5.3, all other terms zero, and
# normal noise of {FORCE_NOISE} N on each force and {TORQUE_NOISE} N m on the torque (the residuals of T Table 5.2). Uniform:
# i_x, i_y within 3 A, i_theta within 4.5 A, x, y within 0.25 mm, theta over one electrical period of 16 poles.
# T's own 175 finite-element points are not printed. Written by tests/procedures/force_map_samples.py, seed {SEED}.
i_x [A],i_y [A],i_theta [A],x [mm],y [mm],theta [deg],F_x [N],F_y [N],tau [N m]
"""


def table_5_3() -> dict[str, float]:
    """T Table 5.3."""
    return parse_constants(
        (files("procedures.force_map.data") / "tsbs-table-5-3.json").read_text("utf-8"), "tsbs-table-5-3.json"
    )


def points(random: np.random.Generator, count: int = COUNT) -> Points:
    """Operating points spread evenly, as the heading says, rounded as they are written."""
    i_x, i_y = (np.round(random.uniform(-3, 3, count), 3) for _ in range(2))
    i_theta = np.round(random.uniform(-4.5, 4.5, count), 3)
    x, y = (np.round(random.uniform(-0.25, 0.25, count), 4) * 1e-3 for _ in range(2))
    theta = np.radians(np.round(random.uniform(0, 360 / 8, count), 3))
    return Points(i_x, i_y, i_theta, x, y, theta)


def measured(p: Points, constants: dict[str, float], random: np.random.Generator) -> tuple[Array, Array]:
    """Forces (n, 2) and torque (n, 1) with noise."""
    force = predict(force_design(p, POLES), FORCE_TERMS, constants)
    torque = predict(torque_design(p, POLES), TORQUE_TERMS, constants)
    return force + random.normal(0, FORCE_NOISE, force.shape), torque + random.normal(0, TORQUE_NOISE, torque.shape)


def synthetic_csv() -> str:
    """The file."""
    random = np.random.default_rng(SEED)
    p = points(random)
    force, torque = measured(p, table_5_3(), random)
    rows = (
        f"{p.i_x[k]:g},{p.i_y[k]:g},{p.i_theta[k]:g},{p.x[k] * 1e3:.4f},{p.y[k] * 1e3:.4f},{np.degrees(p.theta[k]):.3f},"
        f"{force[k, 0]:.3f},{force[k, 1]:.3f},{torque[k, 0]:.4f}"
        for k in range(len(p))
    )
    return HEAD + "\n".join(rows) + "\n"
