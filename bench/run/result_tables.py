"""What a run found as tables (Parquet, CSV): its results, and what each figure of its report shows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from bench.figures import Figure, Grid, Shown
from bench.record.records import Measurement
from bench.run.export import Tabular, whole_table

Array = npt.NDArray[np.float64]


def products(folder: Path, to: Tabular, found: Iterable[Measurement], figures: Iterable[Shown]) -> Iterator[Path]:
    """Write `results.<to>` and, per figure and panel, `figure-<key>.<to>` into a folder that is there; colour maps are
    `figure-<key>-map.<to>`.

    Results are in SI. A figure's columns are the series, x and y in the units of its axes, and the half-length of the error
    bar on y; a map's are x, y and value. In a polar figure x is an angle in rad.

    Yields:
        the files.

    Raises:
        OSError: a file cannot be written.
    """
    yield whole_table(folder / f"results.{to}", to, results(found))
    for figure in figures:
        if isinstance(figure, Figure):  # a table of texts has its numbers in the results
            yield from _figure(folder, to, figure)


def results(found: Iterable[Measurement]) -> pa.RecordBatch:
    """One row per result: name, place, unit, value, standard uncertainty with its degrees of freedom (inf is infinitely many),
    k and U, interval and its probability, verdict. u and k are empty where the interval alone is stated."""
    rows = [m for m in found if m.value is not None]
    ends = [m.interval or (None, None) for m in rows]
    return pa.record_batch(
        {
            "name": pa.array([m.name for m in rows], pa.string()),
            "where": pa.array([m.where for m in rows], pa.string()),
            "unit": pa.array([m.unit for m in rows], pa.string()),
            "value": pa.array([m.value for m in rows], pa.float64()),
            "standard_uncertainty": pa.array([m.standard_uncertainty for m in rows], pa.float64()),
            "dof": pa.array([math.inf if m.dof is None else m.dof for m in rows], pa.float64()),
            "coverage_factor": pa.array([m.coverage_factor for m in rows], pa.float64()),
            "expanded_uncertainty": pa.array([m.expanded_uncertainty for m in rows], pa.float64()),
            "low": pa.array([low for low, _ in ends], pa.float64()),
            "high": pa.array([high for _, high in ends], pa.float64()),
            "coverage_probability": pa.array([m.coverage_probability for m in rows], pa.float64()),
            "verdict": pa.array([m.verdict for m in rows], pa.string()),
        }
    )


def _figure(folder: Path, to: Tabular, figure: Figure) -> Iterator[Path]:
    if figure.series:
        yield whole_table(folder / f"figure-{figure.key}.{to}", to, curves(figure))
    if figure.grid is not None:
        yield whole_table(folder / f"figure-{figure.key}-map.{to}", to, cells(figure, figure.grid))
    if figure.below is not None:
        yield from _figure(folder, to, figure.below)


def curves(figure: Figure) -> pa.RecordBatch:
    """All points of a figure's series, one series after the other."""
    parts = figure.series
    columns = {
        f"x: {figure.x_label}": np.concatenate([_flat(s.x) for s in parts]),
        f"y: {figure.y_label}": np.concatenate([_flat(s.y) for s in parts]),
        "U (95 %)": np.concatenate([np.full(np.size(s.y), np.nan) if s.u is None else _flat(s.u) for s in parts]),
    }
    labels = [s.label for s in parts for _ in range(np.size(s.y))]
    return pa.record_batch({"series": pa.array(labels, pa.string()), **_numbers(columns)})


def cells(figure: Figure, grid: Grid) -> pa.RecordBatch:
    """Every cell of a figure's map, row by row."""
    x, y = np.meshgrid(grid.x, grid.y)
    found = {f"x: {figure.x_label}": x, f"y: {figure.y_label}": y, grid.label: grid.values}
    return pa.record_batch(_numbers({name: _flat(column) for name, column in found.items()}))


def _flat(column: npt.ArrayLike) -> Array:
    return np.ravel(np.asarray(column, np.float64))


def _numbers(columns: dict[str, Array]) -> dict[str, pa.Array]:
    """NaN is no value."""
    return {name: pa.array(column, pa.float64(), from_pandas=True) for name, column in columns.items()}
