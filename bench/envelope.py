"""The envelope: what may be commanded and what the machine may do. It refuses and raises; nothing is clipped."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bench.errors import InterlockError
from bench.rigfile import RigFile
from bench.samples import SampleBlock

POSITIONS = ("pos_xi", "pos_yi", "pos_xo", "pos_yo")
HELD = ("LEVITATED", "SPINNING")


@dataclass(frozen=True)
class Envelope:
    """Protection of one rig, from its rig file."""

    rig: RigFile

    @cached_property
    def _held(self) -> list[int]:
        """Codes of the controller's states in which the rotor is held."""
        choices = self.rig.choices("state")
        return [code for code, name in choices.items() if self.rig.binding.mode(name) in HELD]

    def check_parameter(self, name: str, value: float) -> None:
        """Refuse a parameter write out of its range.

        Raises:
            InterlockError: nothing was sent.
        """
        p = self.rig.parameters.get(name)
        if p is None:
            raise InterlockError(f"parameter {name}: the rig has none of that name; nothing was sent")
        if not p.low <= value <= p.high:
            raise InterlockError(
                f"parameter {name}: found {value:g} {p.unit}; the envelope allows {p.low:g} to {p.high:g} {p.unit}; "
                "nothing was sent"
            )

    def check_load(self, label: str) -> None:
        """Refuse a mass beyond what may hang.

        Raises:
            InterlockError: nothing was asked of the operator.
        """
        mass = self.rig.masses.get(label)
        limit = self.rig.envelope.max_hung_kg
        if label and (mass is None or mass.value > limit):
            found = "no such mass" if mass is None else f"{mass.value:g} kg"
            raise InterlockError(f"mass {label}: found {found}; the envelope allows {limit:g} kg")

    def problems_of(self, settings: dict[str, float]) -> Iterable[str]:
        """What a plan's settings break, before anything is started."""
        for name, value in settings.items():
            try:
                self.check_parameter(name, value)
            except InterlockError as error:
                yield str(error)

    def check_block(self, block: SampleBlock) -> None:
        """Trip on live telemetry.

        Raises:
            InterlockError: a channel has left its range; the text names it, its value and the time.
        """
        e = self.rig.envelope
        c = block.columns
        for name, x in c.items():
            if name.startswith("i_"):
                self._trip(block, name, np.abs(x), e.max_current_A, "A")
            elif name.startswith("temp_"):
                self._trip(block, name, x, e.max_temperature_K, "K")
        self._trip(block, "speed", np.abs(c["speed"]), e.max_speed_rad_s, "rad/s")
        held = np.isin(c["state"], self._held)
        for name in (n for n in POSITIONS if n in c):
            self._trip(block, name, np.where(held, np.abs(c[name]), 0.0), e.max_levitated_position_m, "m")

    @staticmethod
    def _trip(block: SampleBlock, name: str, x: np.ndarray, limit: float, unit: str) -> None:
        if not (x <= limit).all():  # NaN has left its range too
            k = int(np.argmax(~(x <= limit)))
            raise InterlockError(
                f"interlock: {name} reached {x[k]:.4g} {unit} at tick {int(block.ticks[k])}; the envelope allows "
                f"{limit:g} {unit}"
            )
