"""Numbers, units and names as a reader expects them: one place, used by the view model only.

Rounding follows JCGM 100:2008, 7.2.6: the expanded uncertainty keeps two significant digits, the value is rounded
to the same decimal place. Digits are grouped in threes and units set off by a narrow no-break space (ISO 80000-1).
"""

from __future__ import annotations

import math
import re
from datetime import datetime

from bench.uncertainty import power_out, rounded_at

NARROW = "\u202f"  # narrow no-break space
MINUS = "\u2212"
TIMES = "\u00d7"
DASH = "\u2013"
_SUPERSCRIPTS = str.maketrans("0123456789-+", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺")
GREEK = {"alpha": "α", "beta": "β", "gamma": "γ", "rho": "ρ", "tau": "τ", "theta": "θ"}
SYMBOL = re.compile(r"\b(alpha|beta|gamma|rho|[αβγρ]′?|d?[A-Z]|d?i)_([A-Za-z0-9]{1,3}(?:,[A-Za-z])?)\b")
"""A symbol as prose writes it, `alpha_dx`, `K_i`, `dF_y`: letter and subscript. The PDF's template has the same."""
_UNIT = r"(?:[mµukM]?(?:rad|Hz|min|kg|m|N|A|V|g|s|W|T)|°C|r/min|%)(?:[²³]|\b|(?<=%))"
_AMOUNT = re.compile(rf"(?<=\d) {_UNIT}(?:[ /·]{_UNIT})*")
_WRITTEN: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"\+-"), "±"),
    (re.compile(r"(?<=\d )u(?=(?:m|s|A|rad)\b)"), "µ"),
    (re.compile(r"(?<![\w)\]-])-(?=\d)"), MINUS),
    (re.compile(rf"(?<=\S) = (?=[\d{MINUS}])"), f"{NARROW}={NARROW}"),
    (re.compile(r"(?<=\d) × (?=\d)"), f"{NARROW}{TIMES}{NARROW}"),
)
_EXPONENT = re.compile(r"(?<=\d)e([+-]\d{2})\b")
_UNIT_WORDS = {
    "um": "µm",
    "us": "µs",
    "uA": "µA",
    "urad": "µrad",
    "deg": "°",
    "degC": "°C",
    "ohm": "Ω",
    "Ohm": "Ω",
    "percent": "%",
}


def unit_text(unit: str | None) -> str:
    """A unit as printed: `A s/m` -> `A·s/m`, `N/A^2` -> `N/A²`, `um` -> `µm`; the unit one is the empty string."""
    text = (unit or "").strip()
    if text in ("", "1"):
        return ""
    powers = r"\^\((-?\d+)\)|\^(-?\d+)|(?<=[A-Za-z])(-?\d+)"
    text = re.sub(powers, lambda m: (m[1] or m[2] or m[3]).translate(_SUPERSCRIPTS), text)
    text = re.sub(r"[A-Za-z]+", lambda m: _UNIT_WORDS.get(m[0], m[0]), text)
    return re.sub(r"\s*[*·]\s*|\s+", "·", text)


def with_unit(number: str, unit: str | None) -> str:
    """Number and unit with a narrow no-break space between; angles in degrees take none."""
    printed = unit_text(unit)
    if not printed:
        return number
    return number + printed if printed == "°" else number + NARROW + printed


def grouped(number: str) -> str:
    """Plain decimal digits with a true minus sign and groups of three where there are more than four digits."""
    sign, digits = (MINUS, number[1:]) if number.startswith("-") else ("", number)
    whole, point, fraction = digits.partition(".")
    if len(whole) > 4:
        whole = re.sub(r"(?<=\d)(?=(?:\d{3})+$)", NARROW, whole)
    if len(fraction) > 4:
        fraction = re.sub(r"(\d{3})(?=\d)", rf"\1{NARROW}", fraction)
    return sign + whole + point + fraction


def power_of_ten(exponent: int) -> str:
    """` × 10⁻⁶`, with the spaces that keep it on one line."""
    return f"{NARROW}{TIMES}{NARROW}10{str(exponent).translate(_SUPERSCRIPTS)}"


def _fixed(number: float, last: int, shift: int) -> str:
    """`number` / 10^shift, rounded at the decade `last` of the unshifted number; never a negative zero."""
    scaled = rounded_at(number, last).scaleb(-shift)
    text = format(abs(scaled) if scaled.is_zero() else scaled, "f")
    return grouped(text)


def rounded_together(numbers: list[float], uncertainty: float, digits: int = 2) -> tuple[list[str], str, int]:
    """All `numbers`, and the uncertainty, to `digits` significant digits of the uncertainty.

    Returns the texts, the uncertainty's text, and the common power of ten (0 if none).
    """
    if not uncertainty > 0:
        return [plain(n) for n in numbers], "0", 0
    last = int(f"{uncertainty:.{digits - 1}e}".partition("e")[2]) - digits + 1
    shift = power_out(max(abs(uncertainty), *(abs(n) for n in numbers)), last)
    return [_fixed(n, last, shift) for n in numbers], _fixed(uncertainty, last, shift), shift


def result(value: float | None, expanded: float | None, unit: str) -> str:
    """`23.412 ± 0.034 N/A`; the whole in brackets where a unit or a power of ten follows and binds both."""
    if value is None:
        return DASH
    if expanded is None:
        return with_unit(plain(value), unit)
    (number,), u, shift = rounded_together([value], expanded)
    pair = f"{number} ± {u}"
    if not shift and not unit_text(unit):
        return pair
    pair = f"({pair})"
    return with_unit(pair + (power_of_ten(shift) if shift else ""), unit)


def shift_of(value: float | None, expanded: float | None) -> int:
    """The power of ten that `result` sets a value with its uncertainty in; 0 for none."""
    if value is None or expanded is None:
        return 0
    return rounded_together([value], expanded)[2]


def shifted(number: float, shift: int) -> str:
    """A setting over a power of ten that stands beside it, without the last digits that the division makes."""
    return plain(number) if not shift else plain(float(f"{number / 10.0**shift:.10g}"))


def at_power(number: str, shift: int, unit: str) -> str:
    """Numbers with their common power of ten and unit, in brackets where the power binds more than one."""
    if not shift:
        return with_unit(number, unit)
    return with_unit((f"({number})" if " " in number else number) + power_of_ten(shift), unit)


def interval(low: float | None, high: float | None, expanded: float | None, unit: str) -> str:
    """`[23.31, 23.56] N/A`, rounded like the result it belongs to."""
    if low is None or high is None:
        return DASH
    (a, b), _, shift = rounded_together([low, high], expanded or (high - low) / 2)
    return with_unit(f"[{a},\u00a0{b}]" + (power_of_ten(shift) if shift else ""), unit)


def significant(number: float | None, digits: int = 2) -> str:
    """A number to `digits` significant digits, `0.00051` as `5.1 × 10⁻⁴`."""
    if number is None:
        return DASH
    if number == 0:
        return "0"
    mantissa, _, exponent = f"{number:.{digits - 1}e}".partition("e")
    e = int(exponent)
    if -3 <= e < max(digits, 4):
        return _fixed(number, min(e - digits + 1, 0), 0)
    return mantissa.replace("-", MINUS) + power_of_ten(e)


def plain(number: float | int) -> str:
    """A setting as it was written: up to twelve significant digits, no trailing zeros."""
    if isinstance(number, bool):
        return "yes" if number else "no"
    if isinstance(number, int):
        return grouped(str(number))
    if not math.isfinite(number):
        return str(number)
    short = f"{number:.12g}"
    if number != 0 and not 1e-4 <= abs(number) < 1e7:
        mantissa, _, exponent = f"{number:.11e}".partition("e")
        mantissa = mantissa.rstrip("0").rstrip(".")
        return mantissa.replace("-", MINUS) + power_of_ten(int(exponent))
    return grouped(short)


def degrees_of_freedom(dof: float | None) -> str:
    """Truncated to the next lower integer (JCGM 100, G.4.1 note 1); null in a record means infinite."""
    if dof is None:
        return "∞"
    return grouped(str(math.floor(dof + 1e-9))) if dof < 1000 else "> 999"


def factor(k: float | None) -> str:
    """A coverage factor; none where the interval alone is stated."""
    return DASH if k is None else f"{k:.2f}"


def probability(p: float | None) -> str:
    """`0.95` -> `95 %`."""
    return DASH if p is None else f"{p * 100:.4g}{NARROW}%"


def moment(text: str | None) -> str:
    """An ISO 8601 time as `2026-01-01 00:00:05 UTC`; anything else as it stands."""
    if not text:
        return DASH
    try:
        at = datetime.fromisoformat(text)
    except ValueError:
        return text
    offset = at.utcoffset()
    zone = "" if offset is None else " UTC" if not offset else at.strftime(" UTC%z")
    return at.strftime("%Y-%m-%d %H:%M:%S") + zone


def span(started: str | None, ended: str | None) -> str:
    """From one moment to another, the day said once."""
    begun, end = moment(started), moment(ended)
    if not ended:
        return f"{begun}, end not recorded"
    day, _, clock = end.partition(" ")
    return f"{begun.removesuffix(' UTC') if begun.endswith(' UTC') and end.endswith(' UTC') else begun} to " + (
        clock if clock and begun.startswith(f"{day} ") else end
    )


def prose(said: str) -> str:
    """A text as print has it: true minus signs, `±`, `µ` and powers of ten for what a keyboard gives, and no line that ends
    between a number and its unit."""
    for pattern, instead in _WRITTEN:
        said = pattern.sub(instead, said)
    said = _EXPONENT.sub(lambda m: power_of_ten(int(m[1])), said)
    return _AMOUNT.sub(lambda m: m[0].replace(" ", NARROW), said)


def symbols(said: str) -> list[tuple[str, str]]:
    """A text in parts, each with the subscript that stands behind it: `by K_i` -> (`by `, ``), (`K`, `i`)."""
    parts: list[tuple[str, str]] = []
    end = 0
    for found in SYMBOL.finditer(said):
        parts += [(said[end : found.start()], "")] if found.start() > end else []
        parts.append((GREEK.get(found[1], found[1]), GREEK.get(found[2], found[2])))
        end = found.end()
    return [*parts, (said[end:], "")] if end < len(said) else parts


def symbol(name: str) -> tuple[str, str]:
    """A quantity's name as (letter, subscript): `K_i` -> K, i; `K2_o` -> K, 2,o; `alpha_d` -> α, d; a word stays whole, no
    subscript."""
    greek, _, below = name.partition("_")
    if greek in GREEK and re.fullmatch(r"[A-Za-z0-9]{1,3}", below):
        return GREEK[greek], GREEK.get(below, below)
    # A letter behind a capital is a subscript too: `Kw_i` -> K, w,i.
    match = re.fullmatch(r"([A-Za-z])(\d*)(?:_([A-Za-z0-9]{1,6}))?", name) or re.fullmatch(
        r"([A-Z])([a-z])_([A-Za-z0-9]{1,6})", name
    )
    if not match or not (match[2] or match[3] or len(name) == 1):
        return name, ""
    return match[1], ",".join(part for part in (match[2], match[3]) if part)
