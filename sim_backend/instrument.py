"""Reference instruments of a simulated rig: each reads the true place of an axis with an error of its own, as is stated.

    reading = sign (gain P + error(P) + noise) + zero + drift t,     rounded to its resolution

with t since its first reading. The error along its scale is a sum of sines of random phases, as large at any one place as
stated; on an axis that turns it repeats with a turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

from bench import units
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_reference import ReferenceInstrument
from bench.rigfile.toleranced import Toleranced
from sim_backend.draws import draw_one, uniform
from sim_backend.machine import Truth

SINES: Final = 6
PERIODS: Final = (3, 17)  # in a scale's length, or in a turn
SCALE_M: Final = 0.03
READING_S: Final = 1.0
DRAWN: Final = ("gain", "drift")
DEFECTS: Final = {"reference_sign": 1.0, "reference_unit": 1.0, "reference_drift": 0.0, "reference_mistyped": 0.0}
"""Planted in every instrument, with their harmless values: the way in which it counts, what is read of what it shows (another
unit), how fast its zero wanders, m/s or rad/s, and the number of the reading that is typed with its point one place off."""


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """What is drawn of each instrument, by name."""
    return {
        f"reference.{axis}.{key}": number
        for axis, one in rig.capabilities.reference.items()
        for key in DRAWN
        if (number := getattr(one, key)) is not None
    }


class Instruments:
    """All of a rig's; `places` give the true place of an axis by its name, `now` s. What they truly saw goes into the truth."""

    def __init__(
        self, rig: RigFile, truth: Truth, places: Mapping[str, Callable[[], float]], now: Callable[[], float]
    ) -> None:
        self._rig, self._truth, self._places, self._now = rig, truth, places, now
        self._begun: dict[str, float] = {}
        self._count = 0

    def request(self, axis: str) -> str:
        """What the operator's line answers to `read AXIS`."""
        one = self._rig.capabilities.reference.get(axis)
        if one is None or axis not in self._places:
            return f"error no instrument reads {axis}"
        place = self._places[axis]()
        self._truth.seen.append((axis, place))
        symbol = one.unit or ("rad" if self._rig.encoders[axis].measures == "angle" else "m")
        shown = self.shown(axis, one, place) / units.unit(symbol).factor
        return f"ok {READING_S} {shown!r} {symbol}"

    def shown(self, axis: str, one: ReferenceInstrument, place: float) -> float:
        """Its next reading of a place, SI."""
        values, defects, seed, visit = self._truth.values, self._truth.defects, self._truth.seed, self._truth.visit
        self._count += 1
        noise = (
            draw_one(one.noise, seed, f"reference.{axis}.noise.{self._count}", visit) if one.noise is not None else 0.0
        )
        since = self._now() - self._begun.setdefault(axis, self._now())
        wander = values.get(f"reference.{axis}.drift", 0.0) + defects["reference_drift"]
        read = values[f"reference.{axis}.gain"] * place + scale_error(axis, one, place, seed, self._rig) + noise
        shown = one.sign * defects["reference_sign"] * read * defects["reference_unit"]
        shown += wander * since + (uniform(seed, f"reference.{axis}.zero", visit) - 0.5) * one.resolution
        if self._count == int(defects["reference_mistyped"]):
            shown *= 10
        return round(shown / one.resolution) * one.resolution if one.resolution else shown


def scale_error(axis: str, one: ReferenceInstrument, place: float, seed: int, rig: RigFile) -> float:
    """Of its scale at a place: u sqrt(2/n) times the sum of n sines, whose mean square over phases is u^2 anywhere."""
    if one.error is None:
        return 0.0
    length = 2 * math.pi if rig.encoders[axis].measures == "angle" else SCALE_M
    total = 0.0
    for k in range(SINES):
        periods = round(PERIODS[0] + (PERIODS[1] - PERIODS[0]) * uniform(seed, f"reference.{axis}.period.{k}"))
        total += math.sin(2 * math.pi * (periods * place / length + uniform(seed, f"reference.{axis}.phase.{k}")))
    return one.error.standard_uncertainty * math.sqrt(2 / SINES) * total
