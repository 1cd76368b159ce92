"""Who works on the one-axis AMB: lets the mass go that hangs over the pulley."""

from __future__ import annotations

from sim_backend.machine import Truth
from sim_backend.machines.amb1dof.plant import Plant


class Loader:
    """Hangs masses. `load_rise_s` of the truth is how long the thread takes the force over."""

    def __init__(self, plant: Plant, truth: Truth) -> None:
        self._plant, self._truth = plant, truth

    def request(self, line: str) -> str:
        """One line: `hang M1`, `hang -`, `ask TEXT`; the mass may be named after its hook. Answers `ok SECONDS`, `yes` or
        `error TEXT`."""
        values = self._truth.values
        match line.split():
            case ["ask", *_]:
                return "yes"
            case ["hang", *_, label] if label == "-" or f"masses.{label}" in values:
                newtons = 0.0 if label == "-" else values[f"masses.{label}"] * values["site.gravity"]
                self._plant.load((1 - self._truth.defects["load_lost"]) * newtons, values["load_rise_s"])
            case _:
                return f"error cannot {line.strip()!r}"
        return f"ok {values['load_rise_s']}"
