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

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
SMALL_M = 1e-8
REPEATS = 30  # of a small step in different noise: the mean frequency is then good to 0.005 %, the damping to 0.03 %
ANSWER = 2  # ticks from a set point's write to the amplifiers: computed one later, applied another one later
DECIMATED, ROWS, ORDER = 4, 60, 12  # of the identification: every fourth tick, rows of the Hankel matrix, states
SLOW_HZ, FAST_HZ, DAMPED = 15.0, 250.0, 0.95  # of the rigid modes: slower are integrators, faster filters and bending
SWING = 800  # ticks of the first swing
PHASES = 3  # of the revolution, at which steps begin: what goes with one or two a turn has no mean
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


@dataclasses.dataclass(frozen=True)
class Shown:
    """What steps of one size and direction show together: the mean of their responses `y` (n,) as shares of the step, as read,
    at `t` s from the set point's write; `steady_error` m, of the shaft itself."""

    t: Array
    y: Array
    steady_error: float

    @property
    def overshoot(self) -> float:
        """Greatest position beyond the step, as a share of it."""
        return float(self.y[:SWING].max()) - 1

    @property
    def rise_time(self) -> float:
        """10 to 90 % of the step, s."""
        top = int(np.argmax(self.y[:SWING])) + 1
        low, high = np.interp((0.1, 0.9), self.y[:top], self.t[:top])
        return float(high - low)

    @property
    def bandwidth(self) -> float:
        """Where the spectrum of the response's derivative falls below 0.707 for good, Hz."""
        y = self.y[:2500]
        count = round(1 / (0.5 * TICK_S))  # zeros behind, for lines 0.5 Hz apart
        gain = np.abs(np.fft.rfft(np.diff(y, prepend=y[0]), count))[:1000]
        last = int(np.flatnonzero(gain >= math.sqrt(0.5))[-1])
        return 0.5 * float(np.interp(-math.sqrt(0.5), -gain[last : last + 2], [last, last + 1]))

    def settling_time(self, band: float, window_s: float) -> float:
        """Until the mean over a window stays in the band about 1."""
        total = np.concatenate(([0.0], np.cumsum(self.y)))
        n = round(window_s / TICK_S)
        at = np.arange(1, len(self.y) + 1)
        mean = (total[at] - total[np.maximum(at - n, 0)]) / np.minimum(at, n)
        outside = np.flatnonzero(np.abs(mean - 1) > band)
        return 0.0 if not len(outside) else float(self.t[outside[-1]]) + TICK_S


def steps(
    plant: AmbPlant,
    settings: Mapping[str, float],
    axis: str,
    size: float,
    rest_s: float,
    record_s: float,
    *,
    wait_s: float = 0.0,
    turn_s: float = 0.0,
    told: float = 1.0,
) -> dict[int, Shown]:
    """Up, back, down and back, after `wait_s` and `rest_s`: by way (1 up, -1 down) what they show together; `turn_s` of a
    revolution, 0 at rest; `told`: what the controller makes of a set point, as a share of it. Where the shaft turns, the mean
    of steps at PHASES of its revolution, since unbalance makes the bearings' slopes go with it."""
    responses: dict[int, list[Array]] = {1: [], -1: []}
    errors: dict[int, list[float]] = {1: [], -1: []}
    for begin, end in ((0.0, size), (size, 0.0), (0.0, -size), (-size, 0.0)):
        way = 1 if end > begin else -1
        plant.run(round(wait_s / TICK_S))
        before = plant.run(round(rest_s / TICK_S), 1)[1]
        for phase in range(PHASES if turn_s else 1):
            begun = plant.twin()
            begun.run(round(phase * turn_s / PHASES / TICK_S))
            moved, at_end = _moved(begun, settings, axis, told * end, before, record_s, turn_s)
            responses[way].append(way * moved / size)
            errors[way].append(at_end - way * size)
        plant.set(f"ref_{axis}", told * end)
        plant.run(round(record_s / TICK_S))
    t = np.asarray(np.arange(round(record_s / TICK_S)) * TICK_S, np.float64)
    return {w: Shown(t, np.mean(y, axis=0), float(np.mean(errors[w]))) for w, y in responses.items()}


def _moved(
    plant: AmbPlant, settings: Mapping[str, float], axis: str, end: float, before: Array, record_s: float, turn_s: float
) -> tuple[Array, float]:
    """Along an axis, from where it rested `before`: the position as read (n,) m, and where the shaft itself is in the end. What
    turns with the shaft is taken away, as a twin that makes no step shows it."""
    k, p, many = "yzx".index(axis), plant.params, round(record_s / TICK_S)
    still = plant.twin()
    plant.set(f"ref_{axis}", end)
    after, beside = plant.run(many, 1)[1], still.run(many, 1)[1]
    out = []
    for true in (False, True):
        x, twin, rest = (positions(p, settings, trace, true)[k] for trace in (after, beside, before))
        out.append(x - (twin - _drift(twin, turn_s)) - float(_drift(rest, turn_s).mean()))
    return out[0], float(out[1][-round(min(0.2, record_s / 4) / TICK_S) :].mean())


def _drift(x: Array, turn_s: float) -> Array:
    """`x` (n,) without what goes with the revolution: its means over whole ones, with straight lines between their middles."""
    if not turn_s:
        return x
    edges = np.arange(0, len(x) + 1e-9, turn_s / TICK_S)
    total = np.interp(edges, np.arange(len(x) + 1), np.concatenate(([0.0], np.cumsum(x))))
    middles = (edges[1:] + edges[:-1]) / 2
    return np.asarray(np.interp(np.arange(len(x)) + 0.5, middles, np.diff(total) / np.diff(edges)))


@dataclasses.dataclass(frozen=True)
class Small:
    """Of small motions along an axis: `poles` 1/s of the rigid modes with a positive frequency, their `parts` in a unit step
    when the amplifiers answer."""

    poles: Complex
    parts: Complex

    @property
    def pole(self) -> complex:
        """Of the oscillation as it begins: the mean of the poles, each with its part."""
        return complex((self.parts * self.poles).sum() / self.parts.sum())

    @property
    def damping(self) -> float:
        """Damping ratio of that pole."""
        return -self.pole.real / abs(self.pole)

    @property
    def frequency(self) -> float:
        """Natural frequency of that pole, Hz."""
        return abs(self.pole) / (2 * math.pi)


def small(plant: AmbPlant, settings: Mapping[str, float], axis: str) -> Small:
    """Poles by the eigensystem realisation algorithm (Juang and Pappa, 1985) from steps of SMALL_M: the mean of what each does
    beside a twin in the same noise that makes none."""
    k, begin, length = "yzx".index(axis), 6, 1006
    made = np.zeros((5, length))
    for _ in range(REPEATS):
        other = plant.twin()
        other.set(f"ref_{axis}", SMALL_M)
        stepped, still = (positions(p.params, settings, p.run(length, 1)[1]) for p in (other, plant))
        made += (stepped - still) / (REPEATS * SMALL_M)
    sampled = np.diff(made[:, begin:length:DECIMATED], axis=1)
    values = _eigenvalues(sampled[np.abs(sampled).max(axis=1) > 1e-6])
    s = np.log(values.astype(complex)) / (DECIMATED * TICK_S)
    powers = values[None, :] ** np.arange(sampled.shape[1])[:, None]
    parts = np.linalg.lstsq(powers, sampled[k].astype(complex), rcond=None)[0] / (values - 1)
    hz = np.where(s.imag > 1.0, np.abs(s), 0.0) / (2 * np.pi)
    use = (hz > SLOW_HZ) & (hz < FAST_HZ) & (-s.real < DAMPED * np.abs(s))
    return Small(s[use], parts[use] * np.exp(-s[use] * (begin - ANSWER) * TICK_S))


def _eigenvalues(y: Array) -> Complex:
    columns = y.shape[1] - ROWS
    hankel = np.concatenate([y[:, i : i + columns] for i in range(ROWS)])
    u, size, v = np.linalg.svd(hankel[:, :-1], full_matrices=False)
    root = np.sqrt(size[:ORDER])
    return np.asarray(np.linalg.eigvals((u[:, :ORDER].T @ hankel[:, 1:] @ v[:ORDER].T) / np.outer(root, root)))


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
        for way, shown in steps(
            plant, settings, axis, size, rest_s, record_s, wait_s=wait_s, turn_s=turn, told=told
        ).items():
            out[size, way] = shown
    return of_small, out
