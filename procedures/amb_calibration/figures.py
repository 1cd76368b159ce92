"""What the AMB calibration draws: the fit, its residuals, one step over time, and both polar plots."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from bench.figures import Figure, Series
from bench.recording import Recording
from procedures.amb_calibration.fit import Fit
from procedures.amb_calibration.plan import Plan
from procedures.amb_calibration.steps import Hang, HangingData

Array = npt.NDArray[np.float64]


def all_figures(recording: Recording[Plan], data: HangingData, f: Fit, p: Mapping[str, float]) -> list[Figure]:
    """In the order of the report."""
    around = [_slopes(data, f), _zero_load(data, f)] if len(data.hangings.angles) > 1 else []
    return [*_fits(data, f), *_residuals(data, f), *_one_step(recording, data, f), *around]


def _fits(data: HangingData, f: Fit) -> Iterator[Figure]:
    turns = range(0, len(data.hangings.angles), max(1, len(data.hangings.angles) // 4))
    for b, axis in enumerate(f.pull.axes):
        series = []
        for turn in turns:
            i, force = f.control[b, turn], f.forces[b, turn]
            grid = np.linspace(i.min(), i.max(), 50)
            f0, k, k2, _ = f.terms[b, turn]
            label = f"{np.degrees(data.hangings.angles[turn]):.0f}°"
            series.append(Series(label, i, force, "points"))
            series.append(Series(f"{label} fit", grid, f0 + k * grid + k2 * grid**2, "line"))
        yield Figure(f"fit-{axis.where}", f"Force over control current, {axis.title}",
                     "Force added by the hung masses against the control current, with the fitted parabolas; a shift "
                     "between angles is the eccentricity of the journal.",
                     "control current (A)", "added force (N)", tuple(series))  # fmt: skip


def _residuals(data: HangingData, f: Fit) -> Iterator[Figure]:
    for b, axis in enumerate(f.pull.axes):
        up = data.hangings.branch > 0
        yield Figure(f"residuals-{axis.where}", f"Residuals of the fit, {axis.title}",
                     "Force applied less force fitted, all angles; a pattern common to all angles would point to a mass.",
                     "added force (N)", "residual (mN)",
                     (Series("loading", f.forces[b][up], 1e3 * f.residuals[b][up], "points"),
                      Series("unloading", f.forces[b][~up], 1e3 * f.residuals[b][~up], "points")),
                     lines=(("zero", 0.0),))  # fmt: skip


def _one_step(recording: Recording[Plan], data: HangingData, f: Fit) -> Iterator[Figure]:
    heaviest = recording.plan.masses[-1]
    step = next(s for s in recording.steps(Hang.kind) if s.labels["load"] == heaviest)
    loaded = f.pull.axes[int(np.argmax(np.abs(f.forces).max(axis=(1, 2))))]
    read = step.read(*(a.position for a in f.pull.axes), *loaded.coils)
    t = (read["t_ns"] - read["t_ns"][0]).astype(np.float64) * 1e-9
    yield Figure("step-position", f"Position during one step ({heaviest})",
                 "Position along the loaded axes while the heaviest mass hangs.", "time (s)", "position (µm)",
                 tuple(Series(a.where, t, 1e6 * read[a.position]) for a in f.pull.axes))  # fmt: skip
    control = (read[loaded.coils[0]] - read[loaded.coils[1]]) / 2
    yield Figure("step-current", f"Control current during one step ({heaviest}), {loaded.title}",
                 f"Control current of the {loaded.title} in the same step; its mean enters the fit.", "time (s)",
                 "control current (A)", (Series(loaded.where, t, control),),
                 lines=(("mean", float(control.mean())),))  # fmt: skip


def _closed(angles: Array, values: Array) -> tuple[Array, Array]:
    return np.append(angles, angles[0] + 2 * np.pi), np.append(values, values[0])


def _slopes(data: HangingData, f: Fit) -> Figure:
    series = tuple(
        Series(axis.where, *_closed(data.hangings.angles, f.terms[b, :, 1]), "both")
        for b, axis in enumerate(f.pull.axes)
    )
    return Figure("polar-slope", "Slope at zero control current over the rotor angle",
                  "K at each angle in N/A. The reported value is the mean over the turn.", "rotor angle", "K (N/A)",
                  series, kind="polar")  # fmt: skip


def _zero_load(data: HangingData, f: Fit) -> Figure:
    series = tuple(
        Series(name, *_closed(data.hangings.angles, 1e3 * (zero - zero.mean())), "both")
        for name, zero in ((a.where, f.control[b][:, [0, -1]].mean(axis=1)) for b, a in enumerate(f.pull.axes))
    )
    return Figure("polar-current", "Control current at no load over the rotor angle",
                  "Deviation from its mean in mA: the runout of the journal against the sensors, in units of current.",
                  "rotor angle", "deviation (mA)", series, kind="polar")  # fmt: skip
