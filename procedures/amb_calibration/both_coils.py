"""Whether both coils of a bearing pull: where the load leaves the lower one without current, K and K2 are one number.

With i_n = 0 the pull is F = A i_p^2, and u = i_p^2/(4 b), v = i_p^2/2 - b^2 = 2 b u - b^2 are the same but for a constant: the
data show A = (K/(2 b) + K2)/2 and nothing of B. The own weight of the rotor is in no rig file, so that this shows
only when it hangs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.uncertainty import Estimate, correlation
from procedures.amb_calibration.fit import Hangings
from procedures.amb_calibration.pulls import Loaded, Pull

# finding, and event: no-load current of the lower coils A, and by axis the bias that would do
ONE_SIDED = "one-sided"
LEAST = 0.05  # share of the bias: with less in a lower coil at no load, what it adds under the masses cannot be told
ROOM = 0.1  # share of the bias that the lower coil keeps under the heaviest mass at the bias that is recommended
TIED = 0.99  # correlation of two numbers that the data do not separate


def at_no_load(pull: Pull, reading: Callable[[str], float], bias_A: float) -> dict[str, float]:
    """Axes of which one coil carries next to nothing as it is now, each with the bias that it needs, A."""
    out = {}
    for axis in pull.axes:
        strong, weak = sorted((reading(coil) for coil in axis.coils), reverse=True)
        if weak < LEAST * bias_A:
            out[axis.key] = enough(strong, weak)
    return out


def enough(strong_A: float, weak_A: float) -> float:
    """The bias at which the weaker coil keeps its room under the same force: F goes with i_p^2 - i_n^2 = 4 b i, i the control
    current. In A, rounded up to tenths."""
    return math.ceil(10 * math.sqrt((strong_A**2 - weak_A**2) / (4 * (1 - ROOM)))) / 10


def of_first(recording: Recording[Any], pulls: Iterable[Pull]) -> Iterator[Finding]:
    """What the first hanging showed, where the run ended by it."""
    known = {axis.key: axis for pull in pulls for axis in pull.axes}
    for event in recording.events(ONE_SIDED):
        yield from (one_sided(known[key], float(needed)) for key, needed in event["needed"].items())


def of_fit(estimates: Mapping[str, Estimate], h: Hangings, bias_A: float) -> Iterator[Finding]:
    """Axes of which the data do not separate K and K2, because the heaviest mass leaves the lower coil without current."""
    for k, axis in enumerate(h.pull.axes):
        strong, weak = h.currents[k].max(axis=0), h.currents[k].min(axis=0)
        most = np.unravel_index(int(np.argmax(strong)), strong.shape)
        tied = abs(correlation(estimates[f"K_{axis.key}"], estimates[f"K2_{axis.key}"])) > TIED
        if tied and weak[most] < ROOM * bias_A:
            yield one_sided(axis, enough(float(strong[most]), float(weak[most])))


def one_sided(axis: Loaded, needed_A: float) -> Finding:
    """The finding for an axis."""
    return Finding(
        ONE_SIDED,
        f"the {axis.title} carries the rotor by one coil, the other has next to no current: the data show how that "
        f"coil pulls, and cannot tell K from K2. Give a bias of {needed_A:.1f} A or more.",
        axis.where,
        Effect.ERROR,
    )
