"""What can be wrong with load balancing. Each check names its suspect."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.uncertainty import Estimate, coverage_factor
from procedures.load_balancing import fit, inputs
from procedures.load_balancing.estimates import Result, Turns, loads_of
from procedures.load_balancing.plan import Plan
from procedures.load_balancing.steps import (
    AFTER,
    BEFORE,
    FACTS_SEEN,
    LOADS_SEEN,
    STEP,
    Around,
    Complex,
    bins,
    mean_currents,
    of_way,
    place,
)
from procedures.servomotor import checks
from procedures.servomotor.conventions import Servomotor
from procedures.shared import signals
from procedures.shared.gradients import linearised

FATAL = ("stuck-channel", "missing-turns")
HALF = 0.5  # of a step's samples
ALLOWED = 0.002  # of the reduction: what slew, delay and observer add to a quasi-static formula, see the page
SIDE_N = 3.0  # of constant horizontal load that decides the side; what the observer's noise may add is a sixth of it
CHANGED = 0.01  # of the turn, and of |i_x| in the mean: readings near zero have either sign
OBSERVED = 0.01  # by which its load may differ in size from that of the currents, and in direction, rad
BEYOND = 1.02  # of what the phase angle was told: the capture is of single precision, its clock of 50 ppm
SIZE, TURNED_RAD = 0.003, math.radians(0.2)  # of the load's change: what the torque current adds to it
OFF_RAD = math.radians(0.06)  # of the phase angle, beside its U: slew and delay


def of_losses(recording: Recording[Plan]) -> Iterator[Finding]:
    """Samples that steps have lost, before anything is made of the others. More than half of a step are no turns any more."""
    steps, allowed = list(recording.steps(STEP)), recording.plan.max_lost
    if not steps:
        return
    lost, expected = np.array([(s.lost(), s.expected()) for s in steps], dtype=float).T

    def where(share: fit.Array) -> str:
        labels = steps[int(np.argmax(share))].labels
        return place(str(labels["when"]), str(labels["way"]), int(labels["repeat"]))

    gone = (lost > HALF * expected).any()
    for found in signals.losses(lost, expected, allowed, where):
        yield replace(found, effect=Effect.ERROR) if gone else found


def of_parts(around: Sequence[Around], plan: Plan) -> Iterator[Finding]:
    """Parts of the circle that no turn of a step has a sample of."""
    worst = max(around, key=lambda a: a.unheld)
    if worst.unheld:
        yield Finding(
            "missing-samples",
            f"{worst.unheld} of the {bins(plan)} parts of the circle hold no sample in any of a step's {plan.turns} turns. "
            f"Give a larger bin_s (found {plan.bin_s:g} s) or more turns, or look at the link: load, cable, gateway.",
            worst.where, Effect.ERROR,
        )  # fmt: skip


def of_signals(around: Sequence[Around], machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    """Turns that are missing, stuck channels, limits and contact."""
    for way, _ in plan.signs:
        for when in (BEFORE, AFTER):
            if len(found := of_way(around, way, when)) < plan.repeats:
                text = f"found {len(found)} repeats {way}, {when}; expected {plan.repeats} (was the run stopped early?)"
                yield Finding("missing-turns", text, way, Effect.ERROR)
    for channel in sorted({c for a in around for c in a.stuck}):
        yield Finding(
            "stuck-channel", f"{channel} does not move at all; a live sensor has noise.", channel, Effect.ERROR
        )
    for bits, code, text in checks.limits(machine):
        hit = [a for a in around if a.flags & bits]
        if hit:
            yield Finding(code, f"{text} in {len(hit)} of {len(around)} steps", hit[0].where, Effect.INDETERMINATE)


def of_law(around: Sequence[Around], plan: Plan, model: Mapping[str, float], poles: float) -> Iterator[Finding]:
    """What the controller does by itself: side, bounds, its view of the load."""
    balanced = [a for a in around if a.when == AFTER]
    for a in balanced:
        x = mean_currents(a.segments.mean(axis=0)).real * a.branch
        other = x < 0
        if other.mean() > CHANGED and float(np.abs(x[other]).sum()) > CHANGED * float(np.abs(x).sum()):
            yield Finding(
                "side-changes",
                f"i_x has the other sign on {other.mean():.0%} of the turn: the load's direction is not followed without a "
                "jump, so that gamma passes zero under load (delta wrapped into two quadrants).", a.where, Effect.INDETERMINATE,
            )  # fmt: skip
            break
    furthest, fastest = (
        max(float(np.abs(a.gamma).max()) for a in balanced if a.gamma is not None),
        max(a.fastest for a in balanced),
    )
    for found, told, what, unit in (
        (furthest, plan.gamma_max_rad, "goes to", "°"), (fastest, plan.gamma_slew_rad_s, "turns by up to", "°/s")
    ):  # fmt: skip
        if found > BEYOND * told:
            text = f"gamma {what} {math.degrees(found):.2f}{unit}; it was told {math.degrees(told):.2f}{unit}."
            yield Finding("phase-limits-differ", text, "gamma", Effect.INDETERMINATE)
    if furthest > math.pi / 2 / poles:
        yield Finding(
            "torque-reversed",
            f"gamma went to {math.degrees(furthest):.2f}°, and beyond {90 / poles:.2f}° the motor's torque acts the other way: "
            f"the rotor turned by up to {math.degrees(max(a.turned for a in balanced)):.3g}° before gamma came back.",
            "gamma", Effect.INDETERMINATE,
        )  # fmt: skip
    yield from _observed(balanced, model, poles)


def _observed(balanced: Sequence[Around], model: Mapping[str, float], poles: float) -> Iterator[Finding]:
    """The observer's load over -alpha_eff e^(j phi) i, by the model that the controller was told: 1 on any machine."""
    ratio = 0j
    for a in balanced:
        assert a.gamma is not None
        assert a.observed is not None
        angle = poles * a.gamma.mean(axis=0)
        eff = model["alpha_d"] * np.cos(angle) + 1j * model["alpha_c"] * np.sin(angle)
        own: Complex = -eff * mean_currents(a.segments.mean(axis=0))
        seen = a.observed.mean(axis=0)
        ratio += complex((seen * own.conj()).sum() / (np.abs(own) ** 2).sum()) / len(balanced)
    off = abs(ratio) - 1
    if max(abs(off), abs(np.angle(ratio))) > OBSERVED:
        yield Finding(
            "observer-differs",
            f"the controller has a load {off:+.1%} of that which its currents and its model of the motor give, turned by "
            f"{math.degrees(float(np.angle(ratio))):+.1f}°: its constants are not those it was told, or it does not "
            "know what its currents are.", "observer", Effect.INDETERMINATE,
        )  # fmt: skip


def of_side(results: Mapping[str, Result], plan: Plan, model: Mapping[str, float]) -> Iterator[Finding]:
    """The side to which balancing went, against the constant load as the controller has it when it begins."""
    for result in results.values():
        if len(result.groups) > 1:
            counts = " and ".join(f"{len(g)} turns with i_x {'+' if g.law.branch > 0 else '-'}" for g in result.groups)
            text = f"{counts}: the constant load has hardly a horizontal part, so that noise decides; values are means."
            yield Finding("branch-undecided", text, result.way)
        for group in result.groups:
            across = constant_across(group, plan, model)
            if abs(across) > SIDE_N and (across > 0) != (group.law.branch < 0):
                yield Finding(
                    "balancing-branch",
                    f"the constant load as the controller had it when balancing began was {across:+.1f} N across; "
                    "gamma followed the load to the other side than that.", result.way, Effect.INDETERMINATE,
                )  # fmt: skip


def constant_across(t: Turns, plan: Plan, model: Mapping[str, float]) -> float:
    """Horizontal part in N of what the controller takes for constant in the load, at the phase at which balancing begins: minus
    alpha_d i less its stiffness times the position, by its own model."""
    path, current = t.path_before.mean(axis=0), t.before.mean(axis=0)
    at = round(plan.engage_rad / (2 * math.pi) * len(path)) % len(path)
    near = np.take(current, at + np.arange(-3, 4), mode="wrap").mean()
    return float((-model["alpha_d"] * near - model["stiffness"] * path[at]).real)


def of_results(results: Mapping[str, Result], given: Mapping[str, Estimate]) -> Iterator[Finding]:
    """Measured against predicted: reduction, phase angle, stiffness."""
    for way, result in results.items():
        yield from _reduction(way, result)
        yield from _gamma(way, result, given)
        yield from _stiffness(way, result, given)


def _reduction(way: str, result: Result) -> Iterator[Finding]:
    measured = result.estimates["reduction"]
    for source in (LOADS_SEEN, FACTS_SEEN):
        apart = measured - result.estimates[f"predicted/{source}"]
        allowed = coverage_factor(8) * 1.2 * apart.u + ALLOWED
        if abs(apart.value) > allowed:
            yield Finding(
                "not-as-predicted",
                f"the largest i_y changes by {measured.value:+.1%}, and by the quasi-static formula {source} by "
                f"{measured.value - apart.value:+.1%}: {abs(apart.value) * 100:.2f} points apart, {allowed * 100:.2f} allowed. "
                "Look at how gamma is led, and at whether the adopted constants are this machine's.", way, Effect.INDETERMINATE,
            )  # fmt: skip
            return


def _gamma(way: str, result: Result, given: Mapping[str, Estimate]) -> Iterator[Finding]:
    """Mean distance of gamma from where it should be, where it is neither at its bound nor led by its slew."""
    off, weight, rms = gamma_off(result.main, result.values)
    if weight < 0.1:
        return
    allowed = 2.5 * given["gamma_0"].u + OFF_RAD
    if abs(off) > allowed or rms > 10 * OFF_RAD:
        yield Finding(
            "gamma-differs",
            f"gamma stands {math.degrees(off):+.3f}° (rms {math.degrees(rms):.3f}°) off the angle at which the load by the "
            f"adopted constants is balanced ({math.degrees(allowed):.3f}° allowed): its bound, its slew or its law is another.",
            way, Effect.INDETERMINATE,
        )  # fmt: skip


def gamma_off(t: Turns, p: Mapping[str, float]) -> tuple[float, float, float]:
    """Mean in rad of gamma less that by the load, the share of the turn that is looked at, and the rms."""
    _, load = loads_of(t, p)[LOADS_SEEN]
    goal, seen = fit.balanced(load, t.law, p).gamma, t.gamma.mean(axis=0)
    free = (np.maximum(np.abs(goal), np.abs(seen)) < 0.98 * t.law.limit) & (np.abs(load) > 0.5 * np.abs(load).max())
    if not free.any():
        return 0.0, 0.0, 0.0
    off = (seen - goal)[free]
    return float(off.mean()), float(free.mean()), float(np.sqrt((off**2).mean()))


def _stiffness(way: str, result: Result, given: Mapping[str, Estimate]) -> Iterator[Finding]:
    """How the load changes along the circle, over the adopted stiffness: in size, and in direction. The magnets pull the way in
    which the shaft is moved; a load that is turned against the path has its field turned by another gamma_0."""

    def model(p: dict[str, float]) -> dict[str, float]:
        ratio = along_circle(result.main, p)
        return {"size": abs(ratio), "angle": math.atan2(ratio.imag, ratio.real)}

    found = linearised(model, given)
    size, angle = found["size"], found["angle"]
    if abs(size.value - 1) > 3 * size.u + SIZE:
        yield Finding(
            "stiffness-differs",
            f"along the circle the load changes {size.value:.3f} times as much as the adopted stiffness has it "
            f"(± {2 * size.u:.3f}): a constant, a probe's gain or a current sensor's is not what it was when they "
            "were adopted.", way, Effect.INDETERMINATE,
        )  # fmt: skip
    allowed = 3 * angle.u + TURNED_RAD
    if abs(angle.value) > allowed:
        yield Finding(
            "load-turned",
            f"along the circle the load changes in a direction that is turned by {math.degrees(angle.value):+.2f}° against the "
            f"path ({math.degrees(allowed):.2f}° allowed): the field is not where gamma_0 has it. Has the encoder's zero moved "
            "since force-coupling?", way, Effect.INDETERMINATE,
        )  # fmt: skip


def along_circle(t: Turns, p: Mapping[str, float]) -> complex:
    """The load's first harmonic over k times the path's."""
    load = fit.load(t.before.mean(axis=0), 0.0, p)
    k = p["alpha_x_prime"] * inputs.of_amb_plane(*(p[key] for key in inputs.LENGTHS))
    path = t.path_before.mean(axis=0)
    true = path.real / p["gain_xo"] + 1j * path.imag / p["gain_yo"]
    own = true - true.mean()
    return complex(((load - load.mean()) * own.conj()).sum() / (k * np.abs(own) ** 2).sum())
