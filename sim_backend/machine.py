"""What a machine is that can be simulated, and the truth of one rig of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from bench.errors import Problem
from bench.link.fault_injection import Fault
from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from sim_backend.core import PERIOD_TICKS, TICK_S, DriveLaw
from sim_backend.draws import in_stretch, noise_seed
from sim_backend.motion import NONE, Motions

Array = npt.NDArray[np.float64]
Numbers = Mapping[str, float]
PLANTED_S = 1.0
"""How long a planted reading lasts: a speed that always read too fast would never let the shaft be landed."""


class SimulatedPlant(Protocol):
    """A machine with its controller's law. `run` is the only thing that advances it."""

    mode: int  # OFF, READY, LIFT, LEVITATE or LAND

    @property
    def tick_s(self) -> float: ...  # from control tick to control tick
    @property
    def period_ticks(self) -> int: ...  # ticks of a telemetry period
    @property
    def tick(self) -> int: ...
    @property
    def moved(self) -> bool: ...  # the lift or landing has run its course
    @property
    def speed(self) -> float: ...  # rad/s, as the controller sees it
    @property
    def pulse_age_s(self) -> float | None: ...  # since the last once-per-turn pulse; None: speed not by pulses
    @property
    def turn_s(self) -> float | None: ...  # the longer of the last two times between pulses; None: there are not three
    @property
    def shaft_speed(self) -> float: ...  # the true one
    @property
    def drive_torque(self) -> float: ...  # N m, of the external drive
    @property
    def trips(self) -> int: ...  # latched bits, see core.TRIPS
    def clear_trips(self) -> None: ...
    def set(self, name: str, value: float) -> None: ...  # a parameter of the law, SI
    def drive(self, law: DriveLaw | None, target_rad_s: float = 0.0) -> None: ...
    def run(self, ticks: int) -> Array: ...  # rows of the machine's channels, one per telemetry period


class TracedPlant(Protocol):
    """A plant that also gives the readings of single ticks."""

    def run(self, ticks: int, trace: int) -> tuple[Array, Array]: ...  # rows, and the readings of every so many ticks


class OperatorLine(Protocol):
    """Who works on a machine."""

    def request(self, line: str) -> str: ...


@dataclass(frozen=True)
class Machine:
    """One kind of machine.

    Attributes:
        stated: every toleranced number of a rig file that is drawn, by its name.
        daily: names among them that belong to the day and not to the machine: drawn anew on each visit.
        defects: planted defects and their harmless values.
        params: the plant's parameters, of drawn values and defects.
        quantities: the true quantities, of the plant's parameters and the controller's.
        targets: quantities that can be set directly, and the drawn value that each is proportional to.
        make: the plant, of its parameters, the seed of its noise and integration steps in a tick.
        radial: columns of the plant's rows that come to rest at the end of a lift.
        integral_gains: parameters that the defect `integrator_factor` scales.
        turns: whether the controller can turn the rotor by itself.
        levitates: whether it does; a machine that does not has the states and commands of a stage.
        channels: names without which the telemetry of a DBC cannot be filled.
        places: which columns of the rows are told, and where each goes among the signals of the telemetry.
        spoil: puts planted defects of sensors into telemetry (n, signals).
        supply_V: of the amplifiers.
        windings: temperatures, and how far each is above the inboard AMB's, K.
        copper_W: what the windings dissipate at the present.
        operator: who works on it.
        traced: the channels of a tick's readings, for captures; none where the plant gives no such readings.
        controls: names of what can be set of its law, of a machine whose rig files may call them otherwise.
        columns: of a machine whose rows are channels of the rig file, their names there; `channels` and `places` say nothing
            then.
        motions: what it truly does under a plan.
        unknown: keys of `[simulation]` that it never asks for; of a machine that tells them.
        impossible: by name and value, what is found and expected of a number of its own that it cannot have; else None.
        tick_s, period_s: of its controller, and from sample to sample of its telemetry.
        states: its controller's states in the place of `sim_backend.controller.states.States`, of plant, machine, the
            controller's own parameters, the owner and a planted fault's time.
        controller: what speaks for it, of rig file, truth, faults in the device and integration steps in a tick; None: the
            `SimulatedController` around its plant.
        served: what stands behind real ports; None: the `SimulatedController`, too.
    """

    name: str
    stated: Callable[[RigFile], dict[str, Toleranced]]
    defects: Numbers
    params: Callable[[Numbers, Numbers], Any]
    quantities: Callable[[Any, Numbers], dict[str, float]]
    targets: Mapping[str, str]
    make: Callable[[Any, int, int], SimulatedPlant]
    radial: slice
    integral_gains: frozenset[str]
    turns: bool
    channels: tuple[str, ...]
    places: Callable[[Numbers, Mapping[str, int]], tuple[slice | list[int], list[int]]]
    spoil: Callable[[Array, Mapping[str, int], Numbers], None]
    supply_V: float
    windings: Numbers
    copper_W: Callable[[Any], float]
    operator: Callable[[RigFile, Any, Truth], OperatorLine]
    traced: Callable[[Numbers], tuple[str, ...]] = lambda _: ()
    daily: frozenset[str] = frozenset()
    columns: Callable[[RigFile], tuple[str, ...]] | None = None
    controls: frozenset[str] = frozenset()
    motions: Motions = NONE
    unknown: Callable[[RigFile], Iterable[Problem]] = lambda _: ()
    impossible: Callable[[str, float], tuple[str, str] | None] = lambda name, value: None
    levitates: bool = True
    states: Callable[..., Any] | None = None
    tick_s: float = TICK_S
    period_s: float = PERIOD_TICKS * TICK_S
    controller: Callable[[RigFile, Truth, Sequence[Fault], int], Any] | None = None
    served: Callable[[RigFile, Truth, Sequence[Fault], int], Any] | None = None


@dataclass(frozen=True)
class Truth:
    """Every drawn value by name, planted defects, and what follows from them. `seed` says which machine, `visit` which day,
    `stretch` how often its run had been stopped and
    continued.
    `told` are the names of what was not drawn but said, so that it is not drawn anew either; `seen`: axis and true place, m or
    rad, of each reading of an instrument outside the loop, in their order."""

    seed: int
    values: Mapping[str, float]
    defects: Mapping[str, float]
    plant: Any  # parameters of the machine's plant
    quantities: Mapping[str, float]
    machine: Machine
    visit: int = 0
    stretch: int = 0
    told: frozenset[str] = frozenset()
    seen: list[tuple[str, float]] = field(default_factory=list, compare=False, repr=False)

    @property
    def noise(self) -> int:
        """Seed of all noise: of the plant, and of which frames a fault hits."""
        return noise_seed(self.seed, self.visit, self.stretch)

    def anew(self, name: str) -> str:
        """The name of a draw that is made each time anew: a seat, a weight, a reading."""
        return in_stretch(name, self.stretch)

    def planted(self, device: str = "") -> dict[str, float]:
        """What channels, or registers of a device, tell for PLANTED_S from when the shaft is held first, whatever they read;
        SI by name."""
        before = f"reading.{device}." if device else "reading."
        return {k.removeprefix(before): v for k, v in self.defects.items() if v and k.startswith(before)}

    @property
    def facts(self) -> dict[str, Any]:
        """As `truth.json` has it."""
        return {
            "schema": 1, "seed": self.seed, "visit": self.visit, "quantities": dict(self.quantities),
            "values": dict(self.values), "defects": dict(self.defects), **({"stretch": self.stretch} if self.stretch else {}),
        }  # fmt: skip

    @property
    def supply_V(self) -> float:
        """Of the amplifiers: the machine's, or what the rig file or an override says."""
        return self.values.get("supply_V", self.machine.supply_V)

    def load(self, label: str) -> tuple[float, float]:
        """Hung mass in kg and its weight in air in N for a load's label; the hanger is on, and "" is nothing else.

        Raises:
            KeyError: the rig has no such mass.
        """
        kg = 0.0
        if label:
            kg = self.values[f"masses.{label}"] * (1 + self.defects.get(f"mass_error_{label}", 0.0))
        if label or not self.defects["hanger_off_at_zero"]:
            kg += self.values["hanger"]
        return kg, weight_in_air(kg, self.values)

    def on_lever(self, side: str, label: str) -> tuple[float, float, float]:
        """Mass in kg on the lever, its weight in air in N, and its arm in m, positive on the left.

        Raises:
            KeyError: the rig has no such mass, or no lever.
        """
        arm = self.values[f"geometry.lever_{side}"] * {"left": 1, "right": -1}[side]
        if not label:
            return 0.0, 0.0, arm
        kg = self.values[f"masses.{label}"] * (1 + self.defects.get(f"mass_error_{label}", 0.0))
        return kg, weight_in_air(kg, self.values), arm


def weight_in_air(kg: float, v: Mapping[str, float]) -> float:
    """N of a conventional mass, with drawn values."""
    density = v["mass_density"]
    true = kg * (1 - 1.2 / 8000) / (1 - 1.2 / density)  # `kg` is a conventional mass, OIML D 28
    return true * v["site.gravity"] * (1 - v["site.air_density"] / density)
