"""Force constants by the turning shaft itself, and unbalance on the scales of planes that are anywhere."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.analysis.vectors import Vectors
from bench.errors import AnalysisError
from bench.rigfile import load_rig
from procedures.balance.planes import missing, names_of, planes_of
from procedures.synchronous import bearings, facts
from procedures.synchronous.identified import Reading, find_bearings
from procedures.synchronous.runout import Stand, arms, impedance, slopes, waves

SPINDLE = load_rig(str(Path(__file__).resolve().parents[2] / "examples/vertical-spindle/spindle.toml"))
KNOWN = bearings.Known(None, 0.05, 10e-6)
BETA = np.array([4.3e-7, 4.5e-7, 4.6e-7, 4.2e-7])
RUNOUT = np.array([2.1 - 0.4j, 0.3 + 2.2j, -1.2 + 1.9j, -1.8 - 1.1j]) * 1e-6
UNBALANCE = np.array([2.5 * np.exp(0.4j), 1.8 * np.exp(-2.1j)]) * 1e-6
RPM = math.pi / 30


def readings(speeds: tuple[float, ...], unbalance: np.ndarray = UNBALANCE, run: int = 0) -> list[Reading]:
    """A shaft whose coils answer by a PID to displacements at the axes, made up from T (2.4b)'s slopes."""
    s = replace(Stand.of({n: e.value for n, e in bearings.collect_inputs(SPINDLE, KNOWN).items()}), beta=BETA)
    means, out = np.concatenate([np.zeros(4), np.full(8, 2.0)]), []
    k_p, k_n, k_x = slopes(s, means)
    at_axes, back = s.axes @ np.linalg.inv(s.probes), np.linalg.inv(s.probes)
    for w in speeds:
        answer = -(31000 + 1j * w * 63 + 4.4e5 / (1j * w)) / 2  # of each coil, by half
        force = np.diag((k_p - k_n) * answer) @ at_axes
        whole = impedance(s, k_x, w, w) @ back - s.axes.T @ force
        pulled = w**2 * arms(s.l_iu, s.l_ou).T @ waves(s) @ unbalance
        read = np.linalg.solve(whole, pulled + impedance(s, k_x, w, w) @ back @ RUNOUT)
        amps = answer * (at_axes @ read)
        vectors = np.concatenate([read, np.ravel(np.column_stack([amps, -amps]))])
        sizes = np.repeat([1e-11] * 4 + [1e-7] * 8, 2)
        out.append(Reading(f"{w:.0f}/{run}", w, means, Vectors(vectors, np.diag(sizes**2), 14.0), run))
    return out


def test_three_speeds_tell_the_force_constants_of_every_axis() -> None:
    found = find_bearings(readings((300 * RPM, 4000 * RPM, 10000 * RPM)), SPINDLE, KNOWN).found
    assert [found[f"beta_{k}"].value for k in range(4)] == pytest.approx(BETA, rel=1e-4)
    shares = [found[f"beta_{k}"].u / BETA[k] for k in range(4)]
    assert all(0.02 < u < 0.06 for u in shares)  # of the gap, the probes' gains and the inertia, for the most part


def test_runs_with_other_weights_have_unbalances_of_their_own() -> None:
    some = readings((300 * RPM, 4000 * RPM, 10000 * RPM)) + readings((4000 * RPM, 10000 * RPM), 3 * UNBALANCE[::-1], 1)
    found = find_bearings(some, SPINDLE, KNOWN).found
    assert [found[f"beta_{k}"].value for k in range(4)] == pytest.approx(BETA, rel=1e-4)
    alike = [replace(r, run=0) for r in some]
    with_one = find_bearings(alike, SPINDLE, KNOWN).found
    assert max(abs(with_one[f"beta_{k}"].value / BETA[k] - 1) for k in range(4)) > 1e-3


def test_two_speeds_do_not_and_nothing_is_guessed() -> None:
    known = find_bearings(readings((300 * RPM, 10000 * RPM)), SPINDLE, KNOWN)
    assert known == KNOWN
    assert [f.code for f in bearings.unknown(known, SPINDLE)] == ["bearings-unknown"]
    assert not list(bearings.unknown(known, load_rig("amb5dof")))
    still = [
        replace(r, vectors=replace(r.vectors, values=np.zeros(12, complex))) for r in readings((30.0, 400.0, 1000.0))
    ]
    with pytest.raises(AnalysisError, match="force constants"):
        find_bearings(still, SPINDLE, KNOWN)


def test_lengths_of_the_tables_and_of_geometry_say_the_same() -> None:
    rig = load_rig("amb5dof")
    tables = facts._by_tables(rig)
    stated = facts.collect_lengths(rig)
    for name in ("mass", "inertia", "polar", "l_iu", "l_ou", "coupling", "l_is", "l_os"):
        assert tables[name].value == pytest.approx(stated[name].value, rel=1e-12), name
        assert tables[name].u == pytest.approx(stated[name].u, rel=1e-12), name
    general, plain = (Stand.of({**{f"{n}_{k}": 1.0 for n in ("beta", "offset", "gain", "zero") for k in range(4)},
                                **{f"i_{n}_{k}": 1.0 for n in ("gain", "zero") for k in range(8)},
                                **{n: e.value for n, e in some.items()}}) for some in (tables, stated))  # fmt: skip
    assert np.abs(general.probes - plain.probes).max() < 1e-12
    assert np.abs(general.axes - plain.axes).max() < 1e-12
    assert general.gap == pytest.approx(plain.gap)


def test_a_scale_begins_where_it_does_and_runs_either_way() -> None:
    """The spindle's by hand: lower zero 40° on from the mark, upper 65° before it, both against the shaft's angle."""
    assert names_of(SPINDLE) == ("lower", "upper")
    lower, upper = planes_of(SPINDLE)
    assert math.degrees(lower.from_mark(math.radians(10))) == pytest.approx(30)
    assert math.degrees(upper.from_mark(math.radians(-35))) == pytest.approx(-30)
    for plane in (lower, upper):
        for angle in (0.0, 1.0, -2.5):
            weight = 2e-6 * np.exp(1j * angle)
            assert plane.turned(weight) == pytest.approx(2e-6 * np.exp(1j * plane.from_mark(angle)))
            assert plane.told(plane.turned(weight)) == pytest.approx(weight)
    assert not list(missing(SPINDLE))
    both = {
        name: part.model_copy(update={"at": SPINDLE.balancing["upper"].at}) for name, part in SPINDLE.balancing.items()
    }
    (said,) = missing(SPINDLE.model_copy(update={"balancing": both}))
    assert "lower at +190 mm, upper at +190 mm from the centre of mass" in said
    plain = planes_of(load_rig("amb5dof"))[0]
    assert plain.turned(1 + 2j) == plain.told(1 + 2j) == 1 + 2j
