"""Whether a shaft that something else may turn can be let down (docs/reference/protocol.md, "Letting a shaft down")."""

from __future__ import annotations

import math

from sim_backend.machine import SimulatedPlant

DRIVE_GIVES_UP_S = 1.0  # a drive that nobody asks anything coasts by itself after so long
TOO_FAST = 1.1  # times the landing speed
HARDEST_RAD_S2 = 250.0  # a drive that brakes as hard as it can
SILENT_TURNS = 3  # two pulses may be missed
ROOM = 1.1  # of the time that they take at most


def slow(plant: SimulatedPlant, limit_rad_s: float, free_tick: int) -> bool:
    """Whether the shaft turns slower than `limit_rad_s`, if nothing speeds it up from `free_tick` on.

    What the last two pulses tell is the speed of the turn before, and in the first turn of a run-up they tell nothing. But a
    shaft that nothing speeds up, and that makes less than a turn in 2 pi / limit, is slower than that at the end of it.
    Where pulses have ended while it turned fast, their silence says nothing.
    """
    if plant.pulse_age_s is None:
        return abs(plant.speed) < limit_rad_s
    if pulses_lost(plant):
        return False
    quiet_s = min(plant.pulse_age_s, (plant.tick - free_tick) * plant.tick_s)
    return quiet_s > 2 * math.pi / limit_rad_s


def pulses_lost(plant: SimulatedPlant) -> bool:
    """Whether pulses have ended that the shaft must give: no brake stops it within some turns from that speed.

    A turn took T; at its end the speed was v = 2 pi / T - a T / 2 at least, with a the hardest braking. If v^2 > 4 pi n a, n
    more turns are done after t = (v - sqrt(v^2 - 4 pi n a)) / a. Slower shafts may have stopped.
    """
    age, turn, a = plant.pulse_age_s, plant.turn_s, HARDEST_RAD_S2
    if age is None or turn is None:
        return False
    v = 2 * math.pi / turn - a * turn / 2
    rest = v * abs(v) - 4 * math.pi * SILENT_TURNS * a
    return rest > 0 and age > ROOM * (v - math.sqrt(rest)) / a


def too_fast(plant: SimulatedPlant, limit_rad_s: float) -> bool:
    """Whether a landing is to be broken off: something drives the shaft."""
    return abs(plant.speed) > TOO_FAST * limit_rad_s
