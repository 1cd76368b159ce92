"""Quantities of a tracking test with everything that makes them uncertain, by identity."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence
from procedures.amb_rotor.geometry import Facts, lengths, nominal
from procedures.amb_rotor.stations import stations
from procedures.shared.certificates import certified
from procedures.tracking.currents import of_coils
from procedures.tracking.ellipse import Path, Turns, of_points, quantities, turns
from procedures.tracking.steps import Orbit

TIMING_TICKS = 0.5  # half width: how the reference's zero of phase stands to the answer of the currents
UNITS = {"error": "m", "contour": "m", "amplitude": "1", "phase": "rad", "tilt": "rad", "ring": "m"}
GROWS, SPREAD = math.sqrt(2 / math.pi), math.sqrt(1 - 2 / math.pi)
"""Mean and standard deviation of the amount of a normal deviation of 1: the greatest distance to either side of the middle
grows by an orbit's shift, whichever way it goes."""
BLOCKS = 12  # of revolutions, left out in turn
Moved = Callable[[Facts, float], Facts]


@dataclass(frozen=True)
class Input:
    """One influence on the facts: who it is, its certificate, and the facts with it moved."""

    id: str
    name: str
    stated: Toleranced
    moved: Moved


def _at(k: int, kind: str, sign: int = 1) -> Moved:
    def moved(f: Facts, by: float) -> Facts:
        values = list(getattr(f, kind))
        values[k] += sign * by
        return replace(f, gains=tuple(values)) if kind == "gains" else replace(f, offsets=tuple(values))

    return moved


def _one(kind: str) -> Moved:
    def moved(f: Facts, by: float) -> Facts:
        return replace(f, **{kind: getattr(f, kind) + by})

    return moved


def inputs(rig: RigFile, tick_s: float, runout_m: float) -> list[Input]:
    """Everything that the facts are uncertain by."""
    out = []
    for k, (name, placed) in enumerate(stations(rig).probes.items()):
        s = rig.sensors[name]
        of_sensor = [
            Input(f"sensors/{name}/gain", f"gain of {name}", s.gain, _at(k, "gains", placed.sign)),
            Input(f"sensors/{name}/offset", f"zero of {name}", s.offset, _at(k, "offsets")),
        ]
        out += [i for i in of_sensor if i.stated.standard_uncertainty > 0]
        if runout_m > 0:
            allowed = Toleranced(
                value=0.0,
                unit="m",
                u=None,
                k=1.0,
                half_width=runout_m,
                distribution="rectangular",
                source="plan: runout_m",
            )
            out.append(Input(f"runout/{name}", f"runout at {name}", allowed, _at(k, "offsets")))
    out += [Input(length.identity, length.name, length.number, length.moved) for length in lengths(rig)]
    clock = Toleranced(
        value=0.0,
        unit="s",
        u=None,
        k=1.0,
        half_width=TIMING_TICKS * tick_s,
        distribution="rectangular",
        source="half a tick of the controller either way",
    )
    out.append(Input("timing/start", "start of the reference", clock, _one("t_0")))
    return out


def by_law(orbits: Sequence[Orbit], rig: RigFile, runout_m: float) -> dict[str, dict[str, Estimate]]:
    """Every quantity of each law."""
    return {o.law: {**_of_path(o, rig, runout_m), **({} if o.path.points else of_coils(o, rig))} for o in orbits}


def _told(path: Path) -> Callable[[Turns], dict[str, float]]:
    """What is made of the revolutions."""
    return quantities if path.points is None else lambda whole: of_points(whole, path.wave)


def _of_path(orbit: Orbit, rig: RigFile, runout_m: float) -> dict[str, Estimate]:
    path, facts = orbit.path, nominal(rig, orbit.t_0)
    whole, told = turns(path, facts), _told(path)
    least = told(whole)
    moved: list[tuple[Input, dict[str, float], dict[str, float]]] = []
    for i in inputs(rig, path.wave.tick, runout_m):
        u = i.stated.standard_uncertainty
        up, down = (told(turns(path, i.moved(facts, by))) for by in (u, -u))
        moved.append((i, up, down))
    scatter, out = _scatter(orbit, whole), {}
    for name, value in least.items():
        total = Estimate.exact(value, _unit(name))
        bent = more = 0.0
        for i, up, down in moved:
            c = (up[name] - down[name]) / (2 * i.stated.standard_uncertainty)
            second = (up[name] + down[name]) / 2 - value
            bent, more = math.hypot(bent, second), more + second
            total = total + (certified(i.id, i.stated, i.name) - i.stated.value) * c
        total = total + scatter[name]
        if path.points is not None and name == "ring_distance":
            bent, more = SPREAD * bent, -GROWS * bent
        if bent > 0:
            # a peak only grows by what the sensors hide: the second order belongs to the value (GUM 5.1.2, note)
            total = total + more
            total = total + _small(
                f"curvature/{orbit.law}/{name}", "second-order part of all inputs", bent, _unit(name)
            )
        out[name] = replace(total, unit=_unit(name))
    return out


def _unit(name: str) -> str:
    return UNITS[name.split("_")[0]]


def _scatter(orbit: Orbit, whole: Turns) -> dict[str, Estimate]:
    """Zero, with what the revolutions' scatter makes of each quantity: blocks of them left out in turn; the distance to the
    rings is the least of single samples, and scatters as those of the revolutions do."""
    count = len(whole.left)
    blocks = min(BLOCKS, count)
    told = _told(orbit.path)
    left = [told(whole.without(np.arange(count) % blocks == b)) for b in range(blocks)]
    out = {}
    for name in left[0]:
        values = np.array([x[name] for x in left])
        u = math.sqrt((blocks - 1) / blocks * float(((values - values.mean()) ** 2).sum()))
        if name == "ring_distance":
            u = float(whole.left.std(ddof=1))
        out[name] = Estimate.of(
            0.0,
            Influence(
                id=f"scatter/{orbit.law}/{name}",
                name="scatter over revolutions",
                u=u,
                unit=_unit(name),
                kind="A",
                distribution="normal",
                dof=float(blocks - 1),
                source=f"{blocks} blocks of revolutions of the reference, left out in turn",
            ),
        )
    return out


def _small(identity: str, name: str, u: float, unit: str) -> Estimate:
    return Estimate.of(
        0.0, Influence(id=identity, name=name, u=u, unit=unit, kind="B", distribution="normal", source="evaluation")
    )
