"""Compensation switched on at speed: how the synchronous amplitude falls, and what is left (T 3.5)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.analysis.orders import synchronous
from bench.analysis.sampling import Sampling
from bench.analysis.tachometer import Tachometer, counted, tachometer
from bench.analysis.vectors import Vectors, estimates
from bench.errors import AnalysisError
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.uncertainty import Estimate
from bench.uncertainty.estimate import merged
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.shared.certificates import certified

Array = npt.NDArray[np.float64]
SWITCH = "switch"
WITHIN_S = 0.15  # T 3.5
TURNS_AT, TURNS_LEFT = 6, 50  # that the amplitude then is read over, and the steady state at least


@dataclass(frozen=True)
class Switched:
    """The capture: `t` (n,) s from the switch, `positions` (4, n) m, its tachometer on the same time;
    speed rad/s; the probes' `axes`."""

    t: Array
    positions: Array
    tacho: Tachometer
    rate: float
    speed: float
    axes: tuple[str, ...]

    def between(self, begin: float, end: float, channels: tuple[int, ...] = (0, 1, 2, 3)) -> tuple[Vectors, Array]:
        """Vectors of order 1 and means of the turns between two times."""
        part = (self.t >= begin) & (self.t <= end)
        track = synchronous(self.t[part], self.positions[:, part], self.tacho, Sampling(1 / self.rate), orders=(1.0,))
        return track.vectors(0, channels), track.means[0]

    @property
    def turn(self) -> float:
        """One revolution, s."""
        return 2 * math.pi / self.speed

    def course(self) -> tuple[Array, Array]:
        """Times (b,) s and root mean square (b,) m of the four amplitudes, of every six turns, two apart."""
        times, sizes = [], []
        for begin in np.arange(self.tacho.times[0], self.tacho.times[-1] - 6 * self.turn, 2 * self.turn):
            vectors, _ = self.between(float(begin), float(begin) + 6.1 * self.turn)
            times.append(float(begin) + 3 * self.turn)
            sizes.append(rms(vectors))
        return np.array(times), np.array(sizes)


def rms(vectors: Vectors) -> float:
    """Of the amplitudes."""
    return math.sqrt(float((np.abs(vectors.values) ** 2).mean()))


def switched(machine: AmbRotor) -> dict[str, float]:
    """The parameters that switch the compensation on while its estimates run."""
    waiting = machine.variants["waiting"]
    return {name: value for name, value in machine.variants["corrected"].items() if waiting.get(name) != value}


def captured_channels(machine: AmbRotor) -> tuple[str, ...]:
    """What is captured about the switch."""
    return (*machine.positions, *machine.pulsed)


def read_switch(recording: Recording[Any]) -> Switched:
    """The capture about the switch; its time is that of the parameter's write.

    Raises:
        AnalysisError: there is none.
    """
    machine = conventions(recording.rig)
    found, steps = recording.captures(switch=1), list(recording.steps(SWITCH))
    if not found or not steps:
        raise AnalysisError("found no capture about the switch; expected one (was the run stopped early?)")
    written = [e["t_ns"] for e in recording.events("parameter")
               if e["name"] in switched(machine) and steps[0].start_ns <= e["t_ns"] <= steps[0].end_ns]  # fmt: skip
    if not written:
        raise AnalysisError("found no write that switches the compensation within the step")
    data: Mapping[str, Array] = found[0].arrays(*captured_channels(machine))
    t = data["t_s"] - (written[0] - recording.start_ns) * 1e-9
    count, age = (data[name] for name in machine.pulsed)
    tacho = tachometer(*counted(t, count, age))
    positions = np.array([data[p] for p in machine.positions])
    return Switched(t, positions, tacho, found[0].rate_hz, float(np.nanmedian(tacho.speed(t))), machine.axes)


def of_switch(s: Switched, rig: RigFile) -> dict[str, Estimate]:
    """`drop`, the share by which the amplitude has fallen after WITHIN_S; `residual` m, the greatest |mean| + amplitude of a
    probe at the end of the capture.

    Raises:
        AnalysisError: the capture does not hold enough turns.
    """
    names = conventions(rig).positions
    gains = [certified(f"sensors/{name}/gain", rig.sensors[name].gain, f"gain of {name}") for name in names]
    last = float(s.t[-1])
    if last - WITHIN_S < (TURNS_LEFT + 2) * s.turn:
        raise AnalysisError(
            f"the capture ends {last:.2f} s after the switch; expected {TURNS_LEFT} turns more than {WITHIN_S} s"
        )
    before, _ = s.between(float(s.t[0]), -s.turn)
    then, _ = s.between(WITHIN_S, WITHIN_S + (TURNS_AT + 1) * s.turn)
    left, means = s.between(last - (TURNS_LEFT + 2) * s.turn, last)
    share = _amplitude(then, gains, "switch/then") / _amplitude(before, gains, "switch/before")
    drop = 1 - share
    worst = int(np.argmax(np.abs(means) + np.abs(left.values)))
    size = _amplitude(left.one(worst), gains[worst : worst + 1], "switch/left")
    gain = gains[worst]
    mean = Estimate(abs(float(means[worst])), "m", merged([(-abs(float(means[worst])), gain)]))
    residual = size + mean
    return {
        "drop": Estimate(drop.value, "1", drop.sensitivities),
        "residual": Estimate(residual.value, "m", residual.sensitivities),
    }


def _amplitude(v: Vectors, gains: list[Estimate], identity: str) -> Estimate:
    """Root mean square of amplitudes with scatter and gains."""
    scatter = estimates(v.parts, v.covariance, identity, "scatter in the capture", "m", v.dof)
    size, count = rms(v), len(v.values)
    terms = [(float(p) / (count * size), e) for p, e in zip(v.parts, scatter, strict=True)]
    terms += [(-float(abs(x) ** 2) / (count * size), gains[k]) for k, x in enumerate(v.values)]
    return Estimate(size, "m", merged(terms))
