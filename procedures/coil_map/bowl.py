"""Where a mover lies in its ring under a push, and the pushes found from where it lies.

Pulled outwards by as much in every direction (a negative stiffness about the ring's middle) it lies on the wall, where the
rest of what acts on it has no part along the wall: in the direction of v = g + S i, with g what acts without currents (its
weight, the pull's offset) and S i what the currents i = (d, q) push. In readings

    r = o + c v/|v| + e v,

o the ring's middle, c > 0 its clearance, e the wall's compliance. A scale of g and S together changes nothing but e. So S is
found but for its size, yet with its sign, its handedness and how it stands: what wiring shows in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
CLEAR = (0.6, 1.4)  # the clearance, of half of what the mover's places span
GIVES = 0.3  # what the wall gives way under the whole push, of the same, at most
STARTS = 12  # directions of a push, on either hand, that a search begins with


@dataclass(frozen=True)
class Bowl:
    """A plane's answer: middle `o` (2,) m, clearance `c` m, what acts at rest `g` (2,) A and pushes `s` (2, 2), of which the
    greater singular value is 1: amperes of a bearing current. `m` (2,): what the current beside pushes, in the same. `rest` m:
    what the fit leaves, root mean square."""

    o: Array
    c: float
    g: Array
    s: Array
    m: Array
    rest: float

    @property
    def mirrored(self) -> bool:
        """Its pushes turn the other way than their currents."""
        return bool(np.linalg.det(self.s) < 0)

    @property
    def angle(self) -> float:
        """How far a push of d stands from the first axis, rad: of a turn, or of a turn after (d, -q)."""
        s, sign = self.s, -1.0 if self.mirrored else 1.0
        return math.atan2(s[1, 0] - sign * s[0, 1], s[0, 0] + sign * s[1, 1])

    @property
    def roundness(self) -> float:
        """Its lesser singular value over the greater: 1 where it pushes as hard in every direction."""
        small, large = sorted(np.linalg.svd(self.s, compute_uv=False))
        return float(small / large)


def swing(places: Array) -> float:
    """How far places (n, 2) are from one another at most, by the greater side of a box about them, m."""
    return float(np.ptp(places, axis=0).max())


def fitted(currents: Array, beside: Array, places: Array) -> Bowl:
    """The bowl of a plane by currents (n, 2) A and those beside (n,) A, and by where it lay (n, 2) m; the best of several
    beginnings."""
    from scipy.optimize import least_squares

    middle, size = places.mean(axis=0), max(swing(places) / 2, 1e-9)
    scale = float(np.sqrt((currents**2).sum(axis=1).max()))
    i, b, r = currents / scale, beside[:, None] / scale, (places - middle) / size

    def left(p: Array) -> Array:
        v = i @ p[:4].reshape(2, 2).T + p[4:6] + b * p[6:8]
        length = np.sqrt((v**2).sum(axis=1) + 1e-6)[:, None]
        model = p[8:10] + p[10] * v / length + p[11] * v
        return np.append((model - r).ravel(), 1e-2 * (np.linalg.norm(p[:4]) - math.sqrt(2)))

    low, high = [-np.inf] * 10 + list(CLEAR[:1]) + [0.0], [np.inf] * 10 + list(CLEAR[1:]) + [GIVES]
    best = None
    for hand in (1.0, -1.0):
        for k in range(STARTS // 2):
            a = 2 * math.pi * k / (STARTS // 2)
            turn = [math.cos(a), -hand * math.sin(a), math.sin(a), hand * math.cos(a)]
            start = np.array([*turn, 0.0, -0.3, 0.0, 0.0, 0.0, 0.0, 1.0, 0.05])
            found = least_squares(left, start, bounds=(low, high), max_nfev=60, loss="soft_l1", f_scale=0.1)
            if best is None or found.cost < best.cost:
                best = found
    assert best is not None
    p = best.x
    s, per = p[:4].reshape(2, 2), scale
    of_s = max(float(np.linalg.norm(s, 2)), 1e-12)
    m = p[6:8] / of_s if np.ptp(beside) > 0 else np.zeros(2)
    rest = float(np.sqrt(np.mean(best.fun[:-1] ** 2))) * size
    return Bowl(middle + size * p[8:10], size * float(p[10]), p[4:6] / of_s * per, s / of_s, m, rest)


def rest_of(pushes: Array, places: Array) -> float:
    """What is left of places (n, 2) m, root mean square, by pushes (n, 2) A that are known but for what acts beside them."""
    from scipy.optimize import least_squares

    middle, size = places.mean(axis=0), max(swing(places) / 2, 1e-9)
    scale = float(np.sqrt((pushes**2).sum(axis=1).max()))
    i, r = pushes / scale, (places - middle) / size

    def left(p: Array) -> Array:
        v = i + p[:2]
        length = np.sqrt((v**2).sum(axis=1) + 1e-6)[:, None]
        return np.asarray((p[2:4] + p[4] * v / length + p[5] * v - r).ravel())

    low, high = [-3.0, -3.0, -1.0, -1.0, CLEAR[0], 0.0], [3.0, 3.0, 1.0, 1.0, CLEAR[1], GIVES]
    starts = ([0.3 * math.cos(a), 0.3 * math.sin(a), 0.0, 0.0, 1.0, 0.05] for a in (-math.pi / 2, math.pi / 2))
    found = [least_squares(left, s, bounds=(low, high), max_nfev=40, loss="soft_l1", f_scale=0.1) for s in starts]
    best = min(found, key=lambda f: float(f.cost))
    return float(np.sqrt(np.mean(best.fun**2))) * size
