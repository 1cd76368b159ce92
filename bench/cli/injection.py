"""The fixture `inject`: a procedure while faults happen to the link or the controller. For a conftest of one's own:

    from bench.cli.injection import inject

It is no part of the plug-in, as its name is anybody's.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from bench.run.runner import RunResult


@pytest.fixture
def inject(tmp_path: Path) -> Callable[..., RunResult]:
    """Runs a procedure on the simulated rig while faults happen: `inject("stall@12", procedure="amb-calibration")`.

    Further keywords are those of `bench.cli.compose.Request`: `rig`, `seed`, `visit`, `plan`, `truth`, `backend`, `links`.
    The run directory lies in `tmp_path`; what comes back is a `bench.run.runner.RunResult`.
    """
    from bench.cli.compose import Request
    from bench.cli.run import execute

    def run(*faults: str, procedure: str, rig: str = "tsbs12", **options: Any) -> RunResult:
        return execute(Request(procedure, rig, faults=faults, out=tmp_path / "runs", report=False, **options))

    return run
