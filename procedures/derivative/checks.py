"""What can be wrong with a measured estimator, and what its data can say about it. Each check names its suspect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile.roles import Status
from procedures.derivative import fit
from procedures.derivative.estimates import Result
from procedures.derivative.fitting import lines_clear
from procedures.derivative.plan import Plan
from procedures.derivative.steps import Taken, lines_of
from procedures.one_axis.bank import LITERAL, RULES, aligned, bank, literal, younger

DETUNED = 3e-5  # of a line's frequency, which the controller makes by its own ticks
SMALL_M = 1e-6  # of a line in the position: less, and nothing was injected
OTHER_SPACINGS = np.arange(0.5, 1.51, 0.05)  # of the one asked for
NEAR = 5  # samples: spacings about it that are tried one by one
TRIED = 3000  # samples that another estimator is tried on


def of_signals(taken: Sequence[Taken], plan: Plan, harmonic_hz: float) -> Iterator[Finding]:
    """Lost samples, contact, currents at their limit, channels that stand still, a line that is not in the position."""
    for t in taken:
        if t.lost / max(t.expected, 1) > plan.max_lost:
            share = t.lost / max(t.expected, 1)
            text = (
                f"{share:.2%} of the samples of a step are missing ({plan.max_lost:.2%} is allowed). Look at the link."
            )
            yield Finding("missing-samples", text, t.where, Effect.INDETERMINATE)
        if t.status & (Status.CONTACT_NEAR | Status.CONTACT_FAR):
            yield Finding("contact", "the body touched its ring during a capture.", t.where, Effect.INDETERMINATE)
        if t.status & Status.CURRENT_LIMIT:
            text = "a coil's current was at the end of its range during a capture: inject less."
            yield Finding("current-saturated", text, t.where, Effect.INDETERMINATE)
        if np.ptp(t.y) == 0 or np.ptp(t.v) == 0:
            yield Finding(
                "stuck-channel", "position or velocity does not move at all during a capture.", t.where, Effect.ERROR
            )
    for t in lines_of(taken):
        design = fit.terms(np.arange(len(t.y)) * t.tick_s, t.hz, harmonic_hz)
        found = np.linalg.lstsq(design, t.y, rcond=None)[0]
        size = float(np.hypot(found[1], found[2]))
        if size < SMALL_M:
            text = f"the position has {size * 1e6:.2g} µm at the injected line: nothing is injected, or at another frequency."
            yield Finding("no-line", text, t.where, Effect.ERROR)
        elif abs(off := fit.detuned(t.y, t.hz, harmonic_hz, t.tick_s)) > DETUNED:
            text = (
                f"the injected line is at another frequency than was told, by {off:.2g} of it ({DETUNED:g} is allowed): "
                "what it is compared with turns away from it."
            )
            yield Finding("line-detuned", text, t.where, Effect.INDETERMINATE)


def of_result(result: Result, taken: Sequence[Taken], plan: Plan) -> Iterator[Finding]:
    """Whether the velocity is what the weights asked for make of the captured position; if not, what it looks like."""
    for where, off in result.mismatch.items():
        if off > plan.max_mismatch:
            t = next(t for t in taken if t.where == where)
            text = (
                f"the velocity is not what degree {plan.degree}, spacing {plan.window_s * 1e3:g} ms and rule {plan.rule} make "
                f"of the captured position: off by {off:.2%} of its rms ({plan.max_mismatch:.2%} allowed). {_likeness(t, plan)}"
            )
            yield Finding("not-this-estimator", text, where, Effect.INDETERMINATE)
            break  # one cause, told once
    worst = max(result.mismatch.values(), default=0.0)
    if worst <= plan.max_mismatch:
        text = f"the velocity is what the weights make of the captured position, to {max(worst, 1e-12):.1g} of its rms."
        yield Finding("is-this-estimator", text, "")
    for name, side in (("edge_low", "below"), ("edge_high", "above")):
        if name not in result.whole:
            text = f"the error does not cross {plan.limit:.1%} {side} the band within the lines: move the lines."
            yield Finding("edge-outside", text, name)


def of_exciter(plan: Plan, harmonic_hz: float) -> Iterator[Finding]:
    """Lines that the plan keeps clear of where the controller takes the exciter to be, and not of where it is."""
    half = plan.model_copy(update={"clear_hz": plan.clear_hz / 2})
    for told in lines_clear(half, harmonic_hz):
        text = f"the exciter turns at {harmonic_hz:.4g} Hz. {told}. Next: move the line, or tell the controller its frequency."
        yield Finding("line-not-clear", text, "", Effect.INDETERMINATE)


def _likeness(t: Taken, plan: Plan) -> str:
    """The estimator of another rule, degree, spacing or equation that explains a capture best, if one does."""
    spacing = round(plan.window_s / t.tick_s)
    tried = {f"rule {r}": bank(plan.degree, spacing, r, t.tick_s) for r in RULES if r != plan.rule}
    tried |= {f"degree {k}": bank(k, spacing, plan.rule, t.tick_s) for k in range(3, 10) if k != plan.degree}
    tried |= {f"degree {plan.degree} {w}": literal(plan.degree, spacing, plan.rule, t.tick_s, w) for w in LITERAL}
    tried |= {
        f"spacing {n * t.tick_s * 1e3:g} ms": bank(plan.degree, n, plan.rule, t.tick_s)
        for n in ({round(f * spacing) for f in OTHER_SPACINGS} | {*range(spacing - NEAR, spacing + NEAR + 1)})
        - {spacing}
    }
    tried["the younger of the two filters, (4.17) the wrong way round"] = younger(
        plan.degree, spacing, plan.rule, t.tick_s
    )
    off = {name: aligned(b.rows, t.y[:TRIED], t.v[:TRIED])[1] for name, b in tried.items()}
    own = bank(plan.degree, spacing, plan.rule, t.tick_s).rows
    off["the same, a sample late"] = aligned(own, t.y[: TRIED - 1], t.v[1:TRIED])[1]
    name = min(off, key=lambda n: off[n])
    return f"It looks like {name}." if off[name] < plan.max_mismatch else "Nor is it any other that was tried."
