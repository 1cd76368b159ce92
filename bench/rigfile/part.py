"""The kind of table that a rig file is made of."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Part(BaseModel):
    """A table of the rig file: frozen, no unknown keys, no NaN. Built with the whole that it is part of, not by itself too."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)
