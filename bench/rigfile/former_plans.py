"""What plans of schema 1 had by default and today's leave to the rig file: laws, axes and sizes of the AMB stand.

Plans of schema 1 are those of recordings whose plan.json has no schema, and of rig files of schema 1. Their procedures knew one
stand; today a plan that says nothing goes by the rig: the law that the controller is set to, its axes, its gaps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

PLAN_SCHEMA = 2

BY_DEFAULT: Mapping[str, Mapping[str, Any]] = {
    "step": {"a": {"law": 1.0}},
    "bearing-model": {"law": "CCS", "spacing_m": 20e-6, "radius_m": 82e-6, "biases_A": [1.15, 0.8]},
    "tracking": {"laws": ["CCS", "CAC"], "compare": ["PID"], "y_m": 50e-6, "z_m": 80e-6},
    "unbalance": {"law": "CCS"},
    "compensation": {"law": "CCS"},
    "balance": {"law": "CCS"},
    "run-up": {"law": "CCS"},
    "coast-down": {"law": "CCS"},
    "sensitivity": {"law": "PID", "axes": ["yi", "zi", "yo", "zo", "x"], "speeds_rad_s": [0.0, 10000 * math.pi / 30],
                    "modes_hz": [650.0, 1240.0]},
}  # fmt: skip
"""By procedure."""


def plan_of_schema_1(procedure: str, plan: Mapping[str, Any]) -> dict[str, Any]:
    """A plan of schema 1, whole or in part, as schema 2 has it: what it says itself stays."""
    return {**BY_DEFAULT.get(procedure, {}), **plan}


def plans_of_schema_1(data: Mapping[str, Any]) -> dict[str, Any]:
    """The table `plans` of a rig file of schema 1; a controller without a parameter `law` had none to choose from."""
    stated = data.get("plans", {})
    parameters = data.get("parameters", {})
    if not isinstance(stated, dict) or not isinstance(parameters, dict) or "law" not in parameters:
        return {"plans": stated} if "plans" in data else {}
    names = [*stated, *(name for name in BY_DEFAULT if name not in stated)]
    tables = {name: stated.get(name, {}) for name in names}
    return {
        "plans": {
            name: plan_of_schema_1(name, table) if isinstance(table, dict) else table for name, table in tables.items()
        }
    }
