"""What sines draw: how far each reading is behind, over the frequency."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.figures import Figure, Series
from procedures.sensor_delay.estimates import Result


def all_figures(results: Sequence[Result]) -> Iterator[Figure]:
    """One of all probes."""
    series = []
    for r in results:
        hz = np.array([x.hz for x in r.lines])
        phase, u = (np.degrees([getattr(x, name)[r.k] for x in r.lines]) for name in ("phase", "u"))
        grid = np.linspace(0, hz.max(), 50)
        series.append(Series(r.probe.channel, hz, phase, "points", 2 * u))
        series.append(Series("", grid, 360 * grid * r.delay.seconds, "guide"))
    caption = ("Phase by which each reading is behind what its currents make, with two standard uncertainties; lines are the "
               "fitted delays. A rigid shaft without damping has no phase of its own.")  # fmt: skip
    yield Figure("phases", "Phase behind the current", caption, "frequency (Hz)", "phase / °", tuple(series))
