"""The simulated operator: answers lines, and hangs what the truth says on the shaft."""

from __future__ import annotations

from sim_backend.draws import uniform
from sim_backend.machine import Truth
from sim_backend.machines.tsbs.plant import Plant
from sim_backend.operator_line import words

HAND_OVER_S = 0.3  # how long the operator takes to let a mass go


class SimulatedOperator:
    """The operator of a TSBS. `seat_m` is the half-width of where a strap seats, each time it is hung."""

    def __init__(self, plant: Plant, truth: Truth, seat_m: float) -> None:
        self._plant, self._truth, self._seat_m = plant, truth, seat_m
        self._hangings = 0

    def request(self, line: str) -> str:
        """One line: `hang M2`, `hang -`, `lever left M2`, `lever left -`, `mount ring`, `mount -`, `ask TEXT`. Answers
        `ok SECONDS` (when it will be done), `yes` or `error TEXT`."""
        told = words(line, (name.removeprefix("masses.") for name in self._truth.values))
        match [*told[:-1], "" if told[-1:] == ["-"] else "".join(told[-1:])]:
            case ["ask", *_]:
                return "yes"
            case ["hang", label] if self._knows(label):
                self._hang(label)
            case ["lever", "left" | "right" as side, label] if self._knows(label, f"geometry.lever_{side}"):
                self._plant.lever(*self._truth.on_lever(side, label), HAND_OVER_S)
            case ["mount", "ring" | "" as part] if "ring_inertia" in self._truth.values:
                self._plant.mount(self._truth.values["ring_inertia"] if part else 0.0)
            case _:
                return f"error cannot {line.strip()!r}"
        return f"ok {HAND_OVER_S}"

    def _knows(self, label: str, *needed: str) -> bool:
        masses = [f"masses.{label}"] if label else []
        return all(name in self._truth.values for name in (*masses, *needed))

    def _hang(self, label: str) -> None:
        kg, newtons = self._truth.load(label)
        self._hangings += 1
        seat = self._seat_m * (
            2 * uniform(self._truth.seed, self._truth.anew(f"seat:{self._hangings}"), self._truth.visit) - 1
        )
        self._plant.load(kg, newtons, HAND_OVER_S, seat_m=seat)
