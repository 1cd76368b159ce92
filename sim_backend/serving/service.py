"""Whatever else a served rig offers beside its controller and its operator, such as Modbus devices."""

from __future__ import annotations

from typing import Protocol


class Service(Protocol):
    """Started before the first slice, ticked between slices in the loop's own thread, stopped at the end."""

    def start(self) -> tuple[str, ...]:
        """Open the endpoints; returns their lines, such as `fieldbus modbus-tcp:127.0.0.1:28503`.

        Raises:
            ConfigError: a port is in use.
        """
        ...

    def tick(self, now_ns: int) -> None:
        """Bench time has reached `now_ns` (UNIX ns); must not wait."""
        ...

    def stop(self) -> None:
        """Release everything; also when `start` failed."""
        ...
