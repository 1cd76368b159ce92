"""A Dask cluster of two worker processes on this machine: prints its address, ends when its standard input does."""

from __future__ import annotations

import sys
from typing import Any

if __name__ == "__main__":
    import distributed

    made: Any = distributed
    with made.LocalCluster(n_workers=2, threads_per_worker=int(sys.argv[1]), processes=True, host="127.0.0.1",
                           dashboard_address=None) as cluster:  # fmt: skip
        sys.stdout.write(f"{cluster.scheduler_address}\n")
        sys.stdout.flush()
        sys.stdin.read()
