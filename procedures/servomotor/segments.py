"""Whether the motor's segments are wired as they should be, from small pushes against the AMBs (`wiring`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.recording import Recording
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.conventions import radial_currents as of_segments
from procedures.servomotor.direction import of_probe
from procedures.servomotor.leaning import of_leans

Array = npt.NDArray[np.float64]
FATAL = ("segments-exchanged", "segment-sign", "no-push")
"""Findings after which nothing else is measured."""
EXPECTED = {"i_y": np.array([1.0, 0.0, -1.0, 0.0]), "i_x": np.array([0.0, -1.0, 0.0, 1.0])}  # (6.9); (7.12), per A
OFF = 0.15  # A per A, share of a segment's current that certificates and amplifiers cannot explain
LEAST, CROSS = 0.05, 0.3  # A of the outboard AMB per A; cross over own: half a degree of encoder zero makes 8 %


def before_carrying(recording: Recording[Any]) -> Iterator[Finding]:
    """What `wiring.sound` recorded, judged: the encoder's direction, the pushes, and how a frame of its own answers."""
    yield from of_probe(recording)
    yield from of_nudges(recording)
    yield from of_leans(recording)


def of_nudges(recording: Recording[Any]) -> Iterator[Finding]:
    """Segment by segment by their own sensors, then by the force that the outboard AMB feels."""
    machine, means = conventions(recording.rig), {}
    channels = (*machine.segments, *machine.coils_of("xo", "yo"))
    for step in recording.steps("nudge"):
        data = step.read(*channels)
        i_x, i_y = float(step.labels["i_x_A"]), float(step.labels["i_y_A"])
        means[(bool(i_x), bool(i_y))] = (max(i_x, i_y), np.array([data[c].mean() for c in channels]))
    if len(means) < 3:
        return
    rest = means[(False, False)][1]
    answers = {name: (means[key][1] - rest) / means[key][0]
               for name, key in (("i_y", (False, True)), ("i_x", (True, False)))}  # fmt: skip
    found = list(_segments(answers, machine))
    yield from found or _pushes(answers, machine)


def _segments(answers: dict[str, Array], machine: Servomotor) -> Iterator[Finding]:
    for name, answer in answers.items():
        error = answer[:4] - EXPECTED[name]
        if np.abs(error).max() <= OFF:
            continue
        k = int(np.argmax(np.abs(error)))
        yield Finding(
            "segment-sign",
            f"with 1 A of {name}, {_told(machine, k)} reads {answer[k]:+.2f} A where {_law(machine)} gives "
            f"{EXPECTED[name][k]:+.0f} A: its current sensor is connected the wrong way round or to another segment, or "
            "a force of this axis gives torque "
            f"that the angle's control works against{_or_signs(machine)}.",
            machine.segments[k], Effect.ERROR,
        )  # fmt: skip
        return


def _told(machine: Servomotor, k: int) -> str:
    """A segment's current as the finding calls it."""
    return f"segment {k + 1}" if machine.components == 1 else machine.segments[k]


def _law(machine: Servomotor) -> str:
    return "(6.9)" if machine.components == 1 else "(7.12)"


def _or_signs(machine: Servomotor) -> str:
    return "" if machine.components == 1 else ", or i_y has the signs that T (7.13c), (7.13d) have in print"


def _pushes(answers: dict[str, Array], machine: Servomotor) -> Iterator[Finding]:
    for name, own_axis in (("i_y", 1), ("i_x", 0)):
        answer = answers[name][4:]
        x, y = (answer[0] - answer[1]) / 2, (answer[2] - answer[3]) / 2  # outboard AMB, A per A
        push = machine.pushed(x, y)
        own, across = float(push[own_axis]), float(push[1 - own_axis])
        if abs(across) > CROSS * abs(own) and abs(across) > LEAST:
            yield Finding(
                "segments-exchanged",
                f"1 A of {name} changes the outboard AMB's control current by {own:+.3f} A along its own axis and by "
                f"{across:+.3f} A across: two neighbouring segments are exchanged, or the commutation is far off.",
                name, Effect.ERROR,
            )  # fmt: skip
        elif own > LEAST:
            yield Finding(
                "segments-exchanged",
                f"1 A of {name} burdens the outboard AMB by {own:+.3f} A where it should relieve it: two opposite segments "
                "are exchanged, or a sign of the current sensors is wrong.",
                name, Effect.ERROR,
            )  # fmt: skip
        elif abs(own) < LEAST:
            yield Finding(
                "no-push",
                f"1 A of {name} changes the outboard AMB's control current by {own:+.3f} A only: the motor hardly pushes.",
                name, Effect.ERROR,
            )  # fmt: skip


def radial_currents(segments: Array, p: Mapping[str, float]) -> tuple[Array, Array]:
    """i_x, i_y (N,) A by T (6.18), freed of the sensors' gains and offsets."""
    return of_segments(*((segments[k] - p[f"offset_m{k + 1}"]) / p[f"gain_m{k + 1}"] for k in range(4)))
