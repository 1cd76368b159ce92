"""What large orbits add to a passage: the bearing's own cubic term, nothing for small orbits, what the loop makes of it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from amb_stand import AMB_ROTOR
from bearing_facts import known

from bench.rigfile import load_rig
from procedures.run_up import procedure
from procedures.run_up.linear_model import bend
from procedures.run_up.steps import Curve
from procedures.synchronous.bearings import collect_inputs
from procedures.synchronous.runout import Stand, arms, impedance

RIG = load_rig("amb5dof")
GAINS = {name: p.default for name, p in RIG.parameters.items()}
NOTHING = {1.0: np.zeros(4, complex), 2.0: np.zeros(4, complex)}
W = 450.0


def stand(**changed: object) -> Stand:
    """The nominal one, with magnetic fields that stand about the rings' centre."""
    s = Stand.of({name: e.value for name, e in collect_inputs(RIG, known(procedure.Plan())).items()})
    return dataclasses.replace(s, offset=np.zeros(4), **changed)  # type: ignore[arg-type]


def passing(shaft: np.ndarray, currents: np.ndarray, means: float = 1.0) -> Curve:
    """One block at `W`: vectors (4,) of the shaft, (8,) of the coils about equal means."""
    values = np.concatenate([shaft, currents])[:, None]
    still = np.concatenate([np.zeros(4), np.full(8, means)])[None]
    one = np.array([W])
    return Curve(
        one,
        one,
        one,
        values,
        np.zeros((12, 1, 2, 2)),
        still,
        np.zeros((1, 2)),
        np.full((12, 1), np.nan + 0j),
        one,
        AMB_ROTOR,
    )


@pytest.mark.parametrize("amplitude", [20e-6, 40e-6])
def test_a_bearing_without_load_is_softer_by_one_and_a_half_times_the_square_of_its_orbit(amplitude: float) -> None:
    """1/(s - x)^2 - 1/(s + x)^2 = 4 x/s^3 (1 + 2 x^2/s^2 + 3 x^4/s^4 + ...): over a turn the second term is K_x a 3/2 (a/s)^2,
    the third one K_x a 15/8 (a/s)^4."""
    s = stand()
    at_probe = amplitude * np.array([1, -1j, 1, -1j])  # level: as great at the AMBs
    k_x, part = 4 * s.beta / s.gap**3, (amplitude / s.gap) ** 2
    force = k_x * at_probe * (1.5 * part + 1.875 * part**2)
    free = impedance(s, k_x, W, W)
    expected = arms(s.l_is, s.l_os) @ np.linalg.solve(free, arms(s.l_ia, s.l_oa).T @ force)
    found = bend(s, passing(at_probe, np.zeros(8)), NOTHING, "PID", GAINS)[:, 0]
    assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()


def test_an_orbit_half_as_large_bends_an_eighth_as_much() -> None:
    s = stand()
    shaft = 30e-6 * np.array([1, -1j, 0.6, -0.7j])
    currents = np.repeat(0.2 * np.exp(1j * np.array([2.0, 0.5, 2.1, 0.4])), 2) * np.tile([1, -1], 4)
    large, half = (bend(s, passing(f * shaft, f * currents), NOTHING, "PID", GAINS)[:, 0] for f in (1.0, 0.5))
    assert np.abs(large / half - 8).max() < 0.2
    tiny = bend(s, passing(0.01 * shaft, 0.01 * currents), NOTHING, "PID", GAINS)
    assert np.abs(tiny).max() < 1e-4 * np.abs(large).max()


def test_a_law_that_inverts_the_forces_of_the_very_bearing_at_once_leaves_nothing() -> None:
    """CCS: its balance of forces is that of the accelerations it was set to, so it is not late; its offsets are right."""
    s = stand(gap=np.full(4, GAINS["model_gap"]), gain=np.ones(4), zero=np.zeros(4))
    gains = GAINS | {f"model_offset_{a}": 0.0 for a in ("yi", "zi", "yo", "zo")} | {"notch1_hz": 0.0, "notch2_hz": 0.0}
    shaft = 30e-6 * np.array([1, -1j, 1, -1j])
    rate = 1j * W / (1 + 1j * W / (2 * np.pi * gains["derivative_hz"]))
    g = gains["k1"] + gains["k2_ccs"] * rate + gains["k0"] / (1j * W)
    k_i = 4 * s.beta / s.gap**2
    share = np.array([s.l_oa, s.l_oa, s.l_ia, s.l_ia]) / (s.l_ia + s.l_oa)
    part = (30e-6 / s.gap) ** 2
    k_x = 4 * s.beta / s.gap**3 * (1 + 1.5 * part)
    di = (-g * s.mass * share * shaft - k_x * shaft) / k_i
    currents = np.ravel(np.column_stack([di, -di]))
    left = bend(s, passing(shaft, currents), NOTHING, "CCS", gains)
    whole = bend(s, passing(shaft, currents), NOTHING, "PID", gains)
    assert np.abs(left).max() < 0.2 * np.abs(whole).max()
