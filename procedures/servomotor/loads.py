"""Which of the plan's masses hung in each step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError


def load_index(hung: Sequence[str], masses: tuple[str, ...], where: str) -> npt.NDArray[np.int64]:
    """Index (N,) into `masses` by the labels of what `hung`; -1 for nothing.

    Raises:
        AnalysisError: something else hung there, on the `where` ("hanger", "lever").
    """
    index = {"": -1} | {label: k for k, label in enumerate(masses)}
    if strange := sorted(set(hung) - set(index)):
        raise AnalysisError(
            f"masses: found {', '.join(strange)} on the {where}; expected those of the plan, {', '.join(masses)}"
        )
    return np.array([index[label] for label in hung])
