"""What a calibration by hung masses finds of a twin: slopes of each radial axis' force over its control current where the
probes
read zero, as the mean over a turn.

With the bias b and the control current i an axis pulls F = A (b + i)^2 - B (b - i)^2, A = beta/(gap - xi)^2 and B =
beta/(gap + xi)^2, at
the displacement xi from its magnetic centre. So dF/di at no control current is K = 2 b (A + B), half the second derivative
K2 = A - B,
and where the axis carries the share F of the weight, F = K2 b^2 + K i + K2 i^2, the slope is Kw = sqrt(K^2 + 4 K2 (F - K2
b^2)). The
journals' runout moves the shaft while the probes are held at zero: xi depends on the angle.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim_backend.machines.twin.params import TwinParams

Array = npt.NDArray[np.float64]
ANGLES = 64
PROBES = 16  # columns of a row of `TwinParams.probe`


def calibrated(p: TwinParams, bias: Array, turn: Array | None = None) -> tuple[Array, Array, Array]:
    """K N/A, K2 N/A^2 and Kw N/A of each radial axis at the `bias` A of each; means over a turn, or at the angles `turn`
    rad."""
    angles = np.arange(ANGLES) * 2 * np.pi / ANGLES if turn is None else turn
    xi = displaced(p, angles)
    beta, gap = (np.array(x)[: p.radial, None] for x in (p.beta, p.gap))
    near, far = beta / (gap - xi) ** 2, beta / (gap + xi) ** 2
    b = bias[:, None]
    k, k2 = 2 * b * (near + far), near - far
    slope = np.sqrt(k**2 + 4 * k2 * (carried(p)[:, None] - k2 * b**2))
    return k.mean(axis=1), k2.mean(axis=1), slope.mean(axis=1)


def displaced(p: TwinParams, angles: Array) -> Array:
    """(axes, angles) m: from each radial axis' magnetic centre, with every probe held at zero."""
    looking = np.array(p.probe).reshape(8, PROBES)[:4].T
    seen = np.abs(looking).sum(axis=1) > 0
    zero = -np.array(p.position_offset) / np.array(p.position_gain)
    turning = sum(
        np.outer(np.array(wave).reshape(4, PROBES)[n - 1], f(n * angles))
        for n in (1, 2, 3, 4)
        for wave, f in ((p.runout_c, np.cos), (p.runout_s, np.sin))
    )
    at = np.linalg.pinv(looking[seen], rcond=1e-9) @ (zero[:, None] - turning)[seen]
    rows = np.array(p.axis).reshape(8, 16)[:4].T[: p.radial]
    return np.asarray(rows @ at + np.array(p.offset)[: p.radial, None])


def carried(p: TwinParams) -> Array:
    """(axes,) N: by which the radial axes carry the shaft's weight."""
    rows = np.array(p.axis).reshape(8, 16)[:4].T[: p.radial]
    return np.asarray(np.linalg.pinv(rows.T, rcond=1e-9) @ (-p.mass * np.array([p.gravity[1], p.gravity[2], 0.0, 0.0])))
