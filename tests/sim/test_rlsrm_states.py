"""States of the rotary-linear motor's controller: zeros found from anywhere, held, sent, stopped, tripped, left by its host."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rlsrm_bench import SHAPED, column, drawn

from sim_backend.core.plant import Array
from sim_backend.machines.rlsrm.params import DEG, ControlParams, PlantParams
from sim_backend.machines.rlsrm.plant import FAULTS, STATES, Plant


def waited(plant: Plant, seconds: float, until: str = "") -> Array:
    """Time with a host that beats every 20 ms; at most until a state."""
    rows = []
    for _ in range(round(seconds / 0.02)):
        plant.beat()
        rows.append(plant.run(0.02))
        if plant.state == until:
            break
    return np.concatenate(rows)


def powered(
    params: PlantParams | None = None, control: ControlParams = SHAPED, x: float = 0.0, angle: float = 0.0
) -> Plant:
    plant = Plant(params, control)
    plant.put(x, angle)
    plant.power_on()
    assert plant.command("ready") == 0
    return plant


def held(
    params: PlantParams | None = None, control: ControlParams = SHAPED, x: float = 2e-3, angle: float = 1.0
) -> Plant:
    plant = powered(params, control, x, angle)
    assert plant.command("home") == 0
    waited(plant, 20, "READY")
    assert plant.homed == (True, True)
    assert plant.command("hold") == 0
    waited(plant, 0.2)
    return plant


def test_zeros_are_found_from_anywhere() -> None:
    """Drawn machines, anywhere: readings then are true but for half a count and what the encoders have themselves."""
    rng = np.random.default_rng(7)
    for seed in range(12):
        plant = powered(drawn(seed), x=rng.uniform(-0.014, 0.014), angle=rng.uniform(-10, 10))
        assert plant.command("hold") == 2
        assert plant.command("home") == 0
        waited(plant, 20, "READY")
        assert plant.fault == "NONE"
        assert plant.homed == (True, True)
        assert plant.command("hold") == 0
        rows = waited(plant, 0.5)
        x, angle = column(rows, "x", "angle")[-1] - column(rows, "true_x", "true_angle")[-1]
        assert abs(x) < 1.6e-6
        assert abs((angle + np.pi) % (2 * np.pi) - np.pi) < (0.072 + 0.072 + 0.08) * DEG
        assert plant.state == "HOLDING"


def test_a_mark_that_is_not_there_is_said() -> None:
    plant = powered(replace(PlantParams(), mark=(40e3, 0.0)))
    plant.command("home")
    waited(plant, 20, "READY")
    assert plant.homed == (False, True)
    assert plant.command("hold") == 2
    assert plant.state == "READY"


def test_commands_are_refused_where_they_do_not_belong() -> None:
    plant = Plant(control=SHAPED)
    plant.power_on()
    for command in ("home", "hold", "play", "stop", "clear"):
        assert plant.command(command) == 1, command
    assert plant.command("ready") == 0
    for command in ("play", "clear"):
        assert plant.command(command) == 1, command
    assert plant.command("off") == 0
    plant = held()
    for command in ("ready", "home", "hold", "clear"):
        assert plant.command(command) == 1, command


def test_a_set_point_is_sent_and_reached() -> None:
    plant = held()
    plant.refer(5e-3, 2.0)
    rows = waited(plant, 2)
    states = [STATES[int(s)] for s in column(rows, "state")]
    assert states[:2].count("MOVING") >= 1
    assert states[-1] == "HOLDING"
    assert column(rows, "x")[-1] == pytest.approx(5e-3, abs=5e-5)
    assert column(rows, "angle")[-1] == pytest.approx(2.0, abs=0.2 * DEG)
    assert plant.command("off") == 0
    waited(plant, 0.1)
    assert plant.currents.tolist() == [0] * 6


def test_a_stop_brakes_and_holds_where_it_comes_to_rest() -> None:
    plant = held()
    there = plant.place[1]
    plant.refer(angle=there + 100.0)
    waited(plant, 1.0)
    assert plant.place[3] == pytest.approx(6, abs=0.7)
    before = plant.place[1]
    assert plant.command("stop") == 0
    assert plant.state == "STOPPING"
    waited(plant, 1.0)
    assert plant.state == "HOLDING"
    assert plant.place[3] == pytest.approx(0, abs=0.02)
    assert plant.place[1] - before == pytest.approx(6 * 6 / (2 * 20), abs=0.1)


@pytest.mark.parametrize(("holds", "state"), [(0.0, "READY"), (1.0, "HOLDING")])
def test_made_safe_it_stops_and_holds_or_lets_go(holds: float, state: str) -> None:
    plant = held(control=replace(SHAPED, safe_holds=holds))
    plant.refer(-5e-3, 50.0)
    waited(plant, 0.2)
    plant.command("safe")
    waited(plant, 1.5)
    assert plant.state == state
    assert (plant.currents.max() > 0) == bool(holds)
    assert abs(plant.place[2:]).max() < 1e-2


@pytest.mark.parametrize("holds", [0.0, 1.0])
def test_without_its_host_it_stops_by_itself_and_says_so(holds: float) -> None:
    plant = held(control=replace(SHAPED, safe_holds=holds))
    plant.refer(angle=50.0)
    waited(plant, 0.5)
    plant.beat()
    rows = plant.run(1.5)
    fault = column(rows, "fault").astype(int)
    assert FAULTS[fault[-1]] == plant.fault == "HEARTBEAT_LOST"
    assert 0.08 <= (fault > 0).argmax() * 1e-3 < 0.085
    assert plant.state == "FAULT"
    assert abs(plant.place[2:]).max() < 1e-2
    plant.push(6.0, 0.0)
    plant.run(1.0)
    assert (abs(plant.place[0]) > 5e-3) == (not holds)
    assert plant.command("hold") == 1
    assert plant.command("clear") == 0
    assert plant.state == "READY"
    assert plant.fault == "NONE"


def test_a_wave_plays_until_it_is_stopped() -> None:
    plant = held(control=replace(ControlParams(), wave=(0.0, 1.0), amplitude=(0.0, 1.0)))
    assert plant.command("play") == 0
    rows = waited(plant, 6)
    assert plant.state == "MOVING"
    assert np.ptp(column(rows, "true_angle")[1000:]) == pytest.approx(2, abs=0.05)
    plant.command("stop")
    waited(plant, 1)
    assert plant.state == "HOLDING"
    assert plant.place[3] == pytest.approx(0, abs=0.02)


def test_trips_take_all_currents_off() -> None:
    for cause, fault in ((0, "OVERCURRENT"), (1, "OVERSPEED"), (2, "STROKE"), (3, "OVERTEMPERATURE")):
        plant = held()
        if cause == 0:
            plant.set("trip_A", 2.0)
            plant.push(-5.0)
        elif cause == 1:
            plant.push(0.0, 2.0)
        elif cause == 2:
            plant.refer(x=14.8e-3)
        else:
            plant.set("trip_warm", 20.5)
            plant.push(-5.0)
        assert plant.state != "FAULT"
        waited(plant, 10, "FAULT")
        assert plant.fault == fault, cause
        assert plant.state == "FAULT"
        plant.run(0.02)
        assert plant.currents.tolist() == [0] * 6


def test_what_was_homed_is_not_after_power_on() -> None:
    """Counters begin at zero anywhere."""
    plant = held()
    plant.command("off")
    plant.run(0.2)
    plant.power_on()
    assert plant.homed == (False, False)
    plant.run(0.01)
    assert plant.counts == (0, 0)
