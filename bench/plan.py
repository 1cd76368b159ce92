"""The settings of a run: what every procedure's plan is made of."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class BenchPlan(BaseModel):
    """The settings a procedure is done with, SI. Unknown keys and wrong types are refused."""

    # What reads values is built when the first come: a listing reads few plans.
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)
