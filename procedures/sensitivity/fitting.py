"""What a plan of injections asks too much of the rig: said before anything moves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from bench.errors import BenchError
from bench.rigfile import RigFile
from bench.rigfile.capture import Layout
from bench.rigfile.envelope import Envelope
from bench.units import RPM
from procedures.amb_rotor.conventions import conventions
from procedures.sensitivity import sines
from procedures.sensitivity.injection import Comb, find_refusals, in_whole_samples
from procedures.sensitivity.plan import Plan
from procedures.sensitivity.steps import REFINED, captured_channels
from procedures.shared.limits import above_landing, landing_speed
from procedures.shared.rates import of_rate

WIDER = "If the controller can do it, widen that parameter's range in the rig file"
LEAST_S = 4.0  # of a capture of the second grid: four periods of the finest


def chosen_axes(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """Those of the plan, or all of the machine's into which the controller injects."""
    can = rig.capabilities.injection
    return plan.axes or tuple(a for a in conventions(rig).all_axes if can is not None and a in can.axes)


def of_plan(rig: RigFile, plan: Plan, combs: Sequence[tuple[str, Comb]]) -> Iterator[str]:
    """What the plan asks too much of: key, found, expected."""
    if max(plan.speeds_rad_s) > 0 and not any("drive" in d.roles for d in rig.devices.values()):
        yield "speeds_rad_s: the rig file has no device in the role drive, so that nothing turns the shaft; expected 0"
        return
    if max(plan.speeds_rad_s) > 0 and not conventions(rig).marked:
        yield "speeds_rad_s: the rig tells no angle and speed of the shaft; expected 0 alone"
        return
    known = tuple(rig.capabilities.injection.axes) if rig.capabilities.injection is not None else ()
    for axis in (a for a in plan.axes if a not in known):
        yield f"axes: found {axis}; the controller injects into {', '.join(known) or '(none)'}"
    yield from _injection(rig, plan, combs)
    yield from _speeds(rig, plan)


def _injection(rig: RigFile, plan: Plan, combs: Sequence[tuple[str, Comb]]) -> Iterator[str]:
    yield from _refusals(rig, plan, [c for _, c in combs])
    steps = (("low_hz", plan.low_hz), ("high_step_hz", plan.high_step_hz), ("scan_step_hz", plan.scan_step_hz or 1.0))
    for key, value in steps:
        if math.log2(value) % 1:
            yield f"{key}: found {value:g}; expected a power of two: the lines must repeat after whole samples"
    if len({*plan.axes}) < len(plan.axes):
        yield f"axes: found {', '.join(plan.axes)}; expected each once"
    top = max(hz for _, c in combs for hz in c.hz)
    if top > 0.45 * sines.rate(rig, plan):
        yield (f"rate_hz: found {sines.rate(rig, plan):g}; expected {top / 0.45:.0f} Hz or more for lines up to {top:g} Hz: "
               "what is above half of it folds back")  # fmt: skip
    yield from of_rate(rig, plan.rate_hz)
    for comb in (c for _, c in combs if not in_whole_samples(c.period_s, sines.rate(rig, plan))):
        yield (f"rate_hz: found {sines.rate(rig, plan):g}; lines that repeat after {comb.period_s:g} s need whole samples "
               "within a few of these: expected another of the controller's rates")  # fmt: skip
        break
    yield from _memory(rig, plan, combs)


def _refusals(rig: RigFile, plan: Plan, combs: Sequence[Comb]) -> Iterator[str]:
    """What the envelope and the ranges of the controller's parameters refuse, by the setting that asks for it."""
    can, envelope = rig.capabilities.injection, Envelope(rig)
    if can is None:
        return
    one = sines.makes_one(rig)
    amplitude = "sine_A" if one else "amplitude_A"
    refined = Comb(plan.low_hz, plan.low_hz, 128, plan.amplitude_A)  # at most, in the second pass
    told: set[str] = set()
    for comb in sorted([*combs, *(() if one else (refined,))], key=lambda c: -c.peak):
        for what, why in find_refusals(envelope, can, comb).items():
            if what in told:
                continue
            told.add(what)
            if what == "peak" and not rig.envelope.max_injection_A:
                yield (f"envelope.max_injection_A: found {rig.envelope.max_injection_A or 'none'}; expected what may be added "
                       f"to a current reference, A: {comb.peak:.3g} A or more for this plan's {amplitude}")  # fmt: skip
            elif what == "lines":
                yield f"capabilities.injection.lines: found {comb.count} lines at once: {why}. {WIDER}"
            elif what == "step":
                yield f"low_hz, high_step_hz, scan_step_hz: found {comb.step:g} Hz between lines: {why}. {WIDER}"
            elif what == "hz":
                yield f"low_hz, high_hz: found lines from {comb.first:g} Hz on: {why}. {WIDER}"
            else:
                share = f"for each of {comb.count} lines" if comb.count > 1 else "for the sine"
                yield f"{amplitude}: found {comb.amplitude:g} A {share}; expected less: {why}"


def _memory(rig: RigFile, plan: Plan, combs: Sequence[tuple[str, Comb]]) -> Iterator[str]:
    assert rig.capture is not None
    speed = max(plan.speeds_rad_s)
    slowest = min((s for s in plan.speeds_rad_s if s > 0), default=0.0)
    extra = 0.1 + 4 * math.pi / slowest if slowest else 0.0
    for kind, seconds in [
        *((k, plan.periods * c.period_s) for k, c in combs),
        *(() if sines.makes_one(rig) else ((REFINED, LEAST_S),)),
    ]:
        try:
            names = captured_channels(conventions(rig), kind, speed)
            size = Layout.of(rig.capture, names).sample.itemsize * (seconds + extra) * sines.rate(rig, plan)
        except BenchError as error:
            yield str(error)
            return
        if size > rig.capture.memory_bytes:
            yield (f"periods: found {size:.0f} bytes for the pass {kind!r}; expected {rig.capture.memory_bytes} at most, the "
                   "controller's memory")  # fmt: skip
            return


def _speeds(rig: RigFile, plan: Plan) -> Iterator[str]:
    highest, landing = (
        rig.envelope.max_speed_rad_s,
        landing_speed(rig),
    )
    if max(plan.speeds_rad_s) > highest:
        yield f"speeds_rad_s: found {max(plan.speeds_rad_s) * RPM:.0f} r/min; the envelope allows {highest * RPM:.0f} r/min"
    if min(plan.speeds_rad_s) < 0:
        found = f"found {min(plan.speeds_rad_s) * RPM:.0f} r/min"
        yield f"speeds_rad_s: {found}; expected speeds in the shaft's own sense, 0 r/min or above"
    elif slow := [s for s in plan.speeds_rad_s if 0 < s < 2 * landing]:
        yield f"speeds_rad_s: found {min(slow) * RPM:.0f} r/min; expected 0 or above {above_landing(landing)}"
    if len({*plan.speeds_rad_s}) < len(plan.speeds_rad_s):
        yield "speeds_rad_s: expected each once"
