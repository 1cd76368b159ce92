"""The envelope: what may be commanded and what the machine may do. It refuses and raises; nothing is clipped."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bench import units
from bench.errors import InterlockError
from bench.rigfile import RigFile
from bench.samples import SampleBlock

Values = npt.NDArray[np.float64]
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

    @cached_property
    def _limits(self) -> tuple[list[str], Values, Values, int]:
        """Protected channels with what they may be at least and at most (channels, 1), and where the positions begin,
        which come last."""
        e, known = self.rig.envelope, self.rig.channels
        limits = {n: (-e.max_current_A, e.max_current_A) for n in known if n.startswith("i_")}
        limits |= {n: (-np.inf, e.max_temperature_K) for n in known if n.startswith("temp_")}
        limits["speed"] = (-e.max_speed_rad_s, e.max_speed_rad_s)
        first = len(limits)
        limits |= {n: (-e.max_levitated_position_m, e.max_levitated_position_m) for n in e.positions if n in known}
        low, high = np.array(list(limits.values())).T[:, :, None]
        return list(limits), low, high, first

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

    def check_weight(self, mass_kg: float) -> None:
        """Refuse a weight beyond what may turn in a balancing plane.

        Raises:
            InterlockError: nothing was asked of the operator.
        """
        limit = self.rig.envelope.max_trial_weight_kg
        if not 0 < mass_kg <= limit:
            raise InterlockError(f"weight: found {mass_kg * 1e3:g} g; the envelope allows above 0 to {limit * 1e3:g} g")

    def check_injection(self, peak_A: float) -> None:
        """Refuse an injection into a current reference beyond its greatest value.

        Raises:
            InterlockError: nothing was sent.
        """
        if problem := self.injection_problem(peak_A):
            raise InterlockError(problem)

    def injection_problem(self, peak_A: float) -> str:
        """What is wrong with an injection that reaches `peak_A`; empty where nothing is."""
        limit = self.rig.envelope.max_injection_A
        if 0 < peak_A <= limit:
            return ""
        return (
            f"injection: found a peak of {peak_A:.3g} A; the envelope allows above 0 to {limit:g} A (max_injection_A)"
        )

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
        names, low, high, positions = self._limits
        x = np.array([block.columns[name] for name in names])
        inside = (low <= x) & (x <= high)  # NaN has left its range too
        if not inside.all():  # a rotor that is not held may lie anywhere
            inside[positions:] |= ~np.isin(block.columns["state"], self._held)
        if not inside.all():
            row = int(np.argmin(inside.all(axis=1)))
            k, name = int(np.argmin(inside[row])), names[row]
            unit = units.UNITS[self.rig.channels[name].unit].si
            raise InterlockError(
                f"interlock: {name} reached {abs(x[row, k]):.4g} {unit} at tick {int(block.ticks[k])}; the envelope "
                f"allows {high[row, 0]:g} {unit}"
            )
