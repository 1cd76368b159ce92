"""From the death of the bench (SIGKILL) to the controller's own make-safe, and from a pulled cable: a served rig and a
bench as processes, a third party listening on the bus.

    python benchmarks/dead_host.py [--runs 10]
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "links"))

import processes
from cable import Cable
from listener import Listener

END = ("the bench is killed", "the cable is pulled")


def measured(folder: Path, how: str) -> float:
    """Seconds from the event to the first message that tells of another state than LEVITATED."""
    with processes.served(folder, patience_s=None) as rig, Listener(rig.endpoints["slcan:socket"]) as bus:
        with Cable(rig.endpoints["slcan:socket"]) as cable:
            url = ("--link", f"controller=slcan:{cable.path}")
            arguments = processes.live(
                rig, "slcan:socket", "tiny-levitated", "--no-report", "--plan", 'act="count"', *url
            )
            with processes.bench(folder, *arguments) as child:
                child.wait_for("at ")
                seen, begun = len(bus.heard), time.monotonic_ns()
                if how == END[0]:
                    child.process.kill()
                else:
                    cable.pull()
                left = bus.wait_for(lambda h: h.state != "LEVITATED", seen)
                bus.wait_for(lambda h: h.state == "FAULT", seen)
                assert left.state == "LANDING"
                assert left.fault == "HEARTBEAT_LOST"
    return (left.t_ns - begun) * 1e-9


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=10)
    runs = parser.parse_args().runs
    found = {}
    for how in END:
        with tempfile.TemporaryDirectory() as folder:
            times = 1e3 * np.array([measured(Path(folder), how) for _ in range(runs)])
        print(
            f"{how}: the controller lands after {np.median(times):.0f} ms (median of {runs}), {times.max():.0f} ms at most"
        )
        found[how] = {"median_ms": float(np.median(times)), "most_ms": float(times.max())}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
