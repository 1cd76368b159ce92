"""The envelope: what may be commanded and what the machine may do. It refuses and raises; nothing is clipped."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bench import units
from bench.errors import InterlockError
from bench.rigfile.model import RigFile
from bench.samples import SampleBlock

Values = npt.NDArray[np.float64]
HELD = ("LEVITATED", "SPINNING")
LEAST_V = 0.1  # a supply that gives less is off, whatever it says and whatever the rig file states
AMBIENT = "ambient"  # of a thermal monitor's registers the one that is no winding's


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
        """Protected channels with what they may be at least and at most (channels, 1), and where those begin that count
        only while the rotor is held."""
        e, known = self.rig.envelope, self.rig.channels
        limits = {n: (-e.max_current_A, e.max_current_A) for n in known if n.startswith("i_")}
        limits |= {n: (-np.inf, e.max_temperature_K) for n in known if n.startswith("temp_")}
        limits["speed"] = (-e.max_speed_rad_s, e.max_speed_rad_s)
        first = len(limits)
        if "supply" in known and (e.min_supply_V, e.max_supply_V) != (None, None):
            limits["supply"] = self._supply
        limits |= {n: (-e.max_levitated_position_m, e.max_levitated_position_m) for n in e.positions if n in known}
        low, high = np.array(list(limits.values())).T[:, :, None]
        return list(limits), low, high, first

    @property
    def bounds(self) -> Mapping[str, tuple[float, float, bool]]:
        """Protected channels: least and greatest value, SI, and whether they count only while the rotor is held."""
        names, low, high, held = self._limits
        return {n: (float(low[k, 0]), float(high[k, 0]), k >= held) for k, n in enumerate(names)}

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
        names, low, high, held = self._limits
        x = np.array([block.columns[name] for name in names])
        inside = (low <= x) & (x <= high)  # NaN has left its range too
        if not inside.all():  # a rotor that is not held may lie anywhere
            inside[held:] |= ~np.isin(block.columns["state"], self._held)
        if not inside.all():
            row = int(np.argmin(inside.all(axis=1)))
            k, name = int(np.argmin(inside[row])), names[row]
            unit = units.UNITS[self.rig.channels[name].unit].si
            raise InterlockError(
                _left(name, x[row, k], f" at tick {int(block.ticks[k])}", low[row, 0], high[row, 0], unit)
            )

    @property
    def _supply(self) -> tuple[float, float]:
        """What the supply's voltage may be while the rotor is held, V: what the rig file states, and never nothing."""
        e = self.rig.envelope
        return e.min_supply_V or LEAST_V, e.max_supply_V or math.inf

    def check_reading(self, device: str, values: Mapping[str, float], held: bool) -> None:
        """Trip on a reading of a register device, SI by register; `held`: whether the rotor is.

        Raises:
            InterlockError: a winding is too hot, the shaft too fast, the drive's torque too great, or the rotor is held
                and the supply is off or out of its range; the text names the register and its value.
        """
        spec = self.rig.devices[device]
        for name, (low, high) in self._readings[device].items():
            if name in values and not low <= values[name] <= high:
                unit = units.UNITS[spec.registers[name].unit].si
                raise InterlockError(_left(f"{device} {name}", values[name], "", low, high, unit))
        if not held or "supply" not in spec.roles:
            return
        if not values.get("state", 1.0):
            raise InterlockError(f"interlock: {device} says that it is off while the rotor is held; look at it first")
        low, high = self._supply
        if "voltage" in values and not low <= values["voltage"] <= high:
            raise InterlockError(
                _left(f"{device} voltage", values["voltage"], " while the rotor is held", low, high, "V")
            )

    @cached_property
    def _readings(self) -> dict[str, dict[str, tuple[float, float]]]:
        """What the registers of each device may be in every state: temperatures of windings, and what a drive measures."""
        e, out = self.rig.envelope, dict[str, dict[str, tuple[float, float]]]()
        for device, spec in self.rig.devices.items():
            kelvin = [n for n, r in spec.registers.items() if units.unit(r.unit).si == "K"]
            hot = [n for n in kelvin if n.startswith("temp_") or ("thermal" in spec.roles and n != AMBIENT)]
            limits = dict.fromkeys(hot, (-math.inf, e.max_temperature_K))
            if "drive" in spec.roles:
                limits["actual_speed"] = (-e.max_speed_rad_s, e.max_speed_rad_s)
                torque = e.max_drive_torque_Nm or math.inf
                limits["torque"] = (-torque, torque)
            out[device] = limits
        return out


def _left(name: str, value: float, where: str, low: float, high: float, unit: str) -> str:
    """What a trip says."""
    if value < low and low > 0:
        return f"interlock: {name} fell to {value:.4g} {unit}{where}; the envelope asks for at least {low:g} {unit}"
    return f"interlock: {name} reached {abs(value):.4g} {unit}{where}; the envelope allows {high:g} {unit}"
