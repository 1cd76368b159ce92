"""What one step says of each channel: mean, drift within it and spread, and the flags that stood at any time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError


def reduced(data: Mapping[str, npt.NDArray[Any]], channels: Sequence[str], labels: Mapping[str, Any]) -> dict[str, Any]:
    """`mean`, `drift` (second half less first half) and `spread` by channel, and `flags`, the bits or-ed together.

    `data` are the samples of a step, one array (n,) for each of the `channels`, `flags` among them; `labels` name the step.

    Raises:
        AnalysisError: a channel has fewer than two samples.
    """
    out: dict[str, Any] = {"mean": {}, "drift": {}, "spread": {}}
    for channel in channels:
        x = data[channel]
        half = len(x) // 2
        if half == 0:
            raise AnalysisError(f"step {dict(labels)}: found {len(x)} samples of {channel}; expected at least 2")
        out["mean"][channel] = x.mean()
        out["drift"][channel] = x[half:].mean() - x[:half].mean()
        out["spread"][channel] = x.std()
    out["flags"] = int(np.bitwise_or.reduce(data["flags"].astype(np.int64)))
    return out
