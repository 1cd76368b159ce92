"""An orbit of set points on which the controller let the shaft go: how far it went by then, beside how far it was sent.

A loop goes farther than a set point that moves: by K_i k_p/(K_i k_p - K_x) before the integrator has taken that back, and by
its swing where the points are fast for it. An ellipse of a third of the clearance may then end on the rings.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording
from procedures.amb_rotor.conventions import conventions
from procedures.tracking.points import ORBIT_LOST, read_points
from procedures.tracking.steps import ORBIT

NO_FARTHER = 1.2  # times as far as it was sent, within which it is not the following that took the shaft to its rings


def of_lost_orbit(recording: Recording[Any]) -> Iterator[Finding]:
    """Why an orbit ended before its time."""
    orbits = list(recording.steps(ORBIT))
    for event in recording.events(ORBIT_LOST)[:1]:
        text = f"the shaft was lost while it followed set points ({event['fault']})"
        farthest = _farthest(recording, orbits[-1], int(event["t_ns"])) if orbits else None
        if farthest is not None:
            name, went, sent = farthest
            text += f"; {name} read {went * 1e6:.0f} µm by then, where its set points had asked for {sent * 1e6:.0f} µm"
            if went > NO_FARTHER * sent:
                text += ": the loop follows them with an excess. Take a smaller ellipse (y_m, z_m) or slower points (points_hz)"
        yield Finding("orbit-lost", f"{text}.", "orbit", Effect.ERROR)


def _farthest(recording: Recording[Any], step: Any, until: int) -> tuple[str, float, float] | None:
    """Of the probe that went farthest: its name, how far, and how far the set points so far asked, m."""
    points, stations = read_points(step, step.start_ns), conventions(recording.rig).stations
    data = step.read(*stations.channels)
    before = data["t_ns"] < until
    if points is None or not before.any():
        return None
    went = np.array([np.abs(data[name][before]).max() for name in stations.channels])
    sent = np.abs(stations.reads[:, :2] @ np.array([points.y, points.z])).max(axis=1)
    k = int(np.argmax(went))
    return stations.channels[k], float(went[k]), float(sent[k])
