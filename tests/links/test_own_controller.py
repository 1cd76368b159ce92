"""A controller with a message map of its own (examples/own-controller), bound by its rig file alone: the calibration
through that map and through the native one, from the very same samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import plainamb
import pytest

from bench.cli.opening import SIMULATED, beat_of
from bench.errors import BenchError, ConfigError, DeviceFault, InterlockError
from bench.findings import Finding
from bench.link.fault_injection import parse
from bench.link.frame_faults import FrameFaults
from bench.link.frames import FrameBatch
from bench.link.health import Health
from bench.link.telemetry import TelemetryDecoder
from bench.procedure import Measured
from bench.procedure.rig import Rig
from bench.procedure.roles import Load, RigState
from bench.procedure.states import transition
from bench.recording import Recording
from bench.recording.recorder import Recorder, RunHeader
from bench.rigfile import RigFile, load_rig
from bench.rigfile.check import check_rig
from bench.samples import SampleBlock
from drivers.controller import Controller
from drivers.operator import LineOperator
from procedures.amb_calibration.plan import Plan
from procedures.amb_calibration.procedure import procedure, settings
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

ROOT = Path(__file__).resolve().parents[2]
OWN = str(ROOT / "examples" / "own-controller" / "plainamb.toml")
NATIVE: RigFile = load_rig("tsbs12")
PLAIN: RigFile = load_rig(OWN)
HALF_STEP = {"pos": 12.5e-9, "i": 0.5e-3, "angle": np.radians(0.01), "speed": 0.05 * 2 * np.pi / 60, "temp": 1e-9}
SHORT = Plan.model_validate({**PLAIN.plans["amb-calibration"], "settle_s": 0.15, "average_s": 0.12})


@dataclass
class Twice:
    """What a procedure records goes into both recordings."""

    recorders: list[Recorder] = field(default_factory=list)

    @contextmanager
    def step(self, kind: str, **labels: Any) -> Iterator[None]:
        one, other = self.recorders
        with one.step(kind, **labels), other.step(kind, **labels):
            yield

    def event(self, kind: str, **data: Any) -> None:
        for recorder in self.recorders:
            recorder.event(kind, **data)

    def completed(self, kind: str) -> tuple[Mapping[str, Any], ...]:
        return self.recorders[0].completed(kind)


class Bench:
    """A foreign controller and the bench that is bound to it by its rig file."""

    def __init__(self, seed: int = 2026, **defects: float) -> None:
        self.machine = SimulatedRig(NATIVE, draw(NATIVE, seed, defects, settings(NATIVE, SHORT)))
        self.heard = TelemetryDecoder(NATIVE)
        self.native: Recorder | None = None
        self.link = plainamb.PlainAmb(self.machine.link, self._hear)
        self.controller = Controller(PLAIN, self.link, self.machine, SIMULATED)
        self.operator = LineOperator(self.machine.request, self.controller.clock, self.controller.envelope)
        counters = self.controller.telemetry.counters
        self.rig = Rig(PLAIN, self.controller.clock, self.controller, self.controller.rotation, self.operator, counters,
                       lambda: Health(counters, self.link.stats, None, 0), self.link.close)  # fmt: skip

    def _hear(self, batch: FrameBatch) -> None:
        for block in self.heard.decode(batch):
            if self.native is not None:
                self.native.samples(block)

    def calibrate(self, folder: Path) -> tuple[Path, Path]:
        """The whole procedure; the recordings through the foreign map and through the native one."""
        paths = folder / "foreign.mcap", folder / "native.mcap"
        self.controller.connect()
        with (
            recorder(paths[0], PLAIN, self.controller, self.controller.telemetry) as foreign,
            recorder(paths[1], NATIVE, self.controller, self.heard) as native,
        ):
            both: Any = Twice([foreign, native])
            self.controller.recorder, self.operator.recorder, self.native = foreign, both, native
            self.heard.start_counting()
            transition(self.rig, RigState.READY)
            for name, value in settings(NATIVE, SHORT).items():
                self.controller.set(name, value)
            transition(self.rig, procedure.state)
            procedure.acquire(self.rig, SHORT, both)
            transition(self.rig, RigState.OFF)
        return paths


def recorder(path: Path, rig: RigFile, controller: Controller, telemetry: TelemetryDecoder) -> Recorder:
    header = RunHeader(
        {"run": {"procedure": procedure.name, "seed": "0"}, "versions": {}},
        {
            "rig.toml": rig.toml_text.encode(),
            "rig.dbc": rig.dbc_text.encode(),
            "plan.json": SHORT.model_dump_json().encode(),
        },
    )
    return Recorder(path, clock=controller.clock, streams=[telemetry.layout], header=header)


def test_the_example_is_a_rig_without_a_problem_and_fits_a_classic_bus() -> None:
    found, load = check_rig(OWN)
    assert found == ()
    assert load is not None
    assert load.total < 0.7
    assert not any(m.fd for m in PLAIN.messages.messages.values())
    assert not PLAIN.simulation


def test_the_heartbeat_is_that_of_the_dbc() -> None:
    beat = beat_of(PLAIN, SIMULATED)
    assert (beat.identifier, beat.payload, beat.counter, beat.fd, beat.period_s) == (
        16,
        bytes(4),
        (*range(16),),
        False,
        0.02,
    )


@pytest.mark.long
def test_the_calibration_is_the_same_through_both_maps(tmp_path: Path) -> None:
    bench = Bench()
    foreign, native = (Recording.open(path, Plan) for path in bench.calibrate(tmp_path))
    assert bench.link.refused == []
    assert bench.link.demands == [1, 2, 5, 3, 0]  # Arm, Float, Brake, Descend, Standby
    assert bench.machine.device.state == "OFF"
    for counters in (bench.controller.telemetry.counters, bench.heard.counters):
        assert set(vars(counters).values()) == {0}
    _same_samples(foreign, native)
    ours, theirs = (_results(recording) for recording in (foreign, native))
    assert ours[1] == theirs[1]
    assert set(ours[0]) == {"K_i", "K_o", "K2_i", "K2_o", "Kw_i", "Kw_o"}
    for name, (value, u) in ours[0].items():
        # Rounding to 1 mA, dithered by 5 mA of noise, moves the mean of a step by some 0.03 mA; what is fitted to 72
        # steps and extrapolated to zero current moves by about a tenth of its uncertainty.
        assert abs(value - theirs[0][name][0]) < 0.25 * u, name
        assert u == pytest.approx(theirs[0][name][1], rel=0.05)


def _results(recording: Recording[Plan]) -> tuple[dict[str, tuple[float, float]], list[str]]:
    found = list(procedure.analyse(recording))
    values = {m.quantity.name: (m.estimate.value, m.estimate.u) for m in found if isinstance(m, Measured)}
    return values, [f.code for f in found if isinstance(f, Finding)]


def _same_samples(foreign: Recording[Plan], native: Recording[Plan]) -> None:
    """Sample by sample, within half a step of the foreign signal. The newest sample waits for the next SYNC."""
    for name in PLAIN.channels:
        ours, theirs = foreign.channel(name), native.channel(name)
        when, one, other = np.intersect1d(ours["t_ns"], theirs["t_ns"], assume_unique=True, return_indices=True)
        assert len(when) >= len(theirs["t_ns"]) - 1
        half = HALF_STEP.get(name.partition("_")[0], 0.0)
        worst = np.abs(ours[name][one] - theirs[name][other]).max()
        assert worst <= half * 1.001 + 2e-7 * np.abs(theirs[name]).max(), name  # recorded as float32


def test_a_fault_has_the_controllers_own_name() -> None:
    bench = Bench(fault_after_s=1.0)
    bench.controller.connect()
    with pytest.raises(DeviceFault, match="SensorBad"):
        bench.controller.clock.sleep(2.0)
    assert bench.controller.mode == "FAULT"
    again = Controller(PLAIN, bench.link, bench.machine, SIMULATED)
    with pytest.raises(ConfigError, match=r"SensorBad of an earlier run.*--clear-fault"):
        again.connect()
    again.connect(clear_fault=True)
    assert (again.cleared, bench.link.demands) == ("SensorBad", [7])


def test_parameters_are_refused_before_anything_is_sent() -> None:
    bench = Bench()
    bench.controller.connect()
    with pytest.raises(InterlockError, match="nothing was sent"):
        bench.controller.set("bias_i", 6.0)
    with pytest.raises(BenchError, match="cannot be asked"):
        bench.controller.get("bias_i")
    assert bench.link.demands == []
    transition(bench.rig, RigState.READY)
    bench.controller.set("bias_i", 2.5)
    transition(bench.rig, RigState.LEVITATED)
    with pytest.raises(BenchError, match="at rest only"):
        bench.controller.set("bias_i", 3.0)
    bench.operator.hang(Load("M1"))
    transition(bench.rig, RigState.OFF)
    assert bench.link.refused == []


def test_a_parameter_does_not_command_by_the_way() -> None:
    """Demand shares its message with the angle: before the first command it must ask for the state that there is."""
    first = Bench()
    first.controller.connect()
    transition(first.rig, RigState.READY)
    second = Controller(PLAIN, first.link, first.machine, SIMULATED)  # a bench that finds the controller in READY
    second.connect()
    second.set("speed_ref", 1.0)
    second.clock.sleep(0.1)
    assert (second.mode, first.link.demands) == ("READY", [1])
    transition(first.rig, RigState.LEVITATED)
    third = Controller(PLAIN, first.link, first.machine, SIMULATED)
    third.connect()
    with pytest.raises(BenchError, match="land the rotor"):
        third.set("speed_ref", 1.0)
    assert first.link.demands == [1, 2]
    transition(first.rig, RigState.OFF)


def test_the_rotor_spins_and_stops() -> None:
    bench = Bench()
    bench.controller.connect()
    transition(bench.rig, RigState.LEVITATED)
    bench.controller.rotation.spin(8.0)
    assert bench.controller.mode == "SPINNING"
    assert bench.controller.rotation.speed_rad_s == pytest.approx(8.0, abs=0.3)
    transition(bench.rig, RigState.OFF)
    assert bench.link.refused == []


MUCH = ["drop=0.3", "reorder=0.2", "duplicate=0.1"]


@pytest.mark.parametrize("trouble", [["drop=0.02"], ["duplicate=0.05"], ["reorder=0.1"], MUCH], ids="-".join)
def test_whatever_a_bus_does_no_sample_is_mixed(trouble: list[str]) -> None:
    """Every sample that comes through is, channel by channel, the native one of its tick."""
    machine = SimulatedRig(NATIVE, draw(NATIVE, 4))
    applied = FrameFaults([parse(text) for text in trouble], 7)
    applied.start(machine.now_ns())
    foreign, native = TelemetryDecoder(PLAIN), TelemetryDecoder(NATIVE)
    ours: list[SampleBlock] = []
    theirs: list[SampleBlock] = []
    for _ in range(15):
        machine.sleep(0.1)
        batch = machine.link.receive()
        theirs += native.decode(batch)
        ours += foreign.decode(applied.apply(plainamb.translated(batch), machine.now_ns()))
    ticks, expected = (np.concatenate([b.ticks for b in blocks]) for blocks in (ours, theirs))
    place = np.searchsorted(expected, ticks)
    assert (expected[place] == ticks).all()
    assert (np.diff(ticks.astype(np.int64)) > 0).all()
    for name in ("pos_xi", "i_xi_p", "i_yo_n", "i_z_p", "angle", "temp_o"):
        one, other = (np.concatenate([b.columns[name] for b in blocks]) for blocks in (ours, theirs))
        assert np.abs(one - other[place]).max() <= HALF_STEP[name.partition("_")[0]] * 1.001 + 1e-12, name
    counters = foreign.counters
    assert counters.lost + len(ticks) == int(ticks[-1] - ticks[0]) // 10 + 1
    if not any(text.startswith("drop") for text in trouble):
        assert counters.lost == 0
        assert len(ticks) == len(expected) - 1
