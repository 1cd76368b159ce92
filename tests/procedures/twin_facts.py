"""How a twin's probes truly stand and read: the facts by which its recording without noise gives the true motion."""

from __future__ import annotations

from dataclasses import replace

from bench.rigfile import RigFile
from bench.rigfile.numbers import Sum
from procedures.amb_rotor.geometry import Edge, Facts, nominal
from procedures.amb_rotor.stations import stations
from sim_backend.machine import Truth

SILENT = {"position_noise": 2e-8, "current_noise": 0.0}  # not for its readings to stand, which ends a run


def true_facts(rig: RigFile, drawn: Truth, t_0: float = 0.0) -> Facts:
    """By what was drawn for each number of the rig file."""
    s, values = stations(rig), drawn.values

    def drawn_of(of: Sum) -> float:
        return of.exact + sum(t.factor * values.get(t.identity.replace("/", "."), t.number.value) for t in of.terms)

    probes = s.probes.items()
    return replace(
        nominal(rig, t_0),
        gains=tuple(p.sign * values[f"{name}.gain"] for name, p in probes),
        offsets=tuple(values[f"{name}.offset"] for name, _ in probes),
        arms=tuple(drawn_of(p.arm) for _, p in probes),
        angles=tuple(drawn_of(p.angle) for _, p in probes),
        rings=tuple(
            Edge(r.plane, None if r.arm is None else drawn_of(r.arm), drawn_of(Sum((r.clearance,)))) for r in s.rings
        ),
    )
