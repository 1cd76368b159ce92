"""The simulated controller around the device: in this process spoken to by messages, which become the bytes of its command line
and back; served, by those bytes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from bench.errors import ConfigError
from bench.link.commandstream import CommandStream
from bench.link.fault_injection import Fault
from bench.link.frames import FrameBatch, joined
from bench.rigfile import RigFile, linkurl
from sim_backend.machine import Truth
from sim_backend.machines.lira.device import Device
from sim_backend.machines.lira.linefaults import KINDS, LineFaults
from sim_backend.machines.lira.plant import TICKS_S
from sim_backend.machines.lira.settings import SETTINGS
from sim_backend.machines.lira.uart import Uart
from sim_backend.octets import BYTES, framed, unframed

TICKS: Final = 56
"""Of the machine in one of this controller: whole readings of the positions, and whole nanoseconds."""
TICK_NS: Final = TICKS * 10**9 // TICKS_S
SLICE: Final = 5  # ticks from look to look at the line
FASTEST: Final = 3_000_000  # Bd, where the URL says nothing


class LineController:
    """The device end of the rig's command line.

    Args:
        rig: its table `commandline`.
        truth: which machine it has.
        faults: of its line and in it (`linefaults.KINDS`).

    Raises:
        ConfigError: a fault of another kind.
    """

    tick_ns = TICK_NS
    hears = frozenset({BYTES})
    captures = None

    def __init__(self, rig: RigFile, truth: Truth, faults: Sequence[Fault] = (), substeps: int = 2) -> None:
        if other := [str(f) for f in faults if f.kind not in KINDS]:
            raise ConfigError(
                f"--fault {', '.join(other)}: a line knows no such fault; expected one of {', '.join(KINDS)}"
            )
        self.truth = truth
        self.plant: Any
        self.plant = truth.machine.make(truth.plant, truth.noise, substeps)
        for s in SETTINGS:  # as delivered
            if s.name in rig.parameters:
                self.plant.set(s.field, rig.parameters[s.name].default)
        self.device = Device(self.plant)
        url = linkurl.parse(rig.link.url)
        baud = int(url.query["baudrate"]) if url.query.get("baudrate", "").isdigit() else FASTEST
        self.uart = Uart(self.device, baud, LineFaults(faults, truth.noise) if faults else None)

    @property
    def state(self) -> str:
        """The state's name."""
        return str(self.plant.state)

    @property
    def fault(self) -> str:
        """The latched fault, NONE without one."""
        return str(self.plant.fault)

    def advance(self, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch:
        """Run; bytes come and go as frames with the identifier BYTES."""
        said = self.uart.advance(ticks * TICK_NS * 1e-9, unframed(incoming))
        return framed(said, t0_ns + ticks * TICK_NS)


class SpokenController(LineController):
    """With the host's end of the line beside it: messages in, messages out."""

    def __init__(self, rig: RigFile, truth: Truth, faults: Sequence[Fault] = (), substeps: int = 2) -> None:
        super().__init__(rig, truth, faults, substeps)
        self._stream = CommandStream(rig)
        self._waiting = self._stream.opening()

    def advance(self, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch:
        """Run for so many ticks of 200 us; messages are said when their time has come.

        Returns:
            What the controller's lines and blocks are as messages, with the times at which they were whole.
        """
        out, times, left = [], incoming["t_ns"], len(incoming)
        for begin in range(0, ticks, SLICE):
            end = min(begin + SLICE, ticks)
            data, self._waiting = self._waiting, b""
            if left:
                due = (times >= t0_ns + begin * TICK_NS if begin else times == times) & (
                    times < t0_ns + end * TICK_NS if end < ticks else times == times
                )
                left -= int(np.count_nonzero(due))
                data += self._stream.encode(incoming[due])
            said = self.uart.advance((end - begin) * TICK_NS * 1e-9, data)
            if len(batch := self._stream.feed(said, t0_ns + end * TICK_NS)):
                out.append(batch)
            self._waiting = self._stream.due()
        return joined(out) if out else incoming[:0]
