"""The actuator with a command line and the positioned stage by another laboratory's names: the same numbers, to the last digit.
What is measured at a channel goes by the channel's name there."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from named_otherwise import named_otherwise

from bench.cli.abilities import abilities
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import ConfigError
from bench.findings import Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig
from bench.rigfile.tomltext import to_toml
from sim_backend.controller.controls import controls
from sim_backend.truth import draw

LONG = pytest.mark.long
REDUCED = {"reduced": 1}


@pytest.fixture(params=["lira", "rlsrm"])
def rig(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_it_can_what_it_could(rig: str, tmp_path: Path) -> None:
    here, there = load_rig(rig), load_rig(named_otherwise(rig, tmp_path))
    assert set(here.channels) & set(there.channels) == {"state", "fault"}
    assert not set(here.parameters) & set(there.parameters)
    assert check_rig(there.path)[0] == ()
    assert [a.procedure for a in abilities(there) if a.able] == [a.procedure for a in abilities(here) if a.able]
    assert draw(here, 1).quantities == draw(there, 1).quantities


def told(run: Simulated) -> list[tuple[str, float, float]]:
    return [(m.quantity.name, m.estimate.value, m.estimate.u) for m in run.results if isinstance(m, Measured)]


@pytest.mark.parametrize(
    ("rig", "procedure", "plan", "truth"),
    [
        ("rlsrm", "step-following", {"repeats": 2, "dwell_s": 1.5}, {}),
        pytest.param("rlsrm", "inductance-map", {}, {}, marks=LONG),
        pytest.param("lira", "mission", {}, REDUCED, marks=LONG),
        pytest.param("lira", "unstable-pole", {}, REDUCED, marks=LONG),
    ],
    indirect=["rig"],
)
def test_the_numbers_are_the_same(
    rig: str, procedure: str, plan: Mapping[str, Any], truth: Mapping[str, float], tmp_path: Path
) -> None:
    here, there = (simulated_run(procedure, path, 1, plan, tmp_path / f"{k}.mcap", truth)
                   for k, path in enumerate((rig, named_otherwise(rig, tmp_path))))  # fmt: skip
    assert told(here)
    assert told(here) == told(there)
    assert [f.code for f in here.results if isinstance(f, Finding)] == [
        f.code for f in there.results if isinstance(f, Finding)
    ]


def test_parameters_of_a_setting_in_another_order_are_heard_as_what_they_are(tmp_path: Path) -> None:
    """Of `integrators` the angle's comes first there; where each stands among its axis' parameters says whose it is."""
    path = Path(named_otherwise("rlsrm", tmp_path))
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    axes, parts = (table["capabilities"][key] for key in ("positioning", "settings"))
    parts["integrators"] = {name: dict(reversed(of.items())) for name, of in parts["integrators"].items()}
    path.write_text(to_toml(table), encoding="utf-8")
    rig = load_rig(str(path))
    known = controls(rig, draw(rig, 1).machine)
    for axis in ("x", "angle"):
        assert [c.name for c in known[axes["axes"][axis]["integral"]]] == [f"ki_{axis}"]


def test_a_setting_by_another_name_is_refused_where_the_machine_would_not_hear_its_parameter(tmp_path: Path) -> None:
    path = Path(named_otherwise("rlsrm", tmp_path))
    text = path.read_text(encoding="utf-8")
    assert "sharing" in text
    path.write_text(text.replace("sharing", "verteilung"), encoding="utf-8")
    with pytest.raises(ConfigError, match="would not hear") as refused:
        draw(load_rig(str(path)), 1)
    assert {p.key.split(".")[2] for p in refused.value.problems} == {"verteilung"}
