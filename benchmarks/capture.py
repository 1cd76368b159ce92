"""How fast captures are uploaded, as a share of what the link carries beside the telemetry.

    python benchmarks/capture.py [--seconds 4] [--live]

A capture of four positions at 10 kHz on amb5dof is uploaded over the virtual link in bench time: by ISO-TP at the pace of
CAN FD at 1 and 5 Mbit/s, and by pieces in serial packets at that of 3 Mbit/s. With `--live` also in real time from a
served rig in a process of its own, by SLCAN and by serial packets over TCP, where the machine's load counts. The link's
net rate: payload of its longest messages back to back in the time that periodic messages leave. Prints a JSON line; exit
status 1 where the virtual links miss the target of 70 %.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from bench.cli.opening import beat_of
from bench.clock import Clock, WallClock
from bench.link import Link
from bench.link.session import Session, new_session
from bench.rigfile import RigFile, load_rig
from bench.rigfile.busload import net_bytes_per_second
from bench.wire import packet
from drivers.controller import Controller
from drivers.live_link import LiveLink
from drivers.wires import open_wire
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

TARGET = 0.70
CHANNELS = ("pos_yi", "pos_zi", "pos_yo", "pos_zo")
BAUDRATE = 3_000_000
URL = "slcan:socket://127.0.0.1:28511"


def rig_on(url: str) -> RigFile:
    rig = load_rig("amb5dof")
    return RigFile.parse(rig.toml_text.replace(URL, url), rig.dbc_text)


def net_rate(rig: RigFile, serial: bool) -> float:
    """Bytes a second of payload, see above."""
    if not serial:
        assert rig.link.bitrate is not None
        return net_bytes_per_second(rig.messages, rig.link.bitrate, rig.link.data_bitrate)
    count = packet.LIMIT // (packet.MESSAGE.size + packet.PAYLOAD_LIMIT)
    full = len(packet.packet(0, 0, [(0x201, bytes(range(1, 65)))] * count))
    alone = len(packet.packet(0, 0, [(0x100, bytes(range(1, 65)))]))
    return (BAUDRATE / 10 - 1000 * alone) * count * packet.PAYLOAD_LIMIT / full


def measured(
    rig: RigFile, link: Link, base: Clock, slice_s: float, seconds: float, session: Session
) -> dict[str, float]:
    controller = Controller(rig, link, base, session, slice_s)
    controller.connect()
    assert controller.capture is not None
    controller.capture.arm(CHANNELS, seconds=seconds)
    controller.capture.wait(10 * seconds)
    begin, cpu = base.now_ns(), time.process_time()
    data = controller.capture.upload()
    took = (base.now_ns() - begin) * 1e-9
    size = 2 * len(CHANNELS) * len(data.columns["pos_yi"])
    net = net_rate(rig, rig.link.url.startswith("serial"))
    lost = controller.telemetry.counters.lost
    controller.release()
    return {
        "bytes": size, "seconds": round(took, 3), "kB_s": round(size / took / 1e3, 1), "net_kB_s": round(net / 1e3, 1),
        "share": round(size / took / net, 3), "lost_telemetry": lost, "cpu_s": round(time.process_time() - cpu, 3),
    }  # fmt: skip


def virtual(url: str, seconds: float) -> dict[str, float]:
    rig = rig_on(url)
    machine = SimulatedRig(rig, draw(rig, 1), 1, substeps=1)
    return measured(rig, machine.link, machine, 0.1, seconds, Session(1, 1_767_225_600, "benchmark"))


@contextmanager
def served() -> Iterator[dict[str, str]]:
    """A served rig in real time: its endpoints by kind."""
    anywhere = ("controller=slcan:socket://127.0.0.1:0", "operator=line:127.0.0.1:0", "fieldbus=modbus-tcp:127.0.0.1:0")
    command = [sys.executable, "-m", "bench.cli", "serve", "amb5dof", *(x for a in anywhere for x in ("--link", a))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        found = {}
        for line in process.stdout:
            if line == "ready\n":
                break
            name, _, url = line.strip().partition(" ")
            if name == "controller" and "socket" in url:
                found[url.partition(":")[0]] = url
        try:
            yield found
        finally:
            process.terminate()


def live(url: str, seconds: float) -> dict[str, float]:
    rig, session, wall = rig_on(url), new_session(), WallClock()
    link = LiveLink("controller", lambda: open_wire(rig.link, "controller", (), wall.now_ns), beat_of(rig, session))
    with contextlib.closing(link):
        return measured(rig, link, wall, 0.02, seconds, session)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--live", action="store_true")
    arguments = parser.parse_args()
    results = {"CAN FD, virtual": virtual(URL, arguments.seconds)}
    results["serial, virtual"] = virtual(f"serial:/dev/ttyS9?baudrate={BAUDRATE}", arguments.seconds)
    reached = all(r["share"] >= TARGET for r in results.values())
    if arguments.live:
        with served() as urls:
            for kind, url in sorted(urls.items()):
                results[f"{kind} over TCP, real time"] = live(url, arguments.seconds)
    for name, r in results.items():
        print(
            f"{name:28} {r['kB_s']:7.1f} of {r['net_kB_s']:7.1f} kB/s: {r['share']:5.1%}   {r['cpu_s']:.2f} s of processor"
        )
    print(json.dumps(results))
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
