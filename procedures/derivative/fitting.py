"""Whether a plan fits a rig."""

from __future__ import annotations

from collections.abc import Iterator

from procedures.derivative.plan import Plan


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
