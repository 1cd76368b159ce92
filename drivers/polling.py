"""Polling of register devices: when, what came of it, and its samples. A poll that failed is a lost sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bench import units
from bench.clock import Clock
from bench.errors import BenchError
from bench.rigfile.registers import Register
from bench.samples import ChannelInfo, SampleBlock, StreamLayout
from drivers.registerdevice import RegisterDevice


@dataclass(frozen=True, slots=True)
class Reading:
    """One poll: values in SI by register, or why there are none. `slot` counts periods since polling began; `t_ns` is the
    middle between request and answer."""

    device: str
    slot: int
    t_ns: int
    values: Mapping[str, float] | None
    error: BenchError | None = None


class Poll:
    """When a device is to be read: once in each period, as soon in it as possible."""

    def __init__(self, device: RegisterDevice, period_ns: int, clock: Clock) -> None:
        self.device, self.period_ns, self._clock = device, period_ns, clock
        self._origin, self._slot = clock.now_ns(), -1

    @property
    def due_ns(self) -> int:
        """When the next period begins."""
        return self._origin + (self._slot + 1) * self.period_ns

    def start(self) -> None:
        """The first period begins now."""
        self._origin, self._slot = self._clock.now_ns(), -1

    def take(self) -> Reading | None:
        """Read the device, unless it was read in this period. Periods that passed meanwhile are skipped."""
        begin = self._clock.now_ns()
        if begin < self.due_ns:
            return None
        self._slot = (begin - self._origin) // self.period_ns
        try:
            values, error = self.device.read(), None
        except BenchError as failure:
            values, error = None, failure
        return Reading(self.device.name, self._slot, (begin + self._clock.now_ns()) // 2, values, error)


class PolledStream:
    """A device's readings as a stream: channels `<device>_<register>`, ticks are periods of polling."""

    def __init__(self, device: RegisterDevice, period_ns: int) -> None:
        channels = tuple(channel_of(device.name, name, r) for name, r in device.spec.registers.items())
        self.layout = StreamLayout(device.name, period_ns, channels)
        self._names = tuple(device.spec.registers)
        self._index, self._slot = 0, -1

    def start_counting(self) -> None:
        """The next sample is number 0, and what was lost before it does not count."""
        self._index, self._slot = 0, -1

    def block(self, reading: Reading) -> SampleBlock | None:
        """The reading as a block of one sample; None where there is nothing to tell: the gap shows in the next one."""
        if reading.values is None:
            return None
        lost = reading.slot - self._slot - 1 if self._slot >= 0 else 0
        self._slot = reading.slot
        self._index += lost + 1
        row = np.array([reading.values[name] for name in self._names])
        columns = {channel.name: row[k : k + 1] for k, channel in enumerate(self.layout.channels)}
        at, tick = np.array([reading.t_ns], np.int64), np.array([reading.slot], np.uint64)
        return SampleBlock(self.layout.name, self._index - 1, tick, at, reading.t_ns, lost, columns)


def channel_of(device: str, name: str, register: Register) -> ChannelInfo:
    """A register as a channel; codes are whole numbers on file."""
    code = register.type == "u16" and register.unit == "1" and (register.scale, register.offset) == (1, 0)
    return ChannelInfo(f"{device}_{name}", units.unit(register.unit).si, "u2" if code else "f4")
