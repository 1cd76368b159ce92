"""The envelope over the devices on registers: winding, supply and drive trip a run as the controller's channels do."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from fieldbus_bench import Bench, changed, go, opened

from bench.errors import InterlockError
from bench.rigfile.envelope import HELD
from bench.rigfile.registers import Table, Words

Change = Callable[[Table, int, Words], Words]


def at(address: int, *words: int) -> Change:
    """Words in the place of those that stand from an address on."""

    def change(_: Table, start: int, found: Words) -> Words:
        return tuple(dict(enumerate(words, address)).get(start + k, w) for k, w in enumerate(found))

    return change


HOT, OFF, EMPTY, HIGH = at(0, 2000), at(110, 0), at(100, 0), at(100, 17000)
FAST, TWISTING = at(2, 7500, 0x0001), at(4, 0xFB00)  # 73036 of 0.01 r/min are 76.5 rad/s, low word first; -12.8 N m


@pytest.mark.parametrize(
    ("device", "change", "text"),
    [("thermal", HOT, r"thermal temp_i reached 473\.[12]\d* K; the envelope allows 353 K"),
     ("supply", OFF, "supply says that it is off while the rotor is held"),
     ("supply", EMPTY, "supply voltage fell to 0 V while the rotor is held; the envelope asks for at least 130 V"),
     ("supply", HIGH, "supply voltage reached 170 V while the rotor is held; the envelope allows 160 V"),
     ("drive", FAST, r"drive actual_speed reached 76\.\d+ rad/s; the envelope allows 75 rad/s"),
     ("drive", TWISTING, r"drive torque reached 12\.8 N m; the envelope allows 10 N m")],
    ids=["hot", "off", "empty", "high", "fast", "twisting"],
)  # fmt: skip
def test_every_device_of_a_rig_is_watched(device: str, change: Change, text: str) -> None:
    with opened() as (bench, bus):
        bus.held = lambda: bench.controller.mode in HELD
        go(bench, bus, 1.0)
        bench.lines[device].changed = change
        with pytest.raises(InterlockError, match=text):
            go(bench, bus, 1.5)


def test_a_supply_may_be_off_while_nothing_is_held_and_a_winding_may_not_be_hot() -> None:
    with opened(up=False) as (bench, bus):
        bus.held = lambda: bench.controller.mode in HELD
        bench.lines["supply"].changed = OFF
        go(bench, bus, 1.5)
        bench.lines["thermal"].changed = HOT
        with pytest.raises(InterlockError, match="temp_i"):
            go(bench, bus, 1.5)


def test_a_supply_that_closes_for_the_lift_was_off_before_it() -> None:
    """Its last reading is from before the lift when the rotor is first held."""
    with opened(up=False) as (bench, bus):
        bus.held = lambda: bench.controller.mode in HELD
        closing(bench)
        bus.pump()
        bench.levitate()
        bus.pump()
        go(bench, bus, 1.5)


def closing(bench: Bench) -> None:
    bench.lines["supply"].changed = lambda t, a, w: w if bench.controller.mode in HELD else OFF(t, a, w)


def test_no_supply_holds_a_rotor_with_nothing_whatever_the_rig_file_leaves_out() -> None:
    silent = changed(
        ("min_supply_V = 130.0 # of 148 V; on less the amplifiers cannot hold a rotor that turns\n", ""),
        ("max_supply_V = 160.0\n", ""),
    )
    with opened(silent) as (bench, bus):
        bus.held = lambda: True
        bench.lines["supply"].changed = EMPTY
        with pytest.raises(InterlockError, match="supply voltage fell to 0 V"):
            go(bench, bus, 1.5)


def test_make_safe_may_talk_to_a_rig_that_has_tripped() -> None:
    with opened() as (bench, bus):
        bench.lines["thermal"].changed = HOT
        bus.guarded = False
        go(bench, bus, 1.5)
        assert bus.thermal is not None
        assert bus.thermal.temperatures_K["temp_i"] > 470
