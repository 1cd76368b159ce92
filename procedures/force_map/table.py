"""Reading tables of operating points with forces and torque, and files of constants; every problem is named."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import ConfigError, Problem
from bench.units import to_si, unit
from procedures.force_map.fit import UNITS, Points

Array = npt.NDArray[np.float64]

OPERATING = {"i_x": "A", "i_y": "A", "i_theta": "A", "x": "m", "y": "m", "theta": "rad"}
MEASURED = {"F_x": "N", "F_y": "N", "tau": "N m"}
UNCERTAIN = {"u_F_x": "N", "u_F_y": "N", "u_tau": "N m"}
KNOWN = OPERATING | MEASURED | UNCERTAIN
MODEL_SCHEMA = 1
SHOWN = 12  # problems named at once; a table of a thousand rows may have a thousand of one kind


@dataclass(frozen=True)
class Table:
    """Operating points with what was measured there: `force` (n, 2) N and `torque` (n, 1) N m, None where the table has none,
    and their standard uncertainties `u_force`, `u_torque`, None where they are not stated."""

    points: Points
    force: Array | None
    torque: Array | None
    u_force: Array | None
    u_torque: Array | None


def parse_table(text: str, name: str) -> Table:
    """A table from CSV: comment lines begin with #, the heading names each column with its unit, `x [mil]`.

    Raises:
        ConfigError: columns or units are unknown or missing, or a value is not a finite number; every problem is named.
    """
    lines = [(k, line) for k, line in enumerate(text.removeprefix("\ufeff").splitlines(), 1)
             if line.strip() and not line.lstrip().startswith("#")]  # fmt: skip
    if not lines:
        raise ConfigError(f"table {name}: it has no heading; expected columns {_expected()}")
    columns = _heading(next(csv.reader([lines[0][1]])), name)
    problems: list[Problem] = []
    rows = [_row(line, number, columns, name, problems) for number, line in lines[1:]]
    if problems:
        more = f" (the first {SHOWN} of {len(problems)})" if len(problems) > SHOWN else ""
        raise ConfigError(f"table {name} cannot be used{more}:", tuple(problems[:SHOWN]))
    if not rows:
        raise ConfigError(f"table {name}: it has a heading and no points; expected at least two")
    values = dict(zip([c for c, _ in columns], np.array(rows).T, strict=True))
    return _table(values)


def _table(values: dict[str, Array]) -> Table:
    def stack(*names: str) -> Array | None:
        return np.stack([values[n] for n in names], axis=-1) if all(n in values for n in names) else None

    points = Points(**{n: values[n] for n in OPERATING})
    return Table(points, stack("F_x", "F_y"), stack("tau"), stack("u_F_x", "u_F_y"), stack("u_tau"))


def _expected() -> str:
    return (
        ", ".join(f"{n} [{u}]" for n, u in (OPERATING | MEASURED).items()) + " (torque or both forces may be left out)"
    )


def _heading(cells: list[str], name: str) -> list[tuple[str, str]]:
    """Column names with their units."""
    columns: list[tuple[str, str]] = []
    problems: list[Problem] = []
    for cell in cells:
        column, _, rest = cell.strip().partition("[")
        column, symbol = column.strip(), rest.strip().removesuffix("]").strip()
        try:
            if column not in KNOWN:
                problems.append(Problem(name, "heading", f"column {cell.strip()!r}", f"one of {', '.join(KNOWN)}"))
            elif not symbol or unit(symbol).si != KNOWN[column]:
                expected = f"a unit of the kind of {KNOWN[column]}, as in {column} [{KNOWN[column]}]"
                problems.append(Problem(name, f"heading: {column}", f"unit {symbol!r}", expected))
            elif column in [c for c, _ in columns]:
                problems.append(Problem(name, f"heading: {column}", "it twice", "each column once"))
        except ConfigError as error:
            problems.append(Problem(name, f"heading: {column}", f"unit {symbol!r}", str(error)))
        columns.append((column, symbol))
    problems += _missing({c for c, _ in columns}, name)
    if problems:
        raise ConfigError(f"table {name} cannot be used:", tuple(problems))
    return columns


def _missing(found: set[str], name: str) -> Iterator[Problem]:
    if missing := [f"{n} [{u}]" for n, u in OPERATING.items() if n not in found]:
        yield Problem(name, "heading", "no " + ", ".join(missing), "all of the operating point")
    if ("F_x" in found) != ("F_y" in found):
        yield Problem(name, "heading", "one force", "both F_x and F_y: their nine constants are shared")
    if not found & set(MEASURED):
        yield Problem(name, "heading", "neither forces nor torque", "F_x [N] and F_y [N], or tau [N m], or all")
    for uncertain, needs in (("u_F_x", ("F_x", "u_F_y")), ("u_F_y", ("F_y", "u_F_x")), ("u_tau", ("tau",))):
        if uncertain in found and not found.issuperset(needs):
            yield Problem(name, "heading", f"{uncertain} alone", f"it with {' and '.join(needs)}")


def _row(line: str, number: int, columns: list[tuple[str, str]], name: str, problems: list[Problem]) -> list[float]:
    cells = next(csv.reader([line]))
    if len(cells) != len(columns):
        problems.append(Problem(name, f"line {number}", f"{len(cells)} values", f"{len(columns)}, as the heading has"))
        return [math.nan] * len(columns)
    return [_value(cell, column, symbol, f"line {number}", name, problems)
            for cell, (column, symbol) in zip(cells, columns, strict=True)]  # fmt: skip


def _value(cell: str, column: str, symbol: str, where: str, name: str, problems: list[Problem]) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or (column in UNCERTAIN and value <= 0):
        expected = "a number above zero" if column in UNCERTAIN else "a finite number"
        problems.append(Problem(name, f"{where}: {column}", repr(cell.strip()), expected))
        return math.nan
    return to_si(value, symbol)


def parse_constants(text: str, name: str) -> dict[str, float]:
    """Constants of a force map by name, SI, from the file that `bench map` writes.

    Raises:
        ConfigError: not such a file, of a newer schema, or with unknown constants, units or values.
    """
    try:
        table: Any = json.loads(text)
    except ValueError as error:
        raise ConfigError(f"model {name}: not JSON: {error}") from error
    if not isinstance(table, dict) or table.get("kind") != "force-map" or table.get("schema") != MODEL_SCHEMA:
        raise ConfigError(f'model {name}: expected an object with "kind": "force-map" and "schema": {MODEL_SCHEMA}')
    constants = table.get("constants")
    if not isinstance(constants, dict) or not constants:
        raise ConfigError(f"model {name}: found no constants; expected an object of them, as `bench map` writes it")
    problems = []
    out = {}
    for key, entry in constants.items():
        value = entry.get("value") if isinstance(entry, dict) else None
        found = entry.get("unit") if isinstance(entry, dict) else None
        if key not in UNITS:
            problems.append(Problem(name, key, "this constant", f"one of {', '.join(UNITS)}"))
        elif (
            found != UNITS[key]
            or isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
        ):
            problems.append(Problem(name, key, f"{value!r} {found!r}", f"a finite number in {UNITS[key]}"))
        else:
            out[key] = float(value)
    if problems:
        raise ConfigError(f"model {name} cannot be used:", tuple(problems))
    return out
