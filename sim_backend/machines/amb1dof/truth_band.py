"""What the firmware's estimator truly does: its own recursion, fed with sines, a constant and single samples.

By the code of the device under test, and so by another way than a procedure, which has its weights in closed form.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from bench.rigfile import RigFile
from sim_backend.controller.controls import in_force
from sim_backend.core.plant import TICK_S
from sim_backend.machine import Truth
from sim_backend.machines.amb1dof.params import ControlParams
from sim_backend.machines.amb1dof.plant import Plant
from sim_backend.motion import BandAsked

Complex = npt.NDArray[np.complex128]
WARM = 4  # periods of the resets


class Watched:
    """One that watches: `control` is the firmware's, `drawn` the rig's truth."""

    def __init__(self, drawn: Truth, control: ControlParams) -> None:
        self._plant = Plant(drawn.plant, control=control)
        self._spacing = round(control.window_s / TICK_S)

    def responses(self, hz: float) -> Complex:
        """Output over the derivative (P,) of a sine, at P samples in a row."""
        w, count = 2 * np.pi * hz, (WARM + 1) * self._spacing
        t = np.arange(count) * TICK_S
        out = self._plant.watch(np.cos(w * t)) + 1j * self._plant.watch(np.sin(w * t))
        return np.asarray((out / (1j * w * np.exp(1j * w * t)))[-self._spacing :])

    def error(self, hz: float) -> float:
        """RMS error over the derivative's rms."""
        return float(np.sqrt((np.abs(self.responses(hz) - 1) ** 2).mean()))

    @property
    def false_derivative(self) -> float:
        """Mean output of a constant, 1/s."""
        return float(self._plant.watch(np.ones((WARM + 1) * self._spacing))[-self._spacing :].mean())

    @property
    def noise_gain(self) -> float:
        """RMS output of white noise of rms 1: single samples, each at another place of the period."""
        apart = WARM * self._spacing + 1
        y = np.zeros((self._spacing + 1) * apart)
        y[apart - 1 :: apart][: self._spacing] = 1.0
        return float(np.sqrt((self._plant.watch(y) ** 2).sum() / self._spacing))


def band(rig: RigFile, drawn: Truth, asked: BandAsked) -> Mapping[tuple[str, float | None], float]:
    """Of every line its gain, phase, error and sidebands, and what holds for the whole, by name and line."""
    used = in_force(rig, drawn.machine, asked.settings)
    known = {f.name for f in fields(ControlParams)} & set(used)
    control = ControlParams(**{name: used[name] * drawn.defects.get(f"factor_{name}", 1.0) for name in known})
    watched, out = Watched(drawn, control), dict[tuple[str, float | None], float]()
    for hz in asked.lines:
        each = watched.responses(hz)
        mean = complex(each.mean())
        out |= {("gain", hz): abs(mean), ("phase", hz): float(np.angle(mean)), ("error", hz): watched.error(hz)}
        out["sideband", hz] = float(np.sqrt((np.abs(each - mean) ** 2).mean()))
    fine = np.geomspace(min(asked.lines), max(asked.lines), 200)
    inside = np.flatnonzero(np.array([watched.error(hz) for hz in fine]) < asked.limit)
    for name, k in (("edge_low", inside[0] - 1), ("edge_high", inside[-1])) if len(inside) else ():
        if 0 <= k < len(fine) - 1:
            out[name, None] = float(brentq(lambda f: watched.error(f) - asked.limit, fine[k], fine[k + 1]))
    out["error_at", None] = watched.error(asked.at)
    out["false_derivative", None], out["noise_gain", None] = watched.false_derivative, watched.noise_gain
    return out
