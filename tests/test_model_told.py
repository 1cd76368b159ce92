"""What a controller is told out of the model of a campaign: read strictly, of this machine alone, its values as they stand."""

from __future__ import annotations

import dataclasses
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.calibration import Need
from bench.calibration.lookup import Lookup
from bench.calibration.store import Store
from bench.campaign import told
from bench.campaign.model import Model, Source, constants_of, correlations_of, to_content
from bench.cli.compose import Request, prepare
from bench.errors import ConfigError
from bench.procedure import Measured, Quantity
from bench.record.records import measurement, unfinished
from bench.rigfile import load_rig
from bench.run.provenance import now
from bench.uncertainty import Estimate, Influence
from procedures.stages import map_model

RIG = load_rig("rlsrm")
RUN = "inductance-map-20261129T025258Z-8044"
DEFAULTS = {q: RIG.parameters[name].default for name, (_, q) in map_model.expected(RIG, "inductance-map").items()}


def a_model(values: dict[str, float] = DEFAULTS, **changed: Any) -> Model:
    """Of a campaign with one run by `inductance-map` on virtual rig 1, each value to 1 %."""
    entries = []
    for name, value in values.items():
        kind, _, where = name.partition("@")
        scatter = Influence(f"scatter/{name}", "scatter", 0.01 * abs(value) + 1e-6, "1", "A", "normal", 50.0)
        entries.append(measurement(Measured(Quantity(kind, "1", ""), Estimate.of(value, scatter), where), None))
    base = unfinished(run_id=RUN, procedure="inductance-map", rig="rlsrm", uut={}, started="2026-11-29T02:52:58+00:00",
                      seed=1, plan={}, versions={})  # fmt: skip
    sources = [Source(dataclasses.replace(base, measurements=tuple(entries)), {}, {})]
    made = Model(
        schema=1, name="m", title="", rig="rlsrm", uut=RIG.uut.model_dump(), rig_sha256=RIG.digest, simulated=True, seed=1,
        visit=0, created=now(), complete=True, constants=constants_of(sources, {}), correlations=correlations_of(sources),
        given=(),
    )  # fmt: skip
    return dataclasses.replace(made, **changed)


def written(folder: Path, model: Model) -> Path:
    path = folder / "model.json"
    path.write_text(json.dumps(to_content(model)))
    return path


def asked(path: Path, seed: int = 1, model: str = "inductance-map", **more: Any) -> Request:
    plan = () if not model else (f'model="{model}"',)
    return Request("decoupling", "rlsrm", seed=seed, plan=plan, model=path, calibrations=path.parent / "none", **more)


def test_a_model_is_read_as_it_was_written_and_its_values_are_a_calibration(tmp_path: Path) -> None:
    model = a_model()
    found, sha256 = told.read(written(tmp_path, model))
    assert found == model
    made = told.calibration(found, "inductance-map", sha256)
    assert made is not None
    assert map_model.identified(RIG, "inductance-map", {"inductance-map": made}) == {
        name: RIG.parameters[name].default for name in map_model.expected(RIG, "inductance-map")
    }
    assert (made.run_id, made.seed, made.backend, made.uut, made.sealed) == (RUN, 1, "sim", "SIM-0019", False)
    assert made.values["gain@A1"].u == pytest.approx(0.01, rel=1e-3)
    assert told.calibration(found, "static-characteristics", sha256) is None


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"rig": "lira"}, "of rig lira; this is rlsrm"),
        ({"uut": {"serial": "SIM-0020"}}, "of the machine with serial no. SIM-0020; this is SIM-0019"),
        ({"seed": 2}, "of virtual rig 2; this is virtual rig 1"),
        ({"seed": None}, "of the real rig; this is virtual rig 1"),
        ({"rig_sha256": "0" * 64}, "made with another rig file (SHA-256 000000000000"),
    ],
)
def test_another_machines_model_is_refused(tmp_path: Path, changed: dict[str, Any], said: str) -> None:
    """Before anything starts, with what it is of; the same model is taken where it belongs."""
    with pytest.raises(ConfigError, match="nothing was started") as refused:
        prepare(asked(written(tmp_path, a_model(**changed))))
    assert said in str(refused.value)


def test_a_run_takes_the_model_before_what_was_adopted(tmp_path: Path) -> None:
    job, _ = prepare(asked(written(tmp_path, a_model())))
    (used,) = job.calibrations
    assert (used.procedure, used.run_id, used.due) == ("inductance-map", RUN, "2027-11-29")
    store = Store.of(RIG, 1, tmp_path / "facts")
    other = dataclasses.replace(used, run_id="inductance-map-20261101T000000Z-aaaa", sealed=True)
    store.adopt(other)
    asking = Lookup(store, RIG, datetime.now(UTC), lambda _: "")
    need = (Need("inductance-map", told=True),)
    assert asking.found("decoupling", need)[0].run_id == other.run_id
    assert dataclasses.replace(asking, given={"inductance-map": used}).found("decoupling", need)[0].run_id == RUN


def test_a_plan_that_tells_the_controller_nothing_takes_no_model(tmp_path: Path) -> None:
    path = written(tmp_path, a_model())
    with pytest.raises(ConfigError, match="with this plan decoupling tells the controller nothing"):
        prepare(asked(path, model=""))
    with pytest.raises(ConfigError, match="found no constants by static-characteristics"):
        prepare(asked(path, model="static-characteristics"))


def test_a_model_with_a_value_beyond_the_controllers_range_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="map_zero_1"):
        prepare(asked(written(tmp_path, a_model({**DEFAULTS, "zero@stator1": 0.2}))))
    without = {name: value for name, value in DEFAULTS.items() if name != "centre"}
    with pytest.raises(ConfigError, match="holds no centre"):
        prepare(asked(written(tmp_path, a_model(without))))


@pytest.mark.parametrize(
    "wrong",
    [
        {"date": "yesterday"},
        {"date": "2026-11-29T02:52:58"},
        {"standard_uncertainty": -0.1},
        {"expanded_uncertainty": -1.0},
    ],
)
def test_a_constant_without_its_time_or_with_less_than_no_uncertainty_is_refused(
    tmp_path: Path, wrong: dict[str, Any]
) -> None:
    model = a_model()
    first = dataclasses.replace(model.constants[0], **wrong)
    path = written(tmp_path, dataclasses.replace(model, constants=(first, *model.constants[1:])))
    with pytest.raises(ConfigError, match="expected a time with its zone, and no uncertainty below 0"):
        told.read(path)


WHOLE = json.dumps(to_content(a_model()))


@given(st.one_of(
    st.binary(max_size=200),
    st.tuples(st.integers(0, len(WHOLE) - 1), st.binary(min_size=1, max_size=3)).map(
        lambda cut: WHOLE.encode()[: cut[0]] + cut[1] + WHOLE.encode()[cut[0] + len(cut[1]) :]
    ),
    st.integers(0, len(WHOLE) - 1).map(lambda n: WHOLE.encode()[:n]),
))  # fmt: skip
def test_any_bytes_are_a_model_or_are_refused_by_name(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.mktemp("m") / "model.json"
    path.write_bytes(data)
    said = str(path)
    try:
        model, _ = told.read(path)
        told.refusals(model, RIG, 1)
        told.calibration(model, "inductance-map", "0" * 64)
    except ConfigError as error:
        said = str(error)
    assert str(path) in said
