"""Load balancing on a circle (T 6.7.3) without noise: what the drawn machine does, and what its own constants say it should.

The shaft stands at its home angle. The load on the motor is D, N, horizontal + j up; currents are those along the field.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.controller.controls import in_force
from sim_backend.core.plant import LEVITATE, LIFT, PERIOD_TICKS, READY, TICK_S
from sim_backend.machine import Numbers, Truth
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import CHANNELS, TRACE, Plant
from sim_backend.motion import CircleAsked

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
AT = {name: k for k, name in enumerate(CHANNELS)}
GAMMA = TRACE.index("gamma")
MEAN = 10  # ms of which the currents' moving mean is taken
FIXED = 4  # rounds for the direction of balanced currents, which sensors' zeros turn by a thousandth
SLOTS = 4000  # of a turn of the circle, in which gamma follows by its slew


def circle(rig: RigFile, drawn: Truth, asked: CircleAsked) -> Mapping[tuple[str, str], float]:
    """By quantity and place ("before" or "after", "" where it is neither's), true amperes and readings' metres."""
    used = in_force(rig, drawn.machine, asked.settings)
    known = {f.name for f in fields(ControlParams)} & set(used)
    control = ControlParams(**{name: used[name] * drawn.defects.get(f"factor_{name}", 1.0) for name in known})
    quiet = replace(drawn.plant, position_noise=0.0, current_noise=0.0, position_lsb=0.0, current_lsb=0.0)
    found: list[dict[tuple[str, str], float]] = []
    for branch in sorted(set(asked.branches)):
        seen = _moved(quiet, control, asked, branch)
        part = {**seen, ("predicted_reduction", ""): quasi_static(quiet, control, asked, branch)}
        found += [part] * asked.branches.count(branch)
    return {key: float(np.mean([f[key] for f in found])) for key in found[0]} if found else {}


def _moved(p: PlantParams, control: ControlParams, asked: CircleAsked, branch: int) -> dict[tuple[str, str], float]:
    """What the machine does: a turn on the circle without balancing, one that is left out, one with it."""
    plant, turn = Plant(p, control=control), round(1 / (abs(asked.hz) * TICK_S))
    plant.mode = READY
    plant.run(1000)
    plant.mode = LIFT
    plant.run(round(1.1 * control.lift_time_s / TICK_S))
    plant.mode = LEVITATE
    plant.run(8000)
    for name, value in asked.carried.items():
        plant.set(name, value)
    plant.run(20000)
    for name, value in asked.circled.items():
        plant.set(name, value)
    plant.run(turn * math.ceil(asked.ramp_s * abs(asked.hz)))
    before = plant.run(turn, PERIOD_TICKS)
    plant.run(round((asked.engage_rad * math.copysign(1, asked.hz) / math.tau) % 1 * turn))
    plant._s.law.balancing, plant._s.law.line = 1.0, branch * 1.2  # the branch that the machine took
    for name, value in asked.balanced.items():
        plant.set(name, value)
    plant.run(turn)
    after = plant.run(turn, PERIOD_TICKS)
    out: dict[tuple[str, str], float] = {}
    for when, (rows, trace) in (("before", before), ("after", after)):
        x, y = _currents(p, rows)
        off = np.abs(np.hypot(rows[:, AT["pos_xo"]], rows[:, AT["pos_yo"]]) - asked.radius)
        out |= {
            ("peak_i_y", when): float(_mean(np.abs(y)).max()),
            ("peak_any", when): float(max(_mean(np.abs(y)).max(), _mean(np.abs(x)).max())),
            ("unbalance", when): unbalance(_mean(x), _mean(y)),
            ("error_radius", when): float(_mean(off).max()),
        }
        if when == "after":
            out["gamma_extreme", ""] = float(np.abs(_mean(trace[:, GAMMA])).max())
    out["reduction", ""] = out["peak_i_y", "after"] / out["peak_i_y", "before"] - 1
    out["unbalance_ratio", ""] = out["unbalance", "after"] / out["unbalance", "before"]
    return out


def _mean(x: Array) -> Array:
    """Moving mean over MEAN samples of a closed turn."""
    return np.convolve(np.concatenate([x, x[: MEAN - 1]]), np.full(MEAN, 1 / MEAN), "valid")


def _currents(p: PlantParams, rows: Array) -> tuple[Array, Array]:
    """i_x, i_y, true A, by T (6.18)."""
    read = rows[:, [AT[f"i_m{k}"] for k in range(1, 5)]].T
    one, two, three, four = (
        (read[k] - p.segment_offset[k]) / p.segment_sense[k] for k in range(4)
    )  # their drift is another day's
    return (four - two) / 2, (one - three) / 2


def unbalance(i_x: Array, i_y: Array) -> float:
    """rms(|i_x| - |i_y|) over rms(|i_x| + |i_y|)."""
    x, y = np.abs(i_x), np.abs(i_y)
    return math.sqrt(float(((x - y) ** 2).mean() / ((x + y) ** 2).mean()))


@dataclass(frozen=True)
class Drive:
    """What acts on the shaft of the currents i that the controller asks for, x + j y: a i - b, in units of the segments' true
    amperes times their gains; and `true`, the segments' own currents, c i - d."""

    a: tuple[float, float]
    b: complex
    c: tuple[float, float]
    d: complex

    @staticmethod
    def of(p: PlantParams) -> Drive:
        """Amplifiers close their loops on their own sensors, so that a segment carries (asked - offset)/gain."""
        g, n, o = p.segment_gain, p.segment_sense, p.segment_offset

        def pair(gain: tuple[float, ...], k: int, m: int) -> tuple[float, float]:
            """Of (s_k - s_m)/2 with s_k = (i - o_k) gain_k/n_k, s_m = (-i - o_m) gain_m/n_m."""
            up, down = gain[k] / n[k], gain[m] / n[m]
            return (up + down) / 2, (up * o[k] - down * o[m]) / 2

        (ax, bx), (ay, by) = pair(g, 3, 1), pair(g, 0, 2)
        one = (1.0, 1.0, 1.0, 1.0)
        (cx, dx), (cy, dy) = pair(one, 3, 1), pair(one, 0, 2)
        return Drive((ax, ay), complex(bx, by), (cx, cy), complex(dx, dy))

    def acting(self, i: Complex) -> Complex:
        return self.a[0] * i.real + 1j * self.a[1] * i.imag - self.b

    def asked(self, acting: Complex) -> Complex:
        w = acting + self.b
        return w.real / self.a[0] + 1j * w.imag / self.a[1]

    def true(self, i: Complex) -> Complex:
        return self.c[0] * i.real + 1j * self.c[1] * i.imag - self.d


def load(p: PlantParams, control: ControlParams, sensed: Complex) -> Complex:
    """D, N, (n,): what the motor has to hold while the outboard sensors read `sensed` and the inboard AMB's plane is at zero as
    the controller has it. Moments about that plane, so that the AMB gives none: alpha_x (r_m + offset) and the shaft's weight
    by its leverage."""
    share = control.share_i
    inboard = -share / (1 - share) * sensed
    shaft = []
    for read, k in ((inboard, 0), (sensed, 2)):
        zero = complex(p.position_offset[k], p.position_offset[k + 1])
        at = (read.real - zero.real) / p.position_gain[k] + 1j * (read.imag - zero.imag) / p.position_gain[k + 1]
        turned = sum(
            p.target[2 * k + n] * cmath.exp(1j * p.target_phase[2 * k + n]) for n in range(4)
        )  # at the home angle
        shaft.append(at - turned)
    span = p.z_sensor[1] - p.z_sensor[0]
    motor = shaft[0] + (p.z_motor - p.z_sensor[0]) / span * (shaft[1] - shaft[0]) + complex(p.motor_x, p.motor_y)
    weight = p.mass * p.gravity * -p.z_amb[0] / (p.z_motor - p.z_amb[0])
    out: Complex = p.alpha_x * motor + weight * complex(math.sin(p.tilt), -math.cos(p.tilt))
    return out


def quasi_static(p: PlantParams, control: ControlParams, asked: CircleAsked, branch: int) -> float:
    """Peak of |i_y| with balancing over that without, less 1, by the machine's own constants: T (6.27), (6.36), (6.37) with the
    cut at gamma_max, the slew and the branch, and no dynamics."""
    turn = np.arange(SLOTS) * math.tau / SLOTS * math.copysign(1, asked.hz)
    d = load(p, control, asked.radius * np.exp(1j * turn))
    drive, poles = Drive.of(p), p.pole_pairs
    direct, cross = p.alpha_d - p.alpha_2, p.alpha_c + p.alpha_3

    def held(gamma: Array) -> Complex:
        """What the controller asks for, with the field at `gamma`."""
        angle = poles * (gamma - p.gamma_zero)
        return drive.asked(-d / (direct * np.cos(angle) + 1j * cross * np.sin(angle)))

    goal = _equal(d, drive, branch, direct / cross) / poles + p.gamma_zero
    limit = asked.balanced_limit
    goal = np.clip((goal + math.pi / poles) % (2 * math.pi / poles) - math.pi / poles, -limit, limit)
    gamma = _followed(goal, asked.slew / (abs(asked.hz) * SLOTS))
    before = np.abs(drive.true(held(np.zeros(SLOTS))).imag).max()
    return float(np.abs(drive.true(held(gamma)).imag).max() / before - 1)


def _equal(d: Complex, drive: Drive, branch: int, ratio: float) -> Array:
    """M (gamma - gamma_zero) at which |i_x| = |i_y| as the controller has them: i_y lifts, i_x has the sign of `branch`."""
    size = np.abs(d) / np.abs(d).max() * 5.0
    for _ in range(FIXED):  # A; the direction depends on the size only by the sensors' zeros
        way = drive.acting(size * complex(branch, 1) / math.sqrt(2))
        phi = np.angle(-d) - np.angle(way)
        size = np.abs(d) / np.hypot(12.1 * np.cos(phi), 14.3 * np.sin(phi))
    out: Array = np.arctan2(ratio * np.sin(phi), np.cos(phi))
    return out


def _followed(goal: Array, step: float) -> Array:
    """gamma after a turn, no faster than `step` rad from slot to slot; 0: at once."""
    if step <= 0:
        return goal
    gamma, out = float(goal[0]), np.empty_like(goal)
    for _ in range(2):
        for k, to in enumerate(goal):
            gamma += min(max(float(to) - gamma, -step), step)
            out[k] = gamma
    return out
