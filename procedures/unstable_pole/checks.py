"""What can be wrong with the shots, and what their data can say about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.position_loops.recorded import LEVITATED
from procedures.shared import signals
from procedures.unstable_pole.estimates import Result
from procedures.unstable_pole.plan import Plan
from procedures.unstable_pole.steps import Taken

EXCITED = 0.1  # of the travel along: a tilt of which a finding tells
SURE = 2.0  # standard uncertainties
STILL = 0.1  # of the push: how far held currents may move
UNEXPLAINED = 1.15  # times the readings' own noise that may be left of the fit


def of_signals(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """No shots, none seen, not caught, currents that did not stay, losses."""
    if not taken:
        yield Finding("no-shots", "no currents were held; expected the plan's shots (was the run stopped early?)", "",
                      Effect.ERROR)  # fmt: skip
        return
    if unseen := [t for t in taken if t.seen == 0]:
        text = (f"in {len(unseen)} of {len(taken)} shots the currents were not held, or not captured. Look at the rig file's "
                "capabilities.hold, and whether the controller was levitated.")  # fmt: skip
        yield Finding("hold-not-seen", text, unseen[0].where, Effect.ERROR)
        return
    fell = [t for t in taken if {rig.binding.mode(s) for s in t.states} != {LEVITATED} or t.caught > plan.bound_m]
    if fell:
        worst = max(fell, key=lambda t: t.caught)
        text = (f"after {len(fell)} of {len(taken)} shots the shaft was not back: it read {worst.caught * 1e6:.0f} µm at the "
                "end of the capture. Push less, or hold for less time.")  # fmt: skip
        yield Finding("not-caught", text, worst.where, Effect.ERROR)
    yield from signals.losses_of(taken, plan.max_lost)
    moved = [t for t in taken if t.moved > STILL * plan.push_A]
    if moved:
        text = (f"in {len(moved)} of {len(taken)} shots the currents did not stay where they were held, by "
                f"{max(t.moved for t in moved):.3g} A at most: a limit of current or voltage.")  # fmt: skip
        yield Finding("limited", text, moved[0].where, Effect.INDETERMINATE)
    if early := [t for t in taken if t.early]:
        text = (
            f"{len(early)} of {len(taken)} holds ended before their time, by a reading at {plan.bound_m * 1e6:.3g} µm."
        )
        yield Finding("hold-ended-early", text, "")


def of_results(results: Sequence[Result], plan: Plan) -> Iterator[Finding]:
    """Too little seen of a mode, pushes that tilt, curves that do not explain the readings."""
    for r in results:
        concerns = (f"pole@{r.axis}", f"stiffness@{r.axis}")
        (growth, u), (tilt, u_tilt) = r.growth, r.tilt
        if growth < plan.min_growth_m:
            text = (f"pushes of {plan.push_A:g} A move the shaft by {growth * 1e6:.2g} µm to their side, "
                    f"{plan.min_growth_m * 1e6:.3g} µm wanted. Push more, or hold longer; does the push come?")  # fmt: skip
            yield Finding("grew-too-little", text, r.axis, Effect.INDETERMINATE, concerns)
            continue
        share, u_share = abs(tilt) / growth, (u_tilt + abs(tilt) / growth * u) / growth
        if share - SURE * u_share > EXCITED:
            bad = share - SURE * u_share > plan.max_tilt
            text = (f"a push tilts the shaft by {share:.0%} of how far it moves it: planes that pull or push unlike, or a "
                    "centre of mass off their middle. Both modes are fitted.")  # fmt: skip
            text += " So much is none of this: does the push reach both planes?" if bad else ""
            yield Finding(
                "tilt-excited", text, r.axis, Effect.INDETERMINATE if bad else Effect.NOTE, concerns if bad else ()
            )
        worst = max(r.release.left[k] / r.release.noise[k] for k in (0, 1))
        if worst > UNEXPLAINED:
            text = (f"{worst:.2f} times the readings' own noise is left of the fit: something else moves the shaft, or the "
                    "magnets' pull is not proportional to the way.")  # fmt: skip
            yield Finding("misfit", text, r.axis, Effect.INDETERMINATE, concerns)
