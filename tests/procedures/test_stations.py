"""Positions of a shaft from probes that stand and look anywhere, on rigs that are in no folder: exact on exact readings."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from odd_rig import odd_rig

from bench.rigfile import load_rig
from bench.rigfile.model import RigFile
from bench.rigfile.numbers import Sum
from procedures.amb_rotor import rings
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.geometry import Edge, Facts, centre, distances, left, lengths, nominal
from procedures.amb_rotor.stations import Placed, Stations, row, stations

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SPINDLE, STAND = (str(EXAMPLES / name) for name in ("vertical-spindle/spindle.toml", "plain-stand/stand.toml"))
HELD = np.array([[12e-6], [-30e-6], [200e-6], [-90e-6]])  # y, z, psi, theta


def facts(*probes: tuple[float, float, int]) -> Facts:
    """Of probes at an arm in m, an angle in degrees and a sign."""
    arms, degrees, signs = zip(*probes, strict=True)
    angles = tuple(map(math.radians, degrees))
    return Facts(tuple(map(float, signs)), (0.0,) * len(arms), arms, angles, 0.0, (Edge(1, 0.2, 150e-6),))


@pytest.mark.parametrize(
    "f",
    [
        facts((-0.1, 0, 1), (-0.1, 90, 1), (0.12, 0, 1), (0.12, 90, 1)),
        facts((-0.1, 20, 1), (-0.1, 80, -1), (0.12, 45, 1), (0.12, 160, 1)),
        facts((0.05, 0, 1), (0.09, 100, 1), (0.2, 30, -1), (0.3, 130, 1)),  # the centre of mass outside
        facts((-0.1, 10, 1), (-0.1, 100, 1), (0.0, 55, 1), (0.0, 145, 1), (0.1, 20, 1), (0.1, 130, -1)),
    ],
    ids=["right", "oblique", "four-places", "three-planes"],
)
def test_where_the_shaft_is_follows_from_any_probes(f: Facts) -> None:
    """By hand: at l from the centre of mass it stands at y + l theta, z - l psi."""
    arm, angle = np.array(f.arms), np.array(f.angles)
    y, z = HELD[0] + arm * HELD[3], HELD[1] - arm * HELD[2]
    read = np.array(f.gains) * (np.cos(angle) * y + np.sin(angle) * z)
    assert centre(read[:, None], f) == pytest.approx(HELD, abs=1e-18)
    far = math.hypot(HELD[0, 0] + 0.2 * HELD[3, 0], HELD[1, 0] - 0.2 * HELD[2, 0])
    assert distances(read[:, None], f)[0, 0] == pytest.approx(far, rel=1e-12)
    assert left(read[:, None], f)[0] == pytest.approx(150e-6 - far, rel=1e-12)


def test_probes_that_do_not_tell_the_tilts_are_refused_by_name() -> None:
    """All four in one plane."""
    rig = load_rig(SPINDLE)
    flat = replace(
        stations(rig), probes={name: replace(p, arm=Sum(exact=0.1)) for name, p in stations(rig).probes.items()}
    )
    assert any(line.startswith("probes: found 4 radial") for line in flat.lacks)
    assert stations(rig).lacks == ()


@pytest.mark.parametrize("path", [SPINDLE, STAND, "amb5dof"])
def test_each_length_moves_the_facts_as_its_place_does(path: str) -> None:
    """By the sums of the rig file: a place that is greater by so much is so much farther from the centre of mass."""
    rig = load_rig(path)
    told, plain = {one.identity: one for one in lengths(rig)}, nominal(rig)
    for k, p in enumerate(stations(rig).probes.values()):
        for term in p.arm.terms:
            moved = told[term.identity].moved(plain, 1e-4)
            assert moved.arms[k] - plain.arms[k] == pytest.approx(term.factor * 1e-4)
    assert all(one.number.standard_uncertainty > 0 for one in told.values())


def lying(direction_deg: float, *, centre_m: float = 0.0, sign: int = 1) -> Stations:
    """Two probes each near -0.1 and 0.1 m of a lying shaft, the first at an angle from up."""
    probes = {f"p{k}": Placed(Sum(exact=arm - centre_m), Sum(exact=math.radians(angle)), sign)
              for k, (arm, angle) in enumerate([(-0.1, 0), (-0.1, 90), (0.1, 0), (0.1, 90)])}  # fmt: skip
    axes = {f"a{k}": p for k, p in enumerate(probes.values())}
    return Stations(axes, probes, (), Sum(exact=math.radians(direction_deg)))


@pytest.mark.parametrize(
    ("of", "shares"),
    [
        (lying(-45), [-0.7071, -0.7071, -0.7071, -0.7071]),
        (lying(0), [-1, 0, -1, 0]),
        (lying(30, sign=-1), [0.866, -0.5, 0.866, -0.5]),
        (lying(0, centre_m=0.15), [1, 0, -1, 0]),  # it hangs over the far ring, and lies under the near one
    ],
    ids=["45", "up", "reversed", "outside"],
)
def test_what_a_probe_reads_of_a_shaft_on_its_rings(of: Stations, shares: list[float]) -> None:
    assert list(rings.expected(of).values()) == pytest.approx(shares, abs=1e-4)


def at_rest(rig: RigFile, y: float, z: float) -> dict[str, float]:
    """Readings of a shaft that is off the middle by y and z m, without tilt."""
    return {name: row(0.0, p.angle.value, p.sign)[0] * y + row(0.0, p.angle.value, p.sign)[1] * z
            for name, p in stations(rig).probes.items()}  # fmt: skip


def test_a_shaft_that_lies_across_one_axis_tells_the_other_axis_alone() -> None:
    rig = load_rig(STAND)
    down = at_rest(rig, -200e-6, 4e-6)
    assert list(rings.of_readings(down, rig)) == []
    found = list(rings.of_readings(down | {"LageYVorn": 198e-6}, rig))
    assert [(f.code, f.where) for f in found] == [("sensor-polarity", "LageYVorn")]
    assert [f.code for f in rings.of_readings(at_rest(rig, 200e-6, 0.0), rig)] == ["gravity-reversed"]
    assert [f.code for f in rings.of_readings(at_rest(rig, -230e-6, 0.0), rig)] == ["ring-too-far"] * 2
    assert [f.code for f in rings.of_readings(at_rest(rig, -150e-6, 0.0), rig)] == ["ring-too-near"] * 2
    assert set(rings.unshown(rig)) == {"LageXVorn", "LageXHinten"}


def test_a_probe_that_counts_backwards_reads_above_the_middle_at_rest(tmp_path: Path) -> None:
    """y of this rig is at 10 degrees: straight down is -cos 10 along y, and, z being at -80, sin 10 the other way along z."""
    rig = load_rig(odd_rig(tmp_path))
    down = at_rest(rig, -200e-6 * math.cos(math.radians(10)), -200e-6 * math.sin(math.radians(10)))
    assert down["LageXVorn"] > 0
    assert list(rings.of_readings(down, rig)) == []
    wrong = down | {"LageXVorn": -down["LageXVorn"]}
    assert [(f.code, f.where) for f in rings.of_readings(wrong, rig)] == [("sensor-polarity", "LageXVorn")]


def test_of_a_shaft_that_stands_gravity_tells_no_polarity() -> None:
    rig = load_rig(SPINDLE)
    assert set(rings.unshown(rig)) == set(stations(rig).channels)
    assert list(rings.of_readings(at_rest(rig, 20e-6, -60e-6), rig)) == []  # anywhere within its rings
    assert [f.code for f in rings.of_readings(at_rest(rig, 150e-6, -100e-6), rig)] == ["ring-too-far"] * 2
    (note,) = rings.of_unshown(rig)
    assert "the shaft stands" in note.text
    assert list(rings.of_unshown(load_rig("amb5dof"))) == []


def test_set_points_by_axis_hold_the_shaft_at_its_coordinates() -> None:
    """Axes at 0 and -90 degrees from y: z is to the side of the second one."""
    machine = conventions(load_rig(STAND))
    points = machine.points({"y": 10e-6, "z": 20e-6, "psi": 1e-4, "theta": -1e-4})
    assert points["SollYVorn"] == pytest.approx(10e-6 - 0.13 * 1e-4)
    assert points["SollXVorn"] == pytest.approx(20e-6 - 0.13 * 1e-4)
    assert points["SollYHinten"] == pytest.approx(10e-6 + 0.15 * 1e-4)
    assert points["SollXHinten"] == pytest.approx(20e-6 + 0.15 * 1e-4)
