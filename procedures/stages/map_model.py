"""From the terms of a map of inductances to the parameters of the controller that has one, by meaning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bench.calibration import Calibration
from bench.errors import Lacking
from bench.rigfile import RigFile
from procedures.stages.stators import phases

FLUX, CURRENT = "inductance-map", "current_zero"
SOURCES = {FLUX: "", "static-characteristics": "static_"}
"""Procedures that identify a map, and what the names of their quantities begin with."""
WHOLE = {"map_slope": "slope", "map_unaligned": "unaligned", "map_c2": "c2", "map_c3": "c3", "map_length": "length",
         "map_overlap": "overlap", "map_fringe": "fringe", "map_leakage": "leakage", "map_saturation": "saturation",
         "map_centre": "centre"}  # fmt: skip


def names(stators: Sequence[str], phases: Sequence[str]) -> dict[str, str]:
    """By meaning, the quantity of `inductance-map` that it is, with its place."""
    zeros = {f"map_zero_{k + 1}": f"zero@{stator}" for k, stator in enumerate(stators)}
    gains = {f"map_gain_{k + 1}": f"gain@{phase}" for k, phase in enumerate(phases)}
    return {**WHOLE, **zeros, **gains}


def currents(phases: Sequence[str]) -> dict[str, str]:
    """Likewise the zeros of the phases' currents, which a controller may have beside its map."""
    return {f"{CURRENT}_{k + 1}": f"{CURRENT}@{phase}" for k, phase in enumerate(phases)}


def sources(by: str) -> tuple[str, ...]:
    """The procedures of which a map that was identified `by` one of `SOURCES` is made."""
    return tuple(dict.fromkeys((by, FLUX)))


def expected(rig: RigFile, by: str) -> dict[str, tuple[str, str]]:
    """What goes to which parameter of a rig's controller of a map that was identified `by` one of `SOURCES`: parameter,
    procedure and quantity with its place. Leakage, which makes no force, and zeros of currents are those of the pulses.

    Raises:
        Lacking: the controller has no such map, or not all of it.
    """
    some, model = phases(rig), rig.capabilities.model
    told = {
        **names(list(dict.fromkeys(p.motor for p in some)), [p.name for p in some]),
        **currents([p.name for p in some]),
    }
    known = {meaning: q for meaning, q in told.items() if model.get(meaning) in rig.parameters}
    if missing := [meaning for meaning in told if meaning not in known and not meaning.startswith(CURRENT)]:
        raise Lacking(
            f"capabilities.model: found no {', '.join(missing)}; expected the controller's map of inductances"
        )
    return {
        model[meaning]: (FLUX, q) if meaning.startswith((CURRENT, "map_leakage")) else (by, SOURCES[by] + q)
        for meaning, q in known.items()
    }


def identified(rig: RigFile, by: str, facts: Mapping[str, Calibration]) -> dict[str, float]:
    """The controller's map, SI by parameter, as calibrations by procedure have it; what these lack is left out."""
    return {
        name: facts[procedure].values[q].value
        for name, (procedure, q) in expected(rig, by).items()
        if q in facts[procedure].values
    }


def present(rig: RigFile, meaning: str, otherwise: float) -> float:
    """What the controller's map has by default."""
    known = rig.parameters.get(rig.capabilities.model.get(meaning, ""))
    return otherwise if known is None else known.default
