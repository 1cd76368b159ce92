"""The machines that can be simulated: what the device's interface needs of each. The rig file chooses one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from bench.errors import ConfigError
from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from sim_backend import amb5dof, amb_quantities, tsbs
from sim_backend.core import CHANNELS, DriveLaw

if TYPE_CHECKING:
    from sim_backend.truth import Truth

Array = npt.NDArray[np.float64]
Numbers = Mapping[str, float]


class SimulatedPlant(Protocol):
    """A machine with its controller's law. `run` is the only thing that advances it."""

    mode: int  # OFF, READY, LIFT, LEVITATE or LAND

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
        defects: planted defects and their harmless values.
        params: the plant's parameters, of drawn values and defects.
        quantities: the true quantities, of the plant's parameters and the controller's.
        targets: quantities that can be set directly, and the drawn value that each is proportional to.
        make: the plant, of its parameters, a seed and integration steps in a tick.
        radial: columns of the plant's rows that come to rest at the end of a lift.
        integral_gains: parameters that the defect `integrator_factor` scales.
        turns: whether the controller can turn the rotor by itself.
        channels: names without which the telemetry of a DBC cannot be filled.
        places: which columns of the rows are told, and where each goes among the signals of the telemetry.
        spoil: puts planted defects of sensors into telemetry (n, signals).
        supply_V: of the amplifiers.
        windings: temperatures, and how far each is above the inboard AMB's, K.
        copper_W: what the windings dissipate at the present.
        operator: who works on it.
        traced: the channels of a tick's readings, for captures; none where the plant gives no such readings.
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


TSBS = Machine(
    name="tsbs", stated=tsbs.stated, defects=tsbs.DEFECTS, params=tsbs.params, quantities=tsbs.quantities,
    targets={"K_i": "slope_i", "K_o": "slope_o"}, make=tsbs.make, radial=slice(0, 4),
    integral_gains=frozenset(("ki_i", "ki_o", "ki_z", "ki_m")), turns=True,
    channels=CHANNELS, places=tsbs.places, spoil=tsbs.spoil,
    supply_V=148.0, windings={"temp_i": 0.0, "temp_o": 2.0, "temp_m": -3.0}, copper_W=tsbs.copper_W,
    operator=tsbs.operator,
)  # fmt: skip
AMB5DOF = Machine(
    name="amb5dof", stated=amb5dof.stated, defects=amb5dof.DEFECTS, params=amb5dof.params,
    quantities=amb_quantities.quantities, targets={}, make=amb5dof.make, radial=slice(0, 4),
    integral_gains=frozenset(("ki", "k0")), turns=False,
    channels=amb5dof.NEEDED, places=amb5dof.places, spoil=amb5dof.spoil, supply_V=48.0,
    windings={"temp_i": 0.0, "temp_o": 2.0, "temp_x": -3.0}, copper_W=amb5dof.copper_W, operator=amb5dof.operator,
    traced=amb5dof.traced,
)  # fmt: skip
MACHINES = {machine.name: machine for machine in (TSBS, AMB5DOF)}


def machine_of(rig: RigFile) -> Machine:
    """The machine that `machine` in a rig file's simulation table names; a TSBS where it names none.

    Raises:
        ConfigError: there is no such machine.
    """
    name = rig.simulation.get("machine", TSBS.name)
    if name not in MACHINES:
        raise ConfigError(f"rig {rig.name}: simulation.machine: found {name!r}; expected one of {', '.join(MACHINES)}")
    return MACHINES[name]
