"""Numbers and codes as the screen and the summary show them."""

from __future__ import annotations

import math

from bench import display_units
from bench.link.listened import Listened
from bench.link.readings import Reading
from bench.link.stillness import CODES

DIGITS = 4
SMALL_A = 0.1
USUALLY_LARGE = ("rad", "s")  # an angle that stands at zero is one of the shaft, in degrees


def unit_of(reading: Reading) -> tuple[str, float]:
    """Symbol and size in SI of the unit in which a channel is shown: by the greatest that it has read, so that it stays."""
    size = max(abs(reading.low), abs(reading.high)) if reading.low <= reading.high else 0.0
    if size == 0 and reading.scale.unit in USUALLY_LARGE:
        size = 1.0
    return told_unit(reading.scale.unit, size)


def told_unit(si: str, size: float) -> tuple[str, float]:
    """Symbol and size in SI of the unit in which people are told something of about `size`."""
    symbol, one = ("mA", 1e-3) if si == "A" and 0 < size < SMALL_A else display_units.of_result(si, size)
    return ("" if symbol == "1" else symbol.replace("um", "µm").replace("urad", "µrad")), one


def number(value: float, reading: Reading, one: float) -> str:
    """A value of a channel, with as many places as its greatest needs."""
    if not math.isfinite(value):
        return "-" if math.isinf(value) else "NaN"
    size = max(abs(reading.low), abs(reading.high)) / one
    places = DIGITS - 1 - (math.floor(math.log10(size)) if size > 0 else 0)
    if reading.scale.count:  # none that only the count makes
        places = min(places, math.ceil(-math.log10(reading.scale.count / one) - 1e-9))
    return f"{value / one + 0.0:.{min(max(places, 0), 5)}f}"


def shown(name: str, reading: Reading, heard: Listened) -> tuple[str, str]:
    """A channel's newest value and its unit; codes by name."""
    if not reading.count:
        return "-", ""
    if name in CODES:
        if name == "flags" and math.isfinite(reading.value):
            return f"0x{int(reading.value):04X}", ""
        return heard.readings.code(name), ""
    symbol, one = unit_of(reading)
    return number(reading.value, reading, one), symbol


def rate(hz: float) -> str:
    """`1000/s`, `49.8/s`; `-` where there is none."""
    if not hz:
        return "-"
    return f"{hz:.0f}/s" if hz >= 99.95 else f"{hz:.3g}/s"


def clock(heard: Listened) -> str:
    """The tick against the host's clock, short; why there is no number where there is none."""
    drift = heard.drift_ppm
    if drift is None:
        return "not known yet" if heard.seconds < 10 else "not known: too uneven"
    ppm, expanded = drift
    return f"{round(-ppm):+d} ± {math.ceil(expanded)} ppm"
