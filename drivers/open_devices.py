"""The rig's register devices, opened for the length of a block."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from bench.clock import Clock
from bench.errors import BenchError
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from bench.rigfile.registers import RegisterPort
from drivers.fieldbus import END_S, Fieldbus


@contextmanager
def open_devices(
    rig: RigFile, port_of: Callable[[str], RegisterPort], clock: Clock, envelope: Envelope, *, threaded: bool = False,
    clear_fault: bool = False,
) -> Iterator[Fieldbus]:  # fmt: skip
    """The rig's register devices, probed and polled for the block; nothing where it has none. However the block ends, a
    drive is told to coast.

    Raises:
        ConfigError: a map that cannot be, or a register that a device does not have.
        LinkError: a device does not answer.
        DriveFault: the drive has a fault that stays.
    """
    bus = Fieldbus(rig, port_of, clock, envelope, threaded=threaded)
    try:
        bus.connect(
            clear_fault
        )  # where that fails nothing may be written to a device that is not the one of the rig file
    except BaseException:
        bus.close()
        raise
    try:
        yield bus
    finally:
        try:
            if bus.drive is not None:  # before the end of polling is awaited: that may take a lost line's whole time
                with suppress(BenchError, TimeoutError):
                    coasting = bus.send(bus.devices[bus.drive.name].command, "coast")
                    if coasting is not None:
                        coasting.result(END_S)
        finally:
            bus.close()
