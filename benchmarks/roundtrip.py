"""Command round trip over SLCAN and over serial packets, beside a raw pty echo in the same run.

    python benchmarks/roundtrip.py [--trips 2000]

A process of its own answers each command (0x011) with a reply (0x021) that carries the same bytes; the raw echo sends
back what it reads. The link is the one of a live rig: commands go through the heartbeat process, which sends its
heartbeats meanwhile, and replies through the reader thread. One command every 5 ms; the bench looks for the reply every
0.1 ms. A reader that finds data all the time takes it once a millisecond, which adds as much. Prints median and 99th
percentile, and a JSON line.
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
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from bench.link.frames import FD, frame, payload
from bench.link.packetstream import PacketStream, encode
from bench.rigfile import LinkSpec
from bench.wire import slcan
from drivers.beat import Beat
from drivers.live_link import LiveLink
from drivers.wires import open_wire

COMMAND, REPLY = 0x011, 0x021
LOOK_S, PAUSE_S = 1e-4, 5e-3
WARM_UP = 100
DEADLINE_S = 5.0


# The other end


def answer_slcan(port: int) -> None:
    rest = b""
    while select.select([port], [], [])[0]:
        *found, rest = (rest + os.read(port, 65536)).split(slcan.CR)
        out = b""
        for line in found:
            parsed = slcan.parse(line)
            if parsed is None:
                out += {b"V": b"V1013\r", b"F": b"F00\r"}.get(line, b"\r")
            else:
                out += b"z\r"
                if parsed.identifier == COMMAND:
                    out += slcan.line(REPLY, parsed.payload, fd=True, brs=True)
        os.write(port, out)


def answer_packets(port: int) -> None:
    stream, sequence = PacketStream(), 0
    while select.select([port], [], [])[0]:
        for row in stream.feed(os.read(port, 65536), 0):
            if row["id"] == COMMAND:
                data, sequence = encode(frame(REPLY, payload(row)), sequence)
                os.write(port, data)


def echo(port: int) -> None:
    while select.select([port], [], [])[0]:
        os.write(port, os.read(port, 65536))


ENDS = {"slcan": answer_slcan, "serial": answer_packets, "echo": echo}


@contextmanager
def other_end(kind: str) -> Iterator[tuple[str, int]]:
    """The pty of a process that answers: its name, and a descriptor of it."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    command = [sys.executable, str(Path(__file__).resolve()), "--end", kind, str(master)]
    with subprocess.Popen(command, pass_fds=[master], stdout=subprocess.PIPE) as process:
        os.close(master)
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        try:
            yield os.ttyname(slave), slave
        finally:
            process.terminate()
            os.close(slave)


# The bench's end


def raw(trips: int) -> list[float]:
    took = []
    with other_end("echo") as (_, port):
        for k in range(trips):
            data = slcan.line(COMMAND, k.to_bytes(8, "big"), fd=True, brs=True)
            time.sleep(PAUSE_S)
            begun, got = time.perf_counter(), b""
            os.write(port, data)
            while len(got) < len(data):
                select.select([port], [], [], DEADLINE_S)
                got += os.read(port, 65536)
            took.append(time.perf_counter() - begun)
            assert got == data
    return took


def linked(scheme: str, trips: int) -> tuple[list[float], int, int]:
    """Times, heartbeats meanwhile, and the longest gap between two of them, ns."""
    took = []
    with other_end(scheme) as (where, _):
        rates = {"bitrate": 1e6, "data_bitrate": 5e6} if scheme == "slcan" else {}
        spec = LinkSpec.model_validate({"url": f"{scheme}:{where}", **rates})
        link = LiveLink("controller", lambda: open_wire(spec, "controller"), Beat(0x010, bytes(8), range(32, 48), True))
        try:
            for k in range(trips):
                time.sleep(PAUSE_S)
                link.renew_lease()
                took.append(trip(link, k.to_bytes(8, "big")))
            stats = link.stats
        finally:
            link.close()
    return took, stats.heartbeats, stats.longest_heartbeat_gap_ns


def trip(link: LiveLink, number: bytes) -> float:
    begun = time.perf_counter()
    link.send(frame(COMMAND, number, flags=FD))
    while time.perf_counter() < begun + DEADLINE_S:
        for row in link.receive():
            if row["id"] == REPLY and payload(row) == number:
                return time.perf_counter() - begun
        time.sleep(LOOK_S)
    raise SystemExit(f"no reply within {DEADLINE_S} s")


def shown(name: str, took: list[float], remark: str = "") -> dict[str, float]:
    median, high = (float(x) for x in np.percentile(np.array(took[WARM_UP:]) * 1e6, [50, 99]))
    print(f"{name:24} median {median:7.0f} us   99th percentile {high:7.0f} us{remark}")
    return {"median_us": round(median, 1), "p99_us": round(high, 1)}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--trips", type=int, default=2000)
    parser.add_argument("--end", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.end:
        print("ready", flush=True)
        ENDS[arguments.end[0]](int(arguments.end[1]))
        return 0
    trips = arguments.trips + WARM_UP
    results = {"raw pty echo": shown("raw pty echo", raw(trips))}
    for scheme in ("slcan", "serial"):
        took, beats, gap = linked(scheme, trips)
        remark = f"   ({beats} heartbeats meanwhile, longest gap {gap / 1e6:.1f} ms)"
        results[scheme] = shown(f"command over {scheme}", took, remark)
    print(json.dumps(results))
    return 0


if __name__ == "__main__":
    sys.exit(main())
