"""What protects a rig, in short: each limit with the readings that it bounds, and what no limit bounds."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator

from bench import display_units
from bench.rigfile import RigFile, protection
from bench.rigfile.protection import Protected

WIDTH = 80
WHEN = {False: "protected always:", True: "protected while the rotor is held:"}


def told(rig: RigFile) -> str:
    """Lines of at most 80 columns: limits that always hold, those while the rotor is held, readings without one."""
    found = protection.all_of(rig)
    lines = []
    for held, title in WHEN.items():
        if those := [p for p in found if p.held is held]:
            lines += [title, *_groups(those)]
    lines += _without(rig)
    return "".join(f"{line}\n" for line in lines)


def _groups(found: list[Protected]) -> Iterator[str]:
    """A paragraph for each limit, with the names of what it bounds."""
    groups: dict[tuple[str, str], list[str]] = {}
    for p in found:
        groups.setdefault((_limit(p), p.key), []).append(p.name)
    for (limit, key), names in groups.items():
        yield from _wrapped(f"{limit} ({key}): {', '.join(names)}", "  ")


def _limit(p: Protected) -> str:
    size = max(abs(x) for x in (p.low, p.high) if math.isfinite(x))
    symbol, one = display_units.of_result(p.unit, size) if p.unit == "m" else (p.unit, 1.0)
    low, high, unit = p.low / one, p.high / one, symbol.replace("um", "µm")
    if low == -high:
        return f"±{high:.4g} {unit}"
    if math.isinf(high):
        return f"at least {low:.4g} {unit}"
    return f"at most {high:.4g} {unit}" if math.isinf(low) else f"{low:.4g} to {high:.4g} {unit}"


def _without(rig: RigFile) -> Iterator[str]:
    """Those of one reason together."""
    reasons: dict[str, list[str]] = {}
    for u in protection.without(rig):
        reasons.setdefault(u.why, []).append(u.name)
    said = [f"{', '.join(names)}{f' ({why})' if why else ''}" for why, names in reasons.items()]
    yield from _wrapped(f"without a limit: {'; '.join(said)}", "") if said else ()


def _wrapped(text: str, indent: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=f"{indent}  ",
                         break_on_hyphens=False, break_long_words=False)  # fmt: skip
