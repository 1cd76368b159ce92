"""What can be wrong with a mass-hanging calibration, and what its data can say about it. Each check names its suspect.

Thresholds are chosen so that a sound rig trips one in fewer than one run in a thousand; each is stated where it stands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
from procedures.amb_calibration.scatter import Scatter
from procedures.amb_calibration.steps import AXES, VERTICAL, HangingData
from procedures.servomotor import checks as servomotor_checks
from procedures.servomotor.conventions import Servomotor
from procedures.shared import signals

Array = npt.NDArray[np.float64]

FATAL = ("stuck-channel", "no-response", "axes-exchanged", "bearings-exchanged", "wrong-sign", "masses-exchanged")
"""Findings after which a fit means nothing and is not attempted."""
NAMES = ("inboard", "outboard")
WIRED_WRONG = "wired-wrong"  # event: changes of the control currents under the first mass, A
MOST_WRONG = 0.03  # relative: a set of masses that is off by more would be seen by eye


def of_signals(data: HangingData, machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    """Checks that need no fit: losses, stuck channels, saturation, contact, settling, wiring."""
    table = data.table
    yield from servomotor_checks.of_signals(table, machine, tuple(table.mean), plan.max_lost)
    vertical = {machine.positions[axis]: machine.coils[axis] for axis in VERTICAL}
    yield from signals.settled(table.mean, table.drift, vertical, plan.max_position_m, plan.max_drift_A, table.where)
    yield from _wiring(data, machine)


def _wiring(data: HangingData, machine: Servomotor) -> Iterator[Finding]:
    """Signs and axes, from how the control currents answer the load: the outboard AMB pulls more (positive), the
    inboard one less (negative), the horizontal axes hardly at all (the axes stand within a few mrad of the plumb).
    `acquire` asks the same after the first hanging."""
    load = data.hangings.load
    heavy, light = load == load.max(), load < 0

    def answer(axis: str) -> float:
        control = machine.control(axis, data.table.mean.__getitem__)
        return float(control[heavy].mean() - control[light].mean())

    yield from wiring(*(answer(axis) for axis in AXES))


def of_first(recording: Recording[Any]) -> Iterator[Finding]:
    """What the first hanging showed, where the run ended by it."""
    for event in recording.events(WIRED_WRONG):
        yield from wiring(*(float(event["changes"][axis]) for axis in AXES))
    yield from both_coils.of_first(recording)


def wiring(yi: float, yo: float, xi: float, xo: float) -> Iterator[Finding]:
    """Findings by the changes of the four control currents in A under the heaviest mass."""
    exchanged = [name for name, y, x in (("inboard", yi, xi), ("outboard", yo, xo)) if abs(x) > 0.5 * abs(y)]
    if exchanged:
        yield Finding(
            "axes-exchanged",
            f"the horizontal currents answer a vertical load at the {' and '.join(exchanged)} AMB (y {yi:+.3f}, "
            f"{yo:+.3f} A; x {xi:+.3f}, {xo:+.3f} A for the heaviest mass): x and y look exchanged.",
            "/".join(exchanged),
            Effect.ERROR,
        )
    elif yi > 0 > yo:
        yield Finding(
            "bearings-exchanged",
            f"the inboard current rises ({yi:+.3f} A) and the outboard one falls ({yo:+.3f} A) under the load: inboard "
            "and outboard look exchanged, or both current signs are wrong.",
            "i_yi, i_yo",
            Effect.ERROR,
        )
    else:
        for channel, name, value, expected in (("i_yi", "inboard", yi, -1), ("i_yo", "outboard", yo, 1)):
            if value * expected <= 0:
                yield Finding(
                    "wrong-sign",
                    f"the {name} control current changes by {value:+.3f} A under the heaviest mass; a load outboard of "
                    f"the outboard AMB makes it {'rise' if expected > 0 else 'fall'}. Check the sign of its sensors.",
                    channel,
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
    for b in (0, 1):
        if hysteresis[b] > 1e-3:
            yield Finding(
                "hysteresis",
                f"loading and unloading differ by {2 * hysteresis[b]:.2%} of the load range at the {NAMES[b]} AMB; it "
                "is taken out of K by the branch term.",
                NAMES[b],
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
    for b in (0, 1):
        e = np.abs(s.rest[b])
        limit = max(8 * 1.4826 * float(np.median(e)), 3e-3 * float(np.ptp(f.forces[b])))
        if e.max() > limit:
            yield Finding(
                "outlier",
                f"one hanging is {e.max():.3f} N off the fit of the {NAMES[b]} AMB ({limit:.3f} N allowed); was the "
                "right mass hung, and was the hanger on?",
                data.table.where(e),
                Effect.INDETERMINATE,
            )
