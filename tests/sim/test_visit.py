"""Another visit is the same machine on another day: what it is stays, what is drawn for a day is drawn anew. Visit 0 draws what
was drawn before there were visits."""

from __future__ import annotations

import hashlib
import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import special

from bench.cli.serve import write_truth
from bench.link import fault_injection
from bench.rigfile import RigFile, load_rig
from bench.rigfile.toleranced import Toleranced
from sim_backend.draws import noise_seed, uniform
from sim_backend.endpoint import SimulatedRig
from sim_backend.machine import Array, Truth
from sim_backend.machines.table import machine_of
from sim_backend.truth import draw

RIGS = ("tsbs12", "amb5dof")
VISITS = range(4)


@cache
def rig(name: str) -> RigFile:
    return load_rig(name)


def hashed(seed: int, name: str) -> float:
    """What a draw has been since the first version: a hash of seed and name."""
    digest = hashlib.sha256(f"{seed}:{name}".encode()).digest()
    return (int.from_bytes(digest[:7], "little") + 0.5) / 2**56


def value(t: Toleranced, p: float) -> float:
    """The quantile of the two distributions that our rig files have."""
    if t.distribution == "normal":
        return t.value + t.standard_uncertainty * float(special.ndtri(p))
    assert t.distribution == "rectangular"
    return t.value + (t.half_width or 0.0) * (2 * p - 1)


def noise(truth: Truth, ticks: int = 20_000) -> Array:
    """What the sensors of a machine at rest read, drift taken off, (telemetry periods, channels); channels that are no white
    noise, such as the angle of a shaft that still swings, are left out."""
    plant = truth.machine.make(truth.plant, truth.noise, 2)
    plant.run(10_000)
    rows = plant.run(ticks)
    n = np.linspace(-1, 1, len(rows))[:, None]
    rows = rows - rows.mean(axis=0) - n * (n * rows).mean(axis=0) / (n**2).mean()
    power = (rows**2).mean(axis=0)
    return rows[:, np.abs((rows[1:] * rows[:-1]).mean(axis=0)) < 0.2 * power]


@pytest.mark.parametrize("name", RIGS)
def test_the_machine_is_the_same_on_every_visit(name: str) -> None:
    first, *others = (draw(rig(name), 5, {"coulomb": 0.04}, visit=visit) for visit in VISITS)
    daily = machine_of(rig(name)).daily
    assert daily <= set(first.values)
    for other in others:
        assert other.quantities == first.quantities
        assert other.defects == first.defects
        assert {n for n, v in other.values.items() if v != first.values[n]} == daily


def test_weather_and_drift_are_of_the_day() -> None:
    """Each within what the rig file states, and no two days alike."""
    file, names = rig("tsbs12"), ("drift_0", "drift_9", "segment_drift_3", "site.air_density")
    days = [draw(file, 5, visit=visit).values for visit in range(60)]
    for name in names:
        t = machine_of(file).stated(file)[name]
        found = np.array([v[name] for v in days]) - t.value
        assert len(set(found)) == len(days)
        assert 0.7 < found.std() / t.standard_uncertainty < 1.3
    for name in ("hysteresis", "i_yi_p.offset", "position_offset_yi", "site.gravity", "runout_phase_i1", "tilt"):
        assert len({v[name] for v in days}) == 1


@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("seed", [0, 9])
def test_visit_0_draws_what_was_always_drawn(name: str, seed: int) -> None:
    truth = draw(rig(name), seed, visit=0)
    assert (truth.seed, truth.visit, truth.noise) == (seed, 0, seed)
    for key, t in machine_of(rig(name)).stated(rig(name)).items():
        assert truth.values[key] == value(t, hashed(seed, key)), key


@pytest.mark.parametrize("name", RIGS)
def test_noise_is_drawn_anew_and_that_of_visit_0_is_the_seeds(name: str) -> None:
    days = [draw(rig(name), 3, visit=visit) for visit in VISITS[:3]]
    assert days[0].noise == 3
    read = [noise(day) for day in days]
    assert read[0].shape[1] > 5
    for a, b in ((0, 1), (1, 2)):
        for one, other in zip(read[a].T, read[b].T, strict=True):
            assert one.std() == pytest.approx(other.std(), rel=0.15)
            assert abs(np.corrcoef(one, other)[0, 1]) < 5 / math.sqrt(len(one))


def test_the_noise_of_a_visit_is_no_other_rigs() -> None:
    seeds = [noise_seed(seed, visit) for seed in range(200) for visit in VISITS]
    assert len(set(seeds)) == len(seeds)
    assert seeds[:: len(VISITS)] == list(range(200))


def seats(visit: int, seed: int = 4) -> list[float]:
    """How far outboard of the hook the strap seats, m, each time a mass is hung."""
    machine = SimulatedRig(rig("tsbs12"), draw(rig("tsbs12"), seed, visit=visit))
    plant, found = machine.device.plant, []
    for label in ("M1", "M2", "-", "M3"):
        assert machine.request(f"hang {label}").startswith("ok")
        found.append(float(plant._p.z_hook - machine.truth.plant.z_hook))  # type: ignore[attr-defined]
    return found


def test_the_strap_seats_elsewhere_on_another_visit() -> None:
    half = rig("tsbs12").hook_seat.half_width
    assert half == 2e-5
    assert seats(0) == pytest.approx([half * (2 * hashed(4, f"seat:{k}") - 1) for k in (1, 2, 3, 4)], rel=1e-9)
    all_of_them = {seat for visit in VISITS for seat in seats(visit)}
    assert len(all_of_them) == 4 * len(VISITS)
    assert max(map(abs, all_of_them)) <= half
    drawn = np.array([[uniform(4, f"seat:{k}", visit) for k in range(400)] for visit in VISITS])
    assert np.abs(np.corrcoef(drawn) - np.eye(len(VISITS))).max() < 0.2


def weights(visit: int) -> list[complex]:
    """What hangs in the inboard plane after a weight was fixed there, kg m, y + i z; for two weights one after the other."""
    machine, found = SimulatedRig(rig("amb5dof"), draw(rig("amb5dof"), 4, visit=visit)), []
    for _ in range(2):
        machine.request("attach inboard 0.0002 1.0")
        state = machine.device.plant._s  # type: ignore[attr-defined]
        found.append(complex(state.weight_c[0], state.weight_s[0]))
        machine.request("detach inboard")
    return found


def test_a_weight_is_fixed_otherwise_on_another_visit() -> None:
    """Its mass and its angle; the radius is the ring's and stays."""
    file, radius = rig("amb5dof"), draw(rig("amb5dof"), 4).values["geometry.balance_radius"]
    of = [file.machine["weight_mass"], file.machine["weight_angle"]]
    for number, found in enumerate(weights(0), 1):
        mass, angle = (value(t, hashed(4, f"weight:{k}:{number}")) for k, t in enumerate(of))
        assert abs(found) == pytest.approx((0.2e-3 + mass) * radius, rel=1e-12)
        assert np.angle(found) == pytest.approx(1.0 + angle, rel=1e-12)
    assert len({weight for visit in VISITS for weight in weights(visit)}) == 2 * len(VISITS)


def lost(visit: int, faults: tuple[str, ...], **truth: float) -> list[int]:
    """Which of the first 400 ms of telemetry do not come."""
    machine = SimulatedRig(
        rig("tsbs12"), draw(rig("tsbs12"), 4, truth, visit=visit), faults=[fault_injection.parse(f) for f in faults]
    )
    machine.link.renew_lease()
    machine.sleep(0.4)
    batch = machine.link.receive()
    came = batch["data"][batch["id"] == 0x100][:, :2].copy().view("<u2")[:, 0] - 500
    return sorted(set(range(400)) - set(came.tolist()))


def test_other_frames_are_lost_on_another_visit() -> None:
    planted = [lost(visit, (), drop_fraction=0.1) for visit in (0, 1)]
    assert planted[0] == [k for k in range(400) if hashed(4, f"drop:{k + 500}") < 0.1]
    injected = [lost(visit, ("drop=0.1",)) for visit in (0, 1)]
    for here, there in (planted, injected):
        assert 10 < len(here) < 90
        assert here != there


def test_the_truth_says_both(tmp_path: Path) -> None:
    truth = draw(rig("amb5dof"), 4, visit=2)
    write_truth(tmp_path / "truth.json", truth)
    said = json.loads((tmp_path / "truth.json").read_text())
    assert (said["schema"], said["seed"], said["visit"]) == (1, 4, 2)
    assert said["values"] == dict(truth.values)
