"""Coverage of the identification chain over a few tens of virtual rigs; `make campaigns` has the thousands."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

RIGS, FIRST_SEED = 60, 500_000


@pytest.mark.long
@pytest.mark.timeout(2400)
def test_intervals_hold_the_truth(tmp_path: Path) -> None:
    """0.95 +- 3.3 sqrt(0.95 0.05 / 60) = 0.857 at least; all 60 may hit. A width needs more rigs to be sure of."""
    done = subprocess.run(
        [sys.executable, "-m", "bench.cli", "campaign", "tsbs-identification", "--count", str(RIGS), "--first-seed",
         str(FIRST_SEED), "--keep", "none"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode in (0, 5), done.stderr
    folder = tmp_path / done.stdout.strip()
    found = json.loads((folder / "coverage.json").read_text())
    judged = [q for q in found["quantities"] if q["judged"]]
    assert {"K_i", "K_o", "alpha_d", "alpha_c", "alpha_x_prime", "alpha_tau", "B"} <= {q["name"] for q in judged}
    assert [q["name"] for q in judged if q["verdict"] == "fail"] == []
    assert (folder / "summary.pdf").read_bytes().startswith(b"%PDF")
