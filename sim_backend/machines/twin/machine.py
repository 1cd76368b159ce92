"""The twin of a rig behind the simulated controller: what is drawn for it, its plant, its wiring, who works on it. Each rig
file makes a machine of its own."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import combinations

import numpy as np
import numpy.typing as npt

from bench import units
from bench.rigfile import RigFile, protection
from bench.rigfile.supports import once_per_rig
from bench.rigfile.toleranced import Toleranced
from sim_backend.machine import Machine, Truth
from sim_backend.machines.twin.keys import unknown
from sim_backend.machines.twin.layout import Numbers, layout_of
from sim_backend.machines.twin.motions import MOTIONS
from sim_backend.machines.twin.nominal import nominal_of
from sim_backend.machines.twin.operator import Fitter
from sim_backend.machines.twin.params import TwinParams, params
from sim_backend.machines.twin.plant import TwinPlant
from sim_backend.machines.twin.possible import cannot_be
from sim_backend.machines.twin.quantities import quantities
from sim_backend.machines.twin.rules import drawn
from sim_backend.machines.twin.told import told_of

Array = npt.NDArray[np.float64]
TWIN = "twin"
DAILY = frozenset(("site.air_density", "start_angle"))
PLAIN = {
    "pulse_missing": 0.0, "pulse_doubled": 0.0, "pulse_last": 0.0, "loose_speed": 0.0, "loose_shift": 0.0, "loose_weight": 0.0,
    "weight_lost": 0.0, "weight_astray": 0.0, "weight_turned": 0.0, "weight_turned_rad": 0.0, "weight_heavy": 0.0,
    "weight_heavy_by": 0.0, "hum": 0.0, "hum_hz": 50.0, "hum_probe": 0.0, "hanger_off_at_zero": 0.0, "contact_silent": 0.0,
    "drop_fraction": 0.0, "own_slew": 0.0, "integrator_factor": 1.0, "dead_after_s": 0.0,
    "fault_after_s": 0.0, "drive_fault_after_s": 0.0,
}  # fmt: skip
"""Planted defects that any rig can have, and their harmless values: as those of `amb5dof`. `defects_of` has those of one
rig."""


@once_per_rig
def twin(rig: RigFile) -> Machine:
    """The machine that a rig file describes.

    Raises:
        ConfigError: a twin cannot be made of it.
    """
    layout, nominal = layout_of(rig), nominal_of(rig)
    return Machine(
        name=TWIN, stated=stated, defects=defects_of(rig), params=partial(params, rig), quantities=partial(quantities, rig),
        targets={},
        make=make, radial=slice(0, len(layout.looking)), integral_gains=_integral_gains(rig), turns=False, channels=(),
        places=partial(places, rig), spoil=spoil, supply_V=nominal.set("supply_V", 48.0), windings=windings_of(rig),
        copper_W=copper_W,
        operator=operator, traced=partial(traced, rig), daily=DAILY, columns=columns, motions=MOTIONS,
        unknown=unknown, impossible=cannot_be,
    )  # fmt: skip


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """Every toleranced number of a rig file by its identity, "/" written as ".", gains and offsets by channel, and what the
    twin draws beside them."""
    return dict(drawn(rig))


def defects_of(rig: RigFile) -> dict[str, float]:
    """Planted defects of a rig by name, and their harmless values. `exchange_*` is how it is wired, `told_*` acts on what
    is told alone; `factor_*` scales what a parameter sets before it acts; `reading.*` is what a protected channel, or register
    of a device, tells in the first second in which the shaft is held, SI (0: what it reads)."""
    layout = layout_of(rig)
    out = dict(PLAIN)
    out |= {f"probe_sign.{name}": 1.0 for name in layout.probes}
    out |= {f"{way}_coils.{a.name}": 0.0 for a in layout.axes if len(a.coils) == 2 for way in ("exchange", "told")}
    out |= {f"{way}_probes.{a}.{b}": 0.0 for a, b in combinations(layout.probes, 2) for way in ("exchange", "told")}
    out |= {f"mass_error_{label}": 0.0 for label in rig.masses}
    out |= {f"reading.{p.name.replace(' ', '.')}": 0.0 for p in protection.all_of(rig)}
    return out | {f"factor_{name}": 1.0 for name in rig.parameters}


def _integral_gains(rig: RigFile) -> frozenset[str]:
    """Parameters that the defect `integrator_factor` scales: the twin's own, and the rig's that are bound to them."""
    own = {f"ki.{a.name}" for a in layout_of(rig).axes}
    gains = rig.capabilities.gains
    bound = gains.ki if gains is not None else ""
    return frozenset(own | (set(bound.values()) if isinstance(bound, Mapping) else {bound} - {""}))


def windings_of(rig: RigFile) -> dict[str, float]:
    """Temperatures that channels tell or registers of a thermal monitor, all the same."""
    told = [name for name, c in rig.channels.items() if _in_kelvin(c.unit)]
    devices = [d for d in rig.devices.values() if "thermal" in d.roles]
    read = [name for d in devices for name, r in d.registers.items() if _in_kelvin(r.unit)]
    return {name: 0.0 for name in (*told, *read) if name != "ambient"}


def _in_kelvin(unit: str) -> bool:
    """Whether it is of a temperature; one that nobody knows is told by the check of the rig file."""
    return unit in units.UNITS and units.UNITS[unit].si == "K"


def make(p: TwinParams, seed: int, substeps: int) -> TwinPlant:
    """The plant itself."""
    return TwinPlant(p, seed, substeps=substeps)


def operator(rig: RigFile, plant: TwinPlant, truth: Truth) -> Fitter:
    """Who works on it."""
    return Fitter(rig, plant, truth)


def copper_W(plant: TwinPlant) -> float:
    """What its windings dissipate."""
    return plant.params.resistance * sum(i * i for i in plant.currents)


def columns(rig: RigFile) -> tuple[str, ...]:
    """Names of the rows' columns."""
    return tuple(dict.fromkeys(name for name, _ in told_of(rig, {}).rows))


def places(rig: RigFile, defects: Numbers, at: Mapping[str, int]) -> tuple[list[int], list[int]]:
    """Which columns are told, and where each goes among the signals of a DBC with one message of telemetry."""
    names = columns(rig)
    signals = [rig.channels[name].signal.partition(".")[2] if name in rig.channels else name for name in names]
    told = [k for k, signal in enumerate(signals) if signal in at]
    return told, [at[signals[k]] for k in told]


def traced(rig: RigFile, defects: Numbers) -> tuple[str, ...]:
    """The names of the readings of a tick, for captures."""
    return tuple(name for name, _ in told_of(rig, defects).ticks)


def spoil(values: Array, at: Mapping[str, int], defects: Numbers) -> None:
    """Nothing: what the telemetry's numbers cannot hold is the controller's matter."""
