"""The model file: correlations along the chain from shared influences, and what a constant says of itself."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import jsonschema
import pytest

from bench.calibration import adopted
from bench.campaign import Equation
from bench.campaign.model import (
    SCHEMA_FILE,
    Model,
    Source,
    constants_of,
    correlations_of,
    identity,
    shares_by_kind,
    to_content,
)
from bench.procedure import Measured, Quantity
from bench.record.records import Record, measurement, unfinished
from bench.record.setup import Certified, Setup
from bench.uncertainty import Estimate, Influence, correlation_matrix

D1, D2 = "first-20260101T000000Z-aaaa", "second-20260101T000100Z-bbbb"
GAIN = Influence("sensors/i_yi_p/gain", "gain of i_yi_p", 0.01, "1", "B", "rectangular")
GRAVITY = Influence("site/gravity", "local gravity", 0.02, "1", "B", "normal")


def scatter(u: float) -> Influence:
    return Influence("scatter/1", "scatter", u, "1", "A", "normal", 12.0)


def record(run_id: str, values: dict[str, Estimate], calibrations: tuple[dict[str, Any], ...] = ()) -> Record:
    entries = tuple(measurement(Measured(Quantity(n, "N/A", ""), e), None) for n, e in values.items())
    base = unfinished(run_id=run_id, procedure=run_id.partition("-2")[0], rig="r", uut={}, started="2026-01-01T00:00:00+00:00",
                      seed=1, plan={}, versions={})  # fmt: skip
    return dataclasses.replace(base, measurements=entries)


def chain() -> tuple[dict[str, Estimate], dict[str, Estimate]]:
    """K of a first run; a second that divides by it, with a gain of its own sign and its own scatter of the same name."""
    k = Estimate(70.0, "N/A", {GAIN: 30.0, GRAVITY: 20.0, scatter(0.5): 1.0})
    known = adopted({"K": k}, D1)
    own = Estimate(12.0, "N/A", {GAIN: -4.0, scatter(0.1): 1.0})
    return {"K": k}, {"a": own * known["K"] / 70.0}


def test_correlations_are_those_of_the_estimates() -> None:
    first, second = chain()
    sources = [Source(record(D1, first), {}, {}), Source(record(D2, second), {}, {})]
    found = correlations_of(sources)
    assert found.names == ("K", "a")
    expected = correlation_matrix([adopted(first, D1)["K"], adopted(second, D2, {f"{D1}/scatter/1"})["a"]])
    assert found.matrix == tuple(pytest.approx(tuple(row)) for row in expected)
    assert found.matrix[0][1] < 0.99  # the two scatters of one name are two


def test_identities_follow_the_rule_of_adoption() -> None:
    made = record(D2, {})
    assert identity("geometry/amb_span", made) == "geometry/amb_span"
    assert identity("scatter/1", made) == f"{D2}/scatter/1"
    assert identity(f"{D1}/scatter/1", made) == f"{D1}/scatter/1"
    assert identity("encoders/x/pitch", made) == f"{D2}/encoders/x/pitch"  # an old record does not say what it is


def test_a_scale_is_one_influence_whatever_its_form() -> None:
    """By hand: one run has the pitch as a share of -2 um, the other in metres; K goes with it, a against it."""
    size, u = -2e-6, 1e-9
    number = Certified(size, u, "m", "rectangular", "C")
    share, count = (
        Influence("encoders/x/pitch", "", x, unit, "B", "rectangular") for x, unit in ((u / 2e-6, "1"), (u, "m"))
    )
    setup = Setup("0" * 64, "", {}, {}, {"encoders/x/pitch": number})
    made = [(D1, {"K": Estimate(70.0, "N/A", {share: 70.0})}), (D2, {"a": Estimate(3.0, "N/A", {count: -3.0 / size})})]
    sources = [Source(dataclasses.replace(record(run, values), setup=setup), {}, {}) for run, values in made]
    assert correlations_of(sources).matrix[0][1] == pytest.approx(-1.0)
    unsaid = [Source(record(run, values), {}, {}) for run, values in made]
    assert correlations_of(unsaid).matrix[0][1] == 0.0


def test_a_constant_of_two_degrees_of_freedom_has_its_interval_alone() -> None:
    few = Estimate.of(70.0, Influence("scatter/few", "scatter", 0.5, "N/A", "A", "normal", 2.0))
    (k,) = constants_of([Source(record(D1, {"K": few}), {}, {})], {})
    assert (k.standard_uncertainty, k.coverage_factor) == (None, None)
    assert k.expanded_uncertainty == pytest.approx(2.151, abs=1e-3)


def test_a_constant_says_where_it_comes_from_and_what_limits_it() -> None:
    first, _ = chain()
    source = Source(record(D1, first), {"K": "force per current"}, {"bias_A": 3.0})
    (k,) = constants_of([source], {"K": Equation(text="F = K i", source="T (2.4)")})
    assert (k.about, k.holds_for, k.run_id) == ("force per current", {"bias_A": 3.0}, D1)
    assert [t.influence for t in k.terms] == ["scatter/1", "site/gravity", "sensors/i_yi_p/gain"]
    assert sum(t.share for t in k.terms) == pytest.approx(1.0)
    assert k.rest == 0.0
    shares = shares_by_kind(source.record.measurements[0])
    assert set(shares) == {"sensors", "site", "run"}
    assert shares["run"] == pytest.approx(k.terms[0].share)


def test_the_later_of_two_values_stands() -> None:
    first, _ = chain()
    later = {"K": first["K"] * 1.1}
    (k,) = constants_of([Source(record(D1, first), {}, {}), Source(record(D2, later), {}, {})], {})
    assert k.run_id == D2
    assert correlations_of([Source(record(D1, first), {}, {}), Source(record(D2, later), {}, {})]).names == ("K",)


def test_what_is_written_fits_the_schema() -> None:
    first, second = chain()
    sources = [Source(record(D1, first), {}, {}), Source(record(D2, second), {}, {})]
    model = Model(schema=1, name="x", title="", rig="r", uut={}, rig_sha256="0" * 64, simulated=True, seed=1,
                  created="2026-01-01T00:00:00+00:00", complete=True, constants=constants_of(sources, {}),
                  correlations=correlations_of(sources), given=())  # fmt: skip
    content = json.loads(json.dumps(to_content(model)))
    jsonschema.validate(content, json.loads(SCHEMA_FILE.read_text()))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**content, "colour": "blue"}, json.loads(SCHEMA_FILE.read_text()))
