"""Results in the unit that their field reads: the record holds SI, a quantity may name another unit for its page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bench.units import UNITS

Content = Mapping[str, Any]


def in_unit(measurement: Content, units: Mapping[str, str]) -> Content:
    """A measurement of record.json in the unit that `units` has for its quantity; as it is where there is none, or one of
    another kind."""
    symbol = units.get(str(measurement.get("name", "")), "")
    chosen = UNITS.get(symbol) if symbol else None
    if chosen is None or chosen.si != measurement.get("unit") or chosen.offset:
        return measurement
    per = 1 / chosen.factor

    def scaled(found: Any) -> Any:
        return found * per if isinstance(found, int | float) and not isinstance(found, bool) else found

    out = dict(measurement) | {"unit": symbol}
    for key in ("value", "standard_uncertainty", "expanded_uncertainty"):
        if key in out:
            out[key] = scaled(out[key])
    if out.get("interval"):
        out["interval"] = [scaled(x) for x in out["interval"]]
    if isinstance(out.get("limit"), Mapping):
        out["limit"] = {**out["limit"], **{k: scaled(out["limit"].get(k)) for k in ("low", "high")}}
    if out.get("budget"):
        keys = ("contribution", "sensitivity")
        out["budget"] = [{**e, **{k: scaled(e[k]) for k in keys if k in e}} for e in out["budget"]]
    return out
