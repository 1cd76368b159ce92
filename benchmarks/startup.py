"""Start-up time of `bench --help` and `bench list`: best of five fresh processes each, limit 0.7 s.

The best, because a busy machine only ever adds. Exit status 1 when over the limit.
"""

from __future__ import annotations

import subprocess
import sys
import time

LIMIT_S = 0.7
REPEATS = 5


def best(*arguments: str) -> float:
    """Seconds from start to end of one command, the best of the repeats."""
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-m", "bench.cli", *arguments], check=True, stdout=subprocess.DEVNULL)
        times.append(time.perf_counter() - begin)
    return min(times)


def main() -> int:
    slow = False
    for command in ("--help", "list"):
        seconds = best(command)
        slow |= seconds > LIMIT_S
        print(f"bench {command:8} {seconds:6.3f} s   limit {LIMIT_S} s")
    return int(slow)


if __name__ == "__main__":
    sys.exit(main())
