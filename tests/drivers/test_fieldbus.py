"""Drive, supply and thermal monitor over the simulated devices' registers, on virtual time."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fieldbus_bench import Bench, go, opened, rig

from bench.errors import BenchError, DeviceFault, DeviceUnreadable, InterlockError, LinkError, RotorNotArrived
from bench.recording import Recording
from bench.recording.recorder import Recorder, RunHeader
from bench.rigfile.registers import RegisterRefused
from drivers.fieldbus import Fieldbus
from drivers.polling import Reading
from sim_backend.devices.drive import SimulatedDrive


def test_the_shaft_reaches_its_speed_coasts_and_stops() -> None:
    with opened() as (bench, bus):
        drive = bus.drive
        assert drive is not None
        drive.reach(40.0)
        assert drive.speed_rad_s == pytest.approx(40, abs=0.5)
        assert bench.plant_speed == pytest.approx(40, abs=0.5)
        assert bench.controller.mode == "SPINNING"
        assert drive.running
        drive.coast()
        assert not drive.running
        before = bench.plant_speed
        go(bench, bus, 0.5)
        assert 1 < bench.plant_speed < 0.6 * before
        drive.reach(-10.0)
        assert bench.plant_speed == pytest.approx(-10, abs=0.6)
        drive.stop()
        assert abs(bench.plant_speed) < 0.5


def test_a_drive_that_does_not_stop_is_told_and_not_waited_for_long(caplog: pytest.LogCaptureFixture) -> None:
    with opened() as (bench, bus):
        assert bus.drive is not None
        bus.drive.reach(20.0)
        bench.bank.drives["drive"].obey = lambda command: None  # type: ignore[method-assign]
        begin = bench.machine.now_ns()
        with caplog.at_level(logging.INFO, "drivers"), pytest.raises(RotorNotArrived, match="no slower for 25 s"):
            bus.drive.stop()
        assert bench.machine.now_ns() - begin < 30e9
        lines = [r.getMessage() for r in caplog.records if hasattr(r, "shown")]
        assert lines[0] == "waiting 5 s for the drive to stop the shaft; 20 s left"


def test_however_the_block_ends_the_drive_coasts() -> None:
    def broken() -> None:
        with opened() as (bench, bus):
            assert bus.drive is not None
            bus.drive.reach(20.0)
            states.append(bench.bank.drives["drive"])
            raise RuntimeError

    states: list[SimulatedDrive] = []
    with pytest.raises(RuntimeError):
        broken()
    assert states[0].state == "off"


@pytest.mark.parametrize("speed", [75.1, -76.0, float("nan"), float("inf")])
def test_every_set_speed_passes_the_envelope(speed: float) -> None:
    with opened(up=False) as (bench, bus):
        assert bus.drive is not None
        for call in (bus.drive.set_speed, bus.drive.reach):
            with pytest.raises(InterlockError, match=r"drive speed: found .* allows 75 rad/s; nothing was sent"):
                call(speed)
        assert bench.lines["drive"].writes == []
        bus.drive.set_speed(75.0)
        assert [address for address, _ in bench.lines["drive"].writes] == [1]


def test_a_speed_that_reads_back_otherwise_is_an_error() -> None:
    with opened(up=False) as (bench, bus):
        assert bus.drive is not None
        bench.lines["drive"].changed = lambda t, a, words: (words[0], words[1] ^ 0x100, *words[2:]) if len(
            words) == 3 else words  # fmt: skip
        with pytest.raises(BenchError, match=r"wrote a speed of 10 rad/s, it reads back"):
            bus.drive.set_speed(10.0)


def test_speed_on_the_wire_by_hand() -> None:
    """40 rad/s is 381.97 r/min: 38197 = 0x9535, low word first."""
    with opened(up=False) as (bench, bus):
        assert bus.drive is not None
        bus.drive.set_speed(40.0)
        bus.drive.run()
        assert bench.lines["drive"].writes == [(1, (0x9535, 0)), (0, (1,))]


def test_reads_are_grouped() -> None:
    with opened(up=False) as (bench, bus):
        for line in bench.lines.values():
            line.reads.clear()
        go(bench, bus, 1.0)
        assert bench.lines["drive"].reads == [("holding", 0, 3), ("input", 0, 5)] * 10
        assert bench.lines["thermal"].reads == [("input", 0, 3), ("input", 8, 2)] * 3


def test_a_bench_that_stood_still_does_not_take_its_devices_for_lost() -> None:
    with opened(up=False) as (bench, bus):
        go(bench, bus, 0.5)
        ahead = 0

        def now() -> int:
            return bench.clock.now_ns() + ahead

        bus._clock = SimpleNamespace(now_ns=now, sleep=bench.clock.sleep)
        ahead = 30_000_000_000
        bus.pump()
        for line in bench.lines.values():
            line.failure = LinkError("no answer")
        with pytest.raises(LinkError, match=r"no reading for [34]\.\d s: no answer"):
            go(bench, bus, 6.0)


def test_a_drive_that_goes_into_fault_ends_the_wait() -> None:
    with opened(drive_fault_after_s=4.0) as (bench, bus):
        assert bus.drive is not None
        with pytest.raises(DeviceFault, match="the drive reports EXTERNAL"):
            bus.drive.reach(60.0)
        with pytest.raises(DeviceFault, match="EXTERNAL; it was not started"):
            bus.drive.run()
        bus.guarded = False
        go(bench, bus, 0.3)  # make-safe goes on


def test_what_holds_the_shaft_is_asked_for() -> None:
    with opened() as (bench, bus):
        assert bus.drive is not None
        for gain, value in (("kp_theta", 50.0), ("ki_theta", 100.0), ("kd_theta", 1.0)):
            bench.controller.set(gain, value)
        with pytest.raises(DeviceFault, match="the drive reports OVERLOAD"):
            bus.drive.reach(40.0)


def test_a_run_that_must_not_be_is_not_sent() -> None:
    def resting() -> None:
        raise InterlockError("the rotor rests on its rings")

    with opened(up=False) as (bench, bus):
        assert bus.drive is not None
        bus.drive.may_run = resting
        with pytest.raises(InterlockError, match="rests"):
            bus.drive.run()
        assert bench.lines["drive"].writes == []


def test_a_refusal_during_the_run_names_the_registers() -> None:
    with opened(up=False) as (bench, bus):
        bench.lines["supply"].failure = RegisterRefused(4, "unit 2")
        with pytest.raises(LinkError, match=r"supply \(voltage, current\): unit 2: exception 4 \(device failure\)"):
            go(bench, bus, 1.0)


def test_a_refused_write_names_the_register() -> None:
    with opened(up=False) as (bench, bus):
        assert bus.drive is not None
        bench.lines["drive"].failure = RegisterRefused(6, "unit 1")
        with pytest.raises(LinkError, match=r"drive \(command\): unit 1: exception 6 \(device busy\)"):
            bus.drive.coast()


def test_supply_and_temperatures() -> None:
    with opened() as (bench, bus):
        assert bus.supply is not None
        assert bus.thermal is not None
        go(bench, bus, 1.0)
        assert bus.supply.voltage_V == pytest.approx(148)
        assert bus.supply.on
        assert 0.5 < bus.supply.current_A < 2
        telemetry = bench.controller.telemetry.latest
        for name, kelvin in bus.thermal.temperatures_K.items():
            assert kelvin == pytest.approx(telemetry[name], abs=0.1)
        assert set(bus.thermal.temperatures_K) == {"temp_i", "temp_o", "temp_m"}
        assert bus.thermal.ambient_K == pytest.approx(295, abs=1e-3)


@contextmanager
def recorded(bench: Bench, bus: Fieldbus, path: Path) -> Iterator[None]:
    streams = [bench.controller.telemetry.layout, *bus.layouts]
    header = RunHeader({"run": {}}, {"rig.toml": rig().toml_text.encode(), "rig.dbc": rig().dbc_text.encode()})
    with Recorder(path, clock=bench.clock, streams=streams, header=header) as recorder:
        bench.controller.recorder = bus.recorder = recorder
        yield
        bench.controller.recorder = bus.recorder = None


def test_polled_values_are_recorded_as_streams(tmp_path: Path) -> None:
    with opened() as (bench, bus), recorded(bench, bus, tmp_path / "r.mcap"):
        assert bus.drive is not None
        start = bench.clock.now_ns()
        bus.drive.reach(30.0)
        go(bench, bus, 2.0)
        seconds = (bench.clock.now_ns() - start) * 1e-9
    recording = Recording.open(tmp_path / "r.mcap")  # type: ignore[var-annotated]
    speed = recording.channel("drive_actual_speed")
    assert len(speed["t_ns"]) == pytest.approx(seconds / 0.1, abs=1)
    assert np.diff(speed["t_ns"]).max() <= 200_000_000
    own = recording.channel("speed")
    there = np.interp(speed["t_ns"], own["t_ns"], own["speed"])
    assert np.abs(there - speed["drive_actual_speed"]).max() < 0.5
    assert speed["drive_actual_speed"][-1] == pytest.approx(30, abs=0.3)
    assert len(recording.channel("thermal_temp_m")["t_ns"]) == pytest.approx(seconds / 0.5, abs=1)
    assert recording.channel("supply_current")["supply_current"].min() > 0.4
    integrity = recording.integrity
    assert integrity is not None
    assert integrity["lost"] == {"telemetry": 0, "drive": 0, "supply": 0, "thermal": 0}
    commands = [e.get("command") for e in recording.events("drive")]
    assert commands == ["run"]
    assert recording.events("drive-speed")[0]["rad_s"] == 30.0


def test_a_missed_poll_is_a_lost_sample_and_nothing_is_made_up(tmp_path: Path) -> None:
    with opened() as (bench, bus), recorded(bench, bus, tmp_path / "r.mcap"):
        go(bench, bus, 0.5)
        bench.lines["drive"].failure = LinkError("no answer")
        go(bench, bus, 0.4)  # shorter than its patience
        bench.lines["drive"].failure = None
        go(bench, bus, 0.5)
    recording = Recording.open(tmp_path / "r.mcap")  # type: ignore[var-annotated]
    found = recording.channel("drive_actual_speed")
    assert list(found["index"]) == [0, 1, 2, 3, 4, 9, 10, 11, 12, 13]
    assert recording.integrity is not None
    assert recording.integrity["lost"]["drive"] == 4
    begin, end = int(found["t_ns"][0]), int(found["t_ns"][-1]) + 1
    assert recording.lost("drive", begin, end) == 4
    assert recording.lost("supply", begin, end) == 0


def test_a_word_that_is_no_number_is_a_lost_sample_too() -> None:
    with opened(up=False) as (bench, bus):
        assert bus.thermal is not None
        before = bus.thermal.ambient_K
        bench.lines["thermal"].changed = lambda t, address, words: (0x7FC0, 0) if address == 8 else words
        with pytest.raises(
            DeviceUnreadable, match=r"no reading for .*register ambient: registers 7fc0 0000 hold no finite"
        ):
            go(bench, bus, 8.0)
        assert bus.thermal.ambient_K == before


def test_a_device_that_stays_silent_is_a_lost_link_in_bounded_time() -> None:
    """1 s, three periods and the link's reconnect time."""
    with opened(up=False) as (bench, bus):
        bench.lines["drive"].failure = LinkError("link fieldbus: the connection is lost")
        start = bench.clock.now_ns()
        with pytest.raises(
            LinkError, match=r"device drive on link fieldbus: no reading for .* s: link fieldbus: the conn"
        ):
            go(bench, bus, 10.0)
        assert (bench.clock.now_ns() - start) * 1e-9 == pytest.approx(1.0 + 0.3 + 2.0, abs=0.31)
        bus.guarded = False
        go(bench, bus, 1.0)


def test_periods_in_which_nobody_polled_are_lost_samples_too(tmp_path: Path) -> None:
    with opened(up=False) as (bench, bus), recorded(bench, bus, tmp_path / "r.mcap"):
        go(bench, bus, 0.3)
        bench.clock.sleep(0.5)
        go(bench, bus, 0.3)
    recording = Recording.open(tmp_path / "r.mcap")  # type: ignore[var-annotated]
    assert list(recording.channel("drive_torque")["index"]) == [0, 1, 2, 8, 9, 10]
    assert recording.integrity is not None
    assert recording.integrity["lost"] == {"telemetry": 0, "drive": 5, "supply": 0, "thermal": 0}


def test_a_poll_from_before_a_reset_does_not_bring_the_fault_back() -> None:
    with opened(up=False) as (bench, bus):
        assert bus.drive is not None
        before = Reading("drive", 0, bench.clock.now_ns(), {**bus.latest("drive"), "fault": 3.0})
        bench.bank.drives["drive"].fault = "COMMUNICATION"
        bench.clock.sleep(0.1)
        bus.drive.reset()
        bus._arrived.append(before)  # as a polling thread would have left it
        bus.pump()
        assert bus.drive.fault == ""
