"""Which way the encoder counts, from a small movement that a weak gain made (`hold.probe`)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording, Step
from bench.rigfile.roles import ANGLE
from procedures.servomotor.conventions import Servomotor, conventions

MOVED_RAD = 0.03


@dataclass(frozen=True)
class Movement:
    """How far the rotor turned in rad, `towards` its reference or, negative, away from it; by which largest torque current in
    A, and the work of the current on it in A rad."""

    turned: float
    towards: float
    driven: float
    work: float


def of_probe(recording: Recording[Any]) -> Iterator[Finding]:
    """A motor does work on a rotor that it sets in motion: the integral of torque current over angle is positive. With an
    encoder that counts backwards it is negative. A motor that is driven and does not turn is told too.

    The first movement decides: a loop on a backward encoder runs to where the motor's torque changes its sign, and what it
    does from there tells nothing.
    """
    machine = conventions(recording.rig)
    found = [m for step in recording.steps("probe") if (m := _movement(step, machine)) is not None]
    if not found:
        return
    moved = next((m for m in found if m.turned >= MOVED_RAD), None)
    if moved is None:
        most = max(found, key=lambda m: m.driven)
        yield Finding(
            "rotor-does-not-turn",
            f"up to {most.driven:.2f} A of torque current moved the released rotor by {most.turned:.4f} rad: a detent, a "
            "brake or a rub holds it, or the motor gives no torque.",
            "angle", Effect.ERROR,
        )  # fmt: skip
    elif moved.work < 0:
        yield Finding(
            "encoder-direction",
            f"the rotor turned by {moved.turned:.3f} rad against its torque current of up to {moved.driven:.2f} A, as the "
            "encoder has it: it counts backwards, or the motor's currents are reversed.",
            "angle", Effect.ERROR,
        )  # fmt: skip
    elif moved.towards < -MOVED_RAD:
        yield Finding(
            "angle-feedback-sign",
            f"the rotor turned by {moved.turned:.3f} rad away from its reference, driven by up to {moved.driven:.2f} A: the "
            "controller answers an angle with the wrong sign, as T (7.14) has it in print.",
            "angle", Effect.ERROR,
        )  # fmt: skip


def _movement(step: Step, machine: Servomotor) -> Movement | None:
    data = step.read(ANGLE, *machine.turning)
    angle = np.unwrap(data[ANGLE])
    if len(angle) < 20:
        return None
    current = np.mean([data[c] for c in machine.turning], axis=0)
    work = float(((current[1:] + current[:-1]) / 2 * np.diff(angle)).sum())
    wanted = math.remainder(float(step.labels["reference_rad"]) - float(angle[0]), 2 * math.pi)
    farthest = float(angle[np.argmax(np.abs(angle - angle[0]))] - angle[0])
    return Movement(float(np.ptp(angle)), math.copysign(1.0, wanted) * farthest, float(np.abs(current).max()), work)
