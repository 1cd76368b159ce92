"""What a balancing's recording says: findings, each naming its suspect, and the result where there is one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from bench.analysis.balance import G_MM, bound
from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.units import RPM
from procedures.balance import apart, decision, estimates, planes
from procedures.balance.estimates import Balanced
from procedures.balance.plan import Plan
from procedures.balance.steps import (
    BASE,
    DECISION,
    LIGHTER,
    REFUSED,
    TAKEN_OFF,
    Recorded,
    Run,
)
from procedures.synchronous import checks as dwell_checks
from procedures.synchronous.bearings import Known
from procedures.synchronous.dwells import SLOW

WORST_CONDITION = 50.0  # of the influence coefficients
SPEEDS_APART = 2e-3
DIFFERS = (
    0.02  # of what was mounted: how far a verification may be from the prediction, beside three times its uncertainty
)


def refusals(recording: Recording[Any]) -> Iterator[Finding]:
    for e in recording.events(LIGHTER):
        text = (f"{e['allowed_kg'] * 1e3:.3g} g was fixed in place of {e['kg'] * 1e3:g} g: beside what the shaft does already, "
                "more would leave the plan's share of the clearance.")  # fmt: skip
        yield Finding(LIGHTER, text, str(e["plane"]))
    for e in recording.events(TAKEN_OFF):
        text = (f"the trial weight was taken off before the one {e['plane']} was fixed: with both the shaft could leave the "
                "plan's share of the clearance. The influence of both is told against the base run.")  # fmt: skip
        yield Finding(TAKEN_OFF, text, str(e["taken"]))
    for e in recording.events(REFUSED):
        text = (
            f"the trial weight of {e['kg'] * 1e3:g} g {e['plane']} was refused: beside what the shaft does already its "
            f"predicted response would leave the plan's share of the clearance. Allowed are {e['allowed_kg'] * 1e3:.3g} g, too "
            "little to tell its effect by. Begin at a speed, or under a law, where the shaft moves less."
        )
        yield Finding("trial-refused", text, str(e["plane"]), Effect.ERROR)
    for e in recording.events(DECISION):
        if e["too_heavy_kg"]:
            text = (f"the correction needs {e['too_heavy_kg'] * 1e3:.3g} g in one place, more than the envelope allows: it "
                    "was not mounted.")  # fmt: skip
            yield Finding("correction-refused", text, str(e["run"]), Effect.ERROR)


def of_runs(recorded: Recorded, rig: RigFile, plan: Plan, known: Known) -> Iterator[Finding]:
    """Loose parts, forces, trial weights."""
    for run in recorded.runs:
        yield from decision.find_slips(run)
    base = next((r for r in recorded.runs if r.name == BASE), None)
    if base is None:
        return
    yield from _speeds(recorded)
    off = decision.slow_runout(recorded.slow, base, rig, known)
    looked = [estimates.balance_forces(d, off, rig, known) for d in recorded.dwells if d.kind != SLOW]
    yield from dwell_checks.channels(looked)
    yield from dwell_checks.weight(looked)
    shown: list[decision.Shown] = []
    named = {r.name: r for r in recorded.runs}
    last = base
    for side in planes.names_of(rig):
        having = named.get(f"trial {side}")
        if having is None or not having.weights:
            return
        before = decision.before_trial(base, last, having)
        shown.append(decision.observe(before, having, having.weights[-1], rig, known))
        yield from decision.of_trial(shown[-1])
        last = having
    yield from decision.of_trials(shown[0], shown[1])


def _speeds(recorded: Recorded) -> Iterator[Finding]:
    """Influence coefficients hold for one speed: differences of readings at two are none."""
    for k in range(len(recorded.runs[0].reads)):
        speeds = np.array([r.reads[k].speed for r in recorded.runs])
        apart = float(np.ptp(speeds) / speeds.mean())
        if apart > SPEEDS_APART:
            text = (f"the runs' speeds at {speeds.mean() * RPM:.0f} r/min are {apart:.2%} apart; {SPEEDS_APART:.1%} is "
                    "allowed: the response to unbalance changes with speed.")  # fmt: skip
            yield Finding("speeds-differ", text, "", Effect.INDETERMINATE)


def of_parts(balance: Balanced) -> Iterator[Finding]:
    """Whether all that was read of the base run says the same unbalance."""
    base = balance.trials.base
    if base.name in balance.unbalance:
        yield from apart.parts_apart(balance.apart, balance.unbalance[base.name], balance.planes)


def of_result(balance: Balanced, recorded: Recorded, shown: list[Run], plan: Plan, rig: RigFile) -> Iterator[Finding]:
    """Was it reached, did the corrections act as predicted, and the sheet."""
    if balance.solved.condition > WORST_CONDITION:
        text = (f"the condition of the influence coefficients is {balance.solved.condition:.0f}: the probes do not tell the "
                "planes apart.")  # fmt: skip
        yield Finding("planes-not-told-apart", text, "", Effect.ERROR)
    for before, after in pairwise(shown):
        if after.name.startswith("check"):
            yield from predicted(balance, before, after, rig)
    name = shown[-1].name
    values = balance.unbalance[name]
    for p, side in enumerate(planes.names_of(rig)):
        size, most, per = abs(values.values[p]), bound(values.one(p)), balance.permissible[p].value
        text = (f"{side}: U_res {size / G_MM:.2f}, U {(most - size) / G_MM:.2f}, together {most / G_MM:.2f} g mm; U_per "
                f"{per / G_MM:.2f} g mm (G{plan.grade_m_s * 1e3:g} at {plan.service_rad_s * RPM:.0f} r/min).")  # fmt: skip
        if most <= per:
            yield Finding("reached", text, name)
        else:
            # The limit on residual_share says so too: a share that fails is not put in doubt by it.
            yield Finding(
                "not-reached", text, name, Effect.INDETERMINATE, (f"residual_cos@{side}", f"residual_sin@{side}")
            )
    for p, plane in enumerate(balance.planes):
        side, seen = plane.name, balance.solved.influence[-1, :, p] * plane.turned(1.0 + 0j)
        some = ", ".join(
            f"{axis} {abs(a):.3f} µm ∠{-math.degrees(np.angle(a)) % 360:.0f}°"
            for axis, a in zip(recorded.machine.axes, seen, strict=True)
        )
        text = (f"1 g mm at the scale's zero of the {side} plane, {max(plan.speeds_rad_s) * RPM:.0f} r/min (0-pk, phase "
                f"lag): {some}; condition of all {balance.solved.condition:.1f}.")  # fmt: skip
        yield Finding("influence", text, side)
    yield from sheet(recorded, "correction-sheet", rig, plan)


def predicted(balance: Balanced, before: Run, after: Run, rig: RigFile) -> Iterator[Finding]:
    """What was measured against what was expected of the weights that were fixed in between."""
    sides, both = planes.names_of(rig), balance.planes
    added = estimates.sum_weights(after.weights, both) - estimates.sum_weights(before.weights, both)
    expected = balance.unbalance[before.name].values + added
    found = balance.unbalance[after.name]
    off = found.values - expected
    scale = float(np.abs(added).max())
    told = ", ".join(
        f"{side} {abs(e) / G_MM:.2f} g mm, found {abs(v) / G_MM:.2f} g mm"
        for side, e, v in zip(sides, expected, found.values, strict=True)
    )
    over = np.abs(off) - DIFFERS * scale - 3 * _between(balance, before, after)
    if over.max() > 0:
        worst = sides[int(np.argmax(over))]
        text = (f"predicted {told}: the correction did not act as it should, most {worst}. Suspect a weight of another "
                "mass, at another angle or in the other plane than the sheet says, or one that came loose.")  # fmt: skip
        yield Finding("correction-not-as-stated", text, after.name, Effect.INDETERMINATE)
    else:
        yield Finding("verified", f"predicted {told}.", after.name)


def _between(balance: Balanced, before: Run, after: Run) -> np.ndarray:
    """Standard uncertainty by plane (2,), kg m, of what a correction should have changed and did: the budget of the difference
    of both runs, and the tolerances of the weights that were fixed in between."""
    own = np.zeros(2)
    for w in after.weights:
        if w not in before.weights:
            plane = balance.planes[w.plane]
            radius = plane.radius.value
            mass, angle = plane.weight_mass.standard_uncertainty, plane.weight_angle.standard_uncertainty
            own[w.plane] += (radius * mass) ** 2 + (radius * w.kg * angle) ** 2
    pairs = zip(balance.parts[after.name], balance.parts[before.name], strict=True)
    apart = np.array([(a - b).u for a, b in pairs]).reshape(2, 2)
    return np.asarray(np.sqrt(own + (apart**2).sum(axis=1)))


def sheet(recorded: Recorded, code: str, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """The weights that stay on the shaft, for the operator."""
    kept, both = {w.number for w in recorded.on}, planes.planes_of(rig)
    for w, purpose in recorded.fixed:
        if w.number in kept:
            degrees = math.degrees(w.angle) % 360
            plane = both[w.plane]
            radius, holes = plane.radius.value, decision.holes_of(plane, plan)
            place = f" (position {round(degrees / 360 * holes) % holes})" if holes else ""
            text = (f"{purpose}: {w.kg * 1e3:.3f} g in the {plane.name} plane at {degrees:.1f}°{place} of its scale, "
                    f"radius {radius * 1e3:g} mm ({w.kg * radius / G_MM:.2f} g mm), added. "
                    f"{planes.describe(plane)}")  # fmt: skip
            yield Finding(code, text, plane.name)
