"""What can be wrong with a mass-hanging calibration, and what its data can say about it. Each check names its suspect.

Thresholds are chosen so that a sound rig trips one in fewer than one run in a thousand; each is stated where it stands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy import special

from bench.findings import Effect, Finding
from procedures.estimators import mass_hanging, signals
from procedures.estimators.hanging_data import COILS, POSITIONS, HangingData
from procedures.estimators.mass_hanging import Fit
from procedures.estimators.repeatability import Scatter, misfit

Array = npt.NDArray[np.float64]

FATAL = ("stuck-channel", "no-response", "axes-exchanged", "bearings-exchanged", "wrong-sign")
"""Findings after which a fit means nothing and is not attempted."""
NAMES = ("inboard", "outboard")


class Tolerances(Protocol):
    """The part of a plan that these checks need."""

    @property
    def max_position_m(self) -> float: ...
    @property
    def max_drift_A(self) -> float: ...
    @property
    def max_lost(self) -> float: ...


def of_signals(data: HangingData, plan: Tolerances) -> Iterator[Finding]:
    """Checks that need no fit: losses, stuck channels, saturation, contact, settling, wiring."""
    where = partial(_worst, data)
    yield from signals.losses(data.lost, data.expected, plan.max_lost, where)
    yield from signals.stuck(data.spread, (*COILS, *POSITIONS))
    yield from signals.flagged(data.flags, where)
    yield from signals.settled(data.mean, data.drift, ("yi", "yo"), plan.max_position_m, plan.max_drift_A, where)
    yield from _wiring(data)


def _worst(data: HangingData, values: Array) -> str:
    turn, point = np.unravel_index(int(np.argmax(values)), values.shape)
    return data.where(int(turn), int(point))


def _wiring(data: HangingData) -> Iterator[Finding]:
    """Signs and axes, from how the control currents answer the load: the outboard AMB pulls more (positive), the
    inboard one less (negative), the horizontal axes hardly at all (the axes stand within a few mrad of the plumb)."""
    load = data.hangings.load
    heavy, light = load == load.max(), load < 0

    def answer(axis: str) -> float:
        control = (data.mean[f"i_{axis}_p"] - data.mean[f"i_{axis}_n"]) / 2
        return float(control[heavy].mean() - control[light].mean())

    yi, yo, xi, xo = (answer(axis) for axis in ("yi", "yo", "xi", "xo"))
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
    data: HangingData, f: Fit, s: Scatter, p: Mapping[str, float], plan: Tolerances, u_mass: Array
) -> Iterator[Finding]:
    """Checks of the fit: loads that contradict each other, single hangings that stand out, hysteresis."""
    yield from _loads(data, f, s, p, u_mass)
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


def _loads(data: HangingData, f: Fit, s: Scatter, p: Mapping[str, float], u_mass: Array) -> Iterator[Finding]:
    shares = np.array(mass_hanging.hung_shares(p["hook_to_outboard"], p["amb_span"]))
    total, suspects = misfit(f, data.hangings, s, shares * p["gravity"], u_mass)
    if total < special.chdtri(2 * (len(u_mass) - 3), 1e-6):
        return
    best = suspects[0]
    plausible = [x for x in suspects if x.misfit < best.misfit + 10]
    text = " or ".join(_suspicion(data.masses, x.load, x.extra_kg, x.u_kg, p) for x in plausible)
    yield Finding(
        "load-inconsistent",
        f"the loads contradict each other (chi-squared {total:.0f}); the data agree if {text}.",
        ", ".join(data.masses[x.load] if x.load >= 0 else "no load" for x in plausible),
        Effect.INDETERMINATE,
    )


def _suspicion(masses: tuple[str, ...], load: int, extra: float, u: float, p: Mapping[str, float]) -> str:
    if load >= 0:
        stated = p[f"mass_{load}"]
        return f"{masses[load]} is {stated + extra:.4f} kg ± {2 * u:.4f} kg instead of {stated:.4f} kg"
    if abs(extra + p["hanger"]) < max(5 * u, 0.05 * p["hanger"]):
        return f"the hanger ({p['hanger']:.3f} kg) was off when nothing hung (missing {-extra:.4f} kg ± {2 * u:.4f} kg)"
    return f"{extra:+.4f} kg ± {2 * u:.4f} kg hung at no load"


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
                _worst(data, e),
                Effect.INDETERMINATE,
            )
