"""The simulated operator: answers lines, and hangs what the truth says on the shaft."""

from __future__ import annotations

from sim_backend.core import Plant
from sim_backend.truth import Truth, uniform

HAND_OVER_S = 0.3  # how long the operator takes to let a mass go


class SimulatedOperator:
    """The operator of a simulated rig. `seat_m` is the half-width of where a strap seats, each time it is hung."""

    def __init__(self, plant: Plant, truth: Truth, seat_m: float) -> None:
        self._plant, self._truth, self._seat_m = plant, truth, seat_m
        self._hangings = 0

    def request(self, line: str) -> str:
        """One line: `hang M2`, `hang -`, `ask TEXT`. Answers `ok SECONDS` (when it will be done), `yes`
        or `error TEXT`."""
        verb, _, rest = line.strip().partition(" ")
        if verb == "ask":
            return "yes"
        label = "" if rest == "-" else rest
        if verb != "hang" or (label and f"masses.{label}" not in self._truth.values):
            return f"error cannot {line.strip()!r}"
        kg, newtons = self._truth.load(label)
        self._hangings += 1
        seat = self._seat_m * (2 * uniform(self._truth.seed, f"seat:{self._hangings}") - 1)
        self._plant.load(kg, newtons, HAND_OVER_S, seat_m=seat)
        return f"ok {HAND_OVER_S}"
