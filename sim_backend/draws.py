"""Draws: every one has a name and its own stream, a hash of seed and name, so that adding one leaves the others.

What a machine is depends on its seed; what another day brings depends on the visit too. Visit 0 hashes as if there were none.
What is drawn each time anew, noise and what hands do, is so too in each `stretch` of a run that was stopped and continued.
"""

from __future__ import annotations

import hashlib
import math

from scipy import special

from bench.rigfile.toleranced import Toleranced


def uniform(seed: int, name: str, visit: int = 0) -> float:
    """A number in (0, 1), the same for the same seed, name and visit everywhere."""
    return (int.from_bytes(_digest(seed, name, visit)[:7], "little") + 0.5) / 2**56


def noise_seed(seed: int, visit: int, stretch: int = 0) -> int:
    """What all noise of a visit counts from: the seed itself on visit 0, else a number of 64 bits."""
    name = in_stretch("noise", stretch)
    return int.from_bytes(_digest(seed, name, visit)[:8], "little") if visit or stretch else seed


def in_stretch(name: str, stretch: int) -> str:
    """The name of what is drawn anew in each stretch of a run; that of the first is the name itself."""
    return f"{name}/{stretch}" if stretch else name


def draw_one(t: Toleranced, seed: int, name: str, visit: int = 0) -> float:
    """A value from the distribution that `t` states."""
    p = uniform(seed, name, visit)
    if t.distribution == "normal":
        return t.value + t.standard_uncertainty * float(special.ndtri(p))
    half = t.half_width or 0.0
    if t.distribution == "rectangular":
        return t.value + half * (2 * p - 1)
    if t.distribution == "triangular":
        return t.value + half * (math.sqrt(2 * p) - 1 if p < 0.5 else 1 - math.sqrt(2 - 2 * p))
    return t.value + half * math.sin(math.pi * (p - 0.5))


def _digest(seed: int, name: str, visit: int) -> bytes:
    which = f"{seed}/{visit}" if visit else str(seed)
    return hashlib.sha256(f"{which}:{name}".encode()).digest()
