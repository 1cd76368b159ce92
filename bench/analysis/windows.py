"""Windows of spectra, by name."""

from __future__ import annotations

import numpy as np

from bench.analysis.sampling import Array


def get_window(name: str, size: int) -> Array:
    """A periodic window (size,), as scipy.signal makes it; the one that is used mostly without that slow import."""
    if name == "hann":
        return np.asarray(0.5 + 0.5 * np.cos(np.linspace(-np.pi, np.pi, size + 1)[:-1]))
    from scipy import signal

    return np.asarray(signal.get_window(name, size))
