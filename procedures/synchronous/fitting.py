"""What cannot work in a plan for a turning shaft: speeds, settings, slow roll, captures."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Protocol

from bench.errors import BenchError
from bench.rigfile import RigFile
from bench.rigfile.capture import Layout
from bench.units import RPM
from procedures.amb_rotor.conventions import conventions
from procedures.synchronous.dwells import captured_channels

SLOW_MOST = 0.15  # of the lowest speed of the plan, at slow roll, and of the loop's own frequency
LOOP_RAD_S = 390.0  # sqrt(k1) of T Table 2.4: the rigid modes
TURNS = 20  # that a slow roll needs
PER_TURN = 4.0  # samples in a turn of the highest order


class Settings(Protocol):
    """The part of a plan that these checks, and those of its recording, need."""

    @property
    def slow_rad_s(self) -> float: ...
    @property
    def slow_s(self) -> float: ...
    @property
    def speeds_rad_s(self) -> tuple[float, ...]: ...
    @property
    def variants(self) -> tuple[Any, ...]: ...
    @property
    def law(self) -> str: ...
    @property
    def observed(self) -> bool: ...
    @property
    def capture_s(self) -> float: ...
    @property
    def rate_hz(self) -> float: ...
    @property
    def orders(self) -> int: ...
    @property
    def max_lost(self) -> float: ...
    @property
    def max_speed_error(self) -> float: ...


def of_plan(rig: RigFile, plan: Settings) -> Iterable[str]:
    """What cannot work, before anything starts."""
    speeds, most = plan.speeds_rad_s, rig.envelope.max_speed_rad_s
    landing = rig.parameters["landing_speed"].default if "landing_speed" in rig.parameters else 0.0
    if max(speeds) > most:
        yield f"speeds_rad_s: found {max(speeds) * RPM:.0f} r/min; the envelope allows {most * RPM:.0f} r/min"
    if min(speeds) <= 2 * landing or len(set(speeds)) < len(speeds):
        yield f"speeds_rad_s: expected each once, and above {2 * landing * RPM:.0f} r/min, twice the landing speed"
    if len(set(plan.variants)) < len(plan.variants) or (plan.observed and plan.law == "PID"):
        yield "variants: expected each once, and with law PID off alone: only the flatness laws compensate"
    if 0 < plan.slow_rad_s < 15 or plan.slow_rad_s > too_fast(plan):
        yield (f"slow_rad_s: found {plan.slow_rad_s * RPM:.0f} r/min; expected 0, or 143 (two turns a second and some more) to "
               f"{too_fast(plan) * RPM:.0f} r/min: faster, unbalance moves the shaft")  # fmt: skip
    if plan.slow_rad_s and plan.slow_rad_s * plan.slow_s < 2 * math.pi * TURNS:
        yield f"slow_s: found {plan.slow_s:g} s; expected {TURNS} turns at {plan.slow_rad_s * RPM:.0f} r/min or more"
    highest = plan.orders * max(speeds) / (2 * math.pi)
    if plan.rate_hz < PER_TURN * highest:
        yield (f"rate_hz: found {plan.rate_hz:g}; expected {PER_TURN * highest:.0f} Hz or more for order {plan.orders} at "
               f"{max(speeds) * RPM:.0f} r/min: what is above half of the rate folds back")  # fmt: skip
    if rig.capture is None:
        yield "capture: the controller has none; orbits and D_max are read at its full rate"
        return
    try:
        size = (
            Layout.of(rig.capture, captured_channels(conventions(rig))).sample.itemsize * plan.capture_s * plan.rate_hz
        )
    except BenchError as error:
        yield str(error)
        return
    if size > rig.capture.memory_bytes:
        yield f"capture_s: needs {size:.0f} bytes; the controller has {rig.capture.memory_bytes}"
    if plan.capture_s * min(speeds) < 10 * math.pi:
        yield f"capture_s: found {plan.capture_s:g} s; expected five turns at {min(speeds) * RPM:.0f} r/min or more"


def too_fast(plan: Settings) -> float:
    """Above this speed in rad/s a slow roll is none."""
    return SLOW_MOST * min(*plan.speeds_rad_s, LOOP_RAD_S) if plan.speeds_rad_s else 0.0
