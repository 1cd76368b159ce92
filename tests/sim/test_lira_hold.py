"""A hold of the bearings' currents: when it is taken, when it ends, that the mover is caught."""

from __future__ import annotations

import numpy as np
import pytest

from sim_backend.core.plant import Array
from sim_backend.machines.lira.device import Device
from sim_backend.machines.lira.params import ControlParams, PlantParams
from sim_backend.machines.lira.plant import WHOLE, Plant
from sim_backend.machines.lira.shell import Refused


def flying(**of: object) -> Device:
    device = Device(Plant(PlantParams(**of), 1, control=ControlParams(observer=2.0, watchdog_s=10.0), reduced=True))  # type: ignore[arg-type]
    for words in (("on", "current"), ("lift",)):
        list(device.do(words))
        device.advance(0.2)
    for _ in range(60):
        if device.plant.state == "LEVITATED":
            break
        device.advance(0.05)
    device.plant.beat()
    device.advance(0.5)
    return device


def column(rows: Array, name: str) -> Array:
    return np.asarray(rows[:, WHOLE.index(name)])


def held(device: Device, words: str, seconds: float = 0.05) -> tuple[Array, bytes]:
    said = device.do(tuple(words.split()))
    assert list(said) == [f"hold={float(words.split()[3]):.9g} s {words.split()[1]} {float(words.split()[2]):.9g} A"]
    told, rows = b"", []
    for _ in range(round(seconds / 1e-3)):
        told += device.advance(1e-3)
        rows.append(device._rows)
    return np.concatenate(rows), told


def test_currents_stay_with_a_push_in_both_planes() -> None:
    device = flying()
    rows, told = held(device, "hold x 0.25 0.003")
    on = column(rows, "held") > 0
    assert on.sum() == 105
    for plane in (1, 2):
        x, y = (column(rows, f"wanted_{way}_B{plane}") for way in "dq")
        assert np.ptp(x[on]) == np.ptp(y[on]) == 0
        before = np.median(column(rows, f"wanted_d_B{plane}")[-1000:])
        assert x[on][0] - before == pytest.approx(0.25, abs=0.3)
    assert b" hold over" in told
    assert device.plant.state == "LEVITATED"
    way = (column(rows, "true_x1") + column(rows, "true_x2"))[on] / 2
    assert abs(way[-1] - way[0]) > 3e-6
    assert abs(column(rows, "true_x1")[-1]) < 2e-6


def test_a_reading_at_the_bound_ends_it() -> None:
    device = flying()
    list(device.do(("set", "hold.bound", "1e-5")))
    rows, told = held(device, "hold y -1 0.006")
    on = column(rows, "held") > 0
    assert 20 < on.sum() < 150
    readings = np.abs(np.column_stack([column(rows, n) for n in ("x1", "x2", "y1", "y2")]))
    assert readings[on].max() <= 1e-5
    assert b" hold bound" in told
    assert device.plant.state == "LEVITATED"


def test_a_force_at_rest_ends_it_sooner() -> None:
    """20 um off the middle of their pull 7.5 N hold it: of 0.75 x 26.2 N are left 12.15 N, which is 2 K x at 16 um."""
    farther = []
    for centre in (0.0, 20e-6):
        device = flying(centre=(centre, centre, 0.0, 0.0))
        rows, _ = held(device, "hold x 1 0.006")
        farther.append(np.abs(column(rows, "true_x1")[column(rows, "held") > 0]).max())
        assert device.plant.state == "LEVITATED"
    assert farther[1] < farther[0] - 2e-6


def test_it_is_refused_elsewhere_and_ends_at_will() -> None:
    device = Device(Plant(control=ControlParams(watchdog_s=10.0), reduced=True))
    with pytest.raises(Refused, match="4 state state=OFF"):
        list(device.do(("hold", "x", "0.1", "0.001")))
    device = flying()
    for words, code in (("hold z 0.1 0.001", 2), ("hold x 0.1", 2), ("hold x 3 0.001", 3), ("hold x 0.1 0.007", 3)):
        with pytest.raises(Refused, match=f"^{code} "):
            list(device.do(tuple(words.split())))
    list(device.do(("hold", "x", "0", "0.006")))
    device.advance(1e-3)
    assert device.plant.held
    list(device.do(("hold", "x", "0", "0")))
    assert not device.plant.held
