"""The serial link's receiving side: decoding from memory, through a pty, and 12 Mbit/s with no loss.

    python benchmarks/serial_link.py [--seconds 60]

A sample is one channel value: an 8-channel i16 message with a sequence number and a tick, several in a packet. From
memory it is PacketStream.feed and Decoder.decode beside the plain way (`cobs` and `struct`, a message at a time). Then
a process writes: as fast as it can to PacketWire and Decoder; as fast as a line of 12 Mbit/s (10 bits a byte) would
through a pty, read by pyserial and the plain way and by PacketWire, ten seconds each; and at that rate over TCP to
PacketWire as long as asked, since the ptys of Linux 6.18 now and then stall for good when they are full. Prints a JSON
line; exit status 1 when a target is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import pty
import select
import socket
import subprocess
import sys
import time
import tty
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import serial

from bench.link.codec import Decoder
from bench.link.frames import FrameBatch
from bench.link.packetstream import PacketStream
from bench.rigfile import LinkSpec
from bench.rigfile.messages import Message, load_messages
from benchmarks.serial_messages import CHANNELS, DBC, Row, frames, packets, plain, plain_packet
from drivers.wires import open_wire

PER_PACKET, LINE = 8, 12e6
TARGET = 5e6  # samples/s
READ = 4095  # bytes that one read of a pty gives at most
BATCH = 65_536  # bytes of one read elsewhere
FRAMES = 80_000
STOCK_S = 10.0
SLICE_S, DECODE_S, SILENT_S, STALL_S = 1e-3, 0.1, 1.0, 0.5


# From memory


def ours(data: bytes, decoder: Decoder, chunk: int) -> int:
    stream, count = PacketStream(), 0
    for a in range(0, len(data), chunk):
        values, wrong = decoder.decode(stream.feed(data[a : a + chunk], 0))
        count += len(values["seq"])
    assert (wrong, stream.crc_errors, stream.malformed, stream.packets_lost, stream.pending) == (0, 0, 0, 0, 0)
    return count


def rate(work: Callable[[], int], times: int) -> float:
    """Samples per processor second, best of several tries."""
    best = 0.0
    for _ in range(times):
        begun = time.process_time()
        count = work()
        best = max(best, CHANNELS * count / (time.process_time() - begun))
        assert count == FRAMES
    return best


def from_memory(message: Message) -> dict[str, float]:
    decoder, out = Decoder(message), dict[str, float]()
    print("decode from memory, million samples/s   reads of 64 KiB   reads of 4095 B   plain")
    for per_packet in (1, PER_PACKET, 37):
        data, _ = packets(0, FRAMES, 0, per_packet)
        got = [rate(lambda d=data, c=chunk: ours(d, decoder, c), 5) for chunk in (BATCH, READ)]  # type: ignore[misc]
        got.append(rate(lambda d=data: plain(d), 2))  # type: ignore[misc]
        print(f"{per_packet:3} messages a packet {got[0] / 1e6:33.1f} {got[1] / 1e6:17.1f} {got[2] / 1e6:9.1f}")
        out |= {f"decode_{per_packet}": got[0], f"decode_{per_packet}_reads": got[1], f"plain_{per_packet}": got[2]}
    return {name: round(value) for name, value in out.items()}


# Through a pty


def write(descriptor: int, seconds: float, tcp: bool) -> None:
    """The writer process. Waits for a line, then writes as many bytes as the line had time for, slice by slice, or
    FRAMES messages at once where `seconds` is 0; then its counts; then waits for its end."""
    sequence = first = written = 0
    block = PER_PACKET * 6
    ready, _ = packets(0, FRAMES if seconds == 0 else 0, 0, PER_PACKET)
    sys.stdin.readline()
    if tcp:
        descriptor = socket.socket(fileno=descriptor).accept()[0].detach()
    os.set_blocking(descriptor, False)
    begun = time.monotonic()
    longest = 0.0
    if seconds == 0:
        first, written = FRAMES, written_all(descriptor, ready)
    stalled = False
    while (now := time.monotonic() - begun) < seconds and not stalled:
        while written < now * LINE / 10 and not stalled:
            data, sequence = packets(first, block, sequence, PER_PACKET)
            first += block
            asked = time.monotonic()
            done = written_all(descriptor, data)
            written, stalled = written + done, done < len(data)
            longest = max(longest, time.monotonic() - asked)
        time.sleep(SLICE_S)
    took = time.monotonic() - begun
    print(
        json.dumps(
            {"messages": first, "bytes": written, "due": len(ready), "seconds": took, "longest_write_s": longest}
        ),
        flush=True,
    )
    sys.stdin.read()


def written_all(descriptor: int, data: bytes) -> int:
    """Bytes written: fewer where nothing went on for STALL_S. Now and then the pty itself (Linux 6.18) stalls when it is
    full: its reader has nothing to read and its writer no room, for ever."""
    left, since = memoryview(data), time.monotonic()
    while left and time.monotonic() < since + STALL_S:
        try:
            left, since = left[os.write(descriptor, left) :], time.monotonic()
        except BlockingIOError:
            select.select([], [descriptor], [], SLICE_S)
    return len(data) - len(left)


@dataclass
class Got:
    """What the reading side saw."""

    messages: int = 0
    errors: int = 0  # jumps of the messages' own sequence number, wrong lengths, packets dropped
    packets_lost: int = 0
    reads: int = 0  # that brought something
    last: int = 0xFFFF
    first_s: float = 0.0  # when the writer was told to begin, and when the last bytes came
    last_s: float = 0.0
    cpu_s: float = 0.0

    def seen(self) -> None:
        self.reads, self.last_s = self.reads + 1, time.monotonic()


def by_wire(path: str, message: Message, go: Callable[[], None], got: Got) -> None:
    """The drivers' own way: what came is decoded ten times a second."""
    wire = open_wire(LinkSpec.model_validate({"url": f"serial:{path}"}), "controller")
    decoder = Decoder(message)
    batches, decode_at = [frames(0, 0)], time.monotonic() + DECODE_S
    go()
    while got.reads == 0 or time.monotonic() < got.last_s + SILENT_S:
        batch = wire.read(0.1)
        if len(batch):
            got.seen()
            batches.append(batch)
        if time.monotonic() >= decode_at:
            tally(np.concatenate(batches), decoder, got)
            batches, decode_at = [frames(0, 0)], time.monotonic() + DECODE_S
    tally(np.concatenate(batches), decoder, got)
    got.errors += wire.stats.crc_errors + wire.stats.malformed
    got.packets_lost = wire.stats.packets_lost
    wire.close()


def tally(batch: FrameBatch, decoder: Decoder, got: Got) -> None:
    values, wrong = decoder.decode(batch)
    sequence = values["seq"]
    got.errors += wrong + int(((np.diff(sequence, prepend=got.last) % 65_536) != 1).sum())
    got.messages += len(sequence)
    got.last = int(sequence[-1]) if len(sequence) else got.last


def by_pyserial(path: str, message: Message, go: Callable[[], None], got: Got) -> None:
    """pyserial's own read of what is waiting, and a packet and a message at a time."""
    rest, rows, drop_at = b"", list[Row](), time.monotonic() + DECODE_S
    with serial.Serial(path, timeout=SILENT_S) as port:
        go()
        while data := port.read(port.in_waiting or 1):
            got.seen()
            *ended, rest = (rest + data).split(b"\0")
            for encoded in ended:
                rows += plain_packet(encoded)
            if time.monotonic() >= drop_at:
                got.messages += len(rows)
                rows, drop_at = [], time.monotonic() + DECODE_S
    got.messages += len(rows)


Reader = Callable[[str, Message, Callable[[], None], Got], None]


def through(reader: Reader, message: Message, seconds: float, tcp: bool) -> tuple[dict[str, float], Got]:
    """What the writer says it sent, and what the reader got."""
    listener, (master, slave) = socket.create_server(("127.0.0.1", 0)), pty.openpty()
    tty.setraw(slave)
    path = f"socket://127.0.0.1:{listener.getsockname()[1]}" if tcp else os.ttyname(slave)
    given = listener.fileno() if tcp else master
    command = [sys.executable, str(Path(__file__).resolve()), "--writer", str(given), "--seconds", str(seconds)]
    command += ["--tcp"] * tcp
    with subprocess.Popen(command, pass_fds=[given], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as writer:
        os.close(master)
        listener.close()
        stdin, stdout = writer.stdin, writer.stdout
        assert stdin is not None
        assert stdout is not None

        def go() -> None:
            stdin.write(b"\n")
            stdin.flush()
            got.first_s = time.monotonic()

        got, cpu = Got(), time.process_time()
        try:
            reader(path, message, go, got)
        except BaseException:
            writer.kill()
            raise
        got.cpu_s = time.process_time() - cpu
        sent = json.loads(stdout.readline())
        stdin.close()
    os.close(slave)
    return sent, got


def unpaced(message: Message) -> dict[str, float]:
    runs = [through(by_wire, message, 0.0, True)[1] for _ in range(3)]
    assert all((got.messages, got.errors, got.packets_lost) == (FRAMES, 0, 0) for got in runs)
    cpu = CHANNELS * FRAMES / min(got.cpu_s for got in runs)
    print(f"unpaced over TCP: {cpu / 1e6:.2f} million samples per processor second")
    return {"per_processor_s": round(cpu)}


def paced(name: str, reader: Reader, message: Message, seconds: float, tcp: bool) -> dict[str, float]:
    sent, got = through(reader, message, seconds, tcp)
    took = sent["seconds"]
    out = {
        "line_bit_s": round(10 * sent["bytes"] / took),
        "seconds": round(took, 1),
        "samples_per_s": round(CHANNELS * got.messages / took),
        "packets": round(sent["messages"] / PER_PACKET),
        "packets_lost": got.packets_lost,
        "messages_lost": round(sent["messages"]) - got.messages,
        "errors": got.errors,
        "cpu_share": round(got.cpu_s / took, 3),
        "samples_per_processor_s": round(CHANNELS * got.messages / got.cpu_s),
        "longest_write_s": round(sent["longest_write_s"], 4),
    }
    print(f"{name}, {'TCP' if tcp else 'pty'}: for {out['seconds']} s at {out['line_bit_s'] / 1e6:.2f} Mbit/s: "
          f"{out['packets']} packets, {out['packets_lost']} lost; {out['messages_lost']} messages lost, "
          f"{out['errors']} errors; {out['samples_per_s']} samples/s, {100 * out['cpu_share']:.1f} % of a core, "
          f"{got.reads / took:.0f} reads/s")  # fmt: skip
    return out


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--writer", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--tcp", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.writer is not None:
        write(arguments.writer, arguments.seconds, arguments.tcp)
        return 0
    message = load_messages(DBC)["Samples"]
    memory, burst = from_memory(message), unpaced(message)
    stock = paced("pyserial", by_pyserial, message, min(arguments.seconds, STOCK_S), False)
    short = paced("PacketWire", by_wire, message, min(arguments.seconds, STOCK_S), False)
    line = paced("PacketWire", by_wire, message, arguments.seconds, True)
    lost = line["packets_lost"] or line["messages_lost"] or line["errors"]
    slow = memory[f"decode_{PER_PACKET}"] < TARGET or line["line_bit_s"] < 0.99 * LINE
    print(
        json.dumps(
            {
                "memory": memory,
                "unpaced": burst,
                "pyserial": stock,
                "pty": short,
                "paced": line,
                "target_samples_per_s": TARGET,
            }
        )
    )
    return int(bool(lost) or slow)


if __name__ == "__main__":
    sys.exit(main())
