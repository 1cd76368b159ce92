"""`slcan_batch` against python-can's own `slcan`: 8000 frames/s through a pty with nothing lost, and the most each takes.

    python benchmarks/slcan.py [--seconds 60]

A process of its own is the adapter: it answers the set-up, then writes classic frames of 8 bytes that count, first as
many as a full bus of 1 Mbit/s has, slice by slice; then, for the highest rate, as fast as the pty takes them. Targets:
no loss and 15 % of a core at 8000 frames/s; 20 times the highest rate of `slcan` in the same run. The share of a core
is that of the whole receiving process, whose only work it is. Prints a JSON line; 1 when a target is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import pty
import select
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import can
import numpy as np

from bench.link.frames import FrameBatch
from drivers.slcan_bus import SlcanBatchBus

RATE = 8000  # frames/s
SHARE, TIMES = 0.15, 20.0  # targets
STOCK_FRAMES, OUR_FRAMES = 10_000, 500_000
SLICE_S, BLOCK = 1e-3, 500
SILENT_S = 1.0


# The adapter


def lines(first: int, count: int, fd: bool) -> bytes:
    if fd:
        return b"".join(b"b100F%08X%0120X\r" % (n, n) for n in range(first, first + count))
    return b"".join(b"t1008%08X%08X\r" % (n, n) for n in range(first, first + count))


def adapt(port: int, count: int, rate: float, fd: bool) -> None:
    """Answer until O, then write so many frames: at this rate, or 0 for as fast as they are taken."""
    ready(port)
    blocks = [] if rate else [lines(n, min(BLOCK, count - n), fd) for n in range(0, count, BLOCK)]
    print("ready", flush=True)
    sys.stdin.readline()
    begun, longest = time.monotonic(), 0.0
    for block in blocks:
        put(port, block)
    sent = 0 if rate else count
    while sent < count:
        due = min(count, int((time.monotonic() - begun) * rate))
        if due > sent:
            asked = time.monotonic()
            put(port, lines(sent, due - sent, fd))
            longest = max(longest, time.monotonic() - asked)
            sent = due
        time.sleep(SLICE_S)
    print(json.dumps({"seconds": time.monotonic() - begun, "longest_write_s": longest}), flush=True)
    sys.stdin.read()


def ready(port: int) -> None:
    """Answer V and F until the host has opened the channel and asked for what it wants to know."""
    rest = b""
    while select.select([port], [], [], 1.0)[0] or b"O" not in rest:
        data = os.read(port, 4096)
        rest += data
        os.write(port, b"".join({b"V": b"V1013\r", b"F": b"F00\r"}.get(x, b"\r") for x in data.split(b"\r")[:-1]))


def put(port: int, data: bytes) -> None:
    while data:
        data = data[os.write(port, data) :]


@contextmanager
def adapter(count: int, rate: float, fd: bool) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """The process, and where it is."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    command = [sys.executable, str(Path(__file__).resolve()), "--adapter", str(master), "--frames", str(count)]
    command += ["--rate", str(rate), *(["--fd"] if fd else [])]
    with subprocess.Popen(command, pass_fds=[master], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        os.close(master)
        try:
            yield process, os.ttyname(slave)
        finally:
            process.terminate()
            os.close(slave)


# The host


@dataclass
class Got:
    """What the host saw."""

    frames: int = 0
    jumps: int = 0  # of the frames' own number
    reads: int = 0
    seconds: float = 0.0  # first to last frame
    cpu_share: float = 0.0

    @property
    def rate(self) -> float:
        return self.frames / self.seconds


Receive = Callable[[Any], "list[int] | None"]


def ours(bus: SlcanBatchBus) -> list[int] | None:
    batch = bus.recv_batch(SILENT_S)
    return numbers(batch) if len(batch) else None


def numbers(batch: FrameBatch) -> list[int]:
    found: list[int] = np.ascontiguousarray(batch["data"][:, :4]).view(">u4").ravel().tolist()
    return found


def single(bus: can.BusABC) -> list[int] | None:
    message = bus.recv(SILENT_S)
    return None if message is None else [int.from_bytes(message.data[:4], "big")]


def receive(bus: Any, take: Receive, process: subprocess.Popen[bytes], count: int) -> Got:
    """Start the adapter, and count until all is there or nothing has come for a second."""
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stdout.readline() == b"ready\n"
    got, expected = Got(), 0
    process.stdin.write(b"\n")
    process.stdin.flush()
    first = last = time.monotonic()
    cpu = time.process_time()
    while got.frames < count:
        found = take(bus)
        now = time.monotonic()
        if found is None:
            if now - last > SILENT_S:
                break
            continue
        first, last = (now if not got.frames else first), now
        got.jumps += int(found[0] != expected) + int(found[-1] - found[0] != len(found) - 1)
        got.frames, got.reads, expected = got.frames + len(found), got.reads + 1, found[-1] + 1
    got.seconds = max(last - first, 1e-9)
    got.cpu_share = (time.process_time() - cpu) / got.seconds
    return got


def measure(
    stock: bool, take: Receive, count: int, rate: float = 0.0, fd: bool = False
) -> tuple[Got, dict[str, float]]:
    with adapter(count, rate, fd) as (process, where):
        settings: dict[str, Any] = {"channel": where, "bitrate": 1_000_000}
        if stock:
            bus = can.Bus(interface="slcan", sleep_after_open=0.2, ignore_config=True, **settings)
        else:
            bus = SlcanBatchBus(data_bitrate=5_000_000 if fd else None, **settings)
        with bus:
            got = receive(bus, take, process, count)
            assert process.stdout is not None
            sent = json.loads(process.stdout.readline()) if got.frames == count else {}
    return got, sent


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--adapter", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--frames", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--rate", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--fd", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.adapter is not None:
        adapt(arguments.adapter, arguments.frames, arguments.rate, arguments.fd)
        return 0
    count = int(arguments.seconds * RATE)
    full, sent = measure(False, ours, count, RATE)
    print(f"slcan_batch, pty, {full.seconds:.1f} s at {full.rate:.0f} frames/s: {count - full.frames} lost, {full.jumps} "
          f"jumps, {100 * full.cpu_share:.1f} % of a core, {full.reads / full.seconds:.0f} reads/s, longest write of the "
          f"adapter {1e3 * sent.get('longest_write_s', float('nan')):.1f} ms")  # fmt: skip
    most = {
        "slcan_batch recv_batch": measure(False, ours, OUR_FRAMES)[0],
        "slcan_batch recv": measure(False, single, OUR_FRAMES // 5)[0],
        "slcan_batch recv_batch, CAN FD 64 B": measure(False, ours, OUR_FRAMES // 5, fd=True)[0],
        "slcan recv": measure(True, single, STOCK_FRAMES)[0],
    }
    for name, got in most.items():
        print(f"most, {name:36} {got.rate:9.0f} frames/s, {got.jumps} jumps")
    ratio = most["slcan_batch recv_batch"].rate / most["slcan recv"].rate
    print(f"slcan_batch takes {ratio:.0f} times as many frames as slcan")
    print(json.dumps({"full_bus": asdict(full), "most": {n: round(g.rate) for n, g in most.items()}, "ratio": ratio}))
    lost = full.frames != count or full.jumps or any(g.jumps for g in most.values())
    return int(bool(lost) or full.cpu_share > SHARE or ratio < TIMES)


if __name__ == "__main__":
    sys.exit(main())
