"""Hum at a switch: what a line in the probes makes of its drop and its residual."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from bench.findings import Effect, Finding
from bench.uncertainty import Estimate, interval
from procedures.compensation.switching import TURNS_AT, TURNS_LEFT, WITHIN_S, Switched, rms
from procedures.synchronous.hum import REACH, Heard, describe, leak_over


def of_switch(found: Heard | None, s: Switched, switched: Mapping[str, Estimate], where: str) -> Iterator[Finding]:
    """A line that may move the drop or the residual of a switch by more than its expanded uncertainty. Neither is of more than
    some ten turns, in which much is near the speed."""
    if found is None:
        return
    size = rms(s.between(float(s.t[0]), -s.turn)[0])
    for name, turns, begin, over in (
        ("drop", TURNS_AT, WITHIN_S, size),
        ("residual", TURNS_LEFT, float(s.t[-1]) - (TURNS_LEFT + 1) * s.turn, 1.0),
    ):
        lasts, known = turns * s.turn, interval(switched[name]).U
        lines = found.lines(1 / s.turn - REACH / lasts, 1 / s.turn + REACH / lasts)
        off = [(x.size * leak_over(s.tacho, begin, lasts, x.hz) / over, x) for x in lines]
        worst = max(off, key=lambda o: o[0], default=None)
        if worst is not None and worst[0] > known:
            text = (f"{describe(worst[1])} At the switch, at {1 / s.turn:.2f} Hz, the {name} may be off by "
                    f"{worst[0] / known:.1f} times its U.")  # fmt: skip
            yield Finding("hum", text, where, Effect.INDETERMINATE, (f"{name}@{where}",))
