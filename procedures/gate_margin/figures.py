"""What is looked at: largest readings over the places with the gate, readings of one window with their extremes, the catch."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from bench.figures import Figure, Series
from bench.rigfile import RigFile
from procedures.gate_margin.estimates import Looked, Results
from procedures.gate_margin.place import samples
from procedures.position_loops.movers import radial

UM = 1e6


def all_figures(found: Results, rig: RigFile) -> Iterable[Figure]:
    """In the order in which they are looked at."""
    if found.looked:
        yield _over_places(found)
        yield _histogram(max(found.looked, key=lambda x: float(x.largest.max())), found, rig)
    if found.caught:
        yield _catch(found)


def _angles(found: Results, place_m: float) -> list[int]:
    some = [k for k, x in enumerate(found.looked) if x.taken.place.place_m == place_m]
    return sorted(some, key=lambda k: found.looked[k].taken.place.angle_rad)


def _places(found: Results) -> list[float]:
    return sorted({x.taken.place.place_m for x in found.looked})


def _degrees(found: Results, some: list[int]) -> np.ndarray:
    return np.array([math.degrees(found.looked[k].taken.place.angle_rad) for k in some])


def _over_places(found: Results) -> Figure:
    series = []
    for place in _places(found):
        some = _angles(found, place)
        means = np.array([found.looked[k].largest.mean() for k in some]) * UM
        series.append(Series(f"z {place * 1e3:g} mm, mean of the windows", _degrees(found, some), means, "both"))
        worst = np.array([found.looked[k].largest.max() for k in some]) * UM
        series.append(Series("", _degrees(found, some), worst, "mark"))
    caption = (f"Largest |reading| of all radial probes in {found.gate_s * 1e3:g} ms, at each place: mean of the "
               "windows, and as a dot the "
               "largest of all. The gate passes below its line.")  # fmt: skip
    return Figure("gate", "Largest readings over the places", caption, "angle / °", "largest reading / µm", tuple(series),
                  lines=(("gate", found.gate_m * UM),))  # fmt: skip


def _histogram(x: Looked, found: Results, rig: RigFile) -> Figure:
    assert rig.capture is not None
    n = samples(found.gate_s, 1 / x.taken.step_s)
    series = []
    for k, (probe, channel) in enumerate(radial(rig).items()):
        step = rig.capture.channels[channel].scale
        counts = np.round(x.taken.readings[:, k] / step).astype(int)
        values, many = np.unique(counts, return_counts=True)
        series.append(Series(probe, values * step * UM, np.log10(many * n / len(counts)), "both"))
    top = float(x.largest.max())
    notes = ((f"largest of {len(x.largest)} windows: {top * UM:.2f} µm", top * UM, 0.0),)
    caption = (f"How often each probe reads what, at {x.taken.place.name}, in one window in the mean (its decimal "
               "logarithm): where a curve goes "
               f"through 0 one reading of a window is. Normal noise of this size has {x.normal * UM:.2f} µm as its "
               "largest.")  # fmt: skip
    return Figure("readings", "Readings and their extremes", caption, "reading / µm", "log10 of the number of readings",
                  tuple(series), notes=notes)  # fmt: skip


def _short(x: Looked) -> str:
    place = x.taken.place
    return f"{place.place_m * 1e3:g}, {math.degrees(place.angle_rad):.0f}°"


def _catch(found: Results) -> Figure:
    x = np.arange(float(len(found.looked)))
    series = [Series(c.plane.probe, x, (c.reach - c.excursion) * UM, "both") for c in found.caught]
    caption = ("What the bearings hold, from where the shaft rests and less how far it went from there: of each "
               "probe's plane and axis, by place. "
               "It is less where the magnets' middle is farther off.")  # fmt: skip
    ticks = tuple((_short(look), float(k)) for k, look in enumerate(found.looked))
    return Figure("catch", "What the catch has to spare", caption, "along / mm, around", "catch margin / µm", tuple(series),
                  lines=(("none", 0.0),), ticks=ticks)  # fmt: skip
