"""Results and figures as tables: every number, where it stands, and nothing where there is none."""

from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from pyarrow import parquet

from bench.figures import Figure, Grid, Series
from bench.record.limits import Verdict
from bench.record.records import Measurement
from bench.run.result_tables import products

PHASE = Figure("phase", "", "", "frequency (Hz)", "phase (deg)",
               (Series("measured", np.array([10.0, 20.0]), np.array([-5.0, -30.0])),))  # fmt: skip
BODE = Figure(
    "size", "Bode", "of a test", "frequency (Hz)", "|S| (dB)",
    (Series("measured", np.array([10.0, 20.0]), np.array([0.5, 6.0]), u=np.array([0.1, 0.2])),
     Series("closed form", np.array([10.0, 15.0, 20.0]), np.array([0.4, 2.0, 6.1]))),
    below=PHASE,
)  # fmt: skip
MAP = Figure("map", "Waterfall", "of a test", "order", "speed (r/min)", (),
             grid=Grid(np.array([1.0, 2.0, 3.0]), np.array([600.0, 900.0]),
                       np.array([[1.0, 2.0, 3.0], [4.0, math.nan, 6.0]]), "µm 0-pk"))  # fmt: skip


THERE = Measurement(
    name="s_max", where="yi, at rest", unit="1", value=3.1, standard_uncertainty=0.01, dof=20.0, coverage_factor=2.09,
    expanded_uncertainty=0.021, method="gum", verdict=Verdict.PASS, limit=None, interval=(3.08, 3.13),
    coverage_probability=0.95, budget=(),
)  # fmt: skip
MISSING = dataclasses.replace(
    THERE, where="zi, at rest", value=None, standard_uncertainty=None, interval=None, coverage_probability=None
)
Tabular = Literal["parquet", "csv"]


def written(folder: Path, to: Tabular) -> dict[str, Path]:
    return {path.name: path for path in products(folder, to, [THERE, MISSING], [BODE, MAP])}


@pytest.mark.parametrize("to", ["parquet", "csv"])
def test_a_file_for_the_results_and_for_each_panel_and_map(tmp_path: Path, to: Tabular) -> None:
    names = ("results", "figure-size", "figure-phase", "figure-map-map")
    assert list(written(tmp_path, to)) == [f"{name}.{to}" for name in names]
    assert not list(tmp_path.glob("*.part"))


def test_results_are_those_that_were_measured(tmp_path: Path) -> None:
    rows = parquet.read_table(written(tmp_path, "parquet")["results.parquet"]).to_pylist()
    assert rows == [{
        "name": "s_max", "where": "yi, at rest", "unit": "1", "value": 3.1, "standard_uncertainty": 0.01, "dof": 20.0,
        "coverage_factor": 2.09, "expanded_uncertainty": 0.021, "low": 3.08, "high": 3.13, "coverage_probability": 0.95,
        "verdict": "pass",
    }]  # fmt: skip


@pytest.mark.parametrize("to", ["parquet", "csv"])
def test_results_say_infinitely_many_degrees_of_freedom_and_no_k_where_none_is_stated(
    tmp_path: Path, to: Tabular
) -> None:
    many = dataclasses.replace(THERE, dof=None, coverage_factor=1.96)
    alone = dataclasses.replace(THERE, dof=2.0, standard_uncertainty=None, coverage_factor=None)
    (file, *_) = products(tmp_path, to, [many, alone], [])
    if to == "csv":
        with file.open(newline="") as text:
            told = [(row["dof"], row["coverage_factor"], row["expanded_uncertainty"]) for row in csv.DictReader(text)]
        assert told == [("inf", "1.96", "0.021"), ("2", "", "0.021")]
    else:
        rows = parquet.read_table(file).to_pylist()
        assert [(r["dof"], r["coverage_factor"]) for r in rows] == [(math.inf, 1.96), (2.0, None)]


def test_curves_say_their_series_and_leave_an_error_bar_out_where_there_is_none(tmp_path: Path) -> None:
    with written(tmp_path, "csv")["figure-size.csv"].open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head == ["series", "x: frequency (Hz)", "y: |S| (dB)", "U (95 %)"]
    assert rows == [
        ["measured", "10", "0.5", "0.1"],
        ["measured", "20", "6", "0.2"],
        ["closed form", "10", "0.4", ""],
        ["closed form", "15", "2", ""],
        ["closed form", "20", "6.1", ""],
    ]


def test_a_map_is_told_cell_by_cell(tmp_path: Path) -> None:
    rows = parquet.read_table(written(tmp_path, "parquet")["figure-map-map.parquet"]).to_pylist()
    told = [tuple(row.values()) for row in rows]
    assert list(rows[0]) == ["x: order", "y: speed (r/min)", "µm 0-pk"]
    assert told[:3] == [(1.0, 600.0, 1.0), (2.0, 600.0, 2.0), (3.0, 600.0, 3.0)]
    assert told[3:] == [(1.0, 900.0, 4.0), (2.0, 900.0, None), (3.0, 900.0, 6.0)]
