"""The truth of set-point steps on the AMB stand: the same machine does the same steps without noise and quantisation.

What is meant of small motions (poles) is that of steps of ten nanometres: there the machine is linear, but not deaf to its
sensors' noise. CAC's current goes with the root of the force. The noise in the force that is asked for, share s of its mean,
is smoothed by the amplifiers after the root is taken; mean force is less by s^2/4, its slope more by as much, and the natural
frequency higher by s^2/8 (s is 0.07: 0.06 %). So small motions are those of the machine with its noise.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from sim_backend.core import LEVITATE, LIFT, READY, TICK_S, DriveLaw
from sim_backend.machines.amb5dof.params import AmbControl, AmbParams
from sim_backend.machines.amb5dof.plant import TRACE, AmbPlant
from sim_backend.machines.stepping import Shown, Small, Watched, steps
from sim_backend.machines.stepping import small as small_of

Array = npt.NDArray[np.float64]
REPEATS = 30  # of a small step in different noise: the mean frequency is then good to 0.005 %, the damping to 0.03 %
RADIAL = [TRACE.index(f"pos_{a}") for a in ("yi", "zi", "yo", "zo")]
AXIAL = TRACE.index("pos_x")


def unrounded(p: AmbParams) -> AmbParams:
    """Without quantisation."""
    return dataclasses.replace(p, position_lsb=0.0, current_lsb=0.0)


def quiet(p: AmbParams) -> AmbParams:
    """Without noise and quantisation."""
    return dataclasses.replace(unrounded(p), position_noise=0.0, current_noise=0.0, hum_hz=0.0)


def floating(
    p: AmbParams,
    settings: Mapping[str, float],
    speed: float = 0.0,
    settle_s: float = 8.0,
    substeps: int = 2,
    noise: int | None = None,
) -> AmbPlant:
    """The quiet machine, lifted by the PID, at a speed in rad/s, with the laws' parameters, its integrators at rest; with the
    `noise` of a seed, and the machine's quantisation, where one is given."""
    known = {f.name for f in dataclasses.fields(AmbControl)}
    made = {name: value for name, value in settings.items() if name in known} | {"law": 0.0, "slew": 0.0}
    made_of = quiet(p) if noise is None else p
    plant = AmbPlant(made_of, noise or 1, control=AmbControl(**made), substeps=substeps)
    plant.mode = READY
    plant.run(1000)
    plant.mode = LIFT
    while not plant.moved:
        plant.run(100)
    plant.mode = LEVITATE
    if speed > 0:
        plant.drive(DriveLaw(gain=0.05, limit=1.0, ramp=2000.0), speed)
    plant.set("law", settings["law"])
    plant.run(round((settle_s + speed / 2000.0) / TICK_S))
    return plant


def positions(p: AmbParams, settings: Mapping[str, float], trace: Array, true: bool = False) -> Array:
    """(5, n): y, z, x of the centre of mass with the controller's lengths, and half of what the outboard reading is ahead of
    the inboard one in y and z; as read, or as it is where `true`."""
    gain = np.array(p.position_gain) if true else np.ones(5)
    yi, zi, yo, zo = trace[:, RADIAL].T / gain[:4, None]
    a, b = settings["model_l_os"], settings["model_l_is"]
    y, z = (a * yi + b * yo) / (a + b), (a * zi + b * zo) / (a + b)
    return np.array([y, z, trace[:, AXIAL] / gain[4], (yo - yi) / 2, (zo - zi) / 2])


def watched(p: AmbParams, settings: Mapping[str, float], axis: str, told: float = 1.0) -> Watched:
    """Along one axis; `told`: what the controller makes of a set point, as a share of it."""

    def seen(trace: Array, true: bool) -> Array:
        return positions(p, settings, trace, true)

    def write(plant: AmbPlant, end: float) -> None:
        plant.set(f"ref_{axis}", told * end)

    return Watched(axis, seen, write)


def small(plant: AmbPlant, settings: Mapping[str, float], axis: str) -> Small:
    """Of small motions, of the machine with its noise."""
    return small_of(plant, watched(plant.params, settings, axis), REPEATS)


def truth(
    p: AmbParams, settings: Mapping[str, float], axis: str, sizes: Sequence[float], *, speed: float = 0.0, rest_s: float = 0.3,
    record_s: float = 0.5, wait_s: float = 0.0, told: float = 1.0,
) -> tuple[Small, dict[tuple[float, int], Shown]]:  # fmt: skip
    """Of one axis: small motions, and by size and way the steps, of the machine with its runout and, where it turns, its
    unbalance: where the shaft floats and how far it whirls, there are the bearings' slopes."""
    of_small = small(floating(unrounded(p), settings, speed, noise=1), settings, axis)
    plant = floating(p, settings, speed)
    out: dict[tuple[float, int], Shown] = {}
    for size in sorted(sizes):
        turn = 2 * math.pi / speed if speed else 0.0
        of = watched(p, settings, axis, told)
        for way, shown in steps(plant, of, size, rest_s, record_s, wait_s=wait_s, turn_s=turn).items():
            out[size, way] = shown
    return of_small, out
