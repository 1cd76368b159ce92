"""How many threads linear algebra takes: one. Our systems are small, and threads that wait for each other spin meanwhile.

A run of `step` took 20 s of processor time on two busy cores with as many threads as cores, 10 s with one; and what spins is in
the way of the links. Standard library alone: it has to come before numpy.
"""

from __future__ import annotations

import os

LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def limit() -> None:
    """One thread, where the environment does not say how many; before numpy is imported."""
    for name in LIMITS:
        os.environ.setdefault(name, "1")
