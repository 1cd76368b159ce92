"""Whether a plan fits a rig."""

from __future__ import annotations

from collections.abc import Iterator

from bench.rigfile import RigFile
from procedures.derivative.plan import Plan
from procedures.one_axis.conventions import OneAxis


def lines_clear(plan: Plan, harmonic_hz: float) -> Iterator[str]:
    """Lines that fall together with what else a position has, where the record is sorted by places: the harmonic, and what
    forces that are not linear make of both, each with its images by the resets."""
    rate = 1 / plan.window_s
    for hz in plan.lines_hz:
        others = {
            "a multiple of 1/eps": 0.0,
            "the harmonic": harmonic_hz,
            "twice the line": 2 * hz,
            "three times the line": 3 * hz,
            "the harmonic and two lines": harmonic_hz + 2 * hz,
            "the harmonic less two lines": harmonic_hz - 2 * hz,
        }
        apart = {name: (other - hz, other + hz) for name, other in others.items()} | {
            "half a multiple of 1/eps": (2 * hz,)
        }
        for name, each in apart.items():
            near = min(abs(x - rate * round(x / rate)) for x in each)
            if near < min(plan.clear_hz, hz * 0.9):
                text = f"{near:.2g} Hz from {name} or its image; expected {plan.clear_hz:g} Hz or more"
                yield f"lines_hz: found {hz:g} Hz, {text}"


def in_range(rig: RigFile, machine: OneAxis, plan: Plan) -> Iterator[str]:
    """What `acquire` sets beyond the ranges of the controller's parameters or the injection of the envelope. What it writes of
    the estimator are `settings`, which are held against theirs before every run."""
    injection = machine.can.injection
    if injection is None or machine.axis not in machine.can.set_points.axes:
        return  # what it requires of a rig says so
    point = machine.can.set_points.axes[machine.axis]
    written: tuple[tuple[str, str, tuple[float, ...]], ...] = (
        ("offset_m", point, (plan.offset_m, -plan.offset_m)),
        ("amplitude_A", injection.amplitude, (plan.amplitude_A,)),
        ("lines_hz", injection.hz, plan.lines_hz),
    )
    for key, name, values in written:
        p = rig.parameters[name]
        if beyond := [x for x in values if not p.low <= x <= p.high]:
            yield f"{key}: found {beyond[0]:g} {p.unit}; expected {p.low:g} to {p.high:g}, the range of {name}"
    most = rig.envelope.max_injection_A
    if plan.amplitude_A > most:
        yield f"amplitude_A: found {plan.amplitude_A:g} A; the envelope allows {most:g} A"
