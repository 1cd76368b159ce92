"""A ring on the mover: one body with it, off the axis and slipping, against definitions; who puts it on, and when."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from lira_bench import Bench, opened

from bench.errors import InterlockError, OperatorRefused
from bench.procedure.roles import RigState
from bench.procedure.states import transition, within_reach
from drivers.operator import LineOperator
from sim_backend.machines.lira.params import PlantParams
from sim_backend.machines.lira.plant import TRACE, Plant, ideal

RING = {"kg": 0.3, "inertia": 7.6e-4, "at": 0.06}
TICK_S = 1 / 280_000
NONE = (0.0, 0.0)
FREE = ideal(replace(PlantParams(), cogging_force=0.0, cogging_torque=0.0, pull=NONE, gravity=0.0, torque_constant=NONE,
                     bearing_constant=NONE, force_constant=0.0, clearance=1.0, clearance_out=1.0))  # fmt: skip
"""Nothing acts on it: no magnets, so that no emf brakes it, no weight, no rings to touch."""


def mounted(p: PlantParams, newtons: float = 0.0, **more: float) -> Plant:
    plant = Plant(p)
    plant.mount(RING["kg"], newtons, RING["inertia"], at=RING["at"], **more)
    return plant


def of_energy(p: PlantParams, q: np.ndarray, off: float, phase: float) -> np.ndarray:
    """d2T/dv2 of x, y, alpha, beta, angle: a body, and a ring whose middle is at x + h beta + e cos, y - h alpha - e sin."""
    t, h, m = q[4] + phase, RING["at"], RING["kg"]
    centre = np.array([[1, 0, 0, h, -off * math.sin(t)], [0, 1, -h, 0, -off * math.cos(t)]])
    own = [p.mass, p.mass, *2 * (p.transverse_inertia + RING["inertia"] / 2,), p.polar_inertia + RING["inertia"]]
    return np.diag(own) + m * centre.T @ centre


@pytest.mark.parametrize("rate", [0.0, 25.0])
def test_the_ring_moves_with_the_mover_as_one_body(rate: float) -> None:
    """M a = what acts + m e w^2 towards the ring's middle, of a mover pushed at its planes; 1 mm, so that it counts."""
    off, phase, angle, newtons = 1e-3, 0.7, 0.4, 2.9
    push = np.array([3.0, -1.0, 2.0, 4.0, 0.0, 0.05])
    plant = mounted(FREE, newtons, off=off, phase=phase)
    plant.put(z=FREE.middle, angle=angle, angle_rate=rate)
    plant.push(push)
    before = plant.place
    plant.run(TICK_S)
    found = (plant.place[6:] - before[6:])[[0, 1, 2, 3, 5]] / TICK_S
    q = before[[0, 1, 2, 3, 5]]
    t, h, l = q[4] + phase, RING["at"], FREE.bearing_plane  # noqa: E741
    x, y = push[0] + push[1], push[2] + push[3]
    outward = RING["kg"] * off * rate**2
    fx, fy = outward * math.cos(t), -outward * math.sin(t) - newtons
    acts = np.array([x + fx, y + fy, -l * (push[2] - push[3]) - h * fy, l * (push[0] - push[1]) + h * fx,
                     push[5] + newtons * off * math.cos(t)])  # fmt: skip
    assert found == pytest.approx(np.linalg.solve(of_energy(FREE, q, off, phase), acts), rel=2e-3, abs=1e-3)


def test_nothing_gives_energy_to_a_mover_that_is_free() -> None:
    """An eccentric ring shakes it; kinetic energy and the momenta across stay, over several turns."""
    off, phase = 2e-3, 0.3
    plant = mounted(FREE, off=off, phase=phase)
    plant.put(z=FREE.middle, angle_rate=80.0, x_rate=1e-3)

    def facts() -> tuple[float, np.ndarray]:
        q, v = plant.place[[0, 1, 2, 3, 5]], plant.place[[6, 7, 8, 9, 11]]
        momenta = of_energy(FREE, q, off, phase) @ v
        return float(v @ momenta) / 2, momenta[:2]

    energy, momenta = facts()
    for _ in range(60):
        plant.run(5e-3)
        now, p = facts()
        assert now == pytest.approx(energy, rel=1e-3)
        assert p == pytest.approx(momenta, abs=2e-3 * RING["kg"] * off * 80)
    assert abs(plant.place[5]) > 2 * math.pi


def test_a_ring_slips_beyond_what_it_bears_and_sits_again() -> None:
    """Stuck: T/(J + J_r). Slipping: (T - grip)/J, the ring goes by grip/J_r. Left alone both end at one rate."""
    grip, j, ring = 0.05, FREE.polar_inertia, RING["inertia"]
    plant = mounted(FREE, grip=grip)
    plant.put(z=FREE.middle)
    most = grip * (j + ring) / ring
    plant.push(np.array([0, 0, 0, 0, 0, 0.99 * most]))
    plant.run(0.01)
    assert plant.slip == 0
    assert plant.place[11] == pytest.approx(0.01 * 0.99 * most / (j + ring), rel=1e-3)
    held = plant.place[11]
    plant.push(np.array([0, 0, 0, 0, 0, 2 * most]))
    plant.run(0.01)
    assert plant.place[11] - held == pytest.approx(0.01 * (2 * most - grip) / j, rel=2e-3)
    slipped = 0.5 * 0.01**2 * (grip / ring - (2 * most - grip) / j)
    assert plant.slip == pytest.approx(slipped, rel=2e-3)
    momentum = j * plant.place[11] + ring * (held + 0.01 * grip / ring)
    plant.push(np.zeros(6))
    plant.run(0.1)
    sits = plant.slip
    plant.run(0.05)
    assert plant.slip == sits
    assert plant.place[11] == pytest.approx(momentum / (j + ring), rel=2e-3)


def test_currents_carry_the_ring_by_statics() -> None:
    """K_B (i_1 + i_2) more by its weight, with the mover held; W e besides, which the loop of the angle holds."""
    sums = []
    for kg in (0.0, 0.3):
        plant = Plant(ideal(PlantParams()), reduced=True)
        plant.set("observer", 2.0)
        if kg:
            plant.mount(kg, kg * 9.81, RING["inertia"], at=0.06, off=50e-6, phase=1.0)
        for name in ("idle", "on", "lift"):
            assert plant.command(name) == 0
        for _ in range(40):
            plant.beat()
            plant.run(0.05)
        assert plant.state == "LEVITATED"
        rows = plant.run(0.02)
        sums.append(sum(rows[:, TRACE.index(name)].mean() for name in ("i_q_B1", "i_q_B2")))
    assert sums[1] - sums[0] == pytest.approx(0.3 * 9.81 / 3.7, rel=1e-3)


def plant_of(bench: Bench) -> Plant:
    line = bench.rig.operator
    assert isinstance(line, LineOperator)
    found: Plant = line._request.__self__.device.plant  # type: ignore[attr-defined]
    return found


def test_the_operator_puts_it_on_a_machine_that_is_off() -> None:
    with opened(seed=3, ring_other=0.1) as bench:
        plant, line = plant_of(bench), bench.rig.operator
        transition(bench.rig, RigState.LEVITATED)
        with pytest.raises(InterlockError, match="land it first"):
            line.mount("ring")
        with within_reach(bench.rig):
            line.mount("ring")
            assert plant.link_V < 60
        p = plant._p
        assert bench.rig.levitation.state is RigState.LEVITATED
        assert (p.part, p.part_inertia) == pytest.approx(
            (1.1 * 0.3, 1.1 * 7.6e-4), rel=3e-3
        )  # its certificate, and a tenth
        assert 0 < abs(p.part_off) < 50e-6
        assert p.part_at == pytest.approx(0.06, abs=0.5e-3)
        assert p.part_N == pytest.approx(p.part * 9.81, rel=1e-3)
        with within_reach(bench.rig):
            with pytest.raises(OperatorRefused, match="cannot 'mount bar'"):
                line.mount("bar")
            line.mount("")
        assert p.part == 0


def test_the_simulated_person_mounts_nothing_on_what_is_live() -> None:
    with opened(seed=3, ring_missing=1.0) as bench:
        line = bench.rig.operator
        assert isinstance(line, LineOperator)
        line.approach = lambda: ""
        with pytest.raises(OperatorRefused, match=r"the machine is live: OFF, 3.. V"):
            line.mount("ring")
        bench.rig.clock.sleep(6.0)
        line.mount("ring")
        assert plant_of(bench)._p.part == 0  # it was said, and not done
