"""Bearings whose bias currents differ: what goes with a bias goes with that of its own bearing."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from bench.cli.virtual import simulated_run
from bench.findings import Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.uncertainty import interval
from procedures.amb_rotor.conventions import conventions
from procedures.bearing_model.fitting import check
from procedures.bearing_model.grid import bias_by_axis, biases
from procedures.bearing_model.plan import Plan
from procedures.step import record_length

STAND = Path(__file__).resolve().parents[2] / "examples/plain-stand/stand.toml"
REAR = 'VormagnetHinten = { signal = "VorgabeStrom.VormagnetHinten", unit = "A", default = 1.5, low = 0.2, high = 1.7'


@pytest.fixture
def unlike(tmp_path: Path) -> Callable[..., str]:
    """The plain stand with another bias at the rear."""

    def written(default: float = 1.2, high: float = 1.7) -> str:
        text = STAND.read_text(encoding="utf-8")
        assert REAR in text
        changed = REAR.replace("default = 1.5", f"default = {default}").replace("high = 1.7", f"high = {high}")
        (tmp_path / STAND.name).write_text(text.replace(REAR, changed), encoding="utf-8")
        shutil.copy(STAND.with_suffix(".dbc"), tmp_path)
        return str(tmp_path / STAND.name)

    return written


def test_slopes_are_those_of_the_bias_of_their_own_bearing(unlike: Callable[..., str], tmp_path: Path) -> None:
    run = simulated_run("bearing-model", unlike(), 0, {"settle_s": 0.4, "average_s": 0.3}, tmp_path / "s.mcap")
    off = {(m.quantity.name, m.where): (m.estimate.value - run.truth[f"{m.quantity.name}@{m.where}"]) / interval(m.estimate).U
           for m in run.results if isinstance(m, Measured) and m.quantity.name in ("K_i", "K_x")}  # fmt: skip
    assert set(off) == {(name, axis) for name in ("K_i", "K_x") for axis in ("y_vorn", "y_hinten")}
    assert max(map(abs, off.values())) < 1.2, off
    (compared,) = (f.text for f in run.results if isinstance(f, Finding) and f.code == "models-compared")
    for m in (m for m in run.results if isinstance(m, Measured) and m.quantity.name == "K_i"):
        told = float(compared.split(f"{m.where}: ")[1].split("true slopes ")[1].split()[0])
        assert told == pytest.approx(m.estimate.value, rel=0.03), m.where


def test_a_plan_s_bias_is_one_that_each_bearing_takes(unlike: Callable[..., str]) -> None:
    rig = load_rig(unlike(high=1.3))
    assert bias_by_axis(rig, Plan()) == {"y_vorn": 1.5, "x_vorn": 1.5, "y_hinten": 1.2, "x_hinten": 1.2}
    assert math.isnan(biases(rig, Plan())[0])
    (problem,) = (text for text in check(rig, Plan(biases_A=(1.4,))) if "biases_A" in text)
    assert "VormagnetHinten" in problem
    assert set(bias_by_axis(rig, Plan(biases_A=(1.1,))).values()) == {1.1}
    assert biases(load_rig(STAND), Plan()) == (1.5,)


def test_a_slow_integrator_is_that_of_the_bearing_with_more_bias() -> None:
    rig = load_rig("tsbs12")
    machine = conventions(rig)
    at_rest = {name: p.default for name, p in rig.parameters.items()}
    alike, *unlike = (
        record_length.faded_s(machine, {**at_rest, "bias_i": inboard, "bias_o": outboard}, "y", 0.02)
        for inboard, outboard in ((3.5, 3.5), (3.0, 3.5), (3.5, 3.0))
    )
    assert alike > 0
    assert unlike == [alike, alike]
