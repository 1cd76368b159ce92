"""Lines with register devices on them, and what a package brings that adds a kind of them.

    [project.entry-points."levbench.devices"]
    scpi = "levbench_ball.thermometer:SCPI"      # a DeviceKind

The entry point's name is the scheme of the URL: supply, thermal monitor or drive may then be on a link `scpi:HOST:PORT`. Such a
device keeps its registers in the rig file, by which it is polled, protected, recorded and simulated as any other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from bench import extensions
from bench.link import LinkStats
from bench.rigfile import LinkSpec, linkurl
from bench.rigfile.registers import RegisterPort


class RegisterLine(Protocol):
    """One connection that devices share. May be used from several threads."""

    @property
    def stats(self) -> LinkStats:
        """Counts since it was opened."""
        ...

    def open(self) -> None:
        """Connect.

        Raises:
            ConfigError: nobody answers there.
        """
        ...

    def close(self) -> None:
        """Release it, also while a request waits. Twice is harmless."""
        ...

    def port(self, unit: int) -> RegisterPort:
        """One device on it. Its requests end within a bounded time, raise LinkError where no answer comes, and
        RegisterRefused where the device does not know an address; a write opens a lost connection anew, so that make-safe can
        still stop a drive."""
        ...


@dataclass(frozen=True, slots=True)
class DeviceKind:
    """How a line is made, of the link's name and its entry in the rig file; it is opened afterwards. Raises ConfigError where
    the URL or an option is none of its own."""

    line: Callable[[str, LinkSpec], RegisterLine]


def device_kind(scheme: str) -> DeviceKind | None:
    """What a package brings for a scheme; None where that is ours, or nobody's.

    Raises:
        ConfigError: the scheme is taken twice, or cannot be loaded.
    """
    point = extensions.found(extensions.DEVICES, scheme, linkurl.owner(scheme))
    return None if point is None else extensions.load(point, DeviceKind)
