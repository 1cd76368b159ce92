"""`bench map`: the constants of a force map from a table of operating points; needs no rig."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from bench.errors import AnalysisError, ConfigError
from bench.uncertainty import coverage_factor, stated
from procedures.force_map import figures, fit, terms
from procedures.force_map.fit import UNITS
from procedures.force_map.table import MODEL_SCHEMA, Table, parse_constants, parse_table
from procedures.force_map.terms import Part
from reports.figures import draw

DATA = "procedures.force_map.data"


@dataclass(frozen=True)
class Request:
    """What was typed: a table's path or the name of one that is installed; likewise a model's."""

    table: str
    poles: int
    against: str
    out: Path | None


def map_command(request: Request) -> int:
    """Fit, print, write `model.json` and the figures.

    Raises:
        ConfigError: the table or the model cannot be used, or the points are too few.
    """
    name, text = _text(request.table, ".csv", "table")
    table = parse_table(text, name)
    given = _text(request.against, ".json", "model") if request.against else None
    constants = None if given is None else parse_constants(given[1], given[0])
    try:
        parts = terms.identify(table, request.poles)
    except AnalysisError as error:
        raise ConfigError(f"table {name}: {error}") from error
    stem = Path(request.table).stem
    lines = [f"{stem}: {len(table.points)} points, {request.poles} poles"]
    for part in parts:
        lines += ["", *_constants(part, table, request.poles), *_selection(part)]
    if constants is not None and given is not None:
        lines += ["", *_prediction(parts, constants, Path(given[0]).stem)]
    out = request.out or Path("maps") / stem
    _write(out, parts, request.poles, name, text)
    sys.stdout.write("\n".join(lines) + f"\n\n{out}\n")
    return 0


def _text(name: str, suffix: str, what: str) -> tuple[str, str]:
    """Name and text of a file by its path, else of an installed one by its name.

    Raises:
        ConfigError: there is none, or it is not text.
    """
    path = Path(name)
    shipped = sorted(f.name for f in files(DATA).iterdir() if f.name.endswith(suffix))
    try:
        if path.is_file():
            return name, path.read_text(encoding="utf-8")
        known = f"{name.removesuffix(suffix)}{suffix}"
        if known in shipped:
            return known, (files(DATA) / known).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise ConfigError(f"{what} {name}: cannot be read: {error}; expected a text file") from error
    names = ", ".join(f.removesuffix(suffix) for f in shipped)
    raise ConfigError(f"{what} {name}: there is no such file; expected a path, or one of those installed: {names}")


def _constants(part: Part, table: Table, poles: int) -> list[str]:
    """The table of constants, with what cannot be told and why."""
    k = coverage_factor(part.fit.dof)
    values = f"{part.measured.size} values, {part.fit.dof} degrees of freedom, k = {k:.2f} (95 %)"
    lines = [f"{part.name}: {len(part.fit.terms)} of {len(part.terms)} terms; {values}"]
    for term, value, u in zip(part.fit.terms, part.fit.values, part.fit.u, strict=True):
        lines.append(f"  {term:8} {stated(float(value), float(k * u)):>22} {UNITS[term]:10} {fit.ABOUT[term]}")
    lines += [
        f"  {term:8} cannot be identified: {fit.why_unseen(term, table.points, poles)}" for term in part.told.unseen
    ]
    lines += [
        f"  {', '.join(group)} cannot be identified: these points show only combinations of them"
        for group in part.told.entangled
    ]
    for group, point in part.told.lone:
        lines.append(f"  note: point {point + 1} alone tells {' from '.join(group)}; nothing checks it")
    lines += [f"  {name:8} left out: it does not improve the prediction of points left out" for name in part.dropped]
    rms = float(np.sqrt((part.fit.residuals**2).mean()))
    lines.append(f"  residuals {rms:.3g} {part.unit} rms, {np.abs(part.fit.residuals).max():.3g} {part.unit} at most")
    if part.fit.stated and (ratio := part.fit.chi2 / part.fit.dof) > 1:
        lines.append(f"  chi-squared is {ratio:.2f} per degree of freedom: uncertainties widened by {ratio**0.5:.2f}")
    return lines


def _selection(part: Part) -> list[str]:
    path = part.selection.path
    if part.selection.chosen is None:
        return [
            "  selection: no two points can be spared, so nothing judges the terms; all that can be identified are kept"
        ]
    lines = [f"  selection by leaving out one of {int(part.selection.spared.sum())} points at a time (error, rms):"]
    for candidate in path:
        numbers = " ".join(term.partition("_")[2] for term in candidate.terms)
        mark = "  chosen: the smallest as good as the best" if candidate is part.selection.chosen else ""
        lines.append(f"    {len(candidate.terms)}  {numbers:18} {candidate.loss**0.5:9.4g} {part.unit}{mark}")
    return lines


def _prediction(parts: Sequence[Part], constants: dict[str, float], model: str) -> list[str]:
    """How well given constants predict the table: in its unit, and relative to the values that are not zero."""
    lines = [f"prediction by {model}"]
    for part in parts:
        predicted = fit.predict(part.design, part.terms, constants)
        error, given = np.abs(predicted - part.measured), part.measured != 0
        relative = 100 * (error[given] / np.abs(part.measured[given])).max(initial=0.0)
        absolute = f"{error.size} values within {error.max():.3g} {part.unit}"
        lines.append(f"  {part.name:8} {absolute}; the {int(given.sum())} that are not zero within {relative:.2f} %")
    return lines


def _write(out: Path, parts: Sequence[Part], poles: int, name: str, text: str) -> None:
    digest = hashlib.sha256(text.encode()).hexdigest()
    model = {"schema": MODEL_SCHEMA, "kind": "force-map", "source": {"table": Path(name).name, "sha256": digest},
             "poles": poles, **_model(parts)}  # fmt: skip
    try:
        out.mkdir(parents=True, exist_ok=True)
        _replace(out / "model.json", json.dumps(model, indent=2) + "\n")
        for figure in figures.part_figures(parts):
            _replace(out / f"{figure.key}.svg", draw(figure).svg)
    except OSError as error:
        raise ConfigError(
            f"{out}: cannot be written: {error.strerror or error}; name another folder by --out"
        ) from error


def _model(parts: Sequence[Part]) -> dict[str, Any]:
    constants = {
        term: {"value": float(value), "unit": UNITS[term], "standard_uncertainty": float(u), "dof": part.fit.dof}
        for part in parts
        for term, value, u in zip(part.fit.terms, part.fit.values, part.fit.u, strict=True)
    }
    covariance = {p.name: {"terms": list(p.fit.terms), "matrix": p.fit.covariance.tolist()} for p in parts}
    unidentifiable = [term for part in parts for term in part.told.unidentifiable]
    dropped = [term for part in parts for term in part.dropped]
    return {"constants": constants, "covariance": covariance, "unidentifiable": unidentifiable, "left_out": dropped}


def _replace(path: Path, text: str) -> None:
    part = path.with_name(f".{path.name}.part")
    part.write_text(text, encoding="utf-8", newline="\n")
    os.replace(part, path)
