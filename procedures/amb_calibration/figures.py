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
from procedures.servomotor.conventions import conventions

Array = npt.NDArray[np.float64]
NAMES = ("inboard", "outboard")


def all_figures(recording: Recording[Plan], data: HangingData, f: Fit, p: Mapping[str, float]) -> list[Figure]:
    """In the order of the report."""
    return [*_fits(data, f), *_residuals(data, f), *_one_step(recording), _slopes(data, f), _zero_load(data, f)]


def _fits(data: HangingData, f: Fit) -> Iterator[Figure]:
    turns = range(0, len(data.hangings.angles), max(1, len(data.hangings.angles) // 4))
    for b, name in enumerate(NAMES):
        series = []
        for turn in turns:
            i, force = f.control[b, turn], f.forces[b, turn]
            grid = np.linspace(i.min(), i.max(), 50)
            f0, k, k2, _ = f.terms[b, turn]
            label = f"{np.degrees(data.hangings.angles[turn]):.0f}°"
            series.append(Series(label, i, force, "points"))
            series.append(Series(f"{label} fit", grid, f0 + k * grid + k2 * grid**2, "line"))
        yield Figure(f"fit-{name}", f"Force over control current, {name} AMB",
                     "Force added by the hung masses against the control current, with the fitted parabolas; a shift "
                     "between angles is the eccentricity of the journal.",
                     "control current (A)", "added force (N)", tuple(series))  # fmt: skip


def _residuals(data: HangingData, f: Fit) -> Iterator[Figure]:
    for b, name in enumerate(NAMES):
        up = data.hangings.branch > 0
        yield Figure(f"residuals-{name}", f"Residuals of the fit, {name} AMB",
                     "Force applied less force fitted, all angles; a pattern common to all angles would point to a mass.",
                     "added force (N)", "residual (mN)",
                     (Series("loading", f.forces[b][up], 1e3 * f.residuals[b][up], "points"),
                      Series("unloading", f.forces[b][~up], 1e3 * f.residuals[b][~up], "points")),
                     lines=(("zero", 0.0),))  # fmt: skip


def _one_step(recording: Recording[Plan]) -> Iterator[Figure]:
    heaviest = recording.plan.masses[-1]
    step = next(s for s in recording.steps(Hang.kind) if s.labels["load"] == heaviest)
    machine = conventions(recording.rig)
    inboard, outboard = machine.positions_of("yi", "yo")
    data = step.read(inboard, outboard, *machine.coils["yo"])
    t = (data["t_ns"] - data["t_ns"][0]).astype(np.float64) * 1e-9
    yield Figure("step-position", f"Position during one step ({heaviest})",
                 "Vertical position at both sensor planes while the heaviest mass hangs.", "time (s)", "position (µm)",
                 (Series("inboard", t, 1e6 * data[inboard]), Series("outboard", t, 1e6 * data[outboard])))  # fmt: skip
    control = machine.control("yo", data.__getitem__)
    yield Figure("step-current", f"Outboard control current during one step ({heaviest})",
                 "Control current of the outboard AMB in the same step; its mean enters the fit.", "time (s)",
                 "control current (A)", (Series("outboard", t, control),),
                 lines=(("mean", float(control.mean())),))  # fmt: skip


def _closed(angles: Array, values: Array) -> tuple[Array, Array]:
    return np.append(angles, angles[0] + 2 * np.pi), np.append(values, values[0])


def _slopes(data: HangingData, f: Fit) -> Figure:
    series = tuple(
        Series(name, *_closed(data.hangings.angles, f.terms[b, :, 1]), "both") for b, name in enumerate(NAMES)
    )
    return Figure("polar-slope", "Slope at zero control current over the rotor angle",
                  "K at each angle in N/A. The reported value is the mean over the turn.", "rotor angle", "K (N/A)",
                  series, kind="polar")  # fmt: skip


def _zero_load(data: HangingData, f: Fit) -> Figure:
    series = tuple(
        Series(name, *_closed(data.hangings.angles, 1e3 * (zero - zero.mean())), "both")
        for name, zero in ((n, f.control[b][:, [0, -1]].mean(axis=1)) for b, n in enumerate(NAMES))
    )
    return Figure("polar-current", "Control current at no load over the rotor angle",
                  "Deviation from its mean in mA: the runout of the journal against the sensors, in units of current.",
                  "rotor angle", "deviation (mA)", series, kind="polar")  # fmt: skip
