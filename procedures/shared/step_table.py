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
    x = np.array(
        [data[channel] for channel in channels]
    )  # all channels at once: a look at each costs more than the sums
    half = x.shape[1] // 2
    if half == 0:
        raise AnalysisError(f"step {dict(labels)}: found {x.shape[1]} samples of {channels[0]}; expected at least 2")
    drift = x[:, half:].mean(axis=1) - x[:, :half].mean(axis=1)
    out: dict[str, Any] = {
        kind: dict(zip(channels, values, strict=True))
        for kind, values in (("mean", x.mean(axis=1)), ("drift", drift), ("spread", x.std(axis=1)))
    }
    out["flags"] = int(np.bitwise_or.reduce(data["flags"].astype(np.int64)))
    return out
