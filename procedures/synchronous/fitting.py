"""What cannot work in a plan for a turning shaft: speeds, settings, slow roll, captures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from bench.errors import BenchError
from bench.rigfile import RigFile
from bench.rigfile.capture import Layout
from bench.units import RPM
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.shared.limits import above_landing, landing_speed
from procedures.shared.rates import of_rate, rate_of
from procedures.synchronous.bearings import has_model
from procedures.synchronous.dwells import TELLS, can_capture, captured_channels, telemetry_period_s
from procedures.synchronous.identified import FEWEST

SLOWEST = 15.0  # rad/s, of a slow roll: two turns a second and some more
SLOW_MOST = 0.15  # of the lowest speed of the plan, at slow roll, and of the loop's own frequency
TURNS = 20  # that a slow roll needs
PER_TURN = 4.0  # samples in a turn of the highest order


def of_speeds(rig: RigFile, speeds: Sequence[float]) -> Iterator[str]:
    """Speeds in rad/s that the rig does not allow."""
    most = rig.envelope.max_speed_rad_s
    landing = landing_speed(rig)
    if most <= 2 * landing:
        yield (f"speeds_rad_s: no speed fits: above {above_landing(landing)}, and up to "
               f"{most * RPM:.0f} r/min (envelope.max_speed_rad_s). Expected a lower landing speed "
               "(capabilities.landing_speed) or a greater max_speed_rad_s")  # fmt: skip
        return
    if max(speeds) > most:
        yield f"speeds_rad_s: found {max(speeds) * RPM:.0f} r/min; the envelope allows {most * RPM:.0f} r/min"
    if min(speeds) < 0:
        yield f"speeds_rad_s: found {min(speeds) * RPM:.0f} r/min; expected speeds in the shaft's own sense, above 0 r/min"
    elif min(speeds) <= 2 * landing:
        yield f"speeds_rad_s: found {min(speeds) * RPM:.0f} r/min; expected above {above_landing(landing)}"
    if len(set(speeds)) < len(speeds):
        yield "speeds_rad_s: expected each once"


def of_slow_roll(rig: RigFile, rad_s: float, seconds: float, speeds: Sequence[float]) -> Iterator[str]:
    """A slow roll at `rad_s` (0: none) that is none beside the speeds in rad/s, or too short."""
    if min(speeds) <= 0:  # which `of_speeds` tells
        return
    machine = conventions(rig)
    most = too_fast(speeds, machine)
    if rad_s and most < SLOWEST:
        yield _no_slow_roll(rad_s, speeds, machine, needed=not has_model(rig))
        return
    if 0 < rad_s < SLOWEST or rad_s > most:
        yield (f"slow_rad_s: found {rad_s * RPM:.0f} r/min; expected 0, or {SLOWEST * RPM:.0f} (two turns a second and some "
               f"more) to {most * RPM:.0f} r/min: faster, unbalance moves the shaft")  # fmt: skip
    if rad_s and rad_s * seconds < 2 * math.pi * TURNS:
        yield f"slow_s: found {seconds:g} s; expected {TURNS} turns at {rad_s * RPM:.0f} r/min or more"


def _no_slow_roll(rad_s: float, speeds: Sequence[float], machine: AmbRotor, *, needed: bool) -> str:
    """Which two limits leave no speed for a slow roll, and the way out."""
    lowest, loop = min(speeds), machine.loop_rad_s
    if loop < lowest:
        upper = f"the loop's own {loop * RPM:.0f} r/min, by the gains of its laws"
        ways = ["stiffer gains (defaults of the parameters under capabilities.flatness)"]
    else:
        upper = f"the lowest of speeds_rad_s, {lowest * RPM:.0f} r/min"
        ways = [f"speeds_rad_s from {SLOWEST / SLOW_MOST * RPM:.0f} r/min on"]
    ways.append("the bearings' force constants (capabilities.model, or an adopted bearing-model) and slow_rad_s = 0"
                if needed else "slow_rad_s = 0: none, and the runout stays in the vectors")  # fmt: skip
    return (f"slow_rad_s: found {rad_s * RPM:.0f} r/min; no slow roll fits: it takes {SLOWEST * RPM:.0f} r/min or more (two "
            f"turns a second and some more), and no more than {SLOW_MOST * min(lowest, loop) * RPM:.0f} r/min, {SLOW_MOST:.0%} "
            f"of {upper}. Expected {', or '.join(ways)}")  # fmt: skip


def of_captures(
    rig: RigFile, capture_s: float, planned: float | None, orders: int, speeds: Sequence[float]
) -> Iterator[str]:
    """Captures that are too slow for the highest of the orders, too long for the controller, or of too few turns."""
    if not can_capture(rig):
        yield from _of_telemetry(rig, speeds)
        return
    yield from of_rate(rig, planned)
    rate_hz = rate_of(rig, planned)
    highest = orders * max(speeds) / (2 * math.pi)
    if rate_hz < PER_TURN * highest:
        yield (f"rate_hz: found {rate_hz:g}; expected {PER_TURN * highest:.0f} Hz or more for order {orders} at "
               f"{max(speeds) * RPM:.0f} r/min: what is above half of the rate folds back")  # fmt: skip
    assert rig.capture is not None
    try:
        size = Layout.of(rig.capture, captured_channels(conventions(rig))).sample.itemsize * capture_s * rate_hz
    except BenchError as error:
        yield str(error)
        return
    if size > rig.capture.memory_bytes:
        yield f"capture_s: needs {size:.0f} bytes; the controller has {rig.capture.memory_bytes}"
    if capture_s * min(speeds) < 10 * math.pi:
        yield f"capture_s: found {capture_s:g} s; expected five turns at {min(speeds) * RPM:.0f} r/min or more"


def _of_telemetry(rig: RigFile, speeds: Sequence[float]) -> Iterator[str]:
    """Without captures the telemetry must see order 1."""
    most = TELLS / telemetry_period_s(rig)
    if max(speeds) / (2 * math.pi) > most:
        yield (f"speeds_rad_s: found {max(speeds) * RPM:.0f} r/min; the controller captures nothing, and by its telemetry "
               f"nothing is stated above {most:.0f} Hz, {most * 60:.0f} r/min")  # fmt: skip


def of_bearings(rig: RigFile, slow_rad_s: float, speeds: int) -> Iterator[str]:
    """Where neither the controller nor a calibration knows the bearings' force constants, the dwells must tell them."""
    if has_model(rig):
        return
    if not slow_rad_s or speeds + 1 < FEWEST:
        some = "a" if slow_rad_s else "no"
        yield (f"speeds_rad_s: found {speeds} and {some} slow roll; expected two or more and a slow roll: the controller "
               "knows no force constants, and only the shaft at several speeds tells them")  # fmt: skip


def too_fast(speeds: Sequence[float], machine: AmbRotor) -> float:
    """Above this speed in rad/s a slow roll is none, beside the others in rad/s, and beside the loop where its own is known."""
    return SLOW_MOST * min(*speeds, machine.loop_rad_s) if speeds else 0.0
