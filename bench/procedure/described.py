"""What each setting of a plan is, in words: `settings.toml` beside the module that has the plan, a line for each field."""

from __future__ import annotations

import sys
import tomllib
from functools import lru_cache
from pathlib import Path

from bench.plan import BenchPlan

NAME = "settings.toml"


def settings_of(plan: type[BenchPlan]) -> dict[str, str]:
    """By field. A plan that is another one and more has the words of both, its own where both have some; one without such a
    file has none."""
    found: dict[str, str] = {}
    for cls in reversed(plan.__mro__):
        if issubclass(cls, BenchPlan) and cls is not BenchPlan:
            found |= _words(sys.modules[cls.__module__].__file__ or "")
    return {name: found[name] for name in plan.model_fields if name in found}


@lru_cache
def _words(module: str) -> dict[str, str]:
    path = Path(module).with_name(NAME)
    return {k: str(v) for k, v in tomllib.loads(path.read_text(encoding="utf-8")).items()} if path.is_file() else {}
