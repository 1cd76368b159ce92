"""What can be wrong with an angle step, and what its data can say about it. Each check names its suspect."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.uncertainty import coverage_factor
from procedures.angle_step.estimates import Result
from procedures.angle_step.plan import Plan
from procedures.angle_step.response import Loop, kick_A
from procedures.angle_step.steps import Case, Done
from procedures.servomotor.conventions import Servomotor

FATAL = ("stuck-channel",)
SMALL = 0.9  # of the segments' limit: a step whose demand stays below it should not meet it
CARRIES_A = 4.0  # i_y that the shaft's weight takes at T Table 6.2's force constant (T (6.8), corrected)
UNEXPECTED = 2e-3  # s, of saturation; single samples may come from a noisy encoder


def of_signals(moves: Sequence[Done], machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    """Lost samples, stuck channels, contact, amplifiers at their limits while nothing moves."""
    shares = [d.lost / max(d.expected, 1) for d in moves]
    worst = int(np.argmax(shares))
    if shares[worst] > plan.max_lost:
        yield Finding(
            "missing-samples",
            f"{shares[worst]:.2%} of the samples of a step are missing ({plan.max_lost:.2%} is allowed). Look at the link: "
            "load, cable, gateway.",
            moves[worst].case.where, Effect.INDETERMINATE,
        )  # fmt: skip
    for channel in sorted({c for d in moves for c in d.stuck}):
        yield Finding(
            "stuck-channel", f"{channel} does not move at all; a live sensor has noise.", channel, Effect.ERROR
        )
    for bits, of, code, text in (
        (machine.contact, "flags", "contact", "the rotor touched a touchdown bearing"),
        (machine.amb_limit, "flags", "current-saturated", "an AMB amplifier was at its limit"),
        (machine.segment_limit, "rest_flags", "saturated-at-rest",
         "a segment of the motor was at its limit before the step: it carries more than it should"),
    ):  # fmt: skip
        hit = [d for d in moves if getattr(d, of) & bits]
        if hit:
            places = tuple(dict.fromkeys(f"@{d.case.where}" for d in hit))
            said = f"{text} in {len(hit)} of {len(moves)} steps"
            yield Finding(code, said, hit[0].case.where, Effect.INDETERMINATE, places)


def of_responses(results: Mapping[Case, Result], plan: Plan, loops: Mapping[Case, Loop]) -> Iterator[Finding]:
    """Steps that do not settle, torque at rest, saturation that the step does not explain."""
    for case, result in results.items():
        if not all(math.isfinite(r.settling) for r in result.responses):
            yield Finding("not-settled", "the angle is still outside its band at the end of the record: record longer, or look "
                          "at the integrator and at what holds the rotor.", case.where, Effect.ERROR)  # fmt: skip
        if result.short:
            yield Finding("capture-short", f"{result.short} of {len(result.responses)} captures end before their step has "
                          "settled: it is read from telemetry, and currents are left out. The reference was written late, or "
                          "the loop is slow.", case.where, Effect.INDETERMINATE, (f"@{case.where}",))  # fmt: skip
    yield from _holding(results, plan)
    for case, result in results.items():
        demand = CARRIES_A + kick_A(loops[case], case.size)
        longest = max(r.saturated for r in result.responses)
        if case.allocation == "static" and demand < SMALL * loops[case].limit_A and longest > UNEXPECTED:
            yield Finding(
                "saturated-small-step",
                f"a segment was at its limit for {longest * 1e3:.0f} ms in a step that should ask for {demand:.1f} A of "
                f"{loops[case].limit_A:g} A: the motor carries more than it should, or its gains are not those of the plan.",
                case.where, Effect.INDETERMINATE, (f"@{case.where}",),
            )  # fmt: skip


def _holding(results: Mapping[Case, Result], plan: Plan) -> Iterator[Finding]:
    """Torque current while the rotor stands: a levitated rotor needs none but against drag."""
    held = [
        (abs(current), current, case)
        for case, result in results.items()
        for r in result.responses
        for current in r.hold
    ]
    most, current, case = max(held, key=lambda h: h[0])
    if most > plan.max_hold_A:
        yield Finding(
            "holding-torque",
            f"standing still takes {current:+.3f} A of torque current ({plan.max_hold_A:g} A allowed): something turns the "
            "rotor, such as a large detent, a rub or a load.",
            case.where, Effect.INDETERMINATE,
        )  # fmt: skip


def compared(results: Mapping[Case, Result]) -> Iterator[Finding]:
    """Static against priority at each size: how much of the excursion is left."""
    for case, static in results.items():
        other = results.get(Case("priority", case.size, case.filter_hz))
        if case.allocation != "static" or other is None:
            continue
        a, b = static.estimates["excess"], other.estimates["excess"]
        text = (f"at {np.degrees(case.size):g}° ({case.filter_hz:g} Hz) the peak rises {a.value * 1e6:.1f} µm above standstill "
                f"with the static and {b.value * 1e6:.1f} µm with the priority transformation")  # fmt: skip
        if a.value > 3 * a.u:
            ratio = b / a
            dof = min(len(static.responses), len(other.responses)) - 1
            text += f": {ratio.value:.3f} ± {coverage_factor(dof) * ratio.u:.3f} of it is left"
        else:
            text += ", which is within the uncertainty of nothing: this step does not tell them apart"
        yield Finding("allocations-compared", f"{text}.", f"{np.degrees(case.size):g}°, {case.filter_hz:g} Hz")
