"""What can be wrong with a map of cogging, and what its data can say about it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.cogging_map.estimates import Result, slope
from procedures.cogging_map.plan import Plan
from procedures.cogging_map.steps import Pass
from procedures.position_loops import recorded
from procedures.position_loops.motors import around
from procedures.shared import signals

GAP = 0.25  # of a period of the highest harmonic, between neighbouring places
PROGRESS = 0.05  # by which the speed may differ from the plan's
APART = 5.0  # standard uncertainties
SHARE = 0.01  # of the first harmonic, beside that
THIRD = 0.02  # of the first harmonic
LATE = 0.1  # rad of cogging's phase, between both ways
PLACED = re.compile(r"([-+0-9.eE]+) ?(mm|°)$")  # of a slope, at the end of where it was measured


def of_signals(passes: Sequence[Pass], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """No sweeps, not levitated, not all of the way, another speed, loops at their limit, losses."""
    if not passes:
        yield Finding(
            "no-sweeps", "nothing was swept; expected the plan's loops (was the run stopped early?)", "", Effect.ERROR
        )
        return
    if (told := recorded.not_held(((p.where, p.states) for p in passes), rig)) is not None:
        yield told
        return
    for p in passes:
        if (told := _covered(p, plan)) is not None:
            yield told
            return
    kinds = {
        key: sum((p.map, p.sign, p.fed) == key for p in passes) for key in ((p.map, p.sign, p.fed) for p in passes)
    }
    if min(kinds.values()) < 2 or any((of, -sign, fed) not in kinds for of, sign, fed in kinds):
        text = "found less than two sweeps each way of a kind (was the run stopped early?)"
        yield Finding("no-sweeps", text, passes[-1].map.loop, Effect.ERROR)
        return
    yield from signals.losses_of(passes, plan.max_lost)
    for loop in dict.fromkeys(p.map.loop for p in passes if p.limited):
        hit = [p for p in passes if p.map.loop == loop and p.limited]
        text = f"the loop was at its limit in {len(hit)} sweeps, {max(p.limited for p in hit):.1%} of the worst. Sweep slower."
        yield Finding("loop-limited", text, hit[0].where, Effect.INDETERMINATE, (f"@{loop}",))


def _covered(p: Pass, plan: Plan) -> Finding | None:
    highest = max(p.map.signals)
    ends = np.array([p.map.low, p.map.low + p.map.length])
    gap = float(np.diff(np.sort(np.concatenate([p.position, ends]))).max()) * highest / p.map.length
    wanted = plan.min_samples * highest
    if gap > GAP or p.position.size < wanted:
        text = (f"{p.position.size} samples on the map, {gap:.2g} periods of the highest harmonic between two of them at most; "
                f"expected {wanted} and {GAP:g}: the shaft did not go all of the way, or samples are lost.")  # fmt: skip
        return Finding("way-not-covered", text, p.where, Effect.ERROR)
    speed = abs(float(np.polyfit(p.times, p.position, 1)[0]))
    if abs(speed / p.map.speed - 1) > PROGRESS:
        text = f"the shaft went at {speed:.3g} of its unit a second; expected {p.map.speed:.3g}."
        return Finding("way-not-covered", text, p.where, Effect.ERROR)
    return None


def of_results(results: Sequence[Result], rig: RigFile, plan: Plan, facts: Mapping[str, Estimate]) -> Iterator[Finding]:
    """Nothing seen, currents that lack the feedforward, more harmonics, places that are late, slopes that disagree."""
    for r in results:
        loop, size = r.map.loop, r.shape.amplitude
        if size < plan.min_signal * r.u:
            text = f"the first harmonic is {size / r.u:.2g} standard uncertainties; {plan.min_signal:g} wanted."
            yield Finding("cogging-not-shown", text, loop, Effect.INDETERMINATE, (f"@{loop}",))
            continue
        two = 2 * r.u  # of a difference of two halves of the sweeps, either part
        if r.unfed is not None and abs(r.unfed) > APART * math.sqrt(2) * two + SHARE * size:
            text = (f"without the controller's feedforward the current that holds the shaft differs by {abs(r.unfed):.3g} A of "
                    f"{size:.3g} A: what is read is not all of the current that gives force, or the other setting did not "
                    "come.")  # fmt: skip
            yield Finding("feedforward-not-read", text, loop, Effect.INDETERMINATE, _concerned(rig, loop))
        if abs(r.third) > APART * math.sqrt(2) * r.u + THIRD * size:
            text = f"a third harmonic has {abs(r.third) / size:.1%} of the first: the greatest value is not of the map."
            yield Finding(
                "more-harmonics", text, loop, Effect.INDETERMINATE, tuple(f"peak_{x}@{loop}" for x in _kinds(rig, loop))
            )
        if abs(r.lag) > LATE:
            text = (f"up and down differ by {2 * abs(r.lag):.2g} rad of cogging's phase: the position is read late, or "
                    "there is play. Sweep slower.")  # fmt: skip
            yield Finding("ways-apart", text, loop, Effect.INDETERMINATE, _concerned(rig, loop))
        yield from _slopes(r, rig, facts)


def _kinds(rig: RigFile, loop: str) -> tuple[str, str]:
    return "current", "torque" if around(rig, loop) else "force"


def _concerned(rig: RigFile, loop: str) -> tuple[str, ...]:
    sized = [f"{what}_{kind}@{loop}" for what in ("cogging", "peak") for kind in _kinds(rig, loop)]
    return (*sized, f"cogging_phase@{loop}", *(f"second_share@{loop}, {part}" for part in ("sine", "cosine")))


def _slopes(r: Result, rig: RigFile, facts: Mapping[str, Estimate]) -> Iterator[Finding]:
    """What a mass's answer to sines has told of the slope at a place."""
    name = "cogging_stiffness_angle" if around(rig, r.map.loop) else "cogging_stiffness"
    for key, told in facts.items():
        found = PLACED.search(key)
        if found is None or not key.startswith(f"{name}@{r.map.loop}, "):
            continue
        place = float(found[1]) * (1e-3 if found[2] == "mm" else math.pi / 180)
        apart = slope(r, place) - told
        if abs(apart.value) > APART * apart.u:
            text = (f"the map's slope at {found[0]} is {slope(r, place).value:.4g}, the adopted one {told.value:.4g}, more "
                    f"than {APART:g} standard uncertainties apart: the machine is not what it was, or one of both is "
                    "wrong.")  # fmt: skip
            yield Finding("slopes-disagree", text, r.map.loop, Effect.INDETERMINATE, _concerned(rig, r.map.loop))
            return
