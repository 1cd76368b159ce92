"""The shipped rigs with other names of channels and parameters, as another laboratory has them: the same, to the last digit."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_map import foreign

from bench.calibration import Calibration
from bench.cli.virtual import Simulated, simulated_run
from bench.errors import ConfigError
from bench.findings import Finding
from bench.link.session import Session
from bench.procedure import Measured
from bench.rigfile import RigFile, load_rig
from bench.rigfile.capabilities import parameters_named
from bench.rigfile.supports import radial_supports
from bench.samples import SampleBlock
from benchmarks.moved import QUICK
from drivers.controller import Controller
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

RIGS = Path(__file__).resolve().parent.parent / "rigs"
NAMED = re.compile(r"(pos|i|u)_\w+")
EVERY = re.compile(r"(?!state$|fault$)\w+")
TURNED = """zero_at = "the terminal box"
up = { value = 30, unit = "deg", half_width = 0, distribution = "rectangular", source = "by definition" }
"""
LONG = pytest.mark.long
LONGER = (pytest.mark.long, pytest.mark.longer)
ALONE: tuple[Mapping[str, Any], ...] = (
    {"bearings": "plan", "speeds_rad_s": [418.9]},
    {"axes": ["yi"], "speeds_rad_s": [0]},
)


def renamed(rig: str, folder: Path) -> str:
    """A rig file whose channels of positions, currents and voltages are called `k1`, `k2`, ..., and whose parameters that do
    something named `p1`, `p2`, ...; its DBC is as it was."""
    (folder / f"{rig}.toml").write_text(renamed_toml(rig, NAMED), encoding="utf-8")
    (folder / f"{rig}.dbc").write_text((RIGS / f"{rig}.dbc").read_text(encoding="utf-8"), encoding="utf-8")
    return str(folder / f"{rig}.toml")


def renamed_toml(rig: str, which: re.Pattern[str]) -> str:
    """The rig file with those of its channels, and its parameters, called otherwise."""
    toml = (RIGS / f"{rig}.toml").read_text(encoding="utf-8")
    file = load_rig(rig)
    new = {name: f"k{n}" for n, name in enumerate(filter(which.fullmatch, file.channels), 1)}
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
        elif "signal = " not in line and not section.startswith(("[devices", "[links")):
            line = re.sub(r'(?<=")\w+(?=")', lambda m: new.get(m[0], m[0]), line)
        lines.append(line)
    return "\n".join(lines) + simulation + drawn


def elsewhere(folder: Path, *, replies: bool) -> str:
    """`tsbs12` as another laboratory would write it: every channel, parameter and state under another name, over another DBC,
    with other bits in its status word, and described in a frame that is turned by 30 degrees: what was up is at 30 there."""
    toml = renamed_toml("tsbs12", EVERY)
    supply = re.search(r'(?m)^(k\d+) = \{ signal = "Telemetry.supply"', toml)
    assert supply is not None
    toml = toml.replace("[envelope]\n", f'[envelope]\nsupply = "{supply[1]}"\n')
    toml = re.sub(r"(?<=mask = )\d+", lambda m: str(32 * int(m[0])), toml)
    upright = 'yi = { direction = { value = 0, unit = "deg"'
    assert upright in toml
    turned = toml.replace(upright, upright.replace("0", "30")).replace(
        'far_end = "outboard"\n', f'far_end = "outboard"\n{TURNED}'
    )
    return foreign("tsbs12", turned, folder, replies=replies)


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
        pytest.param("amb5dof", "bearing-model", {}, marks=LONGER),
        pytest.param("amb5dof", "step", {"axes": ["y", "x"]}, marks=LONGER),
        pytest.param("amb5dof", "unbalance", ALONE[0], marks=LONG),
        pytest.param("amb5dof", "compensation", ALONE[0], marks=LONGER),
        pytest.param("amb5dof", "run-up", {"bearings": "plan"}, marks=LONGER),
        pytest.param("amb5dof", "coast-down", {"bearings": "plan"}, marks=LONGER),
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


CHAIN = ("amb-calibration", "force-constant", "negative-stiffness", "force-coupling", "torque-constant", "angle-step", "slew",
         "spindown", "force-map")  # fmt: skip
SHORT = {**QUICK, "force-map": {"ramp_A_s": 5.0, "settle_s": 0.3, "average_s": 0.2}}


Results = tuple[dict[tuple[str, str], tuple[float, float]], list[str]]


def told(run: Simulated) -> Results:
    found = {
        (m.quantity.name, m.where): (m.estimate.value, m.estimate.u) for m in run.results if isinstance(m, Measured)
    }
    return found, [f.code for f in run.results if isinstance(f, Finding)]


def chained(rig: str, folder: Path) -> Iterator[tuple[str, Simulated]]:
    """Runs of the chain by short plans, each with the calibrations by those before it."""
    known: dict[str, Calibration] = {}
    for procedure in CHAIN:
        plan, path = SHORT.get(procedure, {}), folder / f"{procedure}.mcap"
        run = simulated_run(procedure, rig, 1, plan, path, calibrations=known)
        yield procedure, run
        known[procedure] = run.calibration()


def test_the_servomotor_elsewhere_is_the_same_machine(tmp_path: Path) -> None:
    """Nothing is called as it was, directions are others and mean the same, and what is drawn is the same."""
    here, there = load_rig("tsbs12"), load_rig(elsewhere(tmp_path, replies=True))
    assert not set(here.channels) & set(there.channels) - {"state", "fault"}
    assert not set(here.parameters) & {name for _, name in parameters_named(there.capabilities)}
    assert not set(here.choices("state").values()) & set(there.choices("state").values())
    assert {m.identifier for m in here.messages.messages.values()}.isdisjoint(
        m.identifier for m in there.messages.messages.values()
    )
    assert not any(s.little_endian for m in there.messages.messages.values() for s in m.signals)
    assert [a.direction for s in radial_supports(there) for a in s.axes] == [
        a.direction for s in radial_supports(here) for a in s.axes
    ]
    assert draw(here, 1).quantities == draw(there, 1).quantities


def held(rig: RigFile) -> dict[str, np.ndarray]:
    """What the bench makes of the telemetry of a rotor that is lifted, channel by channel in their order."""
    machine = SimulatedRig(rig, draw(rig, 1))
    controller = Controller(rig, machine.link, machine, Session(1, 1_767_225_600, "test"))
    kept: list[Sequence[SampleBlock]] = []
    real = controller.telemetry.decode
    controller.telemetry.decode = lambda frames: kept.append(real(frames)) or kept[-1]  # type: ignore[method-assign,func-returns-value]
    controller.connect()
    controller.enable()
    controller.levitate()
    controller.clock.sleep(0.1)
    return {name: np.concatenate([b.columns[name] for part in kept for b in part]) for name in rig.channels}


def test_the_same_samples_come_by_another_map(tmp_path: Path) -> None:
    """In other bits, bytes and messages, with as many counts to a unit: equal numbers, in equal order; codes are others."""
    here, there = held(load_rig("tsbs12")), held(load_rig(elsewhere(tmp_path, replies=True)))
    assert here["pos_yi"].std() > 0
    for ours, theirs in zip(here, there, strict=True):
        if ours not in ("state", "fault", "flags"):
            np.testing.assert_array_equal(here[ours], there[theirs], err_msg=f"{ours}, {theirs}")


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, Results]]:
    """The chain on the servomotor as it ships."""
    return [(procedure, told(run)) for procedure, run in chained("tsbs12", tmp_path_factory.mktemp("here"))]


@LONG
@pytest.mark.timeout(900)
@pytest.mark.xdist_group("servomotor elsewhere")
def test_the_servomotor_elsewhere_has_the_same_numbers(tmp_path: Path, here: list[tuple[str, Results]]) -> None:
    """Telemetry in one message and a reply to everything: the same samples at the same times, the same numbers. Shares of a
    budget are summed up in the order of their names, so that u is the same to 1e-12; and so are means weighted by them, whose
    last digit may differ (alpha_d@0 of force-constant on some processors, and what rests on it)."""
    for (procedure, ours), (_, there) in zip(here, chained(elsewhere(tmp_path, replies=True), tmp_path), strict=True):
        (values, found), (others, also) = ours, told(there)
        assert values, procedure
        assert values.keys() == others.keys(), procedure
        assert [v for v, _ in others.values()] == pytest.approx([v for v, _ in values.values()], rel=1e-13), procedure
        assert [u for _, u in others.values()] == pytest.approx([u for _, u in values.values()], rel=1e-12), procedure
        assert found == also, procedure


@LONG
@pytest.mark.timeout(900)
@pytest.mark.xdist_group("servomotor elsewhere")
def test_without_replies_the_numbers_are_those_of_other_noise(tmp_path: Path, here: list[tuple[str, Results]]) -> None:
    """Levels and signals are not answered, and a sample in two messages is complete a frame later: the same machine is seen
    at other times, so that values differ as two results of one machine may."""
    runs = chained(elsewhere(tmp_path, replies=False), tmp_path)
    for (procedure, (ours, found)), (_, there) in zip(here, runs, strict=True):
        theirs, also = told(there)
        assert set(ours) == set(theirs), procedure
        assert sorted(found) == sorted(also), procedure
        for name, (value, u) in ours.items():
            assert abs(theirs[name][0] - value) <= 3 * math.hypot(u, theirs[name][1]), (procedure, name)


def test_bearings_by_other_names_are_refused_where_the_machine_would_not_hear(tmp_path: Path) -> None:
    """A parameter that acts on nothing, silently, would be the worst of answers."""
    path = Path(elsewhere(tmp_path, replies=True))
    text = path.read_text(encoding="utf-8")
    path.write_text(re.sub(r"\binboard\b(?! to)", "near", text), encoding="utf-8")
    with pytest.raises(ConfigError, match="cannot be simulated") as refused:
        draw(load_rig(str(path)), 1)
    told = {p.key: p.found for p in refused.value.problems}
    assert "would not hear" in told["capabilities.bias.near"]
