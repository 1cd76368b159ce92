"""The shipped rigs with other names of channels and parameters, as another laboratory has them: the same, to the last digit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from bench.cli.virtual import simulated_run
from bench.findings import Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.capabilities import parameters_named

RIGS = Path(__file__).resolve().parent.parent / "rigs"
NAMED = re.compile(r"(pos|i|u)_\w+")
LONG = pytest.mark.long
ALONE: tuple[Mapping[str, Any], ...] = (
    {"bearings": "plan", "speeds_rad_s": [418.9]},
    {"axes": ["yi"], "speeds_rad_s": [0]},
)


def renamed(rig: str, folder: Path) -> str:
    """A rig file whose channels of positions, currents and voltages are called `k1`, `k2`, ..., and whose parameters that do
    something named `p1`, `p2`, ...; its DBC is as it was."""
    toml = (RIGS / f"{rig}.toml").read_text(encoding="utf-8")
    file = load_rig(rig)
    new = {name: f"k{n}" for n, name in enumerate(filter(NAMED.fullmatch, file.channels), 1)}
    asked = {name: f"p{n}" for n, name in enumerate(dict(map(reversed, parameters_named(file.capabilities))), 1)}
    told, simulation, drawn = toml.partition("\n[simulation]")
    lines, section = [], ""
    for line in told.splitlines():
        section = line if line.startswith("[") else section
        key = re.match(r"(\w+) = \{ (signal|index|gain)", line)
        names = asked if section == "[parameters]" else new
        if key is not None and key[1] in names:
            line = names[key[1]] + line[len(key[1]) :]
        if section.startswith(("[capabilities.settings", "[plans")):
            line = re.sub(r"(?<=[{,] )\w+(?= =)", lambda m: asked.get(m[0], m[0]), line)
        elif section.startswith("[capabilities") and "channel" not in line:
            line = re.sub(r'(?<=")\w+(?=")', lambda m: asked[m[0]], line)
        elif "signal = " not in line:
            line = re.sub(r'(?<=")\w+(?=")', lambda m: new.get(m[0], m[0]), line)
        lines.append(line)
    (folder / f"{rig}.toml").write_text("\n".join(lines) + simulation + drawn, encoding="utf-8")
    (folder / f"{rig}.dbc").write_text((RIGS / f"{rig}.dbc").read_text(encoding="utf-8"), encoding="utf-8")
    return str(folder / f"{rig}.toml")


@pytest.mark.parametrize("rig", ["tsbs12", "amb5dof"])
def test_no_old_name_is_left(rig: str, tmp_path: Path) -> None:
    other = load_rig(renamed(rig, tmp_path))
    assert not list(filter(NAMED.fullmatch, other.channels))
    assert len(other.channels) == len(load_rig(rig).channels)
    bound = {name for _, name in parameters_named(load_rig(rig).capabilities)}
    assert len(bound) > 20
    assert not bound & other.parameters.keys()
    assert other.parameters.keys() >= {name for _, name in parameters_named(other.capabilities)}


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("rig", "procedure", "plan"),
    [
        ("tsbs12", "spindown", {}),
        ("amb5dof", "tracking", {}),
        pytest.param("tsbs12", "amb-calibration", {}, marks=LONG),
        pytest.param("tsbs12", "torque-constant", {}, marks=LONG),
        pytest.param("tsbs12", "angle-step", {}, marks=LONG),
        pytest.param("tsbs12", "slew", {}, marks=LONG),
        pytest.param("amb5dof", "bearing-model", {}, marks=LONG),
        pytest.param("amb5dof", "step", {"axes": ["y", "x"]}, marks=LONG),
        pytest.param("amb5dof", "unbalance", ALONE[0], marks=LONG),
        pytest.param("amb5dof", "compensation", ALONE[0], marks=LONG),
        pytest.param("amb5dof", "run-up", {"bearings": "plan"}, marks=LONG),
        pytest.param("amb5dof", "coast-down", {"bearings": "plan"}, marks=LONG),
        pytest.param("amb5dof", "balance", {"bearings": "plan"}, marks=LONG),
        pytest.param("amb5dof", "sensitivity", ALONE[1], marks=LONG),
    ],
)
def test_the_numbers_are_the_same(rig: str, procedure: str, plan: Mapping[str, Any], tmp_path: Path) -> None:
    runs = [simulated_run(procedure, name, 1, plan, tmp_path / f"{k}.mcap")
            for k, name in enumerate((rig, renamed(rig, tmp_path)))]  # fmt: skip
    told = [{(m.quantity.name, m.where): (m.estimate.value, m.estimate.u) for m in run.results if isinstance(m, Measured)}
            for run in runs]  # fmt: skip
    found = [[f.code for f in run.results if isinstance(f, Finding)] for run in runs]
    assert told[0]
    assert told[0] == told[1]
    assert found[0] == found[1]
