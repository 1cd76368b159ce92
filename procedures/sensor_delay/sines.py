"""Which probes are looked at, and the sines for them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.rigfile import RigFile
from bench.rigfile.places import Places
from procedures.position_loops.injection import USUAL_HZ, Sine, ability, told, whole
from procedures.sensor_delay.plan import Plan
from procedures.shared.rates import rate_of


@dataclass(frozen=True)
class Probe:
    """A position that is read in `channel`, the `current` that pushes there, the `loop` that holds it."""

    channel: str
    current: str
    loop: str


def probes(rig: RigFile) -> tuple[Probe, ...]:
    """Of all directions in which the rig tells currents that push."""
    can = rig.capabilities
    if can.hold is None or can.loop_injection is None:
        return ()
    loops = {one.channel: name for name, one in can.loop_injection.loops.items()}
    pairs = [(p, i) for axis in can.hold.axes.values() for p, i in zip(axis.positions, axis.currents, strict=True)]
    return tuple(Probe(p, i, loops[p]) for p, i in pairs if p in loops)


def captured(rig: RigFile) -> tuple[str, ...]:
    """Channels of a capture: all positions, all currents, whichever loop is pushed."""
    some, wave = probes(rig), ability(rig).wave
    return (*(p.channel for p in some), *(p.current for p in some), *([wave] if wave else []))


def rate(rig: RigFile, plan: Plan) -> float:
    """Of captures, Hz."""
    return rate_of(rig, plan.rate_hz, USUAL_HZ)


def sines(rig: RigFile, plan: Plan, loop: str) -> list[Sine]:
    """Of one loop; their amplitudes are forces, N."""
    force = plan.share * (told(rig, {}, ability(rig).loops[loop].limit) or 0.0)
    exact = (
        whole(rate(rig, plan), float(f), plan.record_s, plan.periods)
        for f in np.geomspace(plan.low_hz, plan.high_hz, plan.lines)
    )
    return [Sine(hz, force, periods, samples) for hz, periods, samples in exact]


def crossover_hz(rig: RigFile, loop: str) -> float | None:
    """Where the gain of a loop by its own numbers falls to 1: of (k_P + k_I/s + k_D s)/(M s^2 - K). None: they are not told."""
    one, known = ability(rig).loops[loop], Places(rig).known
    kp, ki, kd = (told(rig, {}, name) for name in (one.kp, one.ki, one.kd))
    if not kp or not kd or one.inertia not in known:
        return None
    mass = known[one.inertia].value * one.share
    stiff = known[one.stiffness].value if one.stiffness in known else 0.0
    hz = np.geomspace(1.0, 1e5, 20_000)
    s = 2j * np.pi * hz
    above = np.flatnonzero(np.abs((kp + (ki or 0.0) / s + kd * s) / (mass * s * s - stiff)) >= 1)
    return float(hz[above[-1]]) if above.size else None
