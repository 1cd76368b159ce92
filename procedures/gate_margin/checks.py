"""What can be wrong with a gate, with the windows, and what their data can say about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.gate_margin.estimates import CATCH, GATE, Results
from procedures.gate_margin.fit import Array, cut
from procedures.gate_margin.place import grid, samples
from procedures.gate_margin.plan import Plan
from procedures.gate_margin.steps import Taken, Trial
from procedures.position_loops.movers import motion, radial
from procedures.position_loops.recorded import LEVITATED
from procedures.shared import signals

UM = 1e6
LIMITED = 2e-3  # share of telemetry's samples
MORE = 3.0  # times as much scatter of windows as everywhere else
TAILS = 0.15  # of the mean largest reading: more than rounding and a slow motion make of normal noise


def of_trials(trials: Sequence[Trial], gate_m: float, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """A gate that passed while a probe was beyond it; probes on which that was not tried."""
    if not plan.trial or not motion(rig).radial:
        why = (
            "the plan leaves it out"
            if not plan.trial
            else "the rig file's capabilities.motion tells no radial set points"
        )
        yield Finding("gate-not-tried", f"which readings the gate watches was not tried: {why}.", "")
        return
    passed = [t for t in trials if LEVITATED in [rig.binding.mode(s) for s in t.states]]
    for t in passed:
        if t.pulsed:
            text = (f"the controller counted as levitated while {t.probe} went {t.farthest * UM:.1f} µm off every "
                    f"{_between(plan, rig):.2g} s, {gate_m * UM:.3g} µm allowed: it looks at readings that are "
                    "filtered, and single "
                    "ones that the margin counts do not keep it shut.")  # fmt: skip
            yield Finding("gate-filtered", text, t.probe, Effect.INDETERMINATE, (GATE,))
        else:
            stood = f"{t.nearest * UM:.1f} to {t.farthest * UM:.1f} µm off, {gate_m * UM:.3g} µm allowed"
            text = (f"the controller counted as levitated while {t.probe} stood {stood}: its gate does not watch {t.probe}, or "
                    "sees it late through a filter. Further probes were not tried.")  # fmt: skip
            yield Finding("gate-unwatched", text, t.probe, Effect.INDETERMINATE, (GATE,))
    weak = [t for t in trials if t not in passed and (t.farthest if t.pulsed else t.nearest) <= gate_m]
    tried = {t.probe for t in trials if t not in weak}
    if not passed and (left := [p for p in motion(rig).radial if p not in tried]):
        text = f"{', '.join(left)} did not stay beyond the gate during the lift: whether it watches them is not known."
        yield Finding("gate-trial-short", text, left[0], Effect.INDETERMINATE, (GATE,))
    if not passed and not left and any(t.pulsed for t in weak):
        text = "the short moves beyond the gate did not get there: whether it looks at filtered readings is not known."
        yield Finding("gate-trial-short", text, weak[0].probe, Effect.INDETERMINATE, (GATE,))


def _between(plan: Plan, rig: RigFile) -> float:
    return plan.trial_gates * rig.parameters[motion(rig).gate_time].default / plan.pulses


def of_signals(taken: Sequence[Taken], gate: tuple[float, float], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Not lifted, not captured, not held, losses, drift."""
    expected = len(grid(plan))
    if len(taken) < expected:
        text = f"found {len(taken)} places; expected {expected}: the gate did not pass, or the run was stopped early"
        yield Finding("places-missing", text, "", Effect.ERROR)
        return
    short = [t for t in taken if len(t.readings) < plan.windows * samples(gate[1], 1 / t.step_s if t.step_s else 1.0)]
    if short or not all(t.step_s for t in taken):
        worst = next((t for t in taken if not t.step_s), short[0] if short else taken[0])
        text = (f"at {len(short)} of {len(taken)} places the windows were not captured. Telemetry reads up to "
                f"{worst.telemetry * UM:.2f} µm, but leaves readings out: {(gate[0] - worst.telemetry) * UM:.2f} µm "
                "is a bound of the "
                "margin from above, and no margin.")  # fmt: skip
        yield Finding("windows-not-captured", text, worst.place.name, Effect.ERROR)
        return
    for t in taken:
        if other := [s for s in t.states if rig.binding.mode(s) != LEVITATED]:
            text = f"the controller was in {', '.join(other)}: it did not hold the shaft."
            yield Finding("not-levitated", text, t.place.name, Effect.ERROR)
            return
    lost, wanted = np.array([(t.lost, t.expected) for t in taken], dtype=float).T
    yield from signals.losses(lost, wanted, plan.max_lost, lambda share: taken[int(np.argmax(share))].place.name)
    if worn := [t for t in taken if t.limited > LIMITED]:
        worst = max(worn, key=lambda t: t.limited)
        text = (f"at {len(worn)} of {len(taken)} places a bearing's force was at its limit at rest, "
                f"{worst.limited:.1%} of the time "
                "in the worst: nothing is to spare then. Noise that drives it so far? Another observer?")  # fmt: skip
        yield Finding("force-limited", text, worst.place.name, Effect.INDETERMINATE, (GATE, CATCH))
    for t in taken:
        yield from _drift(t, gate[1], rig, plan)


def _drift(t: Taken, gate_s: float, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    means: Array = cut(t.readings, samples(gate_s, 1 / t.step_s)).mean(axis=1)
    third = max(len(means) // 3, 1)
    moved = np.abs(means[-third:].mean(axis=0) - means[:third].mean(axis=0))
    k = int(np.argmax(moved))
    if moved[k] > plan.max_drift_m:
        text = (f"{list(radial(rig))[k]} drifts by {moved[k] * UM:.2f} µm over the windows, "
                f"{plan.max_drift_m * UM:.3g} µm allowed. "
                "Settle longer.")  # fmt: skip
        yield Finding("unsettled", text, t.place.name, Effect.INDETERMINATE, (f"{GATE}@{t.place.name}", CATCH))


def of_results(found: Results, rig: RigFile) -> Iterator[Finding]:
    """Windows that differ more at one place, noise that is none of a normal kind, and what the largest reading was."""
    scatters = [float(x.largest.var(ddof=1)) for x in found.looked]
    for k, x in enumerate(found.looked):
        others = float(np.mean(np.delete(scatters, k))) if len(scatters) > 1 else scatters[k]
        if scatters[k] > MORE**2 * others and np.ptp(x.largest) > 4 * _count(rig):
            text = (f"largest readings of {len(x.largest)} windows are {x.largest.min() * UM:.2f} to "
                    f"{x.largest.max() * UM:.2f} µm, "
                    f"{MORE:g} times as far apart as elsewhere: something comes and goes there.")  # fmt: skip
            yield Finding("windows-differ", text, x.taken.place.name, Effect.INDETERMINATE,
                          (f"{GATE}@{x.taken.place.name}",))  # fmt: skip
        mean = float(x.largest.mean())
        if mean > x.normal * (1 + TAILS) + _count(rig):
            text = (f"the largest reading is {mean * UM:.2f} µm in the mean, {x.normal * UM:.2f} µm for normal "
                    "noise of its size: single "
                    "readings that stand out, which count all the same.")  # fmt: skip
            yield Finding("noise-not-normal", text, x.taken.place.name)
    top = max(found.looked, key=lambda x: float(x.largest.max()))
    count = sum(len(x.largest) for x in found.looked)
    told = max(x.taken.telemetry for x in found.looked)
    text = (f"of {count} windows of {found.gate_s * 1e3:g} ms the largest single reading is "
            f"{top.largest.max() * UM:.2f} µm, at "
            f"{top.taken.place.name}; telemetry shows {told * UM:.2f} µm. A margin is that of one window in the "
            "mean: the largest reading of a "
            "longer time is greater.")  # fmt: skip
    yield Finding("largest-reading", text)


def _count(rig: RigFile) -> float:
    """Of the converter that has the coarsest one."""
    assert rig.capture is not None
    return max(rig.capture.channels[c].scale for c in radial(rig).values())
