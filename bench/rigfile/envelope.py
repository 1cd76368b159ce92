"""The envelope: what may be commanded and what the machine may do. It refuses and raises; nothing is clipped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bench.errors import InterlockError
from bench.rigfile import protection
from bench.rigfile.binding import HELD
from bench.rigfile.model import RigFile
from bench.rigfile.protection import Protected
from bench.samples import SampleBlock

Values = npt.NDArray[np.float64]


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
    def _limits(self) -> tuple[tuple[Protected, ...], Values, Values, int]:
        """Protected channels with what they may be at least and at most (channels, 1), and where those begin that count
        only while the rotor is held."""
        found = protection.of_channels(self.rig)
        low, high = (np.array(x, np.float64).reshape(-1, 1) for x in ([p.low for p in found], [p.high for p in found]))
        return found, low, high, sum(not p.held for p in found)

    @cached_property
    def _readings(self) -> dict[str, dict[str, Protected]]:
        """Protected registers of each device."""
        return {device: protection.of_registers(self.rig, device) for device in self.rig.devices}

    @property
    def bounds(self) -> Mapping[str, tuple[float, float, bool]]:
        """Protected channels: least and greatest value, SI, and whether they count only while the rotor is held."""
        found, low, high, held = self._limits
        return {p.name: (float(low[k, 0]), float(high[k, 0]), k >= held) for k, p in enumerate(found)}

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
        found, low, high, held = self._limits
        x = np.array([block.columns[p.name] for p in found]).reshape(len(found), len(block))
        inside = (low <= x) & (x <= high)  # NaN has left its range too
        if not inside.all():  # a rotor that is not held may lie anywhere
            inside[held:] |= ~np.isin(block.columns["state"], self._held)
        if not inside.all():
            row = int(np.argmin(inside.all(axis=1)))
            k = int(np.argmin(inside[row]))
            raise InterlockError(_left(found[row], x[row, k], f" at tick {int(block.ticks[k])}"))

    def check_reading(self, device: str, values: Mapping[str, float], held: bool) -> None:
        """Trip on a reading of a register device, SI by register; `held`: whether the rotor is.

        Raises:
            InterlockError: a register has left its range (a winding is too hot, the shaft too fast, the drive's torque too
                great), or the rotor is held and the supply is off or out of its range; the text names the register and
                its value.
        """
        limits = self._readings[device]
        for name, p in limits.items():
            if not p.held and name in values and not p.low <= values[name] <= p.high:
                raise InterlockError(_left(p, values[name], ""))
        if not held:
            return
        if "supply" in self.rig.devices[device].roles and not values.get("state", 1.0):
            raise InterlockError(f"interlock: {device} says that it is off while the rotor is held; look at it first")
        for name, p in limits.items():
            if p.held and name in values and not p.low <= values[name] <= p.high:
                raise InterlockError(_left(p, values[name], " while the rotor is held"))


def _left(p: Protected, value: float, where: str) -> str:
    """What a trip says."""
    if value < p.low and p.low != -p.high:
        return f"interlock: {p.name} fell to {value:.4g} {p.unit}{where}; the envelope asks for at least {p.low:g} {p.unit}"
    return f"interlock: {p.name} reached {abs(value):.4g} {p.unit}{where}; the envelope allows {p.high:g} {p.unit}"
