"""Before any orbit of a tracking test: do the readings belong to where they are taken? Each check names its suspect."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording
from procedures.amb_rotor import rings
from procedures.amb_rotor.conventions import AmbRotor, conventions
from procedures.amb_rotor.geometry import centre, nominal
from procedures.amb_rotor.lift import LIFT, LIFT_LOST, NO_SPEED, PROBE, REST

OWN, OTHER = 0.5, 0.3  # shares of a nudge
UNEVEN = 0.6  # of the rise
ANSWERS_A = 5e-3  # a nudge of 10 µm takes some 20 mA, and noise leaves 0.2 mA in a step


def before_orbits(recording: Recording[Any]) -> Iterator[Finding]:
    """Probes at rest, the lift, nudges, the speed; what is an error leaves nothing to evaluate."""
    machine = conventions(recording.rig)
    wrong = list(_at_rest(recording, machine)) or list(_on_rings(recording, machine))
    yield from wrong
    if wrong:
        return
    lost = recording.events(LIFT_LOST)
    if lost:
        yield from _of_lift(recording, machine, str(lost[0]["fault"]))
        return
    yield from _of_nudges(recording, machine)
    yield from _of_coils(recording, machine)
    for event in recording.events(NO_SPEED):
        text = f"the shaft does not reach {event['wanted'] * 30 / math.pi:.0f} r/min: {event['why']}"
        yield Finding("speed-not-reached", text, "drive", Effect.ERROR)


def _at_rest(recording: Recording[Any], machine: AmbRotor) -> Iterator[Finding]:
    """On the rings the rotor lies below the middle on both axes, at the clearance over the square root of two."""
    for step in recording.steps(REST):
        data = step.read(*machine.positions, "flags")
        beyond = bool((data["flags"].astype(np.int64) & machine.sensor_range).any())
        for name in machine.positions:
            mean = float(np.mean(data[name]))
            if mean > 0:
                yield Finding(
                    "sensor-polarity",
                    f"{name} reads {mean * 1e6:+.0f} µm while the rotor lies on its "
                    f"rings, below the "
                    "middle: its polarity is wrong. It was not lifted.",
                    name,
                    Effect.ERROR,
                )
            elif np.ptp(data[name]) == 0:
                why = " and the controller says that a sensor is beyond its range" if beyond else ""
                yield Finding(
                    "stuck-channel",
                    f"{name} stands still at {mean * 1e6:+.0f} µm with the rotor on its rings{why}.",
                    name,
                    Effect.ERROR,
                )


def _on_rings(recording: Recording[Any], machine: AmbRotor) -> Iterator[Finding]:
    """D_max and its share of the clearance rest on the sensors' zeros and on the rings, which show here alone."""
    for step in recording.steps(REST):
        yield from rings.of_rings({name: step.mean(name) for name in machine.positions}, recording.rig)


def _of_lift(recording: Recording[Any], machine: AmbRotor, fault: str) -> Iterator[Finding]:
    """Which way the rotor went when it was lost. On six virtual rigs it tilted by 2.8 to 10 times its rise with the planes
    exchanged, and by at most 1.5 times with the axes exchanged."""
    text, where = "", "lift"
    for step in recording.steps(LIFT):
        data = step.read(*machine.positions)
        x = np.array([data[name] for name in machine.positions])
        x = x - x[:, :20].mean(axis=1, keepdims=True)
        tilt = math.hypot(float((x[2] - x[0]).std()), float((x[3] - x[1]).std()))
        apart = float((x[0] + x[2] - x[1] - x[3]).std()) / 2
        together = float(x.mean(axis=0).std())
        if tilt > 2 * together:
            where, text = (
                "planes",
                ("it tilted far more than it rose: suspect probes or coils of the two planes exchanged"),
            )
        elif max(tilt, apart) > UNEVEN * together:
            where, text = (
                "axes",
                (
                    "one of its axes went up while another went down: suspect probes or coils of y and "
                    "z exchanged, "
                    "in one plane or both"
                ),
            )
    yield Finding(
        "lift-lost",
        f"the rotor was lost in the lift ({fault}); {text or 'no wiring is suspected by its path'}.",
        where,
        Effect.ERROR,
    )


def _of_nudges(recording: Recording[Any], machine: AmbRotor) -> Iterator[Finding]:
    steps = list(recording.steps(PROBE))
    facts = nominal(recording.rig, 0.0)
    for before, after in zip(steps[::2], steps[1::2], strict=False):
        wanted, name = float(after.labels["value"]), str(after.labels["name"])
        means = [np.array([[s.mean(p)] for p in machine.positions]) for s in (before, after)]
        y, z, _, theta = (centre(means[1], facts) - centre(means[0], facts))[:, 0]
        if name == machine.set_points["theta"]:
            if theta < OWN * wanted:
                text = (
                    f"a tilt about z by {wanted * 1e6:g} µrad shows as {theta * 1e6:+.0f} µrad: suspect the readings of the "
                    "two planes exchanged, or a set point that does not act."
                )
                yield Finding("planes-exchanged", text, name, Effect.ERROR)
        elif y < OWN * wanted or abs(z) > OTHER * wanted:
            text = (
                f"a nudge of y by {wanted * 1e6:g} µm shows as {y * 1e6:+.1f} µm in y and {z * 1e6:+.1f} µm in z: suspect the "
                "readings of y and z exchanged, or a set point that does not act."
            )
            yield Finding("axes-exchanged", text, name, Effect.ERROR)


def _of_coils(recording: Recording[Any], machine: AmbRotor) -> Iterator[Finding]:
    """A shaft that is held nearer to a magnet is pulled more by it, so that its coil carries less. That tells the coils of an
    axis apart even where the mean currents do not: where the magnetic offset carries the weight they are nearly alike."""
    told = {c.name for stream in recording.streams.values() for c in stream.channels}
    steps = [s for s in recording.steps(PROBE) if s.labels["name"] == machine.set_points["y"]]
    for before, after in zip(steps[::2], steps[1::2], strict=False):
        for axis in machine.along("y"):
            (p, n), place = machine.pair(axis), machine.position(axis)
            if not {p, n} <= told:
                continue
            moved = after.mean(place) - before.mean(place)
            answer = (after.mean(p) - before.mean(p) - after.mean(n) + before.mean(n)) / 2
            if moved > OWN * float(after.labels["value"]) and answer > ANSWERS_A:
                text = (
                    f"nearer by {moved * 1e6:.1f} µm to the upper magnet of {axis}, the shaft asks {answer * 1e3:+.1f} mA of "
                    "it, as if it pulled the other way: suspect the two coils or their current sensors exchanged."
                )
                yield Finding("coils-exchanged", text, axis, Effect.ERROR)
