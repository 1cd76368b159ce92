"""What turns, by a ring of known moment of inertia that is put on it.

    K i = J x'' + c x' + k x   without,   K i = (J + J_r) x'' + c' x' + k' x   with it;
    p = K/J, q = K/(J + J_r) by the sines   =>   J = J_r q/(p - q),   K = p J

Gains of the currents are in p and q alike and fall out of J. Friction and slopes are fitted in both by themselves. A ring whose
axis is e off the mover's adds J_r + m e^2 (Steiner); its weight is one more slope, m g e at most.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence
from procedures.shared.certificates import certified

RING, RING_MASS, ECCENTRICITY = "ring_inertia", "ring_mass", "ring_eccentricity"
NAME = "ring"
LEAST = 0.02  # of K/J, that the ring takes off


class NotSeen(AnalysisError):
    """The mover turns as easily with the ring as without it."""


def added(rig: RigFile) -> Estimate:
    """What the ring adds about the mover's axis, kg m^2."""
    ring = certified(f"machine/{RING}", rig.machine[RING], "inertia of the ring")
    off = rig.machine.get(ECCENTRICITY)
    if off is None or off.standard_uncertainty == 0:
        return ring
    mass, u = rig.machine[RING_MASS].value, off.standard_uncertainty
    spread = u * u * (math.sqrt(2) if off.distribution == "normal" else math.sqrt(0.8))  # of the square of what is off
    fit = Influence(f"machine/{ECCENTRICITY}/square", "eccentricity of the ring, squared", mass * spread, "kg m^2", "B",
                    "normal", source=off.source)  # fmt: skip
    return ring + Estimate.of(mass * (off.value**2 + u * u), fit)


def inertias(
    bare: Sequence[Mapping[str, Estimate]], ringed: Sequence[Mapping[str, Estimate]], rig: RigFile
) -> list[Estimate]:
    """Of what turns, at each place: K/J of each motor there without and with the ring.

    Raises:
        NotSeen: the ring makes no difference.
    """
    out, ring = [], added(rig)
    for without, beside in zip(bare, ringed, strict=True):
        p, q = (sum(of.values(), Estimate.exact(0.0)) for of in (without, beside))
        if not (p.value - q.value) > LEAST * p.value:
            raise NotSeen(
                f"K over what turns is {q.value / p.value - 1:+.1%} with the ring on: was it mounted, does it sit tight?"
            )
        j = ring * (q / (p - q))
        out.append(Estimate(j.value, "kg m^2", j.sensitivities))
    return out
