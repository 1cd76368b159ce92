"""Names of quantities as letters: Greek, primed, with their subscript; for the page and for matplotlib."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

from reports import text
from reports.text import GREEK
from reports.view import Symbol

_NAME = re.compile(rf"({'|'.join(GREEK)})(?:_(\w+?))?(_prime)?(?:_(amb))?")


def symbol(name: str) -> Symbol:
    """`alpha_x_prime` -> α′ with subscript x; `K_i@upper` -> K with subscript i."""
    base = name.partition("@")[0]
    match = _NAME.fullmatch(base)
    if match is None:
        letter, subscript = text.symbol(base)
        return Symbol(base, letter, subscript)
    subscript = ",".join(GREEK.get(part, part) for part in (match[2], match[4]) if part)
    letter = GREEK[match[1]] + ("′" if match[3] else "")
    return Symbol(letter, letter, subscript)


def axis_label(name: str) -> str:
    """The same for matplotlib's maths, with the place that a name has."""
    base, _, where = name.partition("@")
    if where:
        return f"{axis_label(base)} ({where.replace('$', '')})"
    match = _NAME.fullmatch(base)
    if match is None:
        letter, subscript = text.symbol(base)
        if len(letter) > 1:
            return base.replace("$", "")
        return f"${letter}_{{\\mathrm{{{subscript}}}}}$" if subscript else f"${letter}$"
    parts = [rf"\{p}" if p in GREEK else rf"\mathrm{{{p}}}" for p in (match[2], match[4]) if p]
    prime = "'" if match[3] else ""
    return f"$\\{match[1]}{prime}_{{{','.join(parts)}}}$" if parts else f"$\\{match[1]}{prime}$"


def place(name: str) -> str:
    """What `K_i@upper` says beyond its symbol: `upper`."""
    return name.partition("@")[2]


def with_subscripts(equation: str) -> Markup:
    """`F_y = K i_y` with its subscripts set low; everything else escaped."""
    return Markup(re.sub(r"(?<=[^\W_])_([^\W_]+)", r"<sub>\1</sub>", str(escape(equation))))
