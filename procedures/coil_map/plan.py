"""Settings of the map."""

from __future__ import annotations

from pydantic import Field

from bench.procedure import BenchPlan


class Plan(BenchPlan):
    """Settings of the map, SI."""

    torque_A: float = Field(1.4, gt=0, le=5)  # of a pulse: more than the rings' friction holds against
    bearing_A: float = Field(0.5, gt=0, le=5)
    thrust_A: float = Field(0.15, gt=0, le=5)
    repeats: int = Field(4, ge=2)  # of each pulse, either way
    lead_s: float = Field(4e-3, ge=2e-3)  # from the start of a capture to the pulse at least
    hold_s: float = Field(15e-3, ge=10e-3)  # a pulse
    spare_s: float = Field(5e-3, ge=0)  # of a capture, for what two writes take on their way
    tries: int = Field(4, ge=1, le=10)  # of a pulse that is not whole in its capture, each with more to spare
    rest_s: float = Field(6e-3, ge=1e-3)  # from a pulse's edge until its current rests
    settle_s: float = Field(1.0, ge=0)  # before all: the mover rocks in its rings when it is taken hold of
    calm_s: float = Field(0.05, ge=0)  # between two pulses
    around_A: float = Field(4.5, gt=0, le=5)  # of the push that is turned around: more than weight and pull have beside
    directions: int = Field(32, ge=12)  # of that push
    dwell_s: float = Field(0.02, ge=0.01)  # at each, with a torque current either way
    beside_A: float = Field(
        2.0, ge=0, le=5
    )  # that torque current, along d: it pushes nothing in a winding that is right
    rise_steps: int = Field(8, ge=1)  # up to the push, and back
    max_turn_rad: float = Field(0.5, gt=0)  # a mover that went farther than these was pushed too far: the run ends
    max_along_m: float = Field(1.5e-3, gt=0)
    max_aside_m: float = Field(70e-6, gt=0)
    max_off: float = Field(0.05, gt=0, lt=0.5)  # of a coil's share from 1
    max_angle_rad: float = Field(0.44, gt=0, lt=0.7)  # of a push from its axis: 25 degrees
    min_round: float = Field(0.8, gt=0, lt=1)  # of a push, its least over its greatest direction
    min_turn_rad: float = Field(0.5e-3, gt=0)  # that a torque turns the mover by at least
    min_along_m: float = Field(20e-6, gt=0)  # that a thrust moves it by at least
    max_lost: float = Field(1e-3, ge=0)  # share of a step's samples
