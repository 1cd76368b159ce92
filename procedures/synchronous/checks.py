"""What can be wrong with the dwells of a turning shaft, and what their data can say about it. Each check names its suspect."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bench.analysis.tachometer import against
from bench.analysis.vectors import radius2
from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.units import RPM
from procedures.shared import signals
from procedures.synchronous import mark
from procedures.synchronous.carrying import CARRIED
from procedures.synchronous.dwells import DWELL, SLOW, Dwell
from procedures.synchronous.estimates import ForceBalance, Results
from procedures.synchronous.fitting import PER_TURN, too_fast

HELD = 8  # samples in a row at an extreme: a probe that clips
BESIDE = 0.05  # of the least clearance: motion that does not turn with the shaft
CHANGED, CHANGED_M = 0.1, 0.3e-6  # of the vector, and at least: a repeat that differs by more
ZONES = (("A", 0.3), ("B", 0.4), ("C", 0.5), ("D", math.inf))
"""Upper ends of the zones, D_max over the least clearance (ISO 14839-2, Table 1: numbers not checked against the standard)."""


def zone(share: float) -> str:
    """Letter of the zone of a share of the clearance."""
    return next(name for name, end in ZONES if share <= end)


def before(recording: Recording[Any]) -> Iterator[Finding]:
    """Nothing to evaluate; the landing of a controller that gave up is told by the run itself."""
    if not len(recording.steps(DWELL)):
        yield Finding("no-dwells", "no dwell was recorded", "", Effect.ERROR)


Doubts = Callable[[Dwell], tuple[str, ...]]


def its_own(d: Dwell) -> tuple[str, ...]:
    """What rests on a dwell alone: what is measured there, and the reduction at its speed. On a slow roll all vectors rest."""
    return () if d.kind == SLOW else (f"@{d.where}", f"reduction@{d.wanted * RPM:.0f} r/min")


def of_signals(
    dwells: Sequence[Dwell], max_lost: float, max_speed_error: float, doubts: Doubts = its_own
) -> Iterator[Finding]:
    """Lost samples (a share of them is allowed), pulses, probes that clip or stand still, contact, limits, speed (a share of
    which it may be off). `doubts` are the quantities that a dwell's data are in; none is all of them."""
    lost, expected = np.array([(d.lost, d.expected) for d in dwells], dtype=float).T
    for f in signals.losses(lost, expected, max_lost, lambda share: dwells[int(np.argmax(share))].where):
        hit = [doubts(d) for d in dwells if d.lost > max_lost * max(d.expected, 1)]
        yield replace(f, concerns=tuple(q for some in hit for q in some) if all(hit) else ())
    yield from mark.of_clock([d.tacho for d in dwells], max(d.sampling.tick for d in dwells))
    for d in dwells:
        for name in d.stuck:
            yield Finding("stuck-channel", f"{name} does not move at all; a live sensor has noise.", name, Effect.ERROR)
        yield from _pulses(d)
        yield from _limits(d, doubts)
        off = abs(d.speed / d.wanted - 1)
        if off > max_speed_error:
            text = f"the pulses say {d.speed * RPM:.0f} r/min, {off:.1%} off."
            yield Finding("speed-off", text, d.where, Effect.INDETERMINATE, doubts(d))


def _pulses(d: Dwell) -> Iterator[Finding]:
    """One a turn: by their spacing, and where that is even, by the drive's own speed."""
    other = against(d.tacho, d.driven or d.wanted)
    parts = [("missing", d.tacho.missing), ("doubled", d.tacho.doubled)]
    for kind, times in parts:
        if times or other == kind:
            count = f"{len(times)} times" if times else f"against the drive's {(d.driven or d.wanted) * RPM:.0f} r/min"
            text = f"once-per-turn pulses are {kind}, {count}: the phases are worth nothing. Look at the pickup and its level."
            yield Finding(f"pulse-{kind}", text, d.where, Effect.ERROR)


def _limits(d: Dwell, doubts: Doubts) -> Iterator[Finding]:
    if d.flags & d.machine.sensor_range or d.clips >= HELD:
        text = "a position sensor stood at the end of its range: what it shows of the orbit is cut off."
        yield Finding("sensor-clipped", text, d.where, Effect.ERROR)
    for bits, code, text in (
        (
            d.machine.contact,
            "contact",
            "the shaft touched a ring or the axial stop: this is not its response to unbalance.",
        ),
        (d.machine.current_limit, "current-saturated", "a coil current was at its limit: the response is not linear."),
        (
            d.machine.voltage_limit,
            "voltage-saturated",
            "an amplifier's voltage was at its limit: the currents slewed (T Fig. 2.9).",
        ),
    ):
        if d.flags & bits:
            yield Finding(code, text, d.where, Effect.INDETERMINATE, doubts(d))


def sampling(dwells: Sequence[Dwell], orders: int) -> Iterator[Finding]:
    """The capture must be fast enough for the highest of the orders asked."""
    for d in dwells:
        if d.full is None:
            continue
        need = PER_TURN * orders * d.speed / (2 * math.pi)
        if d.full.rate < need:
            text = (f"captured at {d.full.rate:g} Hz; order {orders} needs {need:.0f} Hz: what is above half of the rate "
                    "appears at other frequencies, and D_max misses peaks.")  # fmt: skip
            yield Finding("aliasing", text, d.where, Effect.ERROR)


def slow_roll(dwells: Sequence[Dwell], speeds: Sequence[float], runout: tuple[str, ...] = ()) -> Iterator[Finding]:
    """Is there a slow roll, and was it slow beside the speeds in rad/s? `runout` are the quantities that it is in; none is
    all of them."""
    slow = [d for d in dwells if d.kind == SLOW]
    if not slow:
        text = "no slow roll: what the probes read of the journals' runout is in every vector, as if it were unbalance."
        yield Finding("no-slow-roll", text, "", Effect.INDETERMINATE, runout)
    elif slow[0].speed > 1.02 * (most := too_fast(speeds, slow[0].machine)):
        text = (f"the slow roll was made at {slow[0].speed * RPM:.0f} r/min; above {most * RPM:.0f} r/min "
                "unbalance and the loop's own response are in it.")  # fmt: skip
        yield Finding("slow-roll-too-fast", text, slow[0].where, Effect.INDETERMINATE, runout)


def of_results(results: Results) -> Iterator[Finding]:
    """Do forces and motion agree? Is a repeat the same? Then zones and the runout, as notes."""
    forces = [r.forces for r in results.dwells]
    yield from channels(forces)
    yield from weight(forces)
    yield from _beside(results)
    yield from _folded(results)
    yield from _repeats(results)
    yield from _told(results)
    yield from _regions(results)
    yield from _zones(results)


def channels(dwells: Sequence[ForceBalance]) -> Iterator[Finding]:
    """Two unbalances must explain motion less control forces of all four axes: they do not where channels are exchanged."""
    worst = max(dwells, key=lambda r: r.misfit / r.allowed)
    if worst.misfit > worst.allowed:
        text = (f"no unbalance in the two planes explains motion and currents: {worst.misfit:.0%} of the forces are left over "
                f"({worst.allowed:.0%} is allowed). Suspect the polarity of a probe, exchanged planes or axes, or "
                "exchanged coils.")  # fmt: skip
        yield Finding("forces-disagree", text, worst.dwell.where, Effect.ERROR)


def weight(dwells: Sequence[ForceBalance]) -> Iterator[Finding]:
    """The mean coil forces must carry the weight; they do not where the two coils of an axis are exchanged."""
    for r in dwells:
        off = np.abs(r.carried - 1)
        k = int(np.argmax(off))
        if off[k] > CARRIED:
            axis = r.dwell.machine.axes[k]
            text = (f"by their currents the coils of {axis} carry {r.carried[k]:.2f} of their share of the weight: "
                    "suspect the coils of an axis exchanged, a current sensor, or a wrong model of the bearing.")  # fmt: skip
            yield Finding("weight-not-carried", text, r.dwell.where, Effect.ERROR)
            return


def _beside(results: Results) -> Iterator[Finding]:
    """D_max holds what does not turn with the shaft by its size only; where it is large, that is not enough to know."""
    clearance = results.clearance.value
    for r in results.dwells:
        if r.beside.max() > BESIDE * clearance:
            plane, far = list(r.dwell.machine.planes)[int(r.beside.argmax())], float(r.beside.max())
            text = (f"{plane} the shaft moves by up to {far * 1e6:.1f} µm that does not turn with it ({far / clearance:.0%} of "
                    f"the clearance; {BESIDE:.0%} is allowed): D_max holds what that may add to the orbit. Suspect a loop near "
                    "its limit of stability, a rub, or a shaker: see the spectrum.")  # fmt: skip
            yield Finding("not-synchronous", text, r.dwell.where, Effect.INDETERMINATE, (f"@{r.dwell.where}",))


def _folded(results: Results) -> Iterator[Finding]:
    """An order that the telemetry takes for order 1 and that is more than all else that is uncertain in a vector."""
    for r in results.dwells:
        n, off = r.folded
        whole = np.array([np.linalg.eigvalsh(r.vectors.one(k).covariance)[0] for k in range(4)])
        known = np.sqrt(np.maximum(whole - off**2 / 2, 1e-24))  # without it
        k = int(np.argmax(off / known))
        if off[k] > 2 * known[k]:
            period, axis = r.dwell.sampling.ticks * r.dwell.sampling.tick, r.dwell.machine.axes[k]
            text = (f"at {r.dwell.speed * RPM:.0f} r/min the telemetry, a sample every {period * 1e3:g} ms, shows order {n} as "
                    f"order 1: the vector of {axis} may be off by {off[k] * 1e6:.2f} µm, which its interval holds. "
                    "Dwell at a speed that is a percent away.")  # fmt: skip
            yield Finding("aliasing", text, r.dwell.where, Effect.INDETERMINATE, its_own(r.dwell))


def _repeats(results: Results) -> Iterator[Finding]:
    """The lowest speed again at the end: a weight that came loose, a shaft that bent."""
    for again in (r for r in results.dwells if r.dwell.again):
        first = next(
            r for r in results.dwells
            if not r.dwell.again and r.dwell.wanted == again.dwell.wanted and r.dwell.variant == again.dwell.variant
        )  # fmt: skip
        a, b = first.dwell.readings(), again.dwell.readings()
        moved, size = np.abs(b.values - a.values), np.abs(a.values)
        noise = np.sqrt(radius2(min(a.dof, b.dof))) * np.hypot(a.u_amplitude, b.u_amplitude)
        over = moved - noise - np.maximum(CHANGED * size, CHANGED_M)
        k = int(np.argmax(over))
        if over[k] > 0:
            before, after = first.unbalance, again.unbalance
            turn = np.degrees(np.angle(after / before))
            text = (f"a vector changed by {moved[k] * 1e6:.2f} µm between the first and the last dwell at "
                    f"{again.dwell.wanted * RPM:.0f} r/min; by the forces, the unbalance went from "
                    f"{abs(before[0]) * 1e6:.2f} and {abs(before[1]) * 1e6:.2f} g mm to {abs(after[0]) * 1e6:.2f} and "
                    f"{abs(after[1]) * 1e6:.2f} g mm, turned by {turn[0]:+.0f}° and {turn[1]:+.0f}°. Suspect a weight "
                    "that came loose, or a shaft that bent as it warmed.")  # fmt: skip
            yield Finding("response-changed", text, again.dwell.where, Effect.ERROR)


def _told(results: Results) -> Iterator[Finding]:
    """What was subtracted, and when it was measured."""
    slow, first = results.slow, results.runouts[1.0]
    if slow is None:
        return

    def polar(values: np.ndarray) -> str:
        return ", ".join(f"{abs(v) * 1e6:.2f} µm ∠{-np.degrees(np.angle(v)) % 360:.0f}°" for v in values)

    axes = ", ".join(slow.machine.axes)
    text = (f"of {axes} (0-pk, phase lag), at {slow.speed * RPM:.0f} r/min, {slow.date}: the probes read "
            f"{polar(first.reading)}; by the forces the shaft itself moved {polar(first.shaft)}; subtracted is the runout "
            f"{polar(first.values)}.")  # fmt: skip
    yield Finding("slow-roll", text, slow.where)


def _regions(results: Results) -> Iterator[Finding]:
    """Of each setting, the greatest 95 % ellipse of a vector."""
    for variant in results.variants:
        some = []
        for r in results.of(variant):
            for k, axis in enumerate(r.dwell.machine.axes):
                one = r.vectors.one(k)
                sizes = np.sqrt(radius2(one.dof) * np.linalg.eigvalsh(one.covariance))
                some.append((float(sizes[1]), float(sizes[0]), f"{axis}, {r.dwell.where}"))
        most, least, where = max(some)
        text = (f"{variant}: the greatest 95 % ellipse of a vector has half axes of {most * 1e6:.2f} and {least * 1e6:.2f} µm; "
                "each follows from its two components and their correlation.")  # fmt: skip
        yield Finding("ellipse", text, where)


def _zones(results: Results) -> Iterator[Finding]:
    """Of each setting, where D_max is greatest."""
    for variant in results.variants:
        shares = [
            (e.value, place, r)
            for r in results.of(variant)
            for (name, place), e in r.estimates.items()
            if name == "d_max_share"
        ]
        most, place, r = max(shares, key=lambda s: s[0])
        text = (f"{variant}: D_max is greatest {place} at {r.dwell.wanted * RPM:.0f} r/min, {most:.1%} of the clearance: zone "
                f"{zone(most)} of ISO 14839-2.")  # fmt: skip
        yield Finding("zone", text, f"{place}, {r.dwell.where}")
