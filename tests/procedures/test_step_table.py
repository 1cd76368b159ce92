"""A table of steps: what is written as labels is read back, and what the samples of each step come to."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np
import numpy.typing as npt
import pytest

from bench.errors import AnalysisError
from bench.recording.recorder import Recorder
from bench.recording.steps import Step, Steps
from bench.rigfile.roles import STATUS
from procedures.servomotor.loads import load_index
from procedures.shared.step_table import Labels, StepTable, by_angle, record_step, reduced, tabulate

MS = 1_000_000


@dataclass(frozen=True)
class Level(Labels):
    """What a test records."""

    kind: ClassVar[str] = "level"
    angle_rad: float
    load: str

    def __str__(self) -> str:
        return f"{self.load or 'nothing'} at {self.angle_rad:g}"


@dataclass
class Recorded:
    """Takes steps, and gives as many samples as each lasted milliseconds, less one that was lost: 0, 1, 2 ..."""

    flags: int = 0

    def __post_init__(self) -> None:
        self.steps: list[Step] = []

    @contextmanager
    def step(self, kind: str, **labels: Any) -> Iterator[None]:
        start = 1_700_000_000_000_000_000 + 100 * MS * len(self.steps)
        self.steps.append(Step(cast(Any, self), kind, labels, start, start + 10 * MS))
        yield

    def read(self, channels: tuple[str, ...], start_ns: int, end_ns: int) -> dict[str, npt.NDArray[Any]]:
        n = round((end_ns - start_ns) / MS) - 1
        data = {c: np.arange(n) * (k + 1.0) for k, c in enumerate(channels)}
        return data | {STATUS: np.where(np.arange(n) == 3, self.flags, 0)}

    def lost(self, stream: str, start_ns: int, end_ns: int) -> int:
        return 1

    @property
    def streams(self) -> dict[str, Any]:
        return {"telemetry": type("Stream", (), {"period_ns": MS})}


def recorded(*levels: Level, flags: int = 0) -> list[Step]:
    record = Recorded(flags)
    for level in levels:
        with record_step(cast(Recorder, record), level):
            pass
    return record.steps


def two_angles() -> StepTable[Level]:
    levels = [Level(angle, load) for angle in (0.0, 1.5) for load in ("", "M1", "M2")]
    steps, shape = by_angle(Steps(tuple(recorded(*levels, flags=8))), "levels")
    return tabulate(steps, Level, ("a", "b"), shape=shape)


def test_labels_are_read_back_as_written() -> None:
    (step,) = recorded(Level(0.5, "M1"))
    assert (step.kind, dict(step.labels)) == ("level", {"angle_rad": 0.5, "load": "M1"})
    assert list(step.labels) == ["angle_rad", "load"]
    assert tabulate([step], Level, ("a",)).labels == (Level(0.5, "M1"),)


def test_a_table_has_the_shape_of_angles_and_steps() -> None:
    table = two_angles()
    assert table.mean["a"].shape == table.flags.shape == table.lost.shape == (2, 3)
    assert len(table) == 6
    assert table.each(lambda level: level.angle_rad).tolist() == [[0.0] * 3, [1.5] * 3]
    assert table.stack(("b", "a")).shape == (2, 2, 3)
    assert np.diff(table.time_s.reshape(-1)) == pytest.approx(0.1)


def test_samples_come_to_means_drifts_spreads_and_flags() -> None:
    table = two_angles()
    x = 2.0 * np.arange(9)
    assert np.unique(table.mean["b"]) == x.mean()
    assert np.unique(table.drift["b"]) == x[4:].mean() - x[:4].mean()
    assert np.unique(table.spread["b"]) == x.std()
    assert np.unique(table.ptp["b"]) == 16
    assert np.unique(table.flags) == 8
    assert np.unique(table.expected) == 10


def test_the_worst_step_is_called_by_its_labels() -> None:
    values = np.zeros((2, 3))
    values[1, 2] = 1.0
    assert two_angles().where(values) == "M2 at 1.5"


def test_an_angle_that_lacks_a_step_is_told() -> None:
    steps = recorded(Level(0.0, ""), Level(0.0, "M1"), Level(1.5, ""))
    for given, found in ((steps, r"\[1, 2\]"), ([], "none")):
        with pytest.raises(AnalysisError, match=f"levels per angle: found {found}; expected the same number"):
            by_angle(Steps(tuple(given)), "levels")


def test_a_load_that_is_not_in_the_plan_is_told() -> None:
    assert load_index(["", "M2", "M1"], ("M1", "M2"), "hanger").tolist() == [-1, 1, 0]
    with pytest.raises(AnalysisError, match="masses: found M9 on the lever; expected those of the plan, M1, M2"):
        load_index(["M1", "M9"], ("M1", "M2"), "lever")


@pytest.mark.parametrize("value", [1e-3, 20e-9, 2.9985, -7.31e-5])
def test_a_constant_has_no_spread(value: float) -> None:
    """The mean of 1000 equal numbers is rounded, and their standard deviation then some 1e-19: a stuck sensor would be live."""
    data = {"x": np.full(1000, value), STATUS: np.zeros(1000, int)}
    assert reduced(data, ("x",), {})["spread"] == {"x": 0.0}
