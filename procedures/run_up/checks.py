"""What can be wrong with a passage through the speeds, and what its data can say about it. Each check names its suspect."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.criticals import CERTAIN
from bench.analysis.peaks import WINDOW
from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.uncertainty import interval
from bench.units import RPM
from procedures.run_up.estimates import DAMPED, Peak, Run, asked_margin
from procedures.run_up.hum import of_peaks
from procedures.run_up.plan import Passing
from procedures.run_up.steps import MISSED, PASSAGE, Passage, passed
from procedures.shared import signals
from procedures.synchronous import checks, facts, mark
from procedures.synchronous.checks import HELD
from procedures.synchronous.hum import listen, of_dwells

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
APART = 0.1  # of the drive's speed: how far that of the pulses may be off
OFTEN = 0.01  # of the samples: pulses that are off for less were a poll's delay
SHORT = 0.02  # of the speed that the passage should end at
LARGE = 0.5  # of the clearance
BY_THE_RING = 0.95  # of the clearance: probes, whose zeros are known to 5 µm, tell no more whether the shaft touches
BESIDE = 0.05  # of a speed: what happens there may be in its turns
OF_CRITICALS = ("critical_speed", "amplification_factor", "critical_amplitude", "separation")


def before(recording: Recording[Any]) -> Iterator[Finding]:
    """Nothing to evaluate."""
    if not len(recording.steps(PASSAGE)):
        yield Finding("no-passage", "no run through the speeds was recorded", "", Effect.ERROR)


def of_passage(p: Passage, recording: Recording[Any], plan: Passing) -> Iterator[Finding]:
    """Lost samples, pulses, probes that clip or stand still, contact, limits, captures, where it ended."""
    yield from signals.losses(np.array([p.lost]), np.array([p.expected]), plan.max_lost, lambda _: p.name)
    for name in p.stuck:
        yield Finding("stuck-channel", f"{name} does not move at all; a live sensor has noise.", name, Effect.ERROR)
    yield from _pulses(p)
    yield from mark.of_clock([p.tacho], p.sampling.tick, p.name)
    yield from _limits(p, plan)
    yield from _silent(p, recording.rig, plan)
    for event in recording.events(MISSED):
        text = f"no capture at {event['wanted'] * RPM:.0f} r/min: {event['why']}"
        yield Finding("capture-missed", text, p.name, Effect.INDETERMINATE, (_at(p, event["wanted"], plan),))
    top = float(np.nanmax(p.speeds))
    bottom = float(np.nanmin(p.speeds))
    goal, got = (plan.top_rad_s, top) if p.direction == "up" else (plan.bottom_rad_s, bottom)
    missed = got < (1 - SHORT) * goal if p.direction == "up" else got > (1 + 2 * SHORT) * goal
    if missed:
        text = f"it ended at {got * RPM:.0f} instead of {goal * RPM:.0f} r/min: the speeds beyond were not seen."
        yield Finding("passage-short", text, p.name, Effect.INDETERMINATE, OF_CRITICALS)


def _pulses(p: Passage) -> Iterator[Finding]:
    """One a turn: by their spacing, and where that is even, by the drive's own speed."""
    for kind, times in (("missing", p.tacho.missing), ("doubled", p.tacho.doubled)):
        if times:
            yield _pulse(kind, f"{len(times)} times, the first at {_speed_at(p, times[0]) * RPM:.0f} r/min", p.name)
    if p.tacho.sound:
        t, drive = p.driven
        ratio = p.tacho.speed(t) / np.where(drive > 0, drive, np.nan)
        ratio = ratio[np.isfinite(ratio)]
        for kind, off in (("missing", ratio < 1 - APART), ("doubled", ratio > 1 + APART)):
            if ratio.size and off.mean() > OFTEN:
                yield _pulse(
                    kind, f"the shaft turns at {np.median(ratio[off]):.2f} of the drive's speed by them", p.name
                )


def _pulse(kind: str, count: str, where: str) -> Finding:
    text = f"once-per-turn pulses are {kind}, {count}: the phases are worth nothing. Look at the pickup and its level."
    return Finding(f"pulse-{kind}", text, where, Effect.ERROR)


def _speed_at(p: Passage, t: float) -> float:
    return float(np.interp(t, *p.driven))


def _at(p: Passage, speed: float, plan: Passing) -> str:
    """What is measured at a speed, as findings name it."""
    return f"@{speed * RPM:.0f} r/min, {passed(p.direction, plan.law)}"


def _doubted(p: Passage, samples: Mask, plan: Passing) -> tuple[str, ...]:
    """What `samples` (n,) put in doubt: what is read off the curve, and what is measured beside the speeds at which they were
    read, in its turns or in the local models that take the lag off. All, where the fastest of these is among them: the runout
    rests on it."""
    hit, block = p.speeds[samples], float(np.ptp(p.speeds[np.isfinite(p.speeds)])) / plan.blocks
    if not np.isfinite(hit).all():
        return ()
    off = {s: np.abs(hit - s).min() for s in plan.speeds_rad_s}
    near = [s for s in plan.speeds_rad_s if off[s] < max(BESIDE * s, WINDOW * block)]
    return () if max(plan.speeds_rad_s) in near else (*(_at(p, s, plan) for s in sorted(near)), *OF_CRITICALS)


def _limits(p: Passage, plan: Passing) -> Iterator[Finding]:
    m = p.machine
    beyond, touched, current, voltage = (
        (p.flags & bits) != 0 for bits in (m.sensor_range, m.contact, m.current_limit, m.voltage_limit)
    )
    if p.clips >= HELD or beyond.any():
        text = (
            f"a position sensor stood at the end of its range{_when(p, beyond)}: what it shows of the orbit is cut off."
        )
        yield Finding("sensor-clipped", text, p.name, Effect.ERROR)
    if touched.any():
        places = {**{f"the {plane} ring": bit for plane, bit in m.rings.items()}, "the axial stop": m.axial_stop}
        hit = [place for place, bit in places.items() if (p.flags & bit).any()]
        text = f"the shaft touched {' and '.join(hit)}{_when(p, touched)}: this is not its response to unbalance."
        yield Finding("contact", text, p.name, Effect.INDETERMINATE, _doubted(p, touched, plan))
    if current.any():
        text = f"a coil current was at its limit{_when(p, current)}: the response is not linear."
        yield Finding("current-saturated", text, p.name, Effect.INDETERMINATE, _doubted(p, current, plan))
    if voltage.any():
        text = f"an amplifier's voltage was at its limit{_when(p, voltage)}: the currents slewed (T Fig. 2.9)."
        yield Finding("voltage-saturated", text, p.name, Effect.INDETERMINATE, _doubted(p, voltage, plan))


def _silent(p: Passage, rig: RigFile, plan: Passing) -> Iterator[Finding]:
    """A controller may not tell of contact; the probes show where the shaft went."""
    clear = facts.clearance(rig).value
    far = np.max([np.hypot(p.data[y], p.data[z]) for y, z in p.machine.planes.values()], axis=0)
    near = far > BY_THE_RING * clear
    if near.any() and not (p.flags & p.machine.contact).any():
        text = (
            f"the probes show the shaft up to {far.max() * 1e6:.0f} µm off their zero{_when(p, near)}, with rings at "
            f"{clear * 1e6:.0f} µm: it may have touched, though the controller tells of no contact. Balance first."
        )
        yield Finding("contact-unreported", text, p.name, Effect.INDETERMINATE, _doubted(p, near, plan))


def _when(p: Passage, samples: Mask) -> str:
    """From which speed to which, first to last."""
    hit = np.flatnonzero(samples)
    if not hit.size:
        return ""
    first, last = (_speed_at(p, float(p.t[k])) * RPM for k in (hit[0], hit[-1]))
    return f", first at {first:.0f} and last at {last:.0f} r/min"


def of_run(run: Run, recording: Recording[Any], plan: Passing) -> Iterator[Finding]:
    """What the turns about the captures say of wiring and zones; then the criticals, as notes."""
    if run.near is None:
        text = "the shaft came through none of the speeds at which vectors were asked for."
        yield Finding("no-vectors", text, run.passage.name, Effect.ERROR)
        return
    yield from checks.sampling([r.dwell for r in run.near.dwells], plan.orders)
    yield from checks.of_results(run.near)
    sound = listen(recording, run.slow)
    yield from of_dwells(sound, run.near.dwells)
    yield from of_peaks(sound, [p for p in run.peaks if p.critical])
    yield from _criticals(run, plan)
    yield from _passed(run)


def _criticals(run: Run, plan: Passing) -> Iterator[Finding]:
    """What is critical, what is too well damped for that, and where nothing is."""
    speed = run.curve.speed * RPM
    found = [p for p in run.peaks if p.critical]
    for p in found:
        yield Finding("critical", _told(p, plan.running_rad_s), p.where)
        if p.amplitude.value > LARGE * run.clearance:
            text = (f"at {p.amplitude.value / run.clearance:.0%} of the clearance the bearings' forces are not linear: what "
                    "that did to speed and factor is taken off as far as the bearings are known. Balance first.")  # fmt: skip
            yield Finding("large-amplitude", text, p.where)
    if not found:
        text = (f"no critical speed between {speed[0]:.0f} and {speed[-1]:.0f} r/min: no greatest amplitude of any probe has "
                f"an amplification factor of {DAMPED} or more.")  # fmt: skip
        yield Finding("no-critical", text, run.passage.name)
    bumps = [f"{axis} at {' and '.join(f'{w * RPM:.0f}' for w in at)} r/min" for axis, at in run.bumps.items() if at]
    if bumps:
        text = (f"bumps that stand out by less than {CERTAIN} standard deviations of their noise, which may have made them: "
                f"{', '.join(bumps)}. Nothing is told of them; a slower passage would tell.")  # fmt: skip
        yield Finding("peak-in-noise", text, run.passage.name)
    for p in run.peaks:
        if p.factor is None:
            text = (f"the greatest amplitude of {p.axis} at {_rpm(p)} does not fall to 0.707 of itself on both sides "
                    "within the speeds run through: it has no amplification factor here.")  # fmt: skip
            yield Finding("half-power-outside", text, p.where)
        elif not p.critical:
            text = (f"the amplitude of {p.axis} is greatest at {_rpm(p)}, with an amplification factor of {_value(p)}: "
                    "critically damped, no critical speed (API 617).")  # fmt: skip
            yield Finding("critically-damped", text, p.where)


def _rpm(p: Peak) -> str:
    i = interval(p.speed)
    return f"{p.speed.value * RPM:.0f} ± {(i.high - i.low) / 2 * RPM:.0f} r/min"


def _value(p: Peak) -> str:
    assert p.factor is not None
    i = interval(p.factor)
    return f"{p.factor.value:.2f} ± {(i.high - i.low) / 2:.2f}"


def _told(p: Peak, running: float) -> str:
    asked = asked_margin(p, running)
    kept = "keeps" if p.margin.value >= asked else "does not keep"
    return (f"{_rpm(p)}, amplification factor {_value(p)}, half power from "
            f"{p.low * RPM:.0f} to {p.high * RPM:.0f} r/min, {p.amplitude.value * 1e6:.1f} µm 0-pk. "
            f"It stands {p.margin.value:.0%} off the running speed of "
            f"{running * RPM:.0f} r/min and {kept} the {asked:.0%} that API 617 asks at that factor (not checked "
            f"against the standard). The passage had moved it by {p.lagged * RPM:+.0f} r/min, the size of the orbit "
            f"by {p.bent * RPM:+.0f} r/min; both are taken off.")  # fmt: skip


def _passed(run: Run) -> Iterator[Finding]:
    c, up = run.curve, run.passage.direction == "up"
    rate, ends = np.abs(c.acceleration) * RPM, c.speed[[0, -1] if up else [-1, 0]] * RPM
    most = [(np.abs(run.shaft[k]).max() * 1e6, c.speed[int(np.argmax(np.abs(run.shaft[k])))] * RPM) for k in range(4)]
    greatest = ", ".join(
        f"{a} {size:.1f} µm at {at:.0f}" for a, (size, at) in zip(run.passage.machine.axes, most, strict=True)
    )
    text = (f"from {ends[0]:.0f} to {ends[1]:.0f} r/min at {rate.min():.0f} to {rate.max():.0f} r/min per second, "
            f"{c.speed.size} blocks of {np.median(c.width) * RPM:.0f} r/min; "
            f"greatest amplitudes of the shaft {greatest} r/min.")  # fmt: skip
    yield Finding("passed", text, run.passage.name)
