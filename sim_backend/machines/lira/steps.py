"""Steps of currents by the line's `step`: until the next one, or for so long by the firmware's own ticks."""

from __future__ import annotations

from sim_backend.machines.lira.plant import DQ, POSITION_TICKS, TICKS_S, Plant
from sim_backend.machines.lira.settings import LONGEST_STEP_S
from sim_backend.machines.lira.shell import Refused, number


class Steps:
    """What is added to the references of a machine's currents."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._ends: dict[str, int] = {}  # ticks of the machine at which steps end by themselves

    def forget(self) -> None:
        """After a restart."""
        self._ends.clear()

    def do(self, *words: str) -> list[str]:
        """Carry out `step`.

        Raises:
            Refused: it cannot be done; with its code.
        """
        if len(words) not in (2, 3) or words[0] not in DQ:
            raise Refused(2, "system amperes [seconds]")
        amperes, seconds = number(words[1]), number(words[2]) if len(words) > 2 else 0.0
        if not -5 <= amperes <= 5 or not 0 <= seconds <= LONGEST_STEP_S:
            raise Refused(3, f"-5..5 A 0..{LONGEST_STEP_S:g} s")
        if self._plant.state not in ("CURRENT", "LEVITATED"):
            raise Refused(4, f"state={self._plant.state}")
        self._ends.pop(words[0], None)
        if seconds:
            lasts = max(round(seconds * TICKS_S) // POSITION_TICKS, 1) * POSITION_TICKS
            self._ends[words[0]] = self._plant.tick + lasts
        self._plant.step(words[0], amperes)
        return [f"{words[0]}={amperes:.9g} A"]

    def ended(self) -> int:
        """Take away those whose time is over; ticks until that of the next one is."""
        now = self._plant.tick
        for name in [name for name, at in self._ends.items() if at <= now]:
            self._plant.step(name, 0.0)
            del self._ends[name]
        return min(self._ends.values(), default=now + TICKS_S) - now
