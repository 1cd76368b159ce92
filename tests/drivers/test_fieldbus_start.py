"""Opening register devices: what a rig file must state, what a device must have, faults that an earlier run left."""

from __future__ import annotations

import pytest
from fieldbus_bench import Bench, changed, opened, rig

from bench.errors import ConfigError, DeviceFault
from bench.rigfile import RigFile
from drivers.open_devices import open_devices


def test_a_fault_of_an_earlier_run_is_cleared_and_told() -> None:
    bench = Bench(rig(), {})
    bench.bank.drives["drive"].fault = "COMMUNICATION"
    with open_devices(rig(), bench.lines.__getitem__, bench.clock, bench.controller.envelope) as bus:
        assert bus.cleared == "COMMUNICATION"
        assert bus.drive is not None
        assert bus.drive.fault == ""


def test_a_fault_that_cannot_be_reset_is_named() -> None:
    file = changed((", reset = { command = 4 }", ""))
    bench = Bench(file, {})
    bench.bank.drives["drive"].fault = "EXTERNAL"
    with (
        pytest.raises(DeviceFault, match="the drive reports EXTERNAL; the rig file states no command to reset it"),
        open_devices(file, bench.lines.__getitem__, bench.clock, bench.controller.envelope, clear_fault=True),
    ):
        pytest.fail("opened")
    assert bench.lines["drive"].writes == []


def test_a_fault_that_stays_is_named() -> None:
    bench = Bench(rig(), {})
    line = bench.lines["drive"]
    line.changed = lambda table, address, words: (0, 2, *words[2:]) if table == "input" else words
    with (
        pytest.raises(DeviceFault, match="the drive reports OVERLOAD, and its reset did not clear it"),
        open_devices(rig(), bench.lines.__getitem__, bench.clock, bench.controller.envelope, clear_fault=True),
    ):
        pytest.fail("opened")


def test_unknown_fault_codes_are_told_as_numbers() -> None:
    with opened(changed(('2 = "OVERLOAD", ', "")), up=False) as (_, bus):
        assert bus.drive is not None
        assert bus.drive.fault_of({"fault": 2.0}) == "fault 2"


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("torque = { address = 4", "torque = { address = 40", r"registers\.torque: found input address 40 \(i16\)"),
        ("target_speed = { address = 1", "target_speed = { address = 77", r"registers\.target_speed: found holding"),
        ("ambient = { address = 8", "ambient = { address = 9000", r"devices\.thermal\.registers\.ambient: found input"),
    ],
)
def test_a_register_that_does_not_exist_is_found_at_the_start(old: str, new: str, text: str) -> None:
    """The device has the registers of the rig file; the driver is given another map."""
    bench, other = Bench(rig(), {}), changed((old, new))
    with (
        pytest.raises(ConfigError, match=text + r".*exception 2 \(illegal data address\)"),
        open_devices(other, bench.lines.__getitem__, bench.clock, bench.controller.envelope),
    ):
        pytest.fail("opened")
    assert bench.lines["drive"].writes == []  # nothing is written to a device that is another one


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("actual_speed = { ad", "speed = { ad", r"devices\.drive\.registers: found .*; expected actual_speed as well"),
        ("stop = { command = 2 }, ", "", r"devices\.drive\.commands: found coast, run, reset; expected stop"),
        ("run = { command = 1 }", "run = { running = 1 }", r"registers\.running: found one that cannot be written"),
        ("run = { command = 1 }", "run = { order = 1 }", r"registers\.order: found no such register"),
        ("run = { command = 1 }", "run = { command = 70000 }", "commands.run: raw value 70000 does not fit u16"),
        ('unit = "r/min", writable', 'unit = "A", writable', r"target_speed\.unit: found A; expected r/min or rad/s"),
        ("voltage = { ad", "volts = { ad", r"devices\.supply\.registers: found .*; expected voltage as well"),
        ("ambient = { ad", "air = { ad", r"devices\.thermal\.registers: found .*; expected ambient as well"),
        ('roles = ["supply"]', 'roles = ["supply", "thermal"]', r"found thermal, which supply has; expected one"),
    ],
)
def test_a_map_that_lacks_what_a_role_needs(old: str, new: str, text: str) -> None:
    bench = Bench(rig(), {})
    with (
        pytest.raises(ConfigError, match=text),
        open_devices(changed((old, new)), bench.lines.__getitem__, bench.clock, bench.controller.envelope),
    ):
        pytest.fail("opened")


def test_a_rig_without_register_devices_has_none() -> None:
    text = rig().toml_text
    head, rest = text.split("[devices.drive]")
    file = RigFile.parse(head + rest[rest.index("[geometry]") :], rig().dbc_text)
    bench = Bench(file, {})
    with open_devices(file, bench.lines.__getitem__, bench.clock, bench.controller.envelope) as bus:
        assert (bus.drive, bus.supply, bus.thermal, bus.layouts) == (None, None, None, ())
        bus.pump()


def test_a_fault_of_the_drive_itself_is_looked_at_first() -> None:
    bench = Bench(rig(), {})
    bench.bank.drives["drive"].fault = "EXTERNAL"
    with (
        pytest.raises(ConfigError, match=r"the drive has the fault EXTERNAL of an earlier run.*--clear-fault"),
        open_devices(rig(), bench.lines.__getitem__, bench.clock, bench.controller.envelope),
    ):
        pytest.fail("opened")
    assert bench.lines["drive"].writes == []
