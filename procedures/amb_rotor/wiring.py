"""Before any orbit of a tracking test: do the readings belong to where they are taken? Each check names its suspect."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.rigfile.roles import STATUS
from procedures.amb_rotor import carrying, nudges, pushes, rings
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.lift import LIFT, LIFT_LOST, NO_SPEED, REST
from procedures.amb_rotor.machine import AmbRotor

UNEVEN = 0.6  # of the rise


def before_orbits(recording: Recording[Any]) -> Iterator[Finding]:
    """Probes at rest, the lift, nudges, the speed; what is an error leaves nothing to evaluate."""
    machine = conventions(recording.rig)
    wrong = list(_at_rest(recording, machine)) or list(_on_rings(recording, machine))
    yield from wrong
    if wrong:
        return
    shown = list(pushes.of_recording(recording))
    if any(f.effect is Effect.ERROR for f in shown):
        yield from shown
        return
    lost = recording.events(LIFT_LOST)
    if lost:
        yield from _of_lift(recording, machine, str(lost[0]["fault"]))
        return
    yield from nudges.judge(nudges.recorded(recording), recording.rig)
    for event in recording.events(NO_SPEED):
        text = f"the shaft does not reach {event['wanted'] * 30 / math.pi:.0f} r/min: {event['why']}"
        yield Finding("speed-not-reached", text, "drive", Effect.ERROR)
    yield from shown


def _at_rest(recording: Recording[Any], machine: AmbRotor) -> Iterator[Finding]:
    """On the rings the rotor lies below the middle along every axis that gravity pulls along."""
    should = rings.expected(machine.stations)
    names = machine.stations.channels
    for step in recording.steps(REST):
        data = step.read(*names, STATUS)
        beyond = bool((data[STATUS].astype(np.int64) & machine.sensor_range).any())
        for name in names:
            mean = float(np.mean(data[name]))
            if abs(should[name]) >= rings.TELLS and mean * should[name] < 0:
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
        yield from rings.of_rings({name: step.mean(name) for name in machine.stations.channels}, recording.rig)


def _of_lift(recording: Recording[Any], machine: AmbRotor, fault: str) -> Iterator[Finding]:
    """Which way the rotor went when it was lost. On six virtual rigs it tilted by 2.8 to 10 times its rise with the planes
    exchanged, and by at most 1.5 times with the axes exchanged."""
    text, where = "", "lift"
    for step in recording.steps(LIFT):
        if not machine.probed:
            continue
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
    if len(recording.steps(pushes.PUSH)):
        text = (
            f"{text or 'its path points to nothing'}; pushes before the lift showed that the probes count the right way along "
            f"their axes: suspect the coils first"
        )
    force = carrying.added(recording.rig)
    yield Finding(
        "lift-lost",
        f"the rotor was lost in the lift ({fault}); {text or 'no wiring is suspected by its path'}{force}.",
        where,
        Effect.ERROR,
    )
