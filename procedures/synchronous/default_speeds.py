"""The speeds of a plan on a rig whose envelope does not allow those that it has by default."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bench.plan import BenchPlan
from bench.rigfile import RigFile
from procedures.synchronous.fitting import SLOW_MOST, SLOWEST

STANDS_OFF = 0.95  # of the envelope's speed, which a drive overshoots


def within_envelope(rig: RigFile, plan: type[BenchPlan], *names: str) -> Mapping[str, Any]:
    """These settings, rad/s, slowed alike where the fastest is beyond the envelope, and with them a slow roll that would be
    none beside the slowest of `speeds_rad_s`. Nothing where none is possible: by its default the plan is refused."""
    of = {name: plan.model_fields[name].default for name in names}
    fastest = max(max(v) if isinstance(v, tuple) else v for v in of.values())
    most = rig.envelope.max_speed_rad_s
    if fastest <= most:
        return {}
    share = STANDS_OFF * most / fastest
    out = {name: tuple(s * share for s in v) if isinstance(v, tuple) else v * share for name, v in of.items()}
    rolls = SLOW_MOST * min(out.get("speeds_rad_s", (STANDS_OFF * most,)))
    if rolls < SLOWEST:
        return {}
    return {**out, "slow_rad_s": rolls} if rolls < plan.model_fields["slow_rad_s"].default else out
