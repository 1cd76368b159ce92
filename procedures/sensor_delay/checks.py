"""What can be wrong with delays of position sensors, and what their data can say about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.position_loops import recorded
from procedures.position_loops.injection import ability
from procedures.sensor_delay.estimates import Result
from procedures.sensor_delay.plan import Plan
from procedures.sensor_delay.sines import crossover_hz
from procedures.sensor_delay.steps import Taken
from procedures.shared import signals

OFF = 0.05  # share by which the captured sine may differ from what was asked for
UNEXPLAINED = 1e-4  # chance that a sound run's phases lie so far off a delay's line, all probes together
BEFORE = 4.5  # standard uncertainties by which a reading may be early


def of_signals(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing injected or captured, not levitated, another sine than was asked for, loops at their limit, losses."""
    if not taken:
        yield Finding("no-sines", "no sine was injected; expected those of the plan (was the run stopped early?)", "",
                      Effect.ERROR)  # fmt: skip
        return
    missing = [t for t in taken if not t.positions.size]
    if (told := recorded.not_captured("sine-not-captured", "sines", missing, len(taken))) is not None:
        yield told
        return
    if (told := recorded.not_held(((t.where, t.states) for t in taken), rig)) is not None:
        yield told
        return
    yield from signals.losses_of(taken, plan.max_lost)
    if ability(rig).wave and (wrong := [t for t in taken if abs(t.wave - 1) > OFF]):
        text = (f"the captured sine has {wrong[0].wave:.3g} of the amplitude asked for: another frequency, or none. Look at "
                "the rig file's capabilities.loop_injection.")  # fmt: skip
        yield Finding("sine-wrong", text, wrong[0].where, Effect.ERROR)
    if hit := [t for t in taken if t.limited > 0]:
        worst = max(hit, key=lambda t: t.limited)
        text = (f"a loop was at its limit in {len(hit)} of {len(taken)} sines ({worst.limited:.1%} of the time in the worst). "
                "What it makes of its readings is no matter here: current and position are both measured.")  # fmt: skip
        yield Finding("loop-limited", text, worst.where, Effect.NOTE)


def of_results(results: Sequence[Result], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Currents that do not tell loops apart, phases that are no delay's, delays lost in noise or before the current; what a
    delay costs."""
    if not results:
        yield Finding("lines-missing", "found fewer than two lines that every loop has.", "", Effect.ERROR)
        return
    worst = max(results[0].lines, key=lambda x: x.condition)
    if worst.condition > plan.max_condition:
        text = (f"the currents of the loops' sines are nearly alike, condition {worst.condition:.3g}: a loop's sine does not "
                "come into its own current.")  # fmt: skip
        yield Finding("currents-alike", text, f"{worst.hz:.4g} Hz", Effect.INDETERMINATE)
    for r in results:
        yield from _of_probe(r, len(results), rig, plan)


def _of_probe(r: Result, count: int, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    of, where, u = (f"delay@{r.probe.channel}",), r.probe.channel, r.estimate.u
    if r.delay.fit.p_value < UNEXPLAINED / count:
        text = (f"phases are off those of a delay by more than their noise, chi-squared {r.delay.fit.chi2:.3g} of "
                f"{r.delay.fit.dof} degrees of freedom: something damps or springs, or couples that no current "
                "tells.")  # fmt: skip
        yield Finding("misfit", text, where, Effect.INDETERMINATE, of)
    if u > plan.max_u_s:
        text = (f"the delay is known to {u * 1e6:.2g} µs, standard uncertainty; {plan.max_u_s * 1e6:g} are wanted. Inject "
                "more, or longer.")  # fmt: skip
        yield Finding("delay-not-told", text, where, Effect.INDETERMINATE, of)
    if r.estimate.value < -BEFORE * u:
        text = (f"the position is read {-r.estimate.value * 1e6:.3g} µs before the current: their samples are not of one "
                "instant.")  # fmt: skip
        yield Finding("position-early", text, where, Effect.INDETERMINATE, of)
    if (hz := crossover_hz(rig, r.probe.loop)) is not None:
        text = (f"{360 * hz * r.estimate.value:.2f}° of phase margin at {hz:.0f} Hz, where the loop's gain is 1 by its own "
                f"numbers (360 f τ, standard uncertainty {360 * hz * u:.2f}°).")  # fmt: skip
        yield Finding("margin-cost", text, where, Effect.NOTE)
