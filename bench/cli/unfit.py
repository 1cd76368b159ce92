"""What a plan asks too much of a rig, found before anything is started."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from bench import units
from bench.errors import ConfigError
from bench.procedure import BenchPlan, Procedure
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope


def unfit(procedure: Procedure, rig: RigFile, plan: BenchPlan) -> Iterator[str]:
    """What the procedure itself says of it, then the parameters that it would write out of their range, with the settings of
    the plan that say so."""
    yield from procedure.check(rig, plan)
    envelope = Envelope(rig)
    for name, value in procedure.settings(rig, plan).items():
        for problem in envelope.problems_of({name: value}):
            yield problem + _where(
                procedure.name, plan, value, rig.parameters[name].unit if name in rig.parameters else ""
            )


def _where(procedure: str, plan: BenchPlan, value: float, unit: str) -> str:
    """Which settings have that value in that unit, and where they are set."""
    keys = [key for key in type(plan).model_fields if unit and _unit(key) == unit and _has(getattr(plan, key), value)]
    if not keys:
        return ""
    where = f"in [plans.{procedure}] of the rig file, or by --plan {keys[0]}=VALUE"
    return f"; it is {' or '.join(keys)} of the plan: set it {where}"


def _unit(key: str) -> str:
    try:
        return units.split_suffix(key)[2]
    except ConfigError:
        return ""


def _has(setting: Any, value: float) -> bool:
    return value in setting if isinstance(setting, tuple) else setting == value
