"""What no data of a run can show: influences of its budgets that no check of the procedure reaches."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

from reports import budgets, tables, text
from reports.view import Symbol, Table

SHOWN = 0.01  # of a variance; what carries less of every result is summed up
MOST = 6  # rows, which leave room for them on page 1
ABOUT = (
    "No check of this procedure can reach these influences. Each is in the uncertainty as far as its source states it, and "
    "nowhere else: an error beyond that moves the result without a finding. Stated is the result that it carries most of."
)
Content = Mapping[str, Any]


def is_reached(identity: str, reached: Sequence[str]) -> bool:
    """Whether a pattern names an influence; one that begins with "!" takes away again. What came with a calibration of
    another run was out of reach there, and is here."""
    found = False
    for pattern in reached:
        if fnmatchcase(identity, pattern.removeprefix("!")):
            found = not pattern.startswith("!")
    return found


def unseen(
    measurements: Iterable[Content], reached: Sequence[str], titles: Mapping[str, str] | None = None
) -> Table:  # fmt: skip
    """The influences of Type B that are out of reach, largest share first, each with the result that it carries most of; those
    of one kind (the gains of all probes, the encoder's count in every result) are one row, named by the largest."""
    best: dict[str, tuple[float, Content, Content]] = {}
    alike: dict[str, set[str]] = defaultdict(set)
    for m in measurements:
        entries = m.get("budget") or ()
        variance = budgets.variance(m)
        for e in entries if variance > 0 else ():
            identity, name = (str(e.get(key) or "") for key in ("influence", "name"))
            share = float(e.get("contribution") or 0.0) ** 2 / variance
            if e.get("type") != "B" or is_reached(identity or name, reached):
                continue
            kind = _kind(name or identity)
            alike[kind].add(name or identity)
            if share > best.get(kind, (0.0, m, e))[0]:
                best[kind] = (share, m, e)
    ranked = sorted(best.values(), key=lambda found: -found[0])
    shown = [found for found in ranked if found[0] >= SHOWN][:MOST]
    rows = [_row(*found, titles or {}, alike) for found in shown]
    left = ranked[len(shown) :]
    if left:
        noun = "influence" if len(left) == 1 else "influences"
        rows.append((f"{len(left)} further {noun}", f"below {_share(left[0][0])} each", "", "", ""))
    header = ("Influence", "Share of variance", "Result", "Moved by one u", "Sensitivity")
    return Table("", header, tuple(rows), (1, 3, 4), _named(left, alike))


def _named(left: Sequence[tuple[float, Content, Content]], alike: Mapping[str, set[str]]) -> str:
    """What is summed up, by name: an error of it is as little seen as one of the others."""
    names = (_alike(str(e.get("name") or e.get("influence")), alike) for *_, e in left)
    return f"The further ones: {', '.join(text.prose(name) for name in names)}." if left else ""


def _kind(name: str) -> str:
    """What influences of several channels, axes or places have in common: "gain of pos_yi" is one of "gain of pos"."""
    about, _, last = name.partition(", ")[0].rpartition(" ")
    stem = last.partition("_")[0] if "_" in last else "" if len(last) <= 2 else last
    return f"{about} {stem}"


def _row(
    share: float, measurement: Content, entry: Content, titles: Mapping[str, str], alike: Mapping[str, set[str]]
) -> tuple[str, ...]:
    where = text.prose(tables.place(measurement))
    unit = str(measurement.get("unit") or "")
    name = str(entry.get("name") or entry.get("influence"))
    return (
        _alike(name, alike),
        _share(share),
        _called(tables.symbol_of(str(measurement.get("name", "")), titles)) + (f" ({where})" if where else ""),
        text.with_unit(text.significant(abs(float(entry.get("contribution") or 0.0))), unit),
        budgets.sensitivity(entry, unit),
    )


def _alike(name: str, alike: Mapping[str, set[str]]) -> str:
    others = len(alike[_kind(name)]) - 1
    return name + (f" (and {others} alike)" if others else "")


def _called(symbol: Symbol) -> str:
    """A symbol as prose writes it, which print sets as such."""
    written = f"{symbol.letter}_{symbol.subscript}"
    return written if text.SYMBOL.fullmatch(written) else symbol.plain


def _share(share: float) -> str:
    return f"{max(100 * share, 0.1):.1f}{text.NARROW}%" if share < 0.1 else f"{100 * share:.0f}{text.NARROW}%"
