"""Numbers with a tolerance, as certificates and data sheets state them."""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from bench import units
from bench.errors import ConfigError
from bench.rigfile.part import Part

Distribution = Literal["normal", "rectangular", "triangular", "arcsine"]
UNKNOWN_UNIT: Final = "unknown_unit"
DIVISOR = {"rectangular": math.sqrt(3), "triangular": math.sqrt(6), "arcsine": math.sqrt(2)}


class Toleranced(Part):
    """A number with what is known of its error: `u` (with its coverage factor `k`), or `half_width`. SI after reading.

    `id` is what budgets and calibrations know it by, where that is not its place in the file; `certificate` a key of
    [certificates].
    """

    value: float
    unit: str
    u: float | None = Field(None, ge=0)
    k: float = Field(1.0, gt=0)
    half_width: float | None = Field(None, ge=0)
    distribution: Distribution
    source: str = Field(min_length=1)
    id: Annotated[str, Field(pattern=r"^([\w.-]+(/[\w.-]+)+)?$")] = ""
    certificate: str = ""

    @model_validator(mode="before")
    @classmethod
    def _si(cls, data: Any) -> Any:
        if isinstance(data, dict) and isinstance(data.get("unit"), str):
            try:
                unit = units.unit(data["unit"])
            except ConfigError as error:  # reported with its key and next to the other problems
                raise PydanticCustomError(UNKNOWN_UNIT, "unknown unit", {"symbol": data["unit"]}) from error
            scaled = {n: data[n] * unit.factor for n in ("u", "half_width") if _number(data.get(n))}
            if _number(data.get("value")):
                scaled["value"] = data["value"] * unit.factor + unit.offset
            return {**data, **scaled, "unit": unit.si}
        return data

    @model_validator(mode="after")
    def _one_width(self) -> Toleranced:
        if (self.u is None) == (self.half_width is None):
            raise ValueError("expected either u (normal) or half_width (rectangular, triangular, arcsine)")
        if (self.u is not None) != (self.distribution == "normal"):
            raise ValueError(
                f"distribution {self.distribution!r} goes with {'u' if self.distribution == 'normal' else 'half_width'}"
            )
        return self

    @property
    def standard_uncertainty(self) -> float:
        """One standard deviation, SI."""
        if self.u is not None:
            return self.u / self.k
        return (self.half_width or 0.0) / DIVISOR[self.distribution]


def simulated(value: Any) -> Any:
    """Tables with a `distribution` become Toleranced, at any depth; everything else stays."""
    if isinstance(value, dict):
        return (
            Toleranced.model_validate(value) if "distribution" in value else {k: simulated(v) for k, v in value.items()}
        )
    return value


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
