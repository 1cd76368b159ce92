"""What can be wrong with a mass-hanging calibration, and what its data can say about it. Each check names its suspect.

Thresholds are chosen so that a sound rig trips one in fewer than one run in a thousand; each is stated where it stands.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.uncertainty.coverage import coverage_factor
from procedures.amb_calibration import both_coils, hypotheses
from procedures.amb_calibration.fit import Fit
from procedures.amb_calibration.hypotheses import CHANCE, Contradiction, Suspect
from procedures.amb_calibration.plan import Plan
from procedures.amb_calibration.pulls import Loaded, Pull, axes
from procedures.amb_calibration.scatter import Scatter
from procedures.amb_calibration.steps import HangingData
from procedures.shared import signals

Array = npt.NDArray[np.float64]

FATAL = ("stuck-channel", "no-response", "axes-exchanged", "bearings-exchanged", "wrong-sign", "masses-exchanged")
"""Findings after which a fit means nothing and is not attempted."""
WIRED_WRONG = "wired-wrong"  # event: changes of the control currents under the first mass, A
MOST_WRONG = 0.03  # relative: a set of masses that is off by more would be seen by eye
ASKEW = 0.06  # of the answer along the pull: 3.4 degrees, by which K changes by 0.2 % where the axis is along it
EXCHANGED = 0.5  # of the loaded axis' answer, that of an axis across the pull


def of_signals(data: HangingData, meanings: tuple[signals.Meaning, ...], plan: Plan) -> Iterator[Finding]:
    """Checks that need no fit: losses, stuck channels, saturation, contact, settling, wiring."""
    table, pull = data.table, data.hangings.pull
    yield from signals.losses(table.lost, table.expected, plan.max_lost, table.where)
    yield from signals.stuck(table.spread, tuple(table.mean))
    yield from signals.flagged(table.flags, meanings, table.where)
    loaded = {axis.position: axis.coils for axis in pull.axes}
    yield from signals.settled(data.held, table.drift, loaded, plan.max_position_m, plan.max_drift_A, table.where)
    yield from _wiring(data)


def _wiring(data: HangingData) -> Iterator[Finding]:
    """Signs and axes, from how the control currents answer the load. `acquire` asks the same after the first hanging."""
    load, pull = data.hangings.load, data.hangings.pull
    heavy, light = load == load.max(), load < 0
    mean = data.table.mean

    def answer(axis: Loaded) -> float:
        control = (mean[axis.coils[0]] - mean[axis.coils[1]]) / 2
        return float(control[heavy].mean() - control[light].mean())

    changes = {axis.name: answer(axis) for axis in axes(pull)}
    wrong = list(wiring(pull, data.hung, changes))
    yield from wrong or askew(pull, changes)


def askew(pull: Pull, changes: Mapping[str, float]) -> Iterator[Finding]:
    """An axis across the pull shows how the bearing is turned: at right angles it answers by lean_a K_b / (lean_b K_a) of what
    the axis along the pull does, of which the force constants' ratio is known to a third."""
    for own in (
        a for a in pull.axes if a.key == a.name
    ):  # a bearing that a motor turns between is by the thesis' equations
        for other in (a for a in pull.across if a.mate == own.name):
            seen, should = changes[other.name] / changes[own.name], other.lean / own.lean
            if abs(seen - should) > ASKEW + abs(should) / 3:
                text = (
                    f"under the heaviest mass the current along {other.name} changes by {seen:+.2f} of that along {own.name}; "
                    f"by the directions of the rig file it should by {should:+.2f}: suspect bearings.{own.bearing}.axes, the "
                    "direction of the pull, or what zero_at and up say."
                )
                yield Finding("pull-askew", text, own.bearing, Effect.INDETERMINATE)


def of_first(
    recording: Recording[Any], pulls: Iterable[Pull], hung: Mapping[str, tuple[float, float]]
) -> Iterator[Finding]:
    """What the first hanging showed, where the run ended by it; `hung` by hook, as for `wiring`."""
    known = {pull.hook: pull for pull in pulls}
    for event in recording.events(WIRED_WRONG):
        pull = known[event.get("hook", next(iter(known)))]
        yield from wiring(pull, hung[pull.hook], {name: float(x) for name, x in event["changes"].items()})
    yield from both_coils.of_first(recording, known.values())


def wiring(pull: Pull, hung: tuple[float, float], changes: Mapping[str, float]) -> Iterator[Finding]:
    """Findings by the changes of the control currents in A under a mass, by axis. `hung` is the share of it that the near
    and the
    far bearing carry: what is hung beyond a bearing makes that one pull more against it, and the other one less; axes across
    the
    pull answer hardly at all (they stand within a few mrad of right angles)."""
    told = ", ".join(f"{name} {x:+.3f} A" for name, x in changes.items())
    crossed = [b for b in pull.axes if any(
        abs(changes[a.name]) > EXCHANGED * abs(changes[b.name]) for a in pull.across if a.mate == b.name)]  # fmt: skip
    right = {axis.name: changes[axis.name] * hung[axis.plane] * axis.lean > 0 for axis in pull.axes}
    if crossed:
        names = " and ".join(axis.bearing for axis in crossed)
        text = (f"the currents across the load answer it at the {names} AMB ({told} for the heaviest mass): x and y look "
                "exchanged.")  # fmt: skip
        yield Finding("axes-exchanged", text, "/".join(axis.bearing for axis in crossed), Effect.ERROR)
    elif not any(right.values()) and len({axis.plane for axis in pull.axes}) > 1:
        one, two = (f"{pull.bearings[0]}", f"{pull.bearings[1]}")
        text = (f"every control current answers the load the other way round ({told}): {one} and {two} look exchanged, or all "
                "current signs are wrong.")  # fmt: skip
        yield Finding("bearings-exchanged", text, ", ".join(right), Effect.ERROR)
    else:
        for axis in pull.axes:
            if not right[axis.name]:
                should = "rise" if hung[axis.plane] * axis.lean > 0 else "fall"
                yield Finding(
                    "wrong-sign",
                    f"the control current of the {axis.title} changes by {changes[axis.name]:+.3f} A under the heaviest mass; "
                    f"a load on that hook makes it {should}. Check the sign of its sensors, and which coil is which.",
                    axis.name,
                    Effect.ERROR,
                )


def of_fit(
    data: HangingData,
    f: Fit,
    s: Scatter,
    c: Contradiction,
    beyond: float,
    p: Mapping[str, float],
    plan: Plan,
    u_mass: Array,
) -> Iterator[Finding]:
    """Checks of the fit: loads that contradict each other, single hangings that stand out, hysteresis. `beyond` is what each
    mass is less sure by than its certificate says (`hypotheses.scatter_of_set`)."""
    mistaken = hypotheses.mistaken(c, beyond)
    for found in _loads(data, c, p, plan, u_mass):
        text = f"{found.text} No value is stated: {beyond:.1%} of each mass is no scatter of a set."
        yield replace(found, text=text, effect=Effect.ERROR) if mistaken else found
    if beyond > 0 and not mistaken:
        text = (
            f"the loads agree worse than certificates and scatter say (by chance with a probability of {c.probability:.1g}): "
            f"{beyond:.2%} of each mass, from the data, is in the budget beside its certificate."
        )
        yield Finding("loads-scatter", text, "masses")
    yield from _outliers(data, f, s)
    span = np.ptp(f.forces, axis=(1, 2))
    hysteresis = np.abs(f.terms[:, :, 3].mean(axis=1)) / span
    for b, axis in enumerate(f.pull.axes):
        if hysteresis[b] > 1e-3:
            yield Finding(
                "hysteresis",
                f"loading and unloading differ by {2 * hysteresis[b]:.2%} of the load range at the {axis.title}; it "
                "is taken out of K by the branch term.",
                axis.where,
            )


def _loads(
    data: HangingData, c: Contradiction, p: Mapping[str, float], plan: Plan, u_mass: Array
) -> Iterator[Finding]:  # fmt: skip
    if c.probability > CHANCE:
        return
    said = f"the loads contradict each other (chi-squared {c.total:.0f} of {len(c.seen)})"
    pair = hypotheses.exchanged(data.hangings, p, plan.bias_A, u_mass)
    if pair is not None:
        a, b = (data.masses[k] for k in pair)
        text = f"{said}; they agree if {a} and {b} are exchanged: each hung where the other was asked for. Look at the labels."
        yield Finding("masses-exchanged", text, f"{a}, {b}", Effect.ERROR)
        return
    found = hypotheses.suspects(c)
    plausible = [x for x in found if x.misfit < found[0].misfit + 10 and x.chance > CHANCE]
    if not plausible:
        text = f"{said}; no single mass that is wrong would make them agree, nor would two that are exchanged."
        yield Finding("load-inconsistent", text, "masses", Effect.INDETERMINATE)
        return
    k = coverage_factor(c.dof)
    text = " or ".join(_suspicion(data.masses, x.load, x.extra_kg, k * x.u_kg, p) for x in plausible)
    yield Finding(
        "load-inconsistent",
        f"{said}; the data agree if {text}.{_all_others(data.masses, plausible[0], p)}",
        ", ".join(data.masses[x.load] if x.load >= 0 else "no load" for x in plausible),
        Effect.INDETERMINATE,
    )


def _all_others(masses: tuple[str, ...], x: Suspect, p: Mapping[str, float]) -> str:
    """The same data with the suspect as stated: errors of the others that go with the square of the load, which K2 takes."""
    if x.load < 0:
        return ""
    per_kg = -x.extra_kg / p[f"mass_{x.load}"] ** 2
    rest = [(masses[k], per_kg * p[f"mass_{k}"]) for k in range(len(masses)) if k != x.load]
    if max(abs(share) for _, share in rest) > MOST_WRONG:
        return ""
    text = ", ".join(f"{label} by {share:+.2%}" for label, share in rest)
    return (
        f" They agree as well if {masses[x.load]} is right and the others are off with the square of the load: {text}."
    )


def _suspicion(masses: tuple[str, ...], load: int, extra: float, u: float, p: Mapping[str, float]) -> str:
    """`u` kg is the expanded uncertainty."""
    if load >= 0:
        stated = p[f"mass_{load}"]
        return f"{masses[load]} is {stated + extra:.4f} kg ± {u:.4f} kg instead of {stated:.4f} kg"
    if abs(extra + p["hanger"]) < max(2.5 * u, 0.05 * p["hanger"]):
        return f"the hanger ({p['hanger']:.3f} kg) was off when nothing hung (missing {-extra:.4f} kg ± {u:.4f} kg)"
    return f"{extra:+.4f} kg ± {u:.4f} kg hung at no load"


def _outliers(data: HangingData, f: Fit, s: Scatter) -> Iterator[Finding]:
    """Single hangings beyond eight robust standard deviations and 0.3 % of the load range."""
    for b, axis in enumerate(f.pull.axes):
        e = np.abs(s.rest[b])
        limit = max(8 * 1.4826 * float(np.median(e)), 3e-3 * float(np.ptp(f.forces[b])))
        if e.max() > limit:
            yield Finding(
                "outlier",
                f"one hanging is {e.max():.3f} N off the fit of the {axis.title} ({limit:.3f} N allowed); was the "
                "right mass hung, and was the hanger on?",
                data.table.where(e),
                Effect.INDETERMINATE,
            )
