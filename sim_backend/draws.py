"""Draws: every one has a name and its own stream, a hash of seed and name, so that adding one leaves the others."""

from __future__ import annotations

import hashlib
import math

from scipy import special

from bench.rigfile.toleranced import Toleranced


def uniform(seed: int, name: str) -> float:
    """A number in (0, 1), the same for the same seed and name everywhere."""
    digest = hashlib.sha256(f"{seed}:{name}".encode()).digest()
    return (int.from_bytes(digest[:7], "little") + 0.5) / 2**56


def draw_one(t: Toleranced, seed: int, name: str) -> float:
    """A value from the distribution that `t` states."""
    p = uniform(seed, name)
    if t.distribution == "normal":
        return t.value + t.standard_uncertainty * float(special.ndtri(p))
    half = t.half_width or 0.0
    if t.distribution == "rectangular":
        return t.value + half * (2 * p - 1)
    if t.distribution == "triangular":
        return t.value + half * (math.sqrt(2 * p) - 1 if p < 0.5 else 1 - math.sqrt(2 - 2 * p))
    return t.value + half * math.sin(math.pi * (p - 0.5))
