"""A recorded channel: its samples with their times, for numpy, pandas and plots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from bench import display_units
from bench.recording.steps import Step

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]
FEW = 8  # samples that are shown of a channel


@dataclass(frozen=True, eq=False)
class Channel:
    """The samples of one channel, in SI.

    Attributes:
        name: as the rig file has it.
        unit: SI, `1` for none.
        values: (n,) float64.
        time: (n,) s since the first sample of the run's telemetry. Samples that were lost are missing, not filled in.
        index: (n,) which sample each is, where lost ones count too: a jump is a loss.
    """

    name: str
    unit: str
    values: Array
    time: Array
    index: npt.NDArray[np.int64]
    steps: Callable[..., list[Step]]
    origin_ns: int

    def __len__(self) -> int:
        return len(self.values)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.array(self.values, dtype, copy=copy)

    @property
    def lost(self) -> int:
        """How many samples are missing between the first and the last one."""
        return int(self.index[-1] - self.index[0]) + 1 - len(self) if len(self) else 0

    def between(self, start_s: float, end_s: float) -> Channel:
        """The samples with start <= time < end."""
        first, last = np.searchsorted(self.time, [start_s, end_s])
        return self._part(slice(int(first), int(last)))

    def during(self, kind: str, **labels: Any) -> list[Channel]:
        """The samples of each step of a kind whose labels are these, in order: one channel for each step.

        Raises:
            ConfigError: there is no step of that kind, or none with such labels.
        """
        times = [
            ((s.start_ns - self.origin_ns) / 1e9, (s.end_ns - self.origin_ns) / 1e9) for s in self.steps(kind, **labels)
        ]
        return [self.between(start, end) for start, end in times]

    def to_pandas(self) -> pd.Series[float]:
        """A series of the values by `t_s`, called as the channel."""
        import pandas as pd

        return pd.Series(self.values, pd.Index(self.time, name="t_s"), name=self.name)

    def plot(self, axes: Axes | None = None, **style: Any) -> Axes:
        """Draw it over time in the unit in which its field tells it, with gaps where samples are missing.

        Args:
            axes: where; a new figure by default.
            style: as `matplotlib.axes.Axes.plot` takes it.
        """
        from matplotlib import pyplot as plt

        drawn: Axes = plt.subplots()[1] if axes is None else axes
        symbol, one = self._told()
        drawn.plot(*self._broken(one), **{"label": self.name, "linewidth": 0.8, **style})
        drawn.set_xlabel("time / s")
        drawn.set_ylabel(self.name if symbol in ("", "1") else f"{self.name} / {symbol}")
        return drawn

    def _told(self) -> tuple[str, float]:
        size = float(np.max(np.abs(self.values[np.isfinite(self.values)]), initial=0.0))
        symbol, one = display_units.of_result(self.unit, size)
        return symbol.replace("um", "µm"), one

    def _broken(self, one: float) -> tuple[Array, Array]:
        """Times and values in a unit, with NaN in each gap, so that no line is drawn across it."""
        gaps = np.flatnonzero(np.diff(self.index) > 1) + 1
        return np.insert(self.time, gaps, np.nan), np.insert(self.values / one, gaps, np.nan)

    def _part(self, chosen: slice) -> Channel:
        return replace(self, values=self.values[chosen], time=self.time[chosen], index=self.index[chosen])

    def __repr__(self) -> str:
        span = f", {self.time[0]:.4g} to {self.time[-1]:.4g} s" if len(self) else ""
        lost = f", {self.lost} lost" if self.lost else ""
        return f"<Channel {self.name} [{self.unit}]: {len(self)} samples{span}{lost}>"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{t:.6g}</td><td>{x:.6g}</td></tr>"
            for t, x in zip(self.time[:FEW], self.values[:FEW], strict=True)
        )
        return (
            f"<p>{escape(repr(self)[1:-1])}</p><table><tr><th>t / s</th><th>{escape(self.name)} / {escape(self.unit)}</th></tr>"
            f"{rows}</table>"
        )
