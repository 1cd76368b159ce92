"""From the recorded swings of a slewing test to arrays, and what their signals can say about what is wrong."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.recording import Recording, Step
from bench.rigfile.roles import ANGLE, STATUS
from procedures.servomotor.conventions import conventions
from procedures.servomotor.parameters import parameter
from procedures.slew.fit import Swing
from procedures.slew.plan import Plan
from procedures.slew.requires import channels

STEP, STARTED = "swing", "sine-started"


def read_swings(recording: Recording[Plan]) -> list[Swing]:
    """Every swing, in time order.

    Raises:
        AnalysisError: there are none, or one has no start.
    """
    steps = list(recording.steps(STEP))
    if not steps:
        raise AnalysisError("found no swings; expected those of the plan (was the run stopped early?)")
    return [_read(recording, step) for step in steps]


def _read(recording: Recording[Plan], step: Step) -> Swing:
    machine = conventions(recording.rig)
    data = step.read(*channels(machine))
    sine, reference = (parameter(recording.rig, key) for key in ("motor.sine", "angle.ref"))
    inside = [e for e in recording.events() if step.start_ns <= e["t_ns"] < step.end_ns]
    written = [e["t_ns"] for e in inside if e["kind"] == "parameter" and e["name"] == sine and e["value"] > 0]
    answered = [e["t_ns"] for e in inside if e["kind"] == STARTED]
    if not written or not answered or not len(data["t_ns"]):
        raise AnalysisError(f"swing {dict(step.labels)}: found no start of the sine within it")
    origin = int(data["t_ns"][0])

    def seconds(t_ns: int) -> float:
        return (t_ns - origin) * 1e-9

    moved = [e for e in inside if e["kind"] == "parameter" and e["name"] == reference]
    angle = np.unwrap(data[ANGLE])
    return Swing(
        float(step.labels["hz"]),
        float(step.labels["amplitude_rad"]),
        (data["t_ns"] - origin).astype(np.float64) * 1e-9,
        angle - 2 * np.pi * np.round(angle[0] / (2 * np.pi)),
        np.mean([data[c] for c in machine.turning], axis=0),
        seconds(written[0]),
        seconds(answered[0]),
        int(step.labels["periods"]),
        np.array([seconds(e["t_ns"]) for e in moved]),
        np.array([float(e["value"]) for e in moved]),
    )


def of_signals(recording: Recording[Plan]) -> Iterator[Finding]:
    """Lost samples, channels that stand still, amplifiers at their limits, contact."""
    machine, max_lost = conventions(recording.rig), recording.plan.max_lost
    names = channels(machine)
    for step in recording.steps(STEP):
        where = f"{float(step.labels['hz']):g} Hz"
        share = step.lost() / max(step.expected(), 1)
        if share > max_lost:
            yield Finding(
                "missing-samples",
                f"{share:.2%} of the samples of a swing are missing ({max_lost:.2%} is allowed). Look at the link: load, "
                "cable, gateway.",
                where, Effect.INDETERMINATE,
            )  # fmt: skip
        data = step.read(*names)
        flags = int(np.bitwise_or.reduce(data[STATUS].astype(np.int64))) if len(data[STATUS]) else 0
        for channel in (c for c in names[:-1] if np.ptp(data[c]) == 0):
            yield Finding("stuck-channel", f"{channel} does not move at all during a swing.", channel, Effect.ERROR)
        limits = machine.amb_limit | machine.segment_limit
        for bits, code, text in ((limits, "current-saturated", "an amplifier was at its limit"),
                                 (machine.contact, "contact", "the rotor touched a touchdown bearing")):  # fmt: skip
            if flags & bits:
                yield Finding(code, f"{text} during a swing", where, Effect.INDETERMINATE)
