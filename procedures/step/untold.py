"""What the steps of a rig do not tell, and why. A quantity that is left out where a sound machine has it is put in doubt by
name: a limit for all places does not pass by those that are left."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import StrEnum

from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from procedures.step.coupled import hardly_swings
from procedures.step.estimates import Result, one_group
from procedures.step.fit import swing
from procedures.step.position import tilting_of
from procedures.step.response import SCAN_HZ
from procedures.step.steps import Case

OF_CASE, OF_SIZES, OF_GROUP = (
    ("overshoot", "bandwidth"),
    ("size_effect", "way_effect"),
    ("damping", "natural_frequency"),
)
AGAIN = "Repeat more often, take larger steps, or faster telemetry."
ASTRAY = (
    "not without one of them, not with what is taken for granted of a second oscillation a little off, or they do not follow "
    "it, so that nothing says how uncertain it is"
)

OBLIQUE = (
    "the axes of a bearing are not at right angles and each has a control of its own: a step along y or z swings "
    "along both, with two oscillations that lie far apart. One is what would be fitted: overshoot, settling, "
    "bandwidth, damping and frequency are not told; rise and error are."
)
GYROSCOPIC = (
    "the shaft turns, and a step along one axis swings along the other one too, as where the centre of mass is beyond the "
    "bearings and gyroscopic moments turn a tilt: y and z share four oscillations. Two are what would be fitted: overshoot, "
    "settling, bandwidth, damping and frequency are not told; rise and error are."
)


class Why(StrEnum):
    """Why a group of steps tells no damping: one of two oscillations hardly swings; the fit to all steps stands, and not those
    with one left out or with what is taken for granted moved."""

    TORN = "torn"
    ASTRAY = "astray"


def groups(results: Mapping[Case, Result], told: Mapping[str, Mapping[str, Estimate]], rig: RigFile) -> dict[str, Why]:
    """Those of the groups `told` that tell no damping though an oscillation fits all of their steps."""
    out = {}
    for group in (name for name, found in told.items() if "damping" not in found):
        ones = one_group(group, results)
        try:
            if ones:
                out[group] = Why.TORN if hardly_swings(swing(ones, tilting=tilting_of(rig))) else Why.ASTRAY
        except AnalysisError:
            continue
    return out


def find_untold(
    results: Mapping[Case, Result], told: Mapping[str, Mapping[str, Estimate]], why: Mapping[str, Why], rig: RigFile
) -> Iterator[Finding]:
    """Of each case that lacks an overshoot or a bandwidth, with what its group lacks by that; of groups that go astray."""
    named: set[str] = set()
    for case, result in results.items():
        lacking = [q for q in OF_CASE if q not in result.estimates]
        if not lacking or result.shared:
            continue
        concerned = [f"{q}@{case.where}" for q in lacking]
        if case.group not in named and "overshoot" in lacking:
            named.add(case.group)
            concerned += [f"{q}@{case.group}" for q in OF_SIZES if q not in told.get(case.group, {})]
        text = f"{_reason(result)}: {' and '.join(lacking)} of these steps are not told. {AGAIN}"
        yield Finding("fit-unsteady", text, case.where, Effect.INDETERMINATE, tuple(concerned))
    for group in (g for g, reason in why.items() if reason is Why.ASTRAY):
        text = (
            f"an oscillation fits all of these steps, and {ASTRAY}: damping and natural frequency are not told. {AGAIN}"
        )
        yield Finding("fit-unsteady", text, group, Effect.INDETERMINATE, tuple(f"{q}@{group}" for q in OF_GROUP))


def _reason(result: Result) -> str:
    if result.swing is None:
        return "no oscillation that dies away fits these steps, none without one of them, or they do not follow it"
    return (
        f"the gain does not fall by 3 dB up to {SCAN_HZ[-1]:g} Hz, not without one of these steps, or it dips to just that "
        "below another crossing"
    )
