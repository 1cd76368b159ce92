"""Stored runs for scripts: channels with their times and gaps, steps, captures, and names that are none."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from recordings import START_NS, gapped, record

import bench
from bench.api.run import Run
from bench.api.tables import results_of
from bench.errors import ConfigError, RecordingError
from bench.quantity import Quantity
from bench.record.records import measurement, missing, unfinished
from bench.uncertainty import Estimate, Influence

NAME = "amb-calibration-20260101T000000Z-0000"


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """A folder of two recordings without records."""
    for name in (NAME, "step-20260102T000000Z-0001"):
        path = tmp_path / "runs" / name
        path.mkdir(parents=True)
        record(path / "recording.mcap", gapped(), captured=2)
    return tmp_path / "runs"


@pytest.fixture
def run(runs: Path) -> Run:
    return bench.open_run(runs / NAME)


def test_a_channel_has_its_samples_at_their_times_and_says_what_is_missing(run: Run) -> None:
    channel = run["pos_yi"]
    index = np.r_[0:1200, 1205:2305]
    assert np.array_equal(channel.values, (1e-6 * np.sin(0.7 * index) + 1e-9 * index).astype(np.float32).astype(float))
    assert np.array_equal(channel.time, index / 1000)
    assert (channel.unit, len(channel), channel.lost) == ("m", 2300, 5)
    assert np.array_equal(channel.to_pandas().index, channel.time)
    assert repr(channel) == "<Channel pos_yi [m]: 2300 samples, 0 to 2.304 s, 5 lost>"
    assert channel.between(1.1, 1.21).lost == 5
    assert len(channel.between(5, 6)) == channel.between(5, 6).lost == 0


def test_a_plot_has_a_gap_where_samples_are_missing(run: Run) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    axes = run["pos_yi"].plot()
    (line,) = axes.get_lines()
    y = np.asarray(line.get_ydata(), float)
    assert np.flatnonzero(np.isnan(y)).tolist() == [1200]
    assert axes.get_ylabel() == "pos_yi / µm"
    assert np.nanmax(np.abs(y)) == pytest.approx(np.max(np.abs(run["pos_yi"].values)) * 1e6)
    axes.figure.clear()


def test_steps_by_kind_and_labels(run: Run) -> None:
    steps = run.steps
    assert list(steps.columns) == ["kind", "start_s", "end_s", "start_ns", "end_ns", "block", "odd"]
    assert len(steps) == 23
    assert steps.start_s[12] == 1.205
    odd = run["pos_yi"].during("dwell", odd=True)
    assert [len(part) for part in odd] == [100] * 11
    assert odd[0].time[0] == 0.1
    with pytest.raises(
        ConfigError, match=r"found no step dwell, block=99; its steps dwell have the labels block, odd$"
    ):
        run["pos_yi"].during("dwell", block=99)
    with pytest.raises(ConfigError, match=r"found no step dwel; it has steps dwell$"):
        run["pos_yi"].during("dwel")


def test_captures_are_counted_as_their_files_are(run: Run) -> None:
    assert run.captures.index.tolist() == [1, 2]
    capture = run.capture(2)
    channel = capture["inject"]
    assert len(channel) == 1500
    assert channel.time[0] == pytest.approx(0.1)
    assert len(capture.to_pandas()) == 1500
    for number in (0, 3):
        with pytest.raises(ConfigError, match=f"found no capture {number}; expected one of 1 to 2"):
            run.capture(number)


def test_names_that_are_none_are_answered_by_the_nearest(run: Run) -> None:
    assert "pos_yi" in run
    assert "pos" not in run
    with pytest.raises(ConfigError, match="found no channel 'pos_yy'; expected one of pos_yi"):
        run["pos_yy"]
    with pytest.raises(ConfigError, match="found no channel 'injekt'; expected one of inject"):
        run.capture(1)["injekt"]
    with pytest.raises(ConfigError, match="found no channel"):
        run.to_pandas("pos_yi", "pos_zi")
    assert list(run.to_pandas("pos_yi", "pos_yi")) == ["pos_yi"]
    assert list(run.to_pandas()) == list(run)


def test_a_run_is_found_by_path_and_name(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`last` goes by the index: `test_python_pages.py`."""
    for found in (str(runs / NAME), runs / NAME / "recording.mcap"):
        assert bench.open_run(found).run_id == NAME
    for name in (NAME, "amb-c"):
        assert bench.open_run(name, str(runs)).run_id == NAME
    monkeypatch.chdir(runs.parent)
    assert bench.open_run("step").run_id.startswith("step-")
    with pytest.raises(ConfigError, match=r"nothing: found no run directory of that name, here or in runs"):
        bench.open_run("nothing")
    with pytest.raises(ConfigError, match=r"last: found no runs in runs"):
        bench.open_run("last")
    (runs / "step-20260101T000000Z-0002").mkdir()
    with pytest.raises(ConfigError, match=r"step: found 2 runs in runs whose name begins so"):
        bench.open_run("step")
    assert bench.open_run("step-20260102").run_id == "step-20260102T000000Z-0001"


def test_without_a_record_or_a_recording_what_is_there_is_given(runs: Path) -> None:
    run = bench.open_run(runs / NAME)
    assert repr(run) == f"<Run {NAME}>"
    assert NAME in run._repr_html_()
    with pytest.raises(ConfigError, match="record"):
        run.results  # noqa: B018
    (runs / NAME / "recording.mcap").write_bytes(b"no recording")
    with pytest.raises(RecordingError):
        bench.open_run(runs / NAME)


def test_times_are_of_the_telemetry(run: Run) -> None:
    assert run.recording.start_ns == START_NS


def test_importing_bench_loads_nothing_heavy() -> None:
    """Nobody who asks for the version waits for numpy, pandas or matplotlib."""
    script = (
        "import sys, bench; print(sorted({'numpy', 'pandas', 'matplotlib', 'pydantic', 'mcap'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_results_say_what_their_uncertainties_are() -> None:
    """An infinite dof is no missing one; with two the interval is stated and no u; U = k u by t of GUM table G.2."""
    own = Influence("scatter/1", "scatter", 0.1, "N/A", "A", "normal", 8.0)
    kinds = (dataclasses.replace(own, dof=math.inf), own, dataclasses.replace(own, dof=2.0))
    made = [
        measurement(Quantity(f"K_{k}", "N/A", "constant").measured(Estimate.of(75.0, i)), None)
        for k, i in enumerate(kinds)
    ]
    blank = unfinished(run_id=NAME, procedure="step", rig="r", uut={}, started="", seed=None, plan={}, versions={})
    gone = missing(Quantity("B", "N/A", "drag"))
    found = results_of(dataclasses.replace(blank, measurements=(*made, gone)))
    assert found.dof.tolist()[:3] == [math.inf, 8.0, 2.0]
    assert found.k.tolist()[:2] == pytest.approx([1.96, 2.306], abs=1e-3)
    assert found.U.tolist()[:3] == pytest.approx([0.196, 0.2306, 0.4303], abs=1e-4)
    assert found.u.isna().tolist() == [False, False, True, True]
    assert found.p.tolist()[:3] == [0.95] * 3
    assert found.loc["B", ["value", "U", "dof", "p"]].isna().all()
