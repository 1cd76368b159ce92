"""Propagation through a costly model by its inputs: as many evaluations as inputs, not as elementary influences.

A calibrated constant arrives with dozens of influences, all of which act on the model through that one number. Its
sensitivity is found once and the constant's own influences are scaled by it (GUM 5.1.3, the chain rule).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from bench.uncertainty import Estimate, Influence, propagate

Model = Callable[[dict[str, float]], dict[str, float]]


def by_inputs(model: Model, inputs: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """What `bench.uncertainty.propagate` gives, influences shared between inputs included.

    A model that is not linear over the spread of an input is propagated in full, influence by influence.

    Raises:
        AnalysisError: as `propagate`.
    """
    found = propagate(model, _alone(inputs))
    if any(e.nonlinear for e in found.values()) or any(e.nonlinear for e in inputs.values()):
        return propagate(model, inputs)
    return _chained(found, inputs)


def linearised(model: Model, inputs: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """As `by_inputs`, with a model that is taken as linear whatever it is: for one of many fits, whose Monte Carlo would take
    hours. Coverage over drawn rigs has to show that this will do.

    Raises:
        AnalysisError: as `propagate`.
    """
    return _chained(propagate(model, _alone(inputs)), inputs)


def _alone(inputs: Mapping[str, Estimate]) -> dict[str, Estimate]:
    return {
        name: Estimate.of(e.value, Influence(f"input/{name}", name, e.u, e.unit, "B", "normal"))
        for name, e in inputs.items()
    }


def _chained(found: Mapping[str, Estimate], inputs: Mapping[str, Estimate]) -> dict[str, Estimate]:
    out = {}
    for key, e in found.items():
        total = Estimate.exact(e.value)
        for influence, slope in e.sensitivities.items():
            given = inputs[influence.name]
            total = total + (given - given.value) * slope
        out[key] = Estimate(e.value, "", total.sensitivities)
    return out
