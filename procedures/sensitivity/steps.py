"""From captures under injection to the sensitivity at each line: S = after/inject, with its noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.responses import Response, clear_of_orders, lines, response, single_response, without_orders
from bench.analysis.tachometer import counted, tachometer
from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile.roles import STATUS
from bench.units import RPM
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.sensitivity.injection import in_whole_samples
from procedures.sensitivity.requires import LOOP, _axial, telemetry_channels
from procedures.shared.signals import clips

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
INJECT, NOT_REACHED = "inject", "not-reached"
WIRING, SURVEY, SCAN, MODE, REFINED, HALF = "wiring", "survey", "scan", "mode", "refined", "half"
ORDERS = (1.0, 2.0, 3.0, 4.0)
CLEAR_HZ = 3.0  # to either side of an order of the shaft's speed
SHARING, FEW = 15, 4  # lines to either side that share a noise; at the ends of a grid
# Degree of the polynomial over the lines' numbers by which noise grows over octaves, and lines that each of its degrees asks
# for. On the plain stand (39 lines) a parabola is up to 37 % off, degree 5 at most 6 %.
BENDS, LINES_A_BEND = 5, 7


@dataclass(frozen=True)
class Grid:
    """Lines `hz` (m,), `period` s of the whole, `amplitude` A asked of each."""

    hz: Array
    period: float
    amplitude: float

    @property
    def step(self) -> float:
        """Greatest distance of neighbours, Hz."""
        return float(np.diff(self.hz).max()) if self.hz.size > 1 else math.inf


@dataclass(frozen=True)
class Taken:
    """One capture under injection into `axis`: `kind` of pass about `about` Hz; `response`, S at the lines that are clear of
    the shaft's orders, `excluded` Hz those that are not; `injected` (m,) A found; `peak` A, the greatest; `clipped`, the most
    of the difference of after from before + inject, A; `follows` (5,), the differential coil currents of all axes per `after`
    at the lowest lines (None where the currents were not captured); `rate` Hz, `flags` ORed; `clips` of a probe."""

    axis: str
    speed: float
    turning: float
    kind: str
    about: float
    grid: Grid
    response: Response
    excluded: Array
    injected: Array
    peak: float
    clipped: float
    follows: Complex | None
    rate: float
    flags: int
    clips: int
    lost: int
    expected: int
    machine: AmbRotor
    step_hz: float = 0.0  # of the comb; none of a sine

    @property
    def where(self) -> str:
        """How it is named to the reader."""
        return f"{self.axis}, {name_speed(self.speed)}"

    @property
    def noise(self) -> Array:
        """Mean square (m,) of the noise in S at each line: in shares of abs(S) it hardly changes from line to line."""
        return shared_noise(self.response, self.octaves)

    @property
    def octaves(self) -> bool:
        """Whether its lines stand at steps of the frequency's logarithm, so that noise grows from one to the next."""
        return self.kind == SURVEY and self.step_hz == 0

    @property
    def dof(self) -> float:
        """Degrees of freedom of `noise`: those of the lines that share it, two for each complex value; of a polynomial's
        course each of its terms takes a share."""
        count = self.response.hz.size
        shared = count / (bends(count) + 1) if self.octaves else min(count, 2 * SHARING + 1)
        return 2 * self.response.dof * shared

    @property
    def dof_at_ends(self) -> float:
        """The same where the grid begins and where it ends; a polynomial is known half as well there."""
        few = 2 * self.response.dof * min(self.response.hz.size, FEW + 1)
        return few / 2 if self.octaves else few


def bends(count: int) -> int:
    """Degree of the polynomial by which the noise of `count` lines over octaves grows."""
    return min(BENDS, count // LINES_A_BEND)


def shared_noise(r: Response, octaves: bool = False) -> Array:
    """Mean square (m,) of the noise in a response, its share of abs squared averaged over neighbouring lines: as many to
    either side, since the share grows with the frequency, but a few at the ends. Where neighbours reach over `octaves`, a
    polynomial of the logarithms says first how it grows: the mean of what grows as a square is not what is in the middle."""
    size = np.maximum(np.abs(r.values) ** 2, 1e-12)
    share = np.trace(r.covariance, axis1=1, axis2=2) / size
    if octaves and (share > 0).all():
        x = np.arange(share.size) / share.size  # by ln f the few lowest lines would weigh most
        grown = np.exp(np.polyval(np.polyfit(x, np.log(share), bends(x.size)), x))
        share, size = share / grown, size * grown
    reach = [min(max(k, FEW), max(share.size - 1 - k, FEW), SHARING) for k in range(share.size)]
    near = [share[max(0, k - n) : k + n + 1].mean() for k, n in enumerate(reach)]
    return np.asarray(np.array(near) * size)


def name_speed(speed: float) -> str:
    """A speed, for the reader."""
    return f"{speed * RPM:.0f} r/min" if speed else "at rest"


def captured_channels(machine: AmbRotor, kind: str, speed: float) -> tuple[str, ...]:
    """What is captured: first of all also the coil currents, which tell where the injection goes."""
    return (*LOOP, *(machine.all_currents if kind == WIRING else ()), *(machine.pulsed if speed else ()))


def folds(grid: Grid, rate: float) -> bool:
    """Whether the lines are too high for a capture's rate, or do not lie on its bins."""
    return bool(grid.hz.max() > 0.45 * rate or not in_whole_samples(grid.period, rate))


def sensitivity(
    columns: Mapping[str, Array], t: Array, rate: float, grid: Grid, pulsed: Sequence[str]
) -> tuple[Response, Array, Array]:
    """S at the lines, the amplitudes found there (m,) A, and the excluded lines; with the channels `pulsed` the shaft's orders
    are taken out.

    Raises:
        AnalysisError: fewer than three periods, or a line without injection.
    """
    data = np.array([columns["inject"], columns["after"]])
    hz, near = grid.hz, grid.hz[:0]
    if is_pulsed(columns, pulsed):
        angle, speed, inside = track_angle(columns, t, pulsed)
        data = np.concatenate([data[:1, inside], without_orders(data[1:, inside], angle[inside], ORDERS)])
        free = clear_of_orders(hz, speed, CLEAR_HZ, ORDERS)
        hz, near = hz[free], hz[~free]
    data, period = data - data.mean(axis=1, keepdims=True), round(grid.period * rate)
    if hz.size == 1:
        alone = single_response(data, rate, period, float(hz[0]), 1, 0)
        whole = lines(data[:1], rate, period, hz).values[:, 0]
        return alone, np.abs(whole).mean(axis=0), near
    found = lines(data, rate, period, hz)
    return response(found, 1, 0), np.abs(found.values[:, 0]).mean(axis=0), near


def is_pulsed(columns: Mapping[str, Array], pulsed: Sequence[str]) -> bool:
    """Whether a capture has the mark's pulses."""
    return bool(pulsed) and all(name in columns for name in pulsed)


def track_angle(
    columns: Mapping[str, Array], t: Array, pulsed: Sequence[str]
) -> tuple[Array, float, npt.NDArray[np.bool_]]:
    """Angle (n,) rad by the pulses, mean speed rad/s, and where the angle is known, (n,)."""
    count, age = (columns[name] for name in pulsed)
    tacho = tachometer(*counted(t, count, age))
    angle = tacho.angle(t)
    inside = np.isfinite(angle)
    if inside.sum() < 2:
        raise AnalysisError("sensitivity: found no turn between pulses in a capture; expected several")
    known = angle[inside]
    return angle, float((known[-1] - known[0]) / (t[inside][-1] - t[inside][0])), inside


def read_taken(recording: Recording[Any]) -> list[Taken]:
    """All captures under injection, in time order.

    Raises:
        AnalysisError: there are none, or one cannot be evaluated.
    """
    steps = sorted(recording.steps(INJECT), key=lambda s: s.start_ns)
    if not steps:
        raise AnalysisError("found no injection; expected those of the plan (was the run stopped early?)")
    return [_read(recording, step) for step in steps]


def grid_of(labels: Mapping[str, Any]) -> Grid:
    """As it was asked for."""
    hz = np.asarray(float(labels["first_hz"]) + float(labels["step_hz"]) * np.arange(int(labels["lines"])), np.float64)
    return Grid(hz, float(labels["period_s"]), float(labels["amplitude_A"]))


def _read(recording: Recording[Any], step: Step) -> Taken:
    machine = conventions(recording.rig)
    labels, data = step.labels, step.read(*telemetry_channels(machine))
    captured = recording.captures(number=labels["number"])
    if not captured:
        raise AnalysisError(f"injection {dict(labels)}: found no capture")
    kind, grid, rate = str(labels["pass"]), grid_of(labels), captured[0].rate_hz
    columns = captured[0].arrays(*captured[0].channels)
    found, injected, excluded = sensitivity(columns, columns["t_s"], rate, grid, machine.pulsed)
    clipped = float(np.abs(columns["after"] - columns["before"] - columns["inject"]).max())
    follows = _follows(columns, machine, rate, grid) if kind == WIRING else None
    turns = is_pulsed(columns, machine.pulsed)
    turning = track_angle(columns, columns["t_s"], machine.pulsed)[1] if turns else 0.0
    flags = int(np.bitwise_or.reduce(data[STATUS].astype(np.int64)))
    return Taken(
        str(labels["axis"]), float(labels["speed_rad_s"]), turning, kind, float(labels["about_hz"]), grid, found, excluded,
        injected, float(np.abs(columns["inject"]).max()), clipped, follows, rate, flags,
        clips([data[name] for name in (*machine.stations.channels, *_axial(machine))]), step.lost(), step.expected(),
        machine, float(labels["step_hz"]),
    )  # fmt: skip


def _follows(columns: Mapping[str, Array], machine: AmbRotor, rate: float, grid: Grid) -> Complex | None:
    """Differential current of each axis per `after`, by the whole of the lines: (5,)."""
    if any(c not in columns for c in machine.all_currents):
        return None
    pairs = np.array([(columns[p] - columns[n]) / 2 for p, n in map(machine.pair, machine.all_axes)])
    data = np.concatenate([columns["after"][None], pairs])
    spectra = lines(data - data.mean(axis=1, keepdims=True), rate, round(grid.period * rate), grid.hz).values.mean(
        axis=0
    )
    after = spectra[0]
    return np.asarray((spectra[1:] * after.conj()).sum(axis=1) / (np.abs(after) ** 2).sum())
