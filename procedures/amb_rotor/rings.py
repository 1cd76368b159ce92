"""Before the shaft is held: what the probes read of it on its rings, and where a lift that failed has pressed it.

On its rings the shaft lies below the middle along both axes, in both planes alike: a probe of the wrong polarity, a ring
that is too near, a zero that is off and a range that is too short show there. Exchanged planes or axes do not, because y and
z stand alike to the vertical. They show in the lift, which they make fail: the coils then press the shaft against the rings,
and it lies where their pull and its weight push it only if each reading is taken for what it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.recording import Recording, Step
from bench.rigfile import RigFile
from procedures.amb_rotor import magnetics
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.places import LIFT, LIFT_LOST, REST

Array = npt.NDArray[np.float64]
BETA, OFFSET = 6.95e-7, 1.15e-4  # T Table 2.2: good enough to say which way a coil presses
CARRIES_A = 0.5  # both coils of an axis together, at least, while the controller tries
PRESSED_S = 0.5  # at the end of the lift
TOUCHES = 0.85  # of the clearance
FRICTION = 0.15  # of a ring's force
CLEARLY = 0.5  # of what another wiring leaves
ALIKE_N = 0.5  # that two exchanges may differ by, both being named


@dataclass(frozen=True)
class Exchange:
    """Readings taken for each other: pairs of numbers of radial axes."""

    swaps: tuple[tuple[int, int], ...] = ()

    @property
    def kind(self) -> str:
        """Of planes, of axes, or none."""
        return "" if not self.swaps else "planes" if self.swaps[0][1] - self.swaps[0][0] == 2 else "axes"

    @property
    def order(self) -> tuple[int, ...]:
        """Which reading each radial axis takes."""
        order = list(range(4))
        for a, b in self.swaps:
            order[a], order[b] = order[b], order[a]
        return tuple(order)

    def told(self, axes: tuple[str, ...]) -> str:
        """By the names of the axes."""
        return " and ".join(f"{axes[a]} with {axes[b]}" for a, b in self.swaps)


AS_WIRED = Exchange()
EXCHANGES = (AS_WIRED, *map(Exchange, (((0, 2),), ((1, 3),), ((0, 2), (1, 3)), ((0, 1),), ((2, 3),), ((0, 1), (2, 3)))))


def room(rig: RigFile) -> float:
    """How far from the sensors' zero the rings stand at least, m: clearance, the sensors' zeros and their runout taken off."""
    clear = rig.geometry["clearance"]
    offsets = [rig.sensors[name].offset for name in conventions(rig).positions]
    zero = max(t.half_width or 3 * t.standard_uncertainty for t in offsets)
    ring = clear.value - (clear.half_width or 3 * clear.standard_uncertainty)
    return ring - math.sqrt(2) * zero - 2 * rig.machine["runout"].standard_uncertainty


def farthest(rig: RigFile) -> float:
    """How far from the sensors' zero a shaft on its rings lies at most, m: as `room`, the other way, and the sensors' gain."""
    clear = rig.geometry["clearance"]
    gains = [rig.sensors[name].gain for name in conventions(rig).positions]
    gain = max(t.half_width or 3 * t.standard_uncertainty for t in gains)
    return (2 + gain) * clear.value - room(rig)


def of_readings(readings: Mapping[str, float], rig: RigFile) -> Iterator[Finding]:
    """Readings (m) of a shaft that lies on its rings: what forbids to lift it."""
    machine = conventions(rig)
    for axis in "yz":
        above = [name for name in map(machine.position, machine.along(axis)) if readings[name] > 0]
        said = " and ".join(f"{name} reads {readings[name] * 1e6:+.0f} µm" for name in above)
        if len(above) == 1:
            text = f"{said} while the shaft lies on its rings, below the middle: the probe's polarity is wrong."
            yield Finding("sensor-polarity", f"{text} The shaft was not lifted.", above[0], Effect.ERROR)
        elif above:
            text = (
                f"{said} while the shaft lies on its rings: gravity pulls the other way along axis {axis}, which is turned by "
                "180°, or the polarity of both its probes is wrong. The shaft was not lifted."
            )
            yield Finding("gravity-reversed", text, f"axis {axis}", Effect.ERROR)
    yield from of_rings(readings, rig)


def of_rings(readings: Mapping[str, float], rig: RigFile) -> Iterator[Finding]:
    """Readings (m) of a shaft that lies on its rings, below the middle: is it where they and the sensors' zeros can have it?
    Nothing where the rig states none of them."""
    machine = conventions(rig)
    if "clearance" not in rig.geometry or "runout" not in rig.machine or not set(machine.positions) <= set(rig.sensors):
        return
    for where, pair in machine.planes.items():
        y, z = (readings[machine.positions[k]] for k in pair)
        far = math.hypot(y, z)
        if max(y, z) > 0 or room(rig) <= far <= farthest(rig):
            continue
        near = far < room(rig)
        bound = f"at least {room(rig) * 1e6:.0f}" if near else f"at most {farthest(rig) * 1e6:.0f}"
        text = (
            f"{where}, the shaft lies {far * 1e6:.0f} µm off the sensors' zero on its ring "
            f"({y * 1e6:+.0f}, {z * 1e6:+.0f} µm), {bound} µm are expected: the ring is too {'near' if near else 'far'}, "
            "a sensor's zero or gain is off, or a sensor is beyond its range. The shaft was not lifted."
        )
        yield Finding("ring-too-near" if near else "ring-too-far", text, where, Effect.ERROR)


def before(recording: Recording[Any]) -> list[Finding]:
    """What was found before any position: each of them leaves nothing to evaluate."""
    rig = recording.rig
    found: list[Finding] = []
    for step in recording.steps(REST):
        found += of_readings({name: step.mean(name) for name in conventions(rig).positions}, rig)
    for event, step in zip(recording.events(LIFT_LOST), recording.steps(LIFT), strict=False):
        found.append(_of_lift(step, str(event["fault"]), rig))
    return found


def _of_lift(step: Step, fault: str, rig: RigFile) -> Finding:
    """Which exchange of readings explains where the shaft lies at the end of a lift that failed."""
    machine = conventions(rig)
    data = step.read(*machine.positions, *machine.currents)
    pairs = [machine.pair(axis) for axis in machine.axes]
    tries = np.all([data[p] + data[n] > CARRIES_A for p, n in pairs], axis=0)
    last = np.flatnonzero(tries)[-round(PRESSED_S / recording_period(step)) :]
    text = f"the shaft was lost in the lift ({fault})"
    if len(last):
        read = np.array([data[name][last].mean() for name in machine.positions])
        p, n = (np.array([data[name][last].mean() for name in names]) for names in zip(*pairs, strict=True))
        left = {e: unexplained(read[list(e.order)], p, n, rig) for e in EXCHANGES}
        by_kind = {kind: min(left[e] for e in left if e.kind == kind) for kind in ("planes", "axes", "")}
        what, least = min(by_kind.items(), key=lambda kv: kv[1])
        if what and least < CLEARLY * min(v for kind, v in by_kind.items() if kind != what):
            alike = [e for e in left if e.kind == what and left[e] < least + ALIKE_N]
            said = ", or ".join(e.told(machine.axes) for e in alike)
            text = (
                f"{text}. It lies against its rings where the coils and its weight press it if the readings of {said} are "
                f"exchanged ({least:.1f} N unexplained, as wired {left[AS_WIRED]:.1f} N): look at the probes, or the coils, "
                f"of the two {what}."
            )
            return Finding(f"{what}-exchanged", text, machine.positions[alike[0].swaps[0][0]], Effect.ERROR)
    return Finding("lift-lost", f"{text}; where it lies points to no exchange of probes.", "lift", Effect.ERROR)


def recording_period(step: Step) -> float:
    """Of the telemetry, s."""
    return step.recording.streams["telemetry"].period_ns * 1e-9


def unexplained(read: Array, p: Array, n: Array, rig: RigFile) -> float:
    """Force in N that the rings cannot give, with the shaft at rest where `read` (4,) m says and coil currents `p`, `n` (4,) A.

    Magnets and weight are carried to the rings' planes, which are the sensors'. A ring pushes inwards, where the shaft touches
    it, and along its face by friction.
    """
    g, m = rig.geometry, rig.machine
    l_is, l_os, l_oa = (g[f"com_to_{x}"].value for x in ("inboard_sensor", "outboard_sensor", "outboard_amb"))
    l_ia, span, lean = g["amb_span"].value - l_oa, l_is + l_os, m["radial_axes"].value
    total = 0.0
    pull = np.zeros((2, 2))  # plane, axis
    for axis, slope in ((0, math.cos(lean)), (1, math.sin(lean))):
        i, o = read[axis], read[axis + 2]
        at = np.array([i + (l_is - l_ia) / span * (o - i), i + (l_is + l_oa) / span * (o - i)])
        k = [axis, axis + 2]
        force = magnetics.magnet(BETA, OFFSET, g["amb_gap"].value, at, p[k], n[k])
        weight = -m["mass"].value * rig.site.gravity.value * slope
        both, moment = force.sum() + weight, l_oa * force[1] - l_ia * force[0]
        pull[:, axis] = (l_os * both - moment) / span, (l_is * both + moment) / span
    for plane in (0, 1):
        where = np.array([read[2 * plane], read[2 * plane + 1]])
        far = float(np.hypot(*where))
        if far < TOUCHES * g["clearance"].value:
            total += float(np.hypot(*pull[plane])) ** 2
            continue
        outward = float(pull[plane] @ where) / far
        across = abs(float(pull[plane][1] * where[0] - pull[plane][0] * where[1])) / far
        total += min(outward, 0.0) ** 2 + max(across - FRICTION * max(outward, 0.0), 0.0) ** 2
    return math.sqrt(total)
