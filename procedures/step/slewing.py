"""Whether the controller follows set points at once: one that goes to them at a rate of its own takes longer for a larger step.

A ramp of T = r/s averages the response of a step over T. That comes later by T/2, which the control currents' onset takes away,
and is wider: rise^2 grows by WIDER T^2 (a mean over T has the variance T^2/12, and a rise from 10 to 90 % is some 2.56 standard
deviations; 0.8^2 where the ramp is all). A linear loop rises as fast whatever the size.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from bench.findings import Effect, Finding
from bench.uncertainty import interval
from procedures.step.acting import UNLIKE
from procedures.step.estimates import Result
from procedures.step.steps import Case, Done, by_group, unlike

WIDER = 0.6
SURE = 1.5  # times the expanded uncertainty of the difference
NONLINEAR = 0.01  # of the rise: what bearings make of steps of a tenth of their gap


def of_sizes(results: Mapping[Case, Result]) -> Iterator[Finding]:
    """The rise of the largest steps beside that of the smallest, of each setting, axis and speed; both ways together."""
    for group in dict.fromkeys(case.group for case in results):
        of = {(c.size, c.way): r.estimates["rise_time"] for c, r in results.items() if c.group == group}
        small, large = min(size for size, _ in of), max(size for size, _ in of)
        pairs = [(of[small, way], of[large, way]) for way in (1, -1) if (small, way) in of and (large, way) in of]
        if not pairs or small == large:
            continue
        longer = sum(b.value - a.value for a, b in pairs) / len(pairs)
        rise = sum(a.value for a, _ in pairs) / len(pairs)
        doubt = math.sqrt(sum(interval(e).U ** 2 for pair in pairs for e in pair)) / len(pairs)
        if longer < SURE * doubt + NONLINEAR * rise:
            continue
        slow = rise + longer
        rate = math.sqrt(WIDER * (large**2 - small**2) / (slow**2 - rise**2))
        text = (f"a step of {large * 1e6:g} µm rises in {slow * 1e3:.3g} ms, one of {small * 1e6:g} µm in {rise * 1e3:.3g} ms: "
                f"the controller follows its set points at some {rate * 1e3:.2g} mm/s, or something else limits it; these are "
                "no steps. If it has a rate, bind it as set_points.slew, or set it to none.")  # fmt: skip
        places = (case.where for case in results if case.group == group)
        yield Finding("set-points-slewed", text, group, Effect.INDETERMINATE, (f"@{group}", *(f"@{p}" for p in places)))


def of_starts(steps: list[Done]) -> Iterator[Finding]:
    """Groups in which the currents do not answer as to a jump, so that its instant is known less well."""
    for group, of in by_group(steps).items():
        share = unlike(of)
        if share > UNLIKE:
            text = (f"the control currents answer the set point otherwise than a jump, by {share:.0%} of it: the law pushes as "
                    "the set point goes, as one does that differentiates its error, or the shaft turns the currents round "
                    "within the few samples by which a jump is known, as a light end does; faster telemetry would show which. "
                    f"When a step begins is known to ±{of[0].start_s * 1e3:.2g} ms, and so are settling times.")  # fmt: skip
            yield Finding("start-unclear", text, group)
