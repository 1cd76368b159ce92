"""What an operator's line says, word by word."""

from __future__ import annotations

from collections.abc import Iterable


def words(line: str, masses: Iterable[str]) -> list[str]:
    """Words of a line; the name of one of `masses`, the longest that fits, is one word whatever spaces it has."""
    spaced = sorted((n.split() for n in masses if " " in n), key=len, reverse=True)
    told, out = line.split(), list[str]()
    while told:
        name = next((n for n in spaced if told[: len(n)] == n), told[:1])
        out.append(" ".join(name))
        told = told[len(name) :]
    return out
