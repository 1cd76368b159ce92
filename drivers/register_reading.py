"""Register devices that are only read: each in its period, in a thread, over ports that refuse to write."""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass

from bench.clock import Clock
from bench.errors import BenchError, LinkError
from bench.rigfile import RigFile
from bench.rigfile.registers import RegisterPort, Table, Words
from bench.samples import SampleBlock, StreamLayout
from drivers.modbus import ModbusLine
from drivers.polling import Poll, PolledStream, Reading
from drivers.registerdevice import RegisterDevice

JOIN_S = 5.0


@dataclass(frozen=True)
class ReadPort:
    """A port whose writing is taken away."""

    port: RegisterPort

    def read(self, table: Table, address: int, count: int) -> Words:
        """As RegisterPort says."""
        return self.port.read(table, address, count)

    def write(self, address: int, words: Words) -> None:
        """Refuses.

        Raises:
            LinkError: always.
        """
        raise LinkError(f"holding register {address}: the device is only read; nothing is written to it")


class RegisterReading:
    """The register devices of a rig. `unreachable` says of each that cannot be read why."""

    def __init__(self, rig: RigFile, clock: Clock) -> None:
        self.unreachable: dict[str, str] = {}
        self._clock, self._lines = clock, dict[str, ModbusLine]()
        self._readings: queue.SimpleQueue[Reading] = queue.SimpleQueue()
        self._ending = threading.Event()
        devices = self._reached(rig)
        self._polls = [Poll(d, round(d.spec.poll_s * 1e9), clock) for d in devices]
        self._streams = {d.name: PolledStream(d, round(d.spec.poll_s * 1e9)) for d in devices}
        self._thread = threading.Thread(target=self._read, name="register-reading", daemon=True)
        self._thread.start()

    def _reached(self, rig: RigFile) -> list[RegisterDevice]:
        found = []
        for name, spec in rig.devices.items():
            if not spec.registers:
                continue
            try:
                line = self._lines.get(spec.link)
                if line is None:
                    line = ModbusLine(spec.link, rig.links[spec.link])
                    line.open()
                    self._lines[spec.link] = line
                device = RegisterDevice(name, spec, ReadPort(line.port(spec.unit)))
                device.check()
            except BenchError as error:
                self.unreachable[name] = str(error)
                continue
            found.append(device)
        return found

    @property
    def layouts(self) -> tuple[StreamLayout, ...]:
        """Of the streams that `take` gives blocks of."""
        return tuple(s.layout for s in self._streams.values())

    def take(self) -> tuple[list[Reading], list[SampleBlock]]:
        """What was read since the last call, and the samples of it; never waits."""
        readings: list[Reading] = []
        while True:
            try:
                readings.append(self._readings.get_nowait())
            except queue.Empty:
                break
        blocks = (self._streams[r.device].block(r) for r in readings)
        return readings, [b for b in blocks if b is not None]

    def close(self) -> None:
        """End reading and hang up. Calling it twice is harmless."""
        self._ending.set()
        for line in self._lines.values():
            line.close()
        self._thread.join(JOIN_S)

    def _read(self) -> None:
        while self._polls and not self._ending.is_set():
            for poll in self._polls:
                if (reading := poll.take()) is not None:
                    self._readings.put(reading)
            due = min(poll.due_ns for poll in self._polls)
            self._ending.wait(max(0.001, (due - self._clock.now_ns()) * 1e-9))
