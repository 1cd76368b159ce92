"""From the terms of a map of inductances to the parameters of the controller that has one, by meaning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bench.calibration import Calibration
from bench.errors import Lacking
from bench.rigfile import RigFile
from procedures.stages.stators import phases

SOURCES = {"inductance-map": "", "static-characteristics": "static_"}
"""Procedures that identify a map, and what the names of their quantities begin with."""
WHOLE = {"map_slope": "slope", "map_unaligned": "unaligned", "map_c2": "c2", "map_c3": "c3", "map_length": "length",
         "map_overlap": "overlap", "map_fringe": "fringe", "map_leakage": "leakage", "map_saturation": "saturation",
         "map_centre": "centre"}  # fmt: skip


def names(stators: Sequence[str], phases: Sequence[str]) -> dict[str, str]:
    """By meaning, the quantity of `inductance-map` that it is, with its place."""
    zeros = {f"map_zero_{k + 1}": f"zero@{stator}" for k, stator in enumerate(stators)}
    gains = {f"map_gain_{k + 1}": f"gain@{phase}" for k, phase in enumerate(phases)}
    return {**WHOLE, **zeros, **gains}


def parameters(
    rig: RigFile, values: Mapping[str, float], stators: Sequence[str], phases: Sequence[str]
) -> dict[str, float]:
    """The controller's parameters, SI, of what was measured (`name` or `name@place`)."""
    model = rig.capabilities.model
    return {
        model[meaning]: values[name]
        for meaning, name in names(stators, phases).items()
        if meaning in model and name in values
    }


def expected(rig: RigFile, by: str) -> dict[str, str]:
    """What of a map that was identified `by` a procedure goes to which parameter of a rig's controller: parameter, quantity
    with its place. A map by forces has no leakage, which makes none.

    Raises:
        Lacking: the controller has no such map, or not all of it.
    """
    some, model = phases(rig), rig.capabilities.model
    told = names(list(dict.fromkeys(p.motor for p in some)), [p.name for p in some])
    if missing := [meaning for meaning in told if model.get(meaning) not in rig.parameters]:
        raise Lacking(
            f"capabilities.model: found no {', '.join(missing)}; expected the controller's map of inductances"
        )
    return {
        model[meaning]: SOURCES[by] + quantity
        for meaning, quantity in told.items()
        if not (SOURCES[by] and meaning == "map_leakage")
    }


def adopted(rig: RigFile, calibration: Calibration) -> dict[str, float]:
    """The controller's map, SI by parameter, as a calibration by one of `SOURCES` has it; what that lacks is left out."""
    wanted = expected(rig, calibration.procedure)
    return {name: calibration.values[q].value for name, q in wanted.items() if q in calibration.values}


def present(rig: RigFile, meaning: str, otherwise: float) -> float:
    """What the controller's map has by default."""
    known = rig.parameters.get(rig.capabilities.model.get(meaning, ""))
    return otherwise if known is None else known.default
