"""Coverage of the AMB calibration over a few tens of virtual rigs; `make campaigns` has the thousand."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest

from bench.cli.virtual import simulate
from bench.procedure import Measured
from bench.uncertainty import interval

RIGS, FIRST_SEED = 60, 500_000


def hits(seed: int, folder: str) -> dict[str, bool]:
    """Whether each interval of one rig holds the truth."""
    path = Path(folder) / f"{seed}.mcap"
    true, results = simulate("amb-calibration", "tsbs12", seed, {"settle_s": 0.5, "average_s": 0.3}, path)
    path.unlink()
    out = {}
    for m in results:
        if isinstance(m, Measured):
            bounds = interval(m.estimate)
            out[m.quantity.name] = bounds.low <= true[m.quantity.name] <= bounds.high
    return out


@pytest.mark.long
@pytest.mark.timeout(900)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # fork in a process with the recorder's thread long gone
def test_intervals_hold_the_truth(tmp_path: Path) -> None:
    """0.95 +- 3.3 sqrt(0.95 0.05 / 60) = 0.857 at least; all 60 may hit."""
    with ProcessPoolExecutor(2) as pool:
        seen = list(pool.map(hits, range(FIRST_SEED, FIRST_SEED + RIGS), [str(tmp_path)] * RIGS))
    for name in ("K_i", "K_o"):
        assert sum(one[name] for one in seen) / RIGS > 0.857, name
