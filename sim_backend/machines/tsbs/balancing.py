"""Load balancing on a circle (T 6.7.3): what the drawn machine does in the mean, and what its own constants say it should.

The machine runs with noise of its position sensors, another than that of the run: gamma follows a noisy load by a slew, and so
lags behind more than without. Means over many turns leave little of it. The shaft stands at its home angle, within the count of
its encoder where turning it as the run does has left it. The load on the motor is D, N, horizontal + j up; currents are those
along the field.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.controller.controls import controls, in_force
from sim_backend.core.plant import LEVITATE, LIFT, PERIOD_TICKS, READY, TICK_S
from sim_backend.draws import noise_seed
from sim_backend.machine import Numbers, Truth
from sim_backend.machines.tsbs.params import ControlParams, PlantParams
from sim_backend.machines.tsbs.plant import CHANNELS, TRACE, Plant
from sim_backend.motion import CircleAsked

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
AT = {name: k for k, name in enumerate(CHANNELS)}
GAMMA = TRACE.index("gamma")
MEAN_S, MEANS = 0.01, (100, 400)  # of which means are taken around the circle; so many of a turn, whatever it lasts
ROW_S = PERIOD_TICKS * TICK_S
TURNS, SLOW_HZ = 48, 0.25  # turns that are watched; of slower circles as many as last as long, one at least
CUT = 0.995  # of the limit of gamma
NEAR, ORDERS = 0.02, 2  # of a turn to either side of a peak, through which a parabola is laid; harmonics of the path
NEVER = -1  # a visit that no run is of: its noise is the truth's own
FIXED = 4  # rounds for the direction of balanced currents, which sensors' zeros turn by a thousandth


def circle(rig: RigFile, drawn: Truth, asked: CircleAsked) -> Mapping[tuple[str, str], float]:
    """By quantity and place ("before" or "after", "" where it is neither's), true amperes and readings' metres."""
    quiet = replace(drawn.plant, current_noise=0.0, current_lsb=0.0)
    found = {branch: _moved(rig, drawn, quiet, asked, branch) for branch in set(asked.branches)}
    return {key: float(np.mean([found[b][key] for b in asked.branches])) for key in found[asked.branches[0]]}


def _moved(rig: RigFile, drawn: Truth, p: PlantParams, asked: CircleAsked, branch: int) -> dict[tuple[str, str], float]:
    """What the machine does: a turn on the circle without balancing, one that is left out, one with it."""
    plant, known = _levitated(rig, drawn, p, asked.settings), controls(rig, drawn.machine)

    def write(values: Numbers) -> None:
        for name, value in values.items():
            for control in known[name]:
                plant.set(control.name, control.of(value) * drawn.defects.get(f"factor_{name}", 1.0))

    hz = abs(asked.hz)
    watched = max(round(TURNS * min(1.0, hz / SLOW_HZ)), 1)

    def ticks(turns: float) -> int:
        return round(turns / (hz * TICK_S))

    for values, seconds in (*asked.turned, (asked.carried, 2.0)):
        write(values)
        plant.run(round(seconds / TICK_S))
    write(asked.circled)
    plant.run(round(asked.ramp_s / TICK_S))
    before = plant.run(ticks(watched), PERIOD_TICKS)
    plant.run(ticks((asked.engage_rad * math.copysign(1, asked.hz) / math.tau) % 1))
    plant._s.law.balancing, plant._s.law.line = 1.0, branch * 1.2  # the side that the machine took
    write(asked.balanced)
    plant.run(ticks(1))
    after = plant.run(ticks(watched), PERIOD_TICKS)
    scale = (1 / p.position_gain[2] + 1 / p.position_gain[3]) / 2
    out: dict[tuple[str, str], float] = {}
    for when, (rows, _) in (("before", before), ("after", after)):
        x, y = (folded(i, hz) for i in _currents(p, rows))
        out |= {
            ("peak_i_y", when): top(np.abs(y)),
            ("peak_any", when): max(top(np.abs(y)), top(np.abs(x))),
            ("unbalance", when): unbalance(x, y),
            ("error_radius", when): _off_circle(rows, hz, asked.radius) * scale,
        }
    control = ControlParams(**{f.name: plant.get(f.name) for f in fields(ControlParams)})
    paths = (_path(before[0], hz), _path(after[0], hz))
    return out | {
        ("gamma_extreme", ""): _extreme(np.abs(folded(after[1][:, GAMMA], hz)), control.gamma_max),
        ("reduction", ""): out["peak_i_y", "after"] / out["peak_i_y", "before"] - 1,
        ("unbalance_ratio", ""): out["unbalance", "after"] / out["unbalance", "before"],
        ("predicted_reduction", ""): quasi_static(p, control, asked, branch, paths),
    }


def _levitated(rig: RigFile, drawn: Truth, p: PlantParams, settings: Numbers) -> Plant:
    """With the controller's settings, lifted by the AMBs."""
    used = in_force(rig, drawn.machine, settings)
    known = {f.name for f in fields(ControlParams)} & set(used)
    control = ControlParams(**{name: used[name] * drawn.defects.get(f"factor_{name}", 1.0) for name in known})
    plant = Plant(p, noise_seed(drawn.seed, NEVER), control=control)
    plant.mode = READY
    plant.run(1000)
    plant.mode = LIFT
    plant.run(round(1.1 * control.lift_time_s / TICK_S))
    plant.mode = LEVITATE
    plant.run(8000)
    return plant


def _path(rows: Array, hz: float) -> Complex:
    """Means of a turn, as the outboard sensors read."""
    x, y = (folded(rows[:, AT[name]], hz) for name in ("pos_xo", "pos_yo"))
    return x + 1j * y


def folded(x: Array, hz: float) -> Array:
    """Of values each ROW_S of a circle of `hz` turns a second: means over MEAN_S of its phase and over the turns, from where
    they begin on. A turn need not be a whole number of values, nor of means."""
    count = min(max(round(1 / (hz * MEAN_S)), MEANS[0]), MEANS[1])
    place = ((np.arange(len(x)) + 0.5) * ROW_S * hz * count).astype(int) % count  # the middle of a value is at no edge
    out: Array = np.bincount(place, x, count) / np.bincount(place, minlength=count)
    return out


def top(x: Array) -> float:
    """The greatest of what `x` are means of, by a parabola through those near it where it is a smooth top: the mean of one over
    an interval lies below its middle by a twelfth of its second coefficient."""
    reach = round(NEAR * len(x))
    k, s = int(np.argmax(x)), np.arange(-reach, reach + 1)
    c2, c1, c0 = np.polyfit(s, np.take(x, k + s, mode="wrap"), 2)
    smooth = c2 < 0 and abs(c1) <= -2 * c2 * reach
    return float(c0 - c1**2 / (4 * c2) - c2 / 12) if smooth else float(x[k])


def _extreme(gamma: Array, limit: float) -> float:
    """A top that is cut off at the limit that the machine has, which a defect may make another than what was asked, or nearly,
    is no parabola."""
    return float(gamma.max()) if gamma.max() > CUT * limit else top(gamma)


def _off_circle(rows: Array, hz: float, radius: float) -> float:
    """Greatest deviation along the radius of the turns' mean, of its harmonics up to ORDERS."""
    off = folded(np.hypot(rows[:, AT["pos_xo"]], rows[:, AT["pos_yo"]]) - radius, hz)
    spectrum = np.fft.rfft(off)
    spectrum[ORDERS + 1 :] = 0
    return float(np.abs(np.fft.irfft(spectrum, len(off))).max())


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


def quasi_static(
    p: PlantParams, control: ControlParams, asked: CircleAsked, branch: int, paths: tuple[Complex, Complex]
) -> float:
    """Peak of |i_y| with balancing over that without, less 1, by the machine's own constants: T (6.27), (6.36), (6.37) with the
    cut at gamma_max, the slew and the side, and no dynamics. `paths` as the sensors read them, without and with it."""
    drive, poles = Drive.of(p), p.pole_pairs
    direct, cross = p.alpha_d - p.alpha_2, p.alpha_c + p.alpha_3

    def held(d: Complex, gamma: Array | float) -> Complex:
        """What the controller asks for, with the field at `gamma`."""
        angle = poles * (gamma - p.gamma_zero)
        return drive.asked(-d / (direct * np.cos(angle) + 1j * cross * np.sin(angle)))

    before, after = (load(p, control, path) for path in paths)
    goal = _equal(after, drive, branch, direct, cross) / poles + p.gamma_zero
    limit = asked.balanced_limit
    goal = np.clip((goal + math.pi / poles) % (2 * math.pi / poles) - math.pi / poles, -limit, limit)
    gamma = _followed(goal, asked.slew / (abs(asked.hz) * len(goal)))
    most = float(np.abs(drive.true(held(before, 0.0)).imag).max())
    return float(np.abs(drive.true(held(after, gamma)).imag).max()) / most - 1


def _equal(d: Complex, drive: Drive, branch: int, direct: float, cross: float) -> Array:
    """M (gamma - gamma_zero) at which |i_x| = |i_y| as the controller has them: i_y lifts, i_x has the sign of `branch`."""
    size, out = np.abs(d) / direct, np.zeros(len(d))
    for _ in range(FIXED):  # the direction depends on the size only by the sensors' zeros
        phi = np.angle(-d) - np.angle(drive.acting(np.asarray(size * complex(branch, 1) / math.sqrt(2), np.complex128)))
        out = np.arctan2(direct * np.sin(phi), cross * np.cos(phi))
        size = np.abs(d) / np.hypot(direct * np.cos(out), cross * np.sin(out))
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
