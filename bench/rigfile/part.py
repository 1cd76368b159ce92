"""The kind of table that a rig file is made of."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler
from pydantic_core import CoreSchema


class Part(BaseModel):
    """A table of the rig file: frozen, no unknown keys, no NaN, no text or `true` for a number. Built with the whole that it
    is part of, not by itself too."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        schema = handler(source)
        _as_written(schema)
        return schema


def _as_written(schema: Any) -> None:
    """Where a number belongs it is one, whole or not: `true` would be 1 A, and "0.1" is what somebody meant otherwise."""
    if isinstance(schema, dict):
        if schema.get("type") == "float":
            schema["strict"] = True
        for inner in schema.values():
            _as_written(inner)
    elif isinstance(schema, list | tuple):
        for inner in schema:
            _as_written(inner)
