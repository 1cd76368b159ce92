"""Differences of two runs: pairs worked by hand, and against GTC, which keeps correlation by identity too."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import GTC
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.calibration import adopted
from bench.errors import AnalysisError, ConfigError
from bench.findings import SIMULATED_CONTROLLER, Finding
from bench.history.compare import Comparison, Difference, Side, bent, compare
from bench.history.differ import Differs, differing
from bench.quantity import Quantity
from bench.record.outcomes import Outcome
from bench.record.records import Record, findings_of, measurement, unfinished
from bench.record.setup import Certified, Setup
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence

K = Quantity("K_i", "N/A", "force constant")
A, B = "amb-calibration-20260101T000000Z-aaaa", "amb-calibration-20260201T000000Z-bbbb"
GAIN = Influence("sensors/i/gain", "gain", 0.002, "1", "B", "normal")


def scatter(u: float, dof: float = math.inf, name: str = "scatter/yi") -> Influence:
    return Influence(name, "scatter", u, "N/A", "A", "normal", dof)


def value(middle: float, parts: Mapping[Influence, float]) -> Estimate:
    return Estimate(middle, "N/A", dict(parts))


def record(run_id: str, estimate: Estimate, numbers: Mapping[str, Toleranced] | None = None, **other: Any) -> Record:
    """A finished run that measured K_i; every influence of a sensor, a mass or the site stands in its rig file, beside
    `numbers` of it."""
    certified = {i.id: Certified(1.0, i.u, i.unit, i.distribution, "SIM-1") for i in estimate.sensitivities
                 if i.id.partition("/")[0] in ("sensors", "masses", "site", "capabilities")}  # fmt: skip
    for key, n in (numbers or {}).items():
        certified[key] = Certified(n.value, n.standard_uncertainty, n.unit, n.distribution, "SIM-1")
    start = unfinished(
        run_id=run_id, procedure="amb-calibration", rig="stand", uut={"model": "stand", "serial": "001"}, started="2026-01-01",
        seed=None, plan={}, versions={}, setup=Setup("ab" * 32, "", {}, {"K_i": "K@inboard"}, certified),
    )  # fmt: skip
    made = (measurement(K.measured(estimate), None, 0),)
    return dataclasses.replace(start, outcome=Outcome.DONE, ended="2026-01-01", findings=(), measurements=made, **other)


def compared(a: Record, b: Record) -> Comparison:
    return compare(Side(Path("a"), a), Side(Path("b"), b))


def difference(a: Record, b: Record) -> Difference:
    return compared(a, b).differences[0]


PITCH = Toleranced(value=2e-6, unit="m", u=3e-9, distribution="normal", source="C")
SCALE = Influence("encoders/x/pitch", "scale", PITCH.standard_uncertainty / 2e-6, "1", "B", "normal")
COUNT = Influence("encoders/x/pitch", "pitch", PITCH.standard_uncertainty, "m", "B", "normal")


def test_a_scale_that_came_with_a_calibration_is_the_scale_that_the_other_run_reads() -> None:
    """The second run rests on an adopted value of the same encoder: one scale, which drops out of the difference."""
    numbers = {SCALE.id: PITCH}
    fact = adopted({"K": value(75.0, {SCALE: 75.0})}, A, (), numbers)["K"]
    found = difference(record(A, value(75.0, {SCALE: 75.0, scatter(0.02): 1.0}), numbers),
                       record(B, fact + value(0.1, {scatter(0.02): 1.0}), numbers))  # fmt: skip
    assert found.u == pytest.approx(math.hypot(0.02, 0.02))
    assert found.removed == pytest.approx(1 - 0.02**2 / (0.02**2 + (75 * SCALE.u) ** 2))


@pytest.mark.parametrize("size", [2e-6, -2e-6])
def test_a_record_that_has_a_number_as_a_share_shares_it_with_one_that_has_it_in_its_unit(size: float) -> None:
    """By hand: K goes with the pitch, K = 75 p/p_0, so that a share of it does 75 and a metre 75/p_0, of whatever sign; nothing
    is left of it. Where the other run goes against it, K = 75 p_0/p, both add up."""
    numbers = {SCALE.id: PITCH.model_copy(update={"value": size})}
    before = record(A, value(75.0, {SCALE: 75.0, scatter(0.02): 1.0}), numbers)
    left = difference(before, record(B, value(75.1, {COUNT: 75.0 / size, scatter(0.02): 1.0}), numbers))
    assert left.u == pytest.approx(math.hypot(0.02, 0.02))
    both = difference(before, record(B, value(75.1, {COUNT: -75.0 / size, scatter(0.02): 1.0}), numbers))
    assert both.u == pytest.approx(math.hypot(0.02, 0.02, 2 * 75 * SCALE.u))
    assert next((p.influence, p.shared) for p in both.parts) == (SCALE.id, True)


def test_what_both_share_drops_out_as_gtc_has_it() -> None:
    one = value(70.0, {GAIN: 70.0, scatter(0.1, 8): 1.0})
    other = value(72.0, {GAIN: 72.0, scatter(0.2, 12): 1.0})
    found = difference(record(A, one), record(B, other))
    gain = GTC.ureal(0.0, 0.002)
    d = (72 * gain + 2 + GTC.ureal(0, 0.2, 12)) - 70 * gain - GTC.ureal(0, 0.1, 8)
    assert found.value == 2.0
    assert found.u == pytest.approx(d.u, rel=1e-12)
    assert found.dof == math.floor(d.df)
    assert pytest.approx(GTC.reporting.k_factor(found.dof) * d.u, rel=1e-6) == found.U
    # By hand: sqrt(0.1^2 + 0.2^2 + (2 x 0.002)^2) = 0.22364; the gain alone is 0.14 in each.
    assert found.u == pytest.approx(0.223643, abs=1e-6)
    assert found.en is not None
    assert found.beyond
    assert found.en == pytest.approx(2.0 / found.U, rel=1e-12)


def test_the_scatter_of_two_runs_is_two_though_it_has_one_name() -> None:
    one = value(70.0, {scatter(0.3, 10): 1.0})
    found = difference(record(A, one), record(B, one))
    assert found.u == pytest.approx(0.3 * math.sqrt(2), rel=1e-12)
    assert found.dof == 20  # Welch and Satterthwaite: of two equal variances the sum of their degrees of freedom
    assert [p.shared for p in found.parts] == [False, False]
    assert found.removed == pytest.approx(0.0, abs=1e-12)


def test_parts_of_one_covariance_keep_its_degrees_of_freedom_in_each_run() -> None:
    roots = {scatter(1.0, 10, f"scatter/{k}"): 0.1 * k for k in (1, 2, 3)}
    roots = {dataclasses.replace(i, unit="1"): c for i, c in roots.items()}
    found = difference(record(A, value(1.0, roots)), record(B, value(1.0, roots)))
    x = GTC.multiple_ureal([0.0] * 3, [0.1, 0.2, 0.3], 10)
    y = GTC.multiple_ureal([0.0] * 3, [0.1, 0.2, 0.3], 10)
    d = sum(y) - sum(x)
    assert found.u == pytest.approx(d.u, rel=1e-12)
    assert found.dof == math.floor(d.df + 1e-9) == 20


def test_a_calibration_that_came_from_one_run_is_shared_and_one_from_two_is_not() -> None:
    def by(calibration: str) -> Estimate:
        return value(
            5.0, {scatter(0.4, 9, f"force-constant-20260101T000000Z-{calibration}/scatter/K"): 2.0, scatter(0.1): 1.0}
        )

    same = difference(record(A, by("cccc")), record(B, by("cccc")))
    assert same.u == pytest.approx(0.1 * math.sqrt(2), rel=1e-12)
    two = difference(record(A, by("cccc")), record(B, by("dddd")))
    assert two.u == pytest.approx(math.sqrt(2 * 0.1**2 + 2 * 0.8**2), rel=1e-12)


def test_a_run_that_rests_on_the_other_one_shares_its_scatter() -> None:
    one = value(70.0, {scatter(0.3, 10): 1.0})
    resting = value(71.0, {scatter(0.3, 10, f"{A}/scatter/yi"): 1.0, scatter(0.1, 10): 1.0})
    assert difference(record(A, one), record(B, resting)).u == pytest.approx(0.1, rel=1e-12)


@pytest.mark.parametrize("less", [0.0, 1.0, 3.0])
def test_a_rectangular_influence_of_both_stays_rectangular(less: float) -> None:
    """What is left of it is one rectangle, whose 95 % interval is 0.95 of its half width."""
    offset = Influence("sensors/i/offset", "offset", 1 / math.sqrt(3), "A", "B", "rectangular")
    found = difference(record(A, value(1.0, {offset: 1.0})), record(B, value(1.0, {offset: 1.0 + less})))
    assert abs(found.U - 0.95 * less) <= 0.01 * less
    assert found.en == 0.0


def test_bounds_that_each_run_found_for_itself_are_two() -> None:
    bound = Influence("hysteresis/i", "hysteresis", 1 / math.sqrt(3), "N/A", "B", "rectangular")
    found = difference(record(A, value(1.0, {bound: 1.0})), record(B, value(1.0, {bound: 1.0})))
    triangle = 2 * (1 - math.sqrt(0.05))  # of half width 2, by hand: 3 % less than 1.96 u
    assert abs(found.U / triangle - 1) < 0.035
    assert found.least == 0.0  # had both one cause, it would be the same in both


def test_bounds_of_one_name_may_have_one_cause_on_one_machine_alone() -> None:
    def with_bound(u: float) -> Estimate:
        return value(
            1.0, {Influence("model/yi", "what the model lacks", u, "N/A", "B", "normal"): 1.0, scatter(0.1): 1.0}
        )

    a, b = record(A, with_bound(0.5)), record(B, dataclasses.replace(with_bound(0.8), value=1.5))
    found = difference(a, b)
    k = 1.959964
    assert pytest.approx(found.U, rel=1e-6) == k * math.sqrt(0.5**2 + 0.8**2 + 2 * 0.1**2)
    assert found.least == pytest.approx(k * math.sqrt(0.3**2 + 2 * 0.1**2), rel=1e-6)  # what is more of it in B is left
    assert not found.perhaps
    two = difference(a, other_machine(b))
    assert two.least == two.U


def test_a_number_of_the_day_is_another_one_on_each() -> None:
    air = Influence("site/air_density", "air density", 0.03, "kg/m^3", "B", "rectangular")
    weight = Influence("site/gravity", "gravity", 0.03, "m/s^2", "B", "normal")
    one = value(1.0, {air: 1.0, weight: 1.0})
    assert difference(record(A, one), record(B, one)).u == pytest.approx(0.03 * math.sqrt(2), rel=1e-3)


def test_a_number_that_was_certified_anew_is_another_one() -> None:
    a, b = (record(run, value(70.0, {GAIN: 70.0, scatter(0.01): 1.0})) for run in (A, B))
    assert b.setup is not None
    assert difference(a, b).u == pytest.approx(0.01 * math.sqrt(2), rel=1e-9)
    anew = {GAIN.id: dataclasses.replace(b.setup.certified[GAIN.id], value=1.001, certificate="SIM-2")}
    b = dataclasses.replace(b, setup=dataclasses.replace(b.setup, certified=anew))
    assert difference(a, b).u == pytest.approx(math.hypot(0.14 * math.sqrt(2), 0.01 * math.sqrt(2)), rel=1e-9)
    assert [d.key for d in differing(a, b) if d.what == "certificates"] == [GAIN.id]


def other_machine(of: Record, **changed: Any) -> Record:
    return dataclasses.replace(of, **({"uut": {"model": "stand", "serial": "002"}} | changed))


def test_two_machines_share_what_goes_by_one_certificate() -> None:
    weight = Influence("masses/M1", "mass M1", 0.5, "kg", "B", "normal")
    a, b = (record(run, value(70.0, {GAIN: 70.0, weight: 1.0})) for run in (A, B))
    for r in (a, b):
        assert r.setup is not None
        mass = {
            weight.id: r.setup.certified[weight.id],
            GAIN.id: dataclasses.replace(r.setup.certified[GAIN.id], certificate=""),
        }
        r.setup.certified.update(mass)  # type: ignore[attr-defined]
    found = compared(a, other_machine(b))
    assert not found.one_machine
    assert found.differences[0].u == pytest.approx(
        0.14 * math.sqrt(2), rel=1e-9
    )  # both hung M1, each has its own sensor
    virtual = compared(dataclasses.replace(a, seed=1), other_machine(b, seed=2))
    assert virtual.differences[0].u == pytest.approx(
        math.hypot(0.14, 0.5) * math.sqrt(2), rel=1e-9
    )  # each draws its own M1


@pytest.mark.parametrize(
    "change", [{"seed": 3}, {"findings": findings_of([Finding(SIMULATED_CONTROLLER, "it says so", "c")])}]
)
def test_a_virtual_rig_is_another_machine_than_the_real_one_with_its_serial_number(change: dict[str, Any]) -> None:
    a, b = (record(run, value(70.0, {GAIN: 70.0})) for run in (A, B))
    assert compared(a, b).one_machine
    assert not compared(a, dataclasses.replace(b, **change)).one_machine
    assert compared(dataclasses.replace(a, **change), dataclasses.replace(b, **change)).one_machine


def test_records_of_before_schema_3_share_by_the_names_of_their_influences() -> None:
    beyond = Influence(
        "masses/beyond/1", "beyond its certificate", 1.0, "1", "A", "normal", 3.0
    )  # a run's own, by its type
    a, b = (dataclasses.replace(record(run, value(70.0, {GAIN: 70.0, beyond: 0.1})), setup=None) for run in (A, B))
    assert difference(a, b).u == pytest.approx(0.1 * math.sqrt(2), rel=1e-9)
    former = dataclasses.replace(a, measurements=tuple(  # and of before 2026-11-23, without u of an influence
        dataclasses.replace(m, budget=tuple(dataclasses.replace(e, standard_uncertainty=None) for e in m.budget))
        for m in a.measurements))  # fmt: skip
    assert difference(former, b).u == pytest.approx(0.1 * math.sqrt(2), rel=1e-9)


def product(x: Influence) -> Estimate:
    """10 x^2, of an x that is nought but for its uncertainty: no slope there."""
    return Estimate(1.0, "N/A", {x: 0.0}, sampler=lambda drawn: 1.0 + 10 * np.asarray(drawn[x.id]) ** 2)


def test_a_value_that_is_not_linear_is_taken_from_the_recording() -> None:
    x = Influence("sensors/i/offset", "offset", 0.1, "A", "B", "normal")
    a, b = (record(run, product(x)) for run in (A, B))
    assert bent(a.measurements[0])
    assert not bent(record(A, value(1.0, {GAIN: 1.0})).measurements[0])
    sides = Side(Path("a"), a), Side(Path("b"), b)
    found = compare(*sides, anew=lambda path: {("K_i", ""): product(x)}).differences[0]
    assert (found.source, found.U) == ("recording", 0.0)  # one offset, the same in both
    own = dataclasses.replace(x, id="offset/i")
    sides = Side(Path("a"), record(A, product(own))), Side(Path("b"), record(B, product(own)))
    found = compare(*sides, anew=lambda path: {("K_i", ""): product(own)}).differences[0]
    drawn = np.random.default_rng(1).normal(0, 0.1, (2, 400_000))
    low, high = np.quantile(10 * drawn[1] ** 2 - 10 * drawn[0] ** 2, [0.025, 0.975])
    assert found.low == pytest.approx(low, rel=0.03)
    assert found.high == pytest.approx(high, rel=0.03)

    def none(path: Path) -> dict[tuple[str, str], Estimate]:
        raise AnalysisError("no recording")

    apart = compare(*sides, anew=none).differences[0]
    assert apart.source == "apart"
    assert apart.u == pytest.approx(
        (sides[0].record.measurements[0].standard_uncertainty or 0) * math.sqrt(2), rel=1e-9
    )


def test_the_parts_say_what_could_make_the_difference() -> None:
    found = difference(record(A, value(70.0, {GAIN: 70.0, scatter(0.1): 1.0})), record(B, value(70.7, {GAIN: 70.0})))
    own, same = found.parts
    assert (own.influence, own.shared) == (f"{A}/scatter/yi", False)
    assert own.left == pytest.approx(0.1)
    assert own.alone == pytest.approx(7.0)  # 0.7 of 0.1
    assert (same.influence, same.shared, same.left) == (GAIN.id, True, 0.0)
    assert same.alone == pytest.approx(5.0)  # 0.7 of 0.14, had the gain changed


def test_what_differs_beside_the_results() -> None:
    a, b = (record(run, value(1.0, {GAIN: 1.0})) for run in (A, B))
    assert b.setup is not None
    setup = dataclasses.replace(b.setup, parameters={"bias": 2.0}, firmware="protocol 2", rig_sha256="cd" * 32)
    b = dataclasses.replace(b, plan={"angles": 9}, versions={"numpy": "2"}, setup=setup)
    assert differing(a, a) == ()
    assert differing(a, b) == (
        Differs("plan", "angles", "not said", "9"),
        Differs("rig", "file", "abababababab", "cdcdcdcdcdcd"),
        Differs("parameters", "bias", "not said", "2.0"),
        Differs("firmware", "", "not said", "protocol 2"),
        Differs("versions", "numpy", "not said", "2"),
    )


def test_what_cannot_be_compared_is_refused() -> None:
    a, b = (record(run, value(1.0, {GAIN: 1.0})) for run in (A, B))
    for change, said in (
        ({"ended": None}, "still being written"),
        ({"procedure": "step"}, "different quantities"),
        ({"run_id": A}, "the same run twice"),
        ({"measurements": ()}, "no quantity that both have measured"),
    ):
        with pytest.raises(ConfigError, match=said):
            compared(a, dataclasses.replace(b, **change))


def test_what_one_alone_has_measured_is_named() -> None:
    a, b = (record(run, value(1.0, {GAIN: 1.0})) for run in (A, B))
    more = (*b.measurements, measurement(Quantity("B", "1", "drag").measured(Estimate.exact(1.0), "z"), None))
    found = compared(a, dataclasses.replace(b, measurements=more))
    assert (found.only, [d.name for d in found.differences]) == (("B@z",), ["K_i"])


SIZES = st.floats(0.01, 10.0)


@given(st.floats(-100, 100), SIZES, SIZES, st.floats(-10, 10), st.floats(-10, 10), st.integers(3, 50))
def test_either_way_round_and_never_wider_than_both_together(
    d: float, u: float, v: float, p: float, q: float, dof: int
) -> None:
    a = record(A, value(1.0, {GAIN: p, scatter(u, dof): 1.0}))
    b = record(B, value(1.0 + d, {GAIN: q, scatter(v): 1.0}))
    one, other = difference(a, b), difference(b, a)
    assert one.value == -other.value
    assert one.least <= one.U == pytest.approx(other.U, rel=1e-12)
    assert one.en == pytest.approx(-(other.en or 0.0), rel=1e-9)
    u_a, u_b = (m.measurements[0].standard_uncertainty or 0.0 for m in (a, b))
    assert abs(u_a - u_b) * (1 - 1e-9) <= (one.u or 0.0) <= (u_a + u_b) * (1 + 1e-9)
