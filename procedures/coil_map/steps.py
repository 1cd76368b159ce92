"""What is recorded, and from the recording to arrays: pulses of every current system, pushes that are turned around."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import Lacking
from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_coils import CoilMap, CoilSystem
from procedures.coil_map import winding
from procedures.coil_map.plan import Plan

Array = npt.NDArray[np.float64]
PULSE, TOUR = "pulse", "tour"
WAYS = ("d", "q")
SLOWER = 8  # ticks from sample to sample of a capture: those at which positions are read
LEAST = 20  # samples of a pulse that rests, to be worth a mean
END_S = 2e-3  # at the end of a pulse, over which the mover's place is averaged
STEPPED = 0.2  # of what a pulse should have in its coils, at least


@dataclass(frozen=True)
class Pulse:
    """One pulse of `size` A. By coil: what it should carry, `expected`, what `coils` and `bridges` carry more than before, A,
    in the mean while the current rests; means of the square of what it should carry and of its products with both, A^2;
    `noise` A, of the mean of a half-bridge's. `read` (2,) A: what the controller has of d and q. `moved` by axis, from before
    to the end; `phi` rad, electrical."""

    system: str
    way: str
    size: float
    repeat: int
    phi: float
    expected: Mapping[str, float]
    coils: Mapping[str, float]
    bridges: Mapping[str, float]
    square: Mapping[str, float]
    product: Mapping[str, float]
    product_bridge: Mapping[str, float]
    read: Array
    moved: Mapping[str, float]
    noise: Mapping[str, float]


@dataclass(frozen=True)
class Tour:
    """A push that was turned around: `currents` (n, 2) A, the torque current `beside` (n,) A along d
    and `beside_q`, as the controller has it, along q, where the axes of each radial
    system were, by its name (n, 2) m; `phi` (n,)
    rad, electrical."""

    system: str
    currents: Array
    beside: Array
    beside_q: Array
    places: Mapping[str, Array]
    phi: Array


def ability(rig: RigFile) -> CoilMap:
    """The rig's coils.

    Raises:
        Lacking: nothing is bound.
    """
    if rig.capabilities.coil_map is None:
        raise Lacking("capabilities: found no coil_map")
    return rig.capabilities.coil_map


def size_of(system: CoilSystem, plan: Plan) -> float:
    """Of a pulse, A."""
    return {"torque": plan.torque_A, "radial force": plan.bearing_A, "axial force": plan.thrust_A}[system.gives]


def pulses(can: CoilMap, plan: Plan) -> Iterator[tuple[str, str, float, int]]:
    """System, way, A and repeat of every pulse, in order: those that push nothing aside first, while the mover is calm."""
    calm = [name for name, system in can.systems.items() if system.gives != "radial force"]
    rest = [name for name in can.systems if name not in calm]
    for names in (calm, rest):
        for repeat in range(plan.repeats):
            for name in names:
                size = size_of(can.systems[name], plan)
                yield from ((name, way, sign * size, repeat) for way in WAYS for sign in (1, -1))


def radial(can: CoilMap) -> tuple[str, ...]:
    """Systems that push aside."""
    return tuple(name for name, system in can.systems.items() if system.gives == "radial force")


def points(can: CoilMap, name: str, plan: Plan, beside: bool = True) -> Iterator[tuple[int, float, float, float]]:
    """Number, d, q and the torque current beside, A, of a push that is turned around."""
    sizes = (plan.beside_A, -plan.beside_A) if beside and winding.beside(can, name) and plan.beside_A else (0.0,)
    for k in range(plan.directions):
        at = 2 * np.pi * k / plan.directions
        d, q = plan.around_A * float(np.cos(at)), plan.around_A * float(np.sin(at))
        yield from ((k, d, q, b) for b in (sizes if k % 2 else sizes[::-1]))


def captured(can: CoilMap, name: str, repeat: int) -> tuple[str, ...]:
    """Channels of a capture of a pulse: the first of all coils and of the system's half-bridges, further ones of its own coils;
    the system's currents, where the mover is."""
    system = can.systems[name]
    bridges = [can.bridges[c] for c in system.coils if c in can.bridges]
    currents = system.coils if repeat else (*can.coils, *bridges)
    return tuple(dict.fromkeys((*currents, system.read_d, system.read_q, system.angle, *can.axes)))


def read_pulses(recording: Recording[Plan]) -> list[Pulse]:
    """All pulses in which a current flowed and that are whole in their capture, in time order."""
    found = (_pulse(recording, step) for step in recording.steps(PULSE))
    return [one for one in found if one is not None]


def _pulse(recording: Recording[Plan], step: Step) -> Pulse | None:
    found = recording.captures(**{k: step.labels[k] for k in ("number", "attempt") if k in step.labels})
    if not found:
        return None
    names = captured(ability(recording.rig), str(step.labels["system"]), int(step.labels["repeat"]))
    return pulse_of(recording.rig, recording.plan, step.labels, found[0].arrays(*names), found[0].rate_hz)


def pulse_of(rig: RigFile, plan: Plan, labels: Mapping[str, Any], x: Mapping[str, Array], rate: float) -> Pulse | None:
    """What a capture shows of a pulse; nothing where no current flowed, or where it is not whole in it."""
    can, name, way = ability(rig), str(labels["system"]), str(labels["way"])
    system, size, repeat = can.systems[name], float(labels["size_A"]), int(labels["repeat"])
    span = _span(np.array([x[c] for c in system.coils]), abs(size), round(plan.lead_s / 2 * rate), rate, plan)
    if span is None:
        return None
    before, during, end = span
    phi = winding.phase(rig, system, x[system.angle])
    share = {c: size * e[during] for c, e in winding.of_way(system, way, phi).items()}

    def change(channel: str) -> Array:
        return np.asarray(x[channel][during] - x[channel][before].mean())

    none = np.zeros(len(phi[during]))
    coils = {c: change(c) for c in can.coils if c in x}
    bridges = {c: change(can.bridges[c]) for c in system.coils if can.bridges.get(c) in x}
    read = np.array([change(n).mean() for n in (system.read_d, system.read_q)])
    return Pulse(
        name, way, size, repeat, float(phi[before].mean()),
        {c: float(share.get(c, none).mean()) for c in can.coils},
        {c: float(v.mean()) for c, v in coils.items()}, {c: float(v.mean()) for c, v in bridges.items()},
        {c: float((v**2).mean()) for c, v in share.items()},
        {c: float((v * coils[c]).mean()) for c, v in share.items()},
        {c: float((share[c] * v).mean()) for c, v in bridges.items()},
        read, {a: float(x[a][end].mean() - x[a][before].mean()) for a in can.axes},
        {c: float(v.std()) / math.sqrt(len(v)) for c, v in bridges.items()},
    )  # fmt: skip


def _span(coils: Array, size: float, lead: int, rate: float, plan: Plan) -> tuple[slice, slice, slice] | None:
    """Where it was before a pulse, where its current rested, and its end, `hold_s` after its edge by the capture's own clock: a
    host that takes the current away later pushes the mover on, and that is no part of it. Nothing where no current flowed, or
    where the capture does not hold so much of it."""
    change = np.sqrt(((coils - coils[:, :lead].mean(axis=1, keepdims=True)) ** 2).sum(axis=0))
    top = float(change.max())
    if top < STEPPED * size:
        return None
    on = np.flatnonzero(change > 0.5 * top)
    first, last = int(on[0]), int(on[-1])
    guard, rest, end = round(1e-3 * rate), round(plan.rest_s * rate), round(END_S * rate)
    whole = first + round(plan.hold_s * rate)
    if first <= guard + 2 or last < max(whole - end, first + rest + LEAST):
        return None
    last = min(last, whole)
    return slice(0, first - guard), slice(first + rest, last), slice(max(last - end, first), last)


def read_tours(recording: Recording[Plan]) -> dict[str, Tour]:
    """Every push that was turned around to its end, by system."""
    can, plan, out = ability(recording.rig), recording.plan, {}
    for name in radial(can):
        steps = [s for s in recording.steps(TOUR) if s.labels["system"] == name]
        if len(steps) < sum(1 for _ in points(can, name, plan, beside=False)):
            continue
        angle = np.array([s.mean(can.systems[name].angle) for s in steps])
        out[name] = Tour(
            name, np.array([[s.labels["d_A"], s.labels["q_A"]] for s in steps], float),
            np.array([s.labels["beside_A"] for s in steps], float), _beside_q(recording.rig, can, name, steps),
            {n: np.array([[_late(s, a) for a in can.systems[n].axes] for s in steps]) for n in radial(can)},
            winding.phase(recording.rig, can.systems[name], angle),
        )  # fmt: skip
    return out


def _beside_q(rig: RigFile, can: CoilMap, name: str, steps: Sequence[Step]) -> Array:
    """The torque current along q with which the angle was held meanwhile, where telemetry tells it."""
    other = winding.beside(can, name)
    channel = can.systems[other].read_q if other else ""
    return np.array([_late(s, channel) for s in steps]) if channel in rig.channels else np.zeros(len(steps))


def _late(step: Step, channel: str) -> float:
    """Mean over the last three quarters of a step."""
    x = step.read(channel)[channel]
    return float(np.mean(x[len(x) // 4 :]))
