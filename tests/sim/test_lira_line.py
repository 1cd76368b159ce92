"""The command line's troubles, and what becomes of them: harmless ones cost a repeat, none passes in silence."""

from __future__ import annotations

import numpy as np
import pytest
from lira_bench import Bench, opened

from bench.errors import DeviceFault, LinkError

HARMLESS = ("drop=0.05", "duplicate=0.2", "reorder=0.1", "corrupt=0.05", "drop=0.02@0.5+3")


def flown(bench: Bench) -> None:
    """Up, an offset on the way, and down again."""
    c = bench.controller
    c.enable()
    c.set("observer", 2.0)
    assert c.get("observer") == 2.0
    c.levitate()
    c.set("ref_z", 0.012)
    bench.rig.clock.sleep(1.0)
    assert c.reading("z") == pytest.approx(0.012, abs=1e-4)
    c.land()
    c.disable()
    assert c.mode == "OFF"


def test_a_flight_over_a_sound_line() -> None:
    with opened() as bench:
        flown(bench)
        health = bench.rig.health()
    assert (health.repeats, health.counters.lost, health.stats.malformed) == (0, 0, 0)


@pytest.mark.parametrize("fault", HARMLESS)
def test_a_flight_over_a_bad_line(fault: str) -> None:
    with opened(fault, seed=3) as bench:
        flown(bench)
        health = bench.rig.health()
    c = health.counters
    assert health.repeats + c.lost + c.duplicates + c.late + c.reordered > 0


def test_a_capture_whose_blocks_are_damaged_comes_whole() -> None:
    with opened() as bench:
        sound = captured(bench)
    with opened("corrupt=0.01", "drop=0.01") as bench:
        spoilt = captured(bench)
    assert sound.keys() == spoilt.keys()
    assert all(len(column) == 17_500 for column in spoilt.values())
    assert np.ptp(spoilt["z"]) < 1e-4


def captured(bench: Bench) -> dict[str, np.ndarray]:
    """Half a second of everything, levitated; what the controller and the bench say of it has the same CRC."""
    bench.controller.enable()
    bench.controller.levitate()
    capture = bench.rig.capture
    assert capture is not None
    capture.arm(capture.channels, seconds=0.5, rate_hz=35_000)
    capture.wait(3.0)
    return dict(capture.upload().columns)


def test_a_firmware_that_restarts_ends_the_run() -> None:
    with opened("reboot@1") as bench, pytest.raises(DeviceFault, match="restart"):
        flown(bench)


def test_a_firmware_that_answers_nothing_is_told() -> None:
    with opened("mute@0.5+4") as bench, pytest.raises(LinkError, match="did not come"):
        flown(bench)


def test_heartbeats_that_do_not_count_land_it() -> None:
    with opened("stuck-heartbeat@1") as bench:
        with pytest.raises(DeviceFault, match="HEARTBEAT_LOST"):
            flown(bench)
        bench.controller.guarded = False
        bench.rig.clock.sleep(3.0)
        assert (bench.controller.mode, bench.controller.fault) == ("FAULT", "HEARTBEAT_LOST")
