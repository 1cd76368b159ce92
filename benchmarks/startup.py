"""Start-up time of `bench --help` and `bench list`, limit 0.7 s; processor time of `bench list --rig` for every rig file of
`rigs/` and `examples/`, limit 0.5 s; of `import bench`, and of what `bench` takes to see whose its packages are in the
environment of this Python, limit 0.05 s beyond an empty Python: best of five fresh processes each.

The best, because a busy machine only ever adds. Exit status 1 when over the limit. With bytecode, as an installed bench has it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

from bench import catalogue

LIMIT_S, PROCESSOR_S, IMPORT_S = 0.7, 0.5, 0.05
REPEATS = 5
ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}


def best(*arguments: str) -> float:
    """Seconds from start to end of one command, the best of the repeats."""
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "bench.cli", *arguments], check=True, stdout=subprocess.DEVNULL, env=ENVIRONMENT
        )
        times.append(time.perf_counter() - begin)
    return min(times)


def best_processor(*arguments: str) -> float:
    """Seconds of processor time of Python with these arguments, user and system, the best of the repeats."""
    times = []
    for _ in range(REPEATS):
        child = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL, env=ENVIRONMENT)
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            raise subprocess.CalledProcessError(child.returncode, child.args)
        times.append(usage.ru_utime + usage.ru_stime)
    return min(times)


def main() -> int:
    slow = False
    for command in ("--help", "list"):
        seconds = best(command)
        slow |= seconds > LIMIT_S
        print(f"bench {command:8} {seconds:6.3f} s   limit {LIMIT_S} s")
    for rig in (
        *(entry.name for entry in catalogue.rigs()),
        *sorted(str(p) for p in Path("examples").glob("*/*.toml") if p.name != "pyproject.toml"),
    ):
        seconds = best_processor("-m", "bench.cli", "list", "--rig", rig)
        slow |= seconds > PROCESSOR_S
        print(f"bench list --rig {rig:38} {seconds:6.3f} s of processor time   limit {PROCESSOR_S} s")
    empty, packages = best_processor("-c", "pass"), sysconfig.get_paths()["purelib"]
    owners = f"import levbench; list(levbench._owners({packages!r}))"
    for what, code in (("import bench", "import bench"), ("whose the packages are", owners)):
        seconds = best_processor("-c", code) - empty
        slow |= seconds > IMPORT_S
        print(f"{what:55} {seconds:6.3f} s of processor time   limit {IMPORT_S} s")
    return int(slow)


if __name__ == "__main__":
    sys.exit(main())
