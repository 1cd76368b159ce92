"""From the recorded positions of a levitated shaft to arrays: step means, batch means, drifts, losses, flags."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.recording import Recording, Step
from bench.rigfile.roles import STATUS
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.magnetics import Positions
from procedures.shared.step_table import reduced

Array = npt.NDArray[np.float64]
REST, LIFT, LIFT_LOST, TILT, HOLD = "rest", "lift", "lift-lost", "tilt", "hold"


@dataclass(frozen=True)
class Held:
    """Steps in time order, N of them, by channel of the `machine`.

    `mean`, `drift`, `spread` (N,); `batches` (N, B), means of B parts of a step; `every` (S,), all samples, step by step,
    of which `of_step` (S,) says the step; `labels` (N,); `lost` and `expected` samples; `flags` ORed; `names` for the
    reader.
    """

    mean: dict[str, Array]
    drift: dict[str, Array]
    spread: dict[str, Array]
    batches: dict[str, Array]
    every: dict[str, Array]
    of_step: npt.NDArray[np.int64]
    labels: dict[str, Array]
    lost: Array
    expected: Array
    flags: npt.NDArray[np.int64]
    names: tuple[str, ...]
    machine: AmbRotor

    def __len__(self) -> int:
        return len(self.names)

    def chosen(self, which: npt.NDArray[np.bool_]) -> Held:
        """The steps of which `which` (N,) is true."""
        samples = which[self.of_step]
        renumbered = np.cumsum(which) - 1

        def steps(of: dict[str, Array]) -> dict[str, Array]:
            return {name: values[which] for name, values in of.items()}

        return Held(
            steps(self.mean),
            steps(self.drift),
            steps(self.spread),
            steps(self.batches),
            {name: values[samples] for name, values in self.every.items()},
            renumbered[self.of_step[samples]],
            steps(self.labels),
            self.lost[which],
            self.expected[which],
            self.flags[which],
            tuple(name for name, use in zip(self.names, which, strict=True) if use),
            self.machine,
        )

    def where(self, values: Array) -> str:
        """The name of the step with the greatest of `values` (N,)."""
        return self.names[int(np.argmax(values))]

    def means(self) -> Positions:
        """One column a step."""
        return self._positions(self.mean)

    def parts(self) -> Positions:
        """One column a batch, step by step (N B)."""
        return self._positions({k: v.ravel() for k, v in self.batches.items()})

    def samples(self) -> Positions:
        """One column a sample, step by step (S)."""
        return self._positions(self.every)

    def _positions(self, of: dict[str, Array]) -> Positions:
        p, n = (
            np.array([of[c] for c in names]) for names in zip(*map(self.machine.pair, self.machine.axes), strict=True)
        )
        return Positions(np.array([of[c] for c in self.machine.stations.channels]), p, n, self.machine)


def channels(machine: AmbRotor) -> tuple[str, ...]:
    """What is read of a step."""
    return (*machine.stations.channels, *machine.currents, STATUS)


def of_readings(
    labels: Mapping[str, Sequence[float]], readings: Sequence[Mapping[str, float]], machine: AmbRotor
) -> Held:
    """Positions as a run sees them while it goes on: a reading of each channel in the place of means, one batch each; nothing
    drifts, scatters or is lost."""
    mean = {c: np.array([r[c] for r in readings]) for c in readings[0]}
    count = len(readings)
    none = np.zeros(count)
    nothing, batches = dict.fromkeys(mean, none), {c: v[:, None] for c, v in mean.items()}
    return Held(mean, nothing, nothing, batches, mean, np.arange(count), {k: np.array(v) for k, v in labels.items()},
                none, none, none.astype(np.int64), ("",) * count, machine)  # fmt: skip


def read_steps(recording: Recording[Any], kind: str, labels: tuple[str, ...], batches: int) -> Held:
    """Every step of `kind`; a label that it has not is no number.

    Raises:
        AnalysisError: there are none, or one has fewer samples than `batches`.
    """
    steps = list(recording.steps(kind))
    if not steps:
        raise AnalysisError(f"steps of kind {kind!r}: found none; expected the run's (was it stopped early?)")
    machine = conventions(recording.rig)
    names = channels(machine)
    read = [_read(step, names, batches) for step in steps]
    mean, drift, spread, parts = (
        {c: np.array([r[key][c] for r in read]) for c in names} for key in ("mean", "drift", "spread", "batches")
    )
    return Held(
        mean,
        drift,
        spread,
        parts,
        {c: np.concatenate([r["every"][c] for r in read]) for c in names if c != STATUS},
        np.repeat(np.arange(len(read)), [r["samples"] for r in read]),
        {key: np.array([float(s.labels.get(key, np.nan)) for s in steps]) for key in labels},
        np.array([float(s.lost()) for s in steps]),
        np.array([float(s.expected()) for s in steps]),
        np.array([r["flags"] for r in read]),
        tuple(_name(kind, dict(s.labels)) for s in steps),
        machine,
    )


def _name(kind: str, labels: dict[str, Any]) -> str:
    if kind == TILT:
        return f"tilt psi {labels['psi_rad'] * 1e6:+.0f}, theta {labels['theta_rad'] * 1e6:+.0f} µrad"
    bias = f" at {labels['bias_A']:g} A" if "bias_A" in labels else ""
    return f"y {labels['y_m'] * 1e6:+.0f}, z {labels['z_m'] * 1e6:+.0f} µm{bias}"


def _read(step: Step, names: tuple[str, ...], batches: int) -> dict[str, Any]:
    data = step.read(*names)
    count = len(data[STATUS])
    if count < 2 * batches:
        raise AnalysisError(f"step {dict(step.labels)}: found {count} samples; expected {2 * batches} or more")
    out = reduced(data, names, step.labels)
    out["batches"] = {c: np.array([part.mean() for part in np.array_split(data[c], batches)]) for c in names}
    out["every"] = {c: data[c] for c in names if c != STATUS}
    out["samples"] = count
    return out
