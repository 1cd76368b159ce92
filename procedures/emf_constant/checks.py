"""What can be wrong with fluxes by emf, what their data can say about it, and what a nameplate means."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.emf_constant.estimates import Result
from procedures.emf_constant.moves import chosen
from procedures.emf_constant.nameplate import compared
from procedures.emf_constant.plan import Plan
from procedures.emf_constant.steps import Taken
from procedures.position_loops import recorded
from procedures.shared import signals

APART = 4.5  # standard uncertainties that what should be alike may lie apart
GAINS = (
    3.0  # standard uncertainties of a voltage's gain: beyond what a certificate allows one coil against the mean of all
)
UNSEEN = 0.1  # standard uncertainty of a resistance, as a share, from which on it is said


def of_signals(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing moved or captured, not levitated, losses."""
    if not taken:
        yield Finding("no-moves", "the mover was not sent anywhere; expected the plan's moves (was the run stopped early?)", "",
                      Effect.ERROR)  # fmt: skip
        return
    missing = [t for t in taken if t.move is None]
    if (told := recorded.not_captured("move-not-captured", "moves", missing, len(taken))) is not None:
        yield told
        return
    if (told := recorded.not_held(((t.where, t.states) for t in taken), rig)) is not None:
        yield told
        return
    yield from signals.losses_of(taken, plan.max_lost)


def of_results(
    results: Sequence[Result], rig: RigFile, plan: Plan, constants: Mapping[str, Estimate]
) -> Iterator[Finding]:
    """Motors without enough moves, fluxes lost in noise, coils that differ; what is printed, and what force tells."""
    told = {r.winding.motor for r in results}
    if missing := [m for m in chosen(rig, plan) if m not in told]:
        yield Finding("too-few-moves", f"found fewer than four moves there and back of {', '.join(missing)}.", missing[0],
                      Effect.ERROR)  # fmt: skip
        return
    for r in results:
        yield from _seen(r, plan)
        yield from _coils(r, rig, plan)
        yield from _printed(r, rig, plan)
        yield from _reciprocal(r, constants)


def concerned(r: Result) -> tuple[str, ...]:
    """What a motor's flux makes."""
    return tuple(f"{name}@{r.winding.motor}" for name in r.estimates)


def _seen(r: Result, plan: Plan) -> Iterator[Finding]:
    flux, ohm = r.estimates["flux"], r.estimates["resistance"]
    if flux.u > plan.max_u * flux.value:
        text = (f"the flux is known to {flux.u / flux.value:.2g} of it, standard uncertainty; {plan.max_u:g} is wanted. Move "
                "faster, or more often.")  # fmt: skip
        yield Finding("flux-not-shown", text, r.winding.motor, Effect.INDETERMINATE, concerned(r))
    if ohm.u > UNSEEN * abs(ohm.value):
        text = (f"what resistance takes is told from what speed induces to {ohm.u / abs(ohm.value):.2g} of it: currents of "
                "these moves are small, or go with the speed.")  # fmt: skip
        yield Finding("resistance-not-seen", text, r.winding.motor, Effect.NOTE)


def _coils(r: Result, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """A coil that is reversed, exchanged, has lost turns or whose voltage is read wrongly has another flux."""
    mean, count = r.estimates["flux"].value, len(r.by_coil)
    each, scatter = r.by_coil.mean(axis=0) / mean, r.by_coil.std(axis=0, ddof=1) / math.sqrt(count) / mean
    gains = [rig.sensors[v].gain.standard_uncertainty for v in r.winding.voltages.values()]
    beyond = np.abs(each - 1) - plan.coil_share - np.hypot(APART * scatter, GAINS * np.array(gains))
    k = int(np.argmax(beyond))
    if beyond[k] > 0:
        text = (f"it links {each[k]:+.3f} of its motor's flux as its voltage is read: reversed or exchanged, without some of "
                "its turns, or another gain of its voltage.")  # fmt: skip
        yield Finding("coil-differs", text, r.winding.coils[k], Effect.INDETERMINATE, concerned(r))


def _printed(r: Result, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    flux = r.estimates["flux"]
    found = compared(r.winding, flux, rig, plan)
    if found is None:
        return
    said = (f"the flux of {found.nearest}, fits, {found.off:+.1%}" if found.fits
            else f"no convention fits; the nearest, {found.nearest}, is {found.off:+.1%} off")  # fmt: skip
    text = (f"{found.parameter}, {found.printed * 1e3:.4g} mWb, is {found.ratio:.4g} times what a coil links, "
            f"{flux.value * 1e3:.4g} mWb ± {found.share_U:.2%}: {said}.")  # fmt: skip
    yield Finding("nameplate-flux", text, r.winding.motor, Effect.NOTE)


def _reciprocal(r: Result, constants: Mapping[str, Estimate]) -> Iterator[Finding]:
    """What a motor gives an ampere is what it induces at a speed; no convention of a flux is in either."""
    name = "K_emf" if "K_emf" in r.estimates else "K_emf_angle"
    of = {"K_emf": "K_force", "K_emf_angle": "K_torque"}[name]
    known = constants.get(f"{of}@{r.winding.motor}")
    if known is None:
        return
    mine = r.estimates[name]
    apart = mine - known
    flux = r.estimates["flux"].value * known.value / mine.value
    text = (f"by its emf {mine.value:.5g} {mine.unit}, by its force {known.value:.5g}: {apart.value / known.value:+.2%}, with "
            f"u {apart.u / known.value:.2%}. By reciprocity a coil would link {flux * 1e3:.4g} mWb.")  # fmt: skip
    if abs(apart.value) > APART * apart.u:
        yield Finding("reciprocity-broken", text, r.winding.motor, Effect.INDETERMINATE, concerned(r))
    else:
        yield Finding("reciprocity-holds", text, r.winding.motor, Effect.NOTE)
