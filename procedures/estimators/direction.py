"""Which way the encoder counts, from a small movement that a weak gain made (`procedures.rotor.probe`)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording

SEGMENTS = ("i_m1", "i_m2", "i_m3", "i_m4")
MOVED_RAD = 0.01


def of_probe(recording: Recording[Any]) -> Iterator[Finding]:
    """A motor does work on a rotor that it sets in motion: the integral of torque current over angle is positive. With an
    encoder that counts backwards it is negative. A motor that is driven and does not turn is told too."""
    for step in recording.steps("probe"):
        data = step.read("angle", *SEGMENTS)
        angle = np.unwrap(data["angle"])
        if len(angle) < 20:
            continue
        current = np.mean([data[c] for c in SEGMENTS], axis=0)
        turned, driven = float(np.ptp(angle)), float(np.abs(current).max())
        work = float(((current[1:] + current[:-1]) / 2 * np.diff(angle)).sum())
        if turned < MOVED_RAD:
            yield Finding(
                "rotor-does-not-turn",
                f"up to {driven:.2f} A of torque current moved the released rotor by {turned:.4f} rad: something holds it, or "
                "the motor gives no torque.",
                "angle", Effect.ERROR,
            )  # fmt: skip
        elif work < 0:
            yield Finding(
                "encoder-direction",
                f"the rotor turned by {turned:.3f} rad against its torque current of up to {driven:.2f} A, as the encoder has "
                "it: the encoder counts backwards, or the motor's currents are reversed.",
                "angle", Effect.ERROR,
            )  # fmt: skip
