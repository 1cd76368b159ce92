"""Before the shaft is held: what the probes read of it on its rings, and where a lift that failed has pressed it.

A shaft that lies, lies below the middle of its rings: a probe of the wrong polarity, a ring that is too near, a zero that is
off and a range that is too short show there; not the polarity of a probe that looks across gravity, nor any of one that stands.
Exchanged planes or axes do not show where they stand alike to the vertical. They show in the lift, which they make fail: the
coils then press the shaft against the rings, and it lies where their pull and its weight push it only if each reading is taken
for what it is.
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
from procedures.amb_rotor import carrying, pressed
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.geometry import at_rings, ideal
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.places import LIFT, LIFT_LOST, REST
from procedures.amb_rotor.stations import Ring, Stations, halved, stated, stations

Array = npt.NDArray[np.float64]
TELLS = 0.3  # of the clearance, that gravity must move a reading by to say which way it counts
CARRIES_A = 0.5  # both coils of an axis together, at least, while the controller tries
PRESSED_S = 0.5  # at the end of the lift
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


def room(rig: RigFile, ring: Ring | None = None) -> float:
    """How far from the sensors' zero a ring, or the nearest of them, stands at least, m: clearance, the sensors' zeros and
    their runout taken off; infinite without any."""
    s = stations(rig)
    if ring is None:
        return min((room(rig, one) for one in s.rings), default=math.inf)
    clear = ring.clearance.number
    zero = max(halved(rig.sensors[name].offset) for name in s.channels)
    near = clear.value - halved(clear)
    return near - math.sqrt(2) * _leverage(s, ring) * zero - 2 * _runout(rig)


def farthest(rig: RigFile, ring: Ring) -> float:
    """How far from the sensors' zero a shaft on a ring lies at most, m: as `room`, the other way, and the sensors' gain."""
    gain = max(halved(rig.sensors[name].gain) for name in stations(rig).channels)
    return (2 + gain) * ring.clearance.number.value - room(rig, ring)


def _leverage(s: Stations, ring: Ring) -> float:
    """How much an error that all probes share, each its own way, is at a ring, at most: 1 where they stand beside it."""
    y, z = _read_at(s)[s.rings.index(ring)]
    return max(1.0, float(np.abs(y).sum()), float(np.abs(z).sum()))


def _read_at(s: Stations) -> list[tuple[Array, Array]]:
    """What y and z at each ring are of the readings, (n,) each."""
    facts = ideal(s)
    return at_rings(np.diag(1 / np.array(facts.gains)), facts)


def _runout(rig: RigFile) -> float:
    """Of the shaft at its probes, standard uncertainty, m; nothing where the rig file has none."""
    number = stated(rig, None if rig.shaft is None else rig.shaft.runout, "shaft.runout")
    return 0.0 if number is None else number.standard_uncertainty


def expected(s: Stations) -> dict[str, float]:
    """By channel, what a probe reads of a shaft that lies on its rings, over their clearance: below zero below the middle."""
    arms = sorted(r.arm.value for r in s.rings if r.arm is not None) or [p.arm.value for p in s.axes.values()]
    if min(arms) < 0 < max(arms):
        return {name: -p.row[0] * s.up[0] - p.row[1] * s.up[1] for name, p in s.probes.items()}
    near, far = sorted(set(arms), key=abs)[:2] if len(set(arms)) > 1 else (arms[0], arms[0] + 1.0)
    out = {}
    for name, p in s.probes.items():  # it tips over the ring that is nearer to its weight, and lies under the other one
        below = 2 * (p.arm.value - near) / (far - near) - 1
        out[name] = below * (p.row[0] * s.up[0] + p.row[1] * s.up[1])
    return out


def unshown(rig: RigFile) -> tuple[str, ...]:
    """Channels of the probes of which gravity does not say which way they count."""
    return tuple(name for name, share in expected(stations(rig)).items() if abs(share) < TELLS)


def of_readings(readings: Mapping[str, float], rig: RigFile) -> Iterator[Finding]:
    """Readings (m) of a shaft that lies on its rings: what forbids to lift it."""
    should = expected(stations(rig))
    for alike in _alike(stations(rig)):
        above = [n for n in alike if abs(should[n]) >= TELLS and readings[n] * should[n] < 0]
        said = " and ".join(f"{name} reads {readings[name] * 1e6:+.0f} µm" for name in above)
        if above and (len(above) < len(alike) or len(alike) == 1):
            text = f"{said} while the shaft lies on its rings, below the middle: the probe's polarity is wrong."
            yield Finding("sensor-polarity", f"{text} The shaft was not lifted.", above[0], Effect.ERROR)
        elif above:
            way = _way(stations(rig), above[0])
            text = (
                f"{said} while the shaft lies on its rings: gravity pulls the other way along axis {way}, which is turned by "
                f"180°, or the polarity of {'both' if len(above) == 2 else 'all'} its probes is wrong. The shaft was not "
                "lifted."
            )
            yield Finding("gravity-reversed", text, f"axis {way}", Effect.ERROR)
    yield from of_rings(readings, rig)


def _alike(s: Stations) -> list[list[str]]:
    """Channels of the probes that look the same way, to within 5 degrees, near end first."""
    out: dict[int, list[str]] = {}
    for name, p in s.probes.items():
        angle = p.angle.value + (0.0 if p.sign > 0 else math.pi)
        out.setdefault(round(math.remainder(angle, 2 * math.pi) / math.radians(5.0)), []).append(name)
    return list(out.values())


def _way(s: Stations, channel: str) -> str:
    """Along which axis a probe looks: y, z, or so many degrees from y."""
    angle = round(math.degrees(s.probes[channel].angle.value), 1) % 360
    return {0.0: "y", 90.0: "z"}.get(angle, f"at {angle:g}° from y")


def of_rings(readings: Mapping[str, float], rig: RigFile) -> Iterator[Finding]:
    """Readings (m) of a shaft on its rings: is it where they and the sensors' zeros can have it? Below the middle they are
    touched; a shaft that stands is somewhere within them. Nothing where the rig states none of them."""
    s, should = stations(rig), expected(stations(rig))
    if not s.rings or not set(s.channels) <= set(rig.sensors):
        return
    wrong = {n for n, share in should.items() if abs(share) >= TELLS and readings[n] * share < 0}
    lies = math.hypot(*s.up) > TELLS
    for ring, (of_y, of_z) in zip(s.rings, _read_at(s), strict=True):
        used = {n for n, a, b in zip(s.channels, of_y, of_z, strict=True) if a or b}
        read = np.array([readings[n] for n in s.channels])
        y, z = float(of_y @ read), float(of_z @ read)
        far = math.hypot(y, z)
        if used & wrong or (room(rig, ring) if lies else 0.0) <= far <= farthest(rig, ring):
            continue
        near = far < room(rig, ring)
        bound = f"at least {room(rig, ring) * 1e6:.0f}" if near else f"at most {farthest(rig, ring) * 1e6:.0f}"
        text = (
            f"{ring.name}, the shaft lies {far * 1e6:.0f} µm off the sensors' zero on its ring "
            f"({y * 1e6:+.0f}, {z * 1e6:+.0f} µm), {bound} µm are expected: the ring is too {'near' if near else 'far'}, "
            "a sensor's zero or gain is off, or a sensor is beyond its range. The shaft was not lifted."
        )
        yield Finding("ring-too-near" if near else "ring-too-far", text, ring.name, Effect.ERROR)


def of_unshown(rig: RigFile) -> Iterator[Finding]:
    """A note on the probes whose polarity nothing has shown: a loop whose probe and coils are both reversed floats as well."""
    if names := unshown(rig):
        why = "gravity does not pull along " + ("them" if len(names) > 1 else "it")
        if len(names) == len(stations(rig).channels):
            why += ", the shaft stands"
        text = (
            f"no check of polarity was made of {', '.join(names)}: {why}. That the shaft floats shows that probes and coils "
            "agree; an axis that is reversed as a whole, probe and coils, is turned by 180° in the results. Run it with "
            "somebody at the terminal, who is asked to push the shaft."
        )
        yield Finding("polarity-not-shown", text)


def before(recording: Recording[Any]) -> list[Finding]:
    """What was found before any position: each of them leaves nothing to evaluate."""
    rig = recording.rig
    found: list[Finding] = []
    for step in recording.steps(REST):
        found += of_readings({name: step.mean(name) for name in stations(rig).channels}, rig)
    for event, step in zip(recording.events(LIFT_LOST), recording.steps(LIFT), strict=False):
        machine = conventions(rig)
        data = step.read(*machine.positions, *machine.currents) if machine.probed else {}
        found.append(of_lift(data, recording_period(step), str(event["fault"]), rig))
    return found


def of_lift(data: Mapping[str, Array], period_s: float, fault: str, rig: RigFile) -> Finding:
    """Which exchange of readings explains where the shaft lies at the end of a lift that failed; `data` are positions and
    currents in it, (n,) SI, empty where none came."""
    machine = conventions(rig)
    text = f"the shaft was lost in the lift ({fault})"
    if machine.probed and data and (known := pressed.known(rig)) is not None:
        found = _exchanged(data, period_s, text, machine, known)
        return found or Finding(
            "lift-lost",
            f"{text}; where it lies points to no exchange of probes{carrying.added(rig)}.",
            "lift",
            Effect.ERROR,
        )
    return Finding(
        "lift-lost", f"{text}{carrying.added(rig)}. Whether probes are exchanged is not told: {pressed.UNKNOWN}.", "lift",
        Effect.ERROR,
    )  # fmt: skip


def _exchanged(
    data: Mapping[str, Array], period_s: float, text: str, machine: AmbRotor, known: pressed.Known
) -> Finding | None:
    """The finding that names the exchange, if one does."""
    pairs = [machine.pair(axis) for axis in machine.axes]
    tries = np.all([data[p] + data[n] > CARRIES_A for p, n in pairs], axis=0)
    last = np.flatnonzero(tries)[-round(PRESSED_S / period_s) :]
    if len(last):
        read = np.array([data[name][last].mean() for name in machine.positions])
        p, n = (np.array([data[name][last].mean() for name in names]) for names in zip(*pairs, strict=True))
        left = {e: pressed.unexplained(read[list(e.order)], p, n, known) for e in EXCHANGES}
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
    return None


def recording_period(step: Step) -> float:
    """Of the telemetry, s."""
    return step.recording.streams["telemetry"].period_ns * 1e-9
