"""Small rig files for tests of the twin, made of a few words each."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from bench.rigfile import RigFile
from sim_backend.core import LEVITATE, LIFT, READY
from sim_backend.draws import draw_one
from sim_backend.machine import Truth
from sim_backend.machines.table import machine_of
from sim_backend.machines.twin.machine import twin
from sim_backend.machines.twin.plant import TwinPlant

ROOT = Path(__file__).resolve().parents[2]
HEAD = """
schema = 2
name = "{name}"
title = "{name}"
uut = {{ model = "rotor", serial = "SIM-9" }}
[site]
place = "Edmonton"
latitude_deg = 53.527
elevation_m = 668
gravity = {{ value = 9.81175, unit = "m/s^2", u = 5e-4, distribution = "normal", source = "IUGG formula" }}
air_density = {{ value = 1.11, unit = "kg/m^3", half_width = 0.05, distribution = "rectangular", source = "weather" }}
[links.controller]
url = "slcan:socket://127.0.0.1:28599"
bitrate = 1_000_000
data_bitrate = 5_000_000
dbc = "none.dbc"
[devices.controller]
link = "controller"
roles = ["levitation"]
tick_s = {tick}
[envelope]
max_hung_kg = {hung}
max_current_A = {current}
max_speed_rad_s = {speed}
max_levitated_position_m = 150e-6
positions = []
"""


def number(value: float, unit: str, half: float = 0.0) -> str:
    return f'{{ value = {value!r}, unit = "{unit}", half_width = {half!r}, distribution = "rectangular", source = "test" }}'


def bearing(name: str, at_mm: float, axes: Mapping[str, float], *, gap_mm: float = 0.5, coils: int = 2) -> str:
    lines = [f'[bearings.{name}]\nkind = "radial"\nat = {number(at_mm, "mm", 0.2)}\ngap = {number(gap_mm, "mm", 0.01)}',
             f'voltage = "volt_{name}"']  # fmt: skip
    for axis, deg in axes.items():
        used = ", ".join(f'"amp_{axis}_{c}"' for c in "pn"[:coils])
        lines.append(f"axes.{axis} = {{ direction = {number(deg, 'deg', 0.3)}, coils = [{used}] }}")
    return "\n".join(lines)


def thrust(name: str = "thrust", axis: str = "w") -> str:
    coils = f'axes.{axis} = {{ coils = ["amp_{axis}_p", "amp_{axis}_n"] }}'
    return f'[bearings.{name}]\nkind = "axial"\ngap = {number(0.6, "mm")}\n{coils}'


def probe(name: str, at_mm: float = 0.0, deg: float | None = None, sign: int = 1) -> str:
    lines = [f"[probes.{name}]", f'channel = "pos_{name}"', f"sign = {sign}"]
    if deg is not None:
        lines += [f"at = {number(at_mm, 'mm', 0.2)}", f"direction = {number(deg, 'deg', 0.3)}"]
    return "\n".join(lines)


def rig(
    name: str,
    parts: Iterable[str],
    *,
    tick: float = 1e-4,
    current: float = 6.0,
    speed: float = 2000.0,
    hung: float = 0.0,
    top: str = "",
) -> RigFile:
    """`parts` are tables, `top` keys that stand before the first."""
    text = top + "\n".join([HEAD.format(name=name, tick=tick, current=current, speed=speed, hung=hung), *parts])
    data = tomllib.loads(text)
    channels = [p["channel"] for p in data.get("probes", {}).values()]
    units = dict.fromkeys(channels, "m")
    for b in data["bearings"].values():
        units |= {c: "A" for a in b["axes"].values() for c in a["coils"]}
        units |= {b["voltage"]: "V"} if "voltage" in b else {}
    mark = data.get("mark", {})
    units |= {
        mark[k]: u for k, u in (("angle", "rad"), ("speed", "rad/s"), ("pulses", "1"), ("edge", "s")) if k in mark
    }
    lines = [f'{c} = {{ signal = "T.{c}", unit = "{u}" }}' for c, u in units.items()]
    return RigFile.parse("\n".join([text, "[channels]", *lines]), "", f"{name}.toml")


SPINDLE = (
    '[shaft]\nfar_end = "top"\nsense = -1',
    f"mass = {number(4.0, 'kg', 0.02)}\npolar_inertia = {number(4e-3, 'kg m^2')}",
    f"transverse_inertia = {number(3e-2, 'kg m^2')}",
    f"tilt = {number(90, 'deg')}\ncentre_of_mass = {number(20, 'mm', 0.5)}",
    bearing("lower", -90, {"u1": 30, "v1": 120}), bearing("upper", 110, {"u2": 30, "v2": 120}), thrust(),
    probe("u1", -60, 30), probe("v1", -60, 120, -1), probe("u2", 80, 75), probe("v2", 80, 165), probe("w"),
    '[mark]\nangle = "ang"\nspeed = "rate"\npulses = "count"\nedge = "edge"\n' + f"direction = {number(40, 'deg')}",
    f'[rings.low]\nclearance = {number(0.2, "mm")}\nat = {number(-100, "mm")}',
    f'[rings.high]\nclearance = {number(0.2, "mm")}\nat = {number(120, "mm")}',
    f'[rings.end]\nkind = "axial"\nclearance = {number(0.25, "mm")}',
    f'[balancing.disc]\nat = {number(60, "mm")}\nradius = {number(30, "mm")}\nsense = -1\nzero = {number(20, "deg")}',
    f'[balancing.nut]\nat = {number(-30, "mm")}\nradius = {number(20, "mm")}',
    f'[coupling]\nat = {number(-120, "mm")}\nstiffness = {number(800, "N/m")}\noffset = {number(10, "um")}',
)  # fmt: skip
STAND = (
    '[shaft]\nfar_end = "rechts"', f"mass = {number(8.0, 'kg')}",
    bearing("links", -150, {"xl": 90, "yl": 0}, gap_mm=0.4), bearing("rechts", 100, {"xr": 90, "yr": 0}, gap_mm=0.4),
    probe("xl", -120, 90), probe("yl", -120, 0), probe("xr", 130, 90), probe("yr", 130, 0),
)  # fmt: skip
THREES = (
    '[shaft]\nfar_end = "far"', f"mass = {number(3.0, 'kg')}",
    f"centre_of_mass = {number(60, 'mm')}",
    bearing("one", -60, {"a1": 0, "b1": 120, "c1": 240}), bearing("two", 40, {"a2": 60, "b2": 180, "c2": 300}),
    probe("p1", -50, 10), probe("p2", -50, 100), probe("p3", 0, 55), probe("p4", 30, 20), probe("p5", 30, 130),
)  # fmt: skip
"""Three axes in each of two bearings, three planes of probes, the centre of mass outside the bearings."""
ONE_AXIS = (
    '[shaft]\nfar_end = "front"', f"mass = {number(2.0, 'kg')}",
    bearing("magnet", 0, {"y": 0}, coils=1), probe("y", 0, 0),
)  # fmt: skip
HUNG = (
    f'[masses]\nM1 = {number(0.5, "kg")}',
    f'[hooks.h]\nat = {number(0, "mm")}\n[hooks.side]\nat = {number(50, "mm")}\npull = {number(60, "deg")}',
    f'pulley = {{ friction = {number(0.02, "1")}, misalignment = {number(1.5, "deg")} }}',
)  # fmt: skip
TOP = f"mass_density = {number(8000, 'kg/m^3')}\nhanger = {number(0.1, 'kg')}\nhook_seat = {number(0, 'mm')}\n"


def shipped(**replaced: str) -> RigFile:
    """The AMB stand's rig file, simulated as a twin of itself with a rigid shaft."""
    text = (ROOT / "rigs/amb5dof.toml").read_text(encoding="utf-8").replace('machine = "amb5dof"', 'machine = "twin"')
    text = text.replace("mode_1_on = 1.0", "mode_1_on = 0.0").replace("mode_2_on = 1.0", "mode_2_on = 0.0")
    for old, new in replaced.items():
        text = text.replace(old, new)
    return RigFile.parse(text, (ROOT / "rigs/amb5dof.dbc").read_text(encoding="utf-8"), "twin.toml")


def truth(rig: RigFile, seed: int = 0, **changes: float) -> Truth:
    """Of a rig without a DBC: as `sim_backend.truth.draw`; `changes` are values or defects by name, "." as "__"."""
    machine = machine_of(rig) if rig.simulation.get("machine") else twin(rig)
    values = {n: draw_one(t, seed, n) for n, t in machine.stated(rig).items()}
    defects = dict(machine.defects)
    for name, value in changes.items():
        key = name.replace("__", ".")
        assert key in values or key in defects, key
        (defects if key in defects else values)[key] = value
    used = {n: p.default for n, p in rig.parameters.items()}
    plant = machine.params(values, defects)
    return Truth(seed, values, defects, plant, machine.quantities(plant, used), machine)


def plant_of(t: Truth, substeps: int = 2) -> TwinPlant:
    return TwinPlant(t.plant, t.noise, substeps=substeps)


def levitated(t: Truth, settle_s: float = 1.0) -> TwinPlant:
    """Lifted off its rings and held."""
    plant = plant_of(t)

    def ticks(seconds: float) -> int:
        return math.ceil(seconds / plant.tick_s)

    plant.run(ticks(0.3))
    plant.mode = READY
    plant.run(ticks(0.05))
    plant.mode = LIFT
    plant.run(ticks(plant.get("lift_time_s") + 0.05))
    plant.mode = LEVITATE
    plant.run(ticks(settle_s))
    return plant


def column(plant: TwinPlant, rows: Any, name: str) -> Any:
    return rows[:, plant.channels.index(name)]


def nominal(rig: RigFile, **changes: float) -> Truth:
    """Every drawn number as the rig file or a rule states it: no offsets, gains of 1; without noise and runout."""
    stated = {name.replace(".", "__"): t.value for name, t in twin(rig).stated(rig).items()}
    t = truth(rig, **{**stated, **changes})
    silent = (0.0,) * 16
    still = (0.0,) * 64
    plant = dataclasses.replace(
        t.plant,
        position_noise=silent,
        current_noise=0.0,
        runout_c=still,
        runout_s=still,
        position_lsb=0.0,
        current_lsb=0.0,
    )
    return dataclasses.replace(t, plant=plant)
