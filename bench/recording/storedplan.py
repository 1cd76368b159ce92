"""plan.json: the plan of a run, in SI, with the number of its schema. One without a number is of schema 1."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from bench.errors import ConfigError
from bench.plan import BenchPlan
from bench.rigfile.former_plans import PLAN_SCHEMA, plan_of_schema_1


def written(plan: BenchPlan) -> str:
    """The text of plan.json."""
    return json.dumps({"schema": PLAN_SCHEMA, **plan.model_dump(mode="json")}, allow_nan=False)


def schema_of(stored: Mapping[str, Any]) -> int:
    """The schema of a plan.json."""
    found = stored.get("schema", 1)
    return found if type(found) is int else 0


def migrated(stored: Mapping[str, Any], procedure: str) -> dict[str, Any]:
    """The settings that a plan.json holds, as today's schema has them.

    Raises:
        ConfigError: it is of a newer schema, or of none that there was.
    """
    plan = dict(stored)
    schema, found = schema_of(plan), plan.pop("schema", 1)
    if not 1 <= schema <= PLAN_SCHEMA:
        newer = "; it was written by a newer Levbench" if schema > PLAN_SCHEMA else ""
        raise ConfigError(f"plan.json: schema: found {found!r}; expected 1 to {PLAN_SCHEMA}{newer}")
    return plan_of_schema_1(procedure, plan) if schema == 1 else plan
