"""Captures on a rig whose channels are called otherwise: what is recorded goes by the rig file, voltages may lack."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.cli.virtual import simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.recorded import pulsed, unrecorded
from procedures.sensitivity.injection import Comb, repeated
from procedures.sensitivity.margins import _freed
from procedures.shared.rates import of_rate, rate_of
from procedures.synchronous.dwells import can_capture, uncapturable
from procedures.unbalance.procedure import VOLTAGE, of_captures
from sim_backend.controller.capture_memory import CaptureMemory, Order
from sim_backend.controller.capture_port import told_by
from sim_backend.machines.twin.machine import traced

FOLDER = Path(__file__).resolve().parent / "strangers"
TILTED = FOLDER / "tilted.toml"
COUNT = 'pulses = { index = 18, unit = "1", type = "u16", scale = 1 }'


def edited(folder: Path, *changes: tuple[str, str]) -> str:
    """The tilted rig with another file."""
    text = TILTED.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    (folder / "tilted.toml").write_text(text, encoding="utf-8")
    (folder / "tilted.dbc").write_bytes(TILTED.with_suffix(".dbc").read_bytes())
    return str(folder / "tilted.toml")


@pytest.mark.parametrize(
    ("name", "count"), [("pulses", "pulses"), ("index_count", "index_count")], ids=["by its own name", "by the mark's"]
)
def test_the_count_is_found_by_the_mark_or_by_the_controllers_name(tmp_path: Path, name: str, count: str) -> None:
    rig = load_rig(edited(tmp_path, (COUNT, COUNT.replace("pulses", name))))
    assert pulsed(rig) == (count, "pulse_age")
    assert unrecorded(rig) == ()
    assert can_capture(rig)
    assert of_captures(rig) == (VOLTAGE,)


def test_what_cannot_be_recorded_is_named(tmp_path: Path) -> None:
    rig = load_rig(edited(tmp_path, (COUNT, ""), ("y_b = { index = 3,", "y_c = { index = 3,")))
    assert pulsed(rig) == ()
    assert not can_capture(rig)
    assert uncapturable(rig) == ("y_b", "index_count or pulses (the mark's count of pulses)")


def test_triggers_of_the_mark_go_by_the_rig_file_and_no_request_raises() -> None:
    """Speed and count have other names in the telemetry, and an unknown channel is refused, not recorded."""
    rig = load_rig(str(TILTED))
    assert rig.capture is not None
    names = traced(rig, {})
    assert told_by(rig, names) == {"PULSE": "index_count", "SPEED": "rpm"}
    memory = CaptureMemory(rig.capture, names, told_by(rig, names))
    for trigger in ("PULSE", "SPEED"):
        assert memory.arm(Order(1 << 18, 1, 100, 0, trigger, 0, 100.0)) == "OK"
        memory.cancel()
    bare = CaptureMemory(rig.capture, [n for n in names if n != "pulses"], told_by(rig, names))
    assert bare.arm(Order(1 << 18, 1, 100, 0, "NOW")) == "UNKNOWN_CHANNEL"


def test_a_margin_that_its_bias_takes_below_zero_is_not_told() -> None:
    """It had a negative number of decibels' argument. Nor one whose draws all lie far beside the curve."""
    assert _freed(0.2, 0.2, np.full(100, 0.5)) is None
    assert _freed(0.6, 0.2, np.full(100, 0.5)) is None
    assert _freed(0.6, 0.2, np.tile([0.2, 0.22], 50)) == pytest.approx((0.59, 0.01))


FASTER = ("tick_s = 5e-5", "tick_s = 8e-5")


def test_a_plan_without_a_rate_takes_the_controllers_nearest(tmp_path: Path) -> None:
    rig = load_rig(edited(tmp_path, FASTER))
    assert rate_of(rig, None) == pytest.approx(12500)
    assert rate_of(rig, None, 500.0) == pytest.approx(500)
    assert list(of_rate(rig, None)) == list(of_rate(rig, 6250.0)) == []
    (text,) = of_rate(rig, 10000.0)
    assert "12500, 6250, 4166.67" in text
    assert rate_of(load_rig(str(TILTED)), None) == pytest.approx(10000)


def test_periods_of_combs_are_whole_samples() -> None:
    """0.125 s at 12.5 kHz are 1562.5 samples."""
    comb = Comb(8.0, 16.0, 12, 4e-3)
    assert comb.period_s == 0.125
    assert repeated(comb, 10000.0) is comb
    made = repeated(comb, 12500.0)
    assert (made.period_s, made.hz) == (0.25, comb.hz)
    assert repeated(comb, 1 / 9e-5).period_s * (1 / 9e-5) == pytest.approx(12500)


@pytest.mark.parametrize("procedure", ["unbalance", "run-up"])
def test_a_turning_shaft_is_captured_without_coil_voltages(tmp_path: Path, procedure: str) -> None:
    run = simulated_run(procedure, str(TILTED), 0, {}, tmp_path / "tilted.mcap")
    findings = {f.code: f for f in run.results if isinstance(f, Finding)}
    assert [f for f in findings.values() if f.effect is not Effect.NOTE] == []
    assert "voltages" in findings["voltage-not-captured"].text
    told = {m.quantity.name for m in run.results if isinstance(m, Measured)}
    assert "current_peak" in told
    assert "voltage_peak" not in told
