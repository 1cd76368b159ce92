"""The settings of a run: what every procedure's plan is made of."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class BenchPlan(BaseModel):
    """The settings a procedure is done with, SI. Unknown keys and wrong types are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
