"""What the probes read of forces that no unbalance makes: the loop's response, from the influence coefficients.

A runout R acts on the loop as forces H^-1 A_s^-1 R do (`runout.as_unbalance`). Where the stiffness K_x is not the same across
and along the load, those whirl backward too, and no unbalance in two planes makes them: e is left of them, a few percent. The
probes read A_s (D' + C)^-1 e of it, D' = H^-1 of the shaft in its magnets and C the controller, which the response to the trial
weights shows, (D' + C) q = w^2 B with q = A_s^-1 A:

- bearings whose axes all look along y or z: C = (w^2 B - D' q) q^-1 in each of the two planes, whatever the controller does in
  it with both of the plane's probes;
- other ones: C = T' c T with T the axes' arms and c of one axis each, by least squares.

A controller that crosses the planes is neither; e is small, and so is what of it goes wrong.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from procedures.synchronous.runout import (
    Stand,
    Turning,
    arms,
    divided,
    equivalent,
    impedance,
    runout_forces,
    slopes,
    times,
    waves,
)

Complex = npt.NDArray[np.complex128]
PLANES = ([0, 3], [1, 2])  # y and theta, z and psi
AIMED = 1e-3  # of an axis' arms, what looks to the other plane


def beside_unbalance(s: Stand, t: Turning, runout: Complex, influence: Complex) -> Complex:
    """What the probes read (4,) m of a runout (4,) m beside what they read of the unbalance that it is taken for. `influence`
    (4, 2) m/(kg m) from the mark, at the speed of `t`."""
    w = t.speed
    d, forces = impedance(s, slopes(s, t.means)[2], w, w), runout_forces(s, t.means, runout, w)
    taken, _ = equivalent(s, forces, w)
    acts = w**2 * arms(s.l_iu, s.l_ou).mT @ waves(s)
    q: Complex = np.asarray(np.linalg.solve(s.probes, influence), np.complex128)
    whole = np.add(d, controller(s, acts - d @ q, q))
    return np.asarray(times(s.probes, divided(forces - times(acts, taken), whole)))


def controller(s: Stand, forces: Complex, q: Complex) -> Complex:
    """What it answers to motion, (4, 4) N/m by y z psi theta: from its `forces` (4, 2) at two motions `q` (4, 2)."""
    out = np.zeros(np.broadcast_shapes(s.axes.shape, (*q.shape[:-2], 4, 4)), complex)
    if is_square(s):
        for plane in PLANES:
            block = forces[..., plane, :] @ np.linalg.inv(q[..., plane, :])
            for n, row in enumerate(plane):
                out[..., row, plane] = block[..., n, :]
        return out
    along, there = np.linalg.solve(s.axes.mT, forces), s.axes @ q
    c = (along * there.conj()).sum(axis=-1) / (np.abs(there) ** 2).sum(axis=-1)
    return np.asarray(s.axes.mT @ (c[..., None] * s.axes))


def is_square(s: Stand) -> bool:
    """Whether every axis looks along y or z."""
    size = np.abs(s.axes)
    y, z = (size[..., plane].max(axis=-1) for plane in PLANES)
    return bool((np.minimum(y, z) < AIMED).all())
