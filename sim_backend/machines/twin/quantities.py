"""The true quantities of a rig's twin, by the measurands' definitions and not by what estimates them. A quantity of a place is
called `kind@where`, by the rig's name of the axis or plane."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping

import numpy as np

from bench.rigfile import RigFile
from sim_backend.machines.twin import linear
from sim_backend.machines.twin.calibrated import calibrated
from sim_backend.machines.twin.control import bias_of
from sim_backend.machines.twin.layout import layout_of
from sim_backend.machines.twin.nominal import nominal_of
from sim_backend.machines.twin.params import TwinParams
from sim_backend.machines.twin.rules import short


def quantities(rig: RigFile, p: TwinParams, settings: Mapping[str, float]) -> dict[str, float]:
    """By axis `beta` (N m^2/A^2), `K_i` (N/A) and `K_x` (N/m), the slopes of the force at the magnetic centre where both
    coils carry the bias that the controller's `settings` say, and `offset` (m, from the magnetic centre to where the probes
    read zero), and `K`, `K2`, `Kw` of each radial axis as hung masses show them (`calibrated`); by balancing plane
    `unbalance` (kg m) and `unbalance_phase` (rad from the shaft's mark, in the sense in
    which it turns); `eccentricity` (m)."""
    out: dict[str, float] = {}
    layout, zero = layout_of(rig), offsets(p)
    for k, axis in enumerate(layout.axes):
        beta, gap = (p.beta[k], p.gap[k]) if axis is not layout.axial else (p.beta_x, p.gap_x)
        bias = p.control.bias[k] if len(axis.coils) == 1 else _bias(rig, axis.bearing, settings)
        coils = len(axis.coils)
        out |= {f"beta@{axis.name}": beta, f"K_i@{axis.name}": 2 * coils * beta * bias / gap**2,
                f"K_x@{axis.name}": 2 * coils * beta * bias**2 / gap**3, f"offset@{axis.name}": zero[k]}  # fmt: skip
    whole = 0j
    for k, part in enumerate(layout.planes):
        whole += cmath.rect(p.unbalance[k], p.unbalance_phase[k])
        out |= {f"unbalance@{short(part)}": p.unbalance[k],
                f"unbalance_phase@{short(part)}": math.remainder(p.unbalance_phase[k], 2 * math.pi)}  # fmt: skip
    hz, damping = linear.slowest(p, loop_of(rig, p, settings, zero))
    out |= _calibrated(rig, p, settings)
    return out | {"eccentricity": abs(whole) / p.mass, "frequency": hz, "damping": damping}


def _calibrated(rig: RigFile, p: TwinParams, settings: Mapping[str, float]) -> dict[str, float]:
    """Of each radial axis with two coils, as masses show them: see `calibrated`."""
    radial = layout_of(rig).radial
    bias = np.array([_bias(rig, axis.bearing, settings) if len(axis.coils) == 2 else math.nan for axis in radial])
    found = calibrated(p, bias)
    return {f"{name}@{axis.name}": float(values[k]) for name, values in zip(("K", "K2", "Kw"), found, strict=True)
            for k, axis in enumerate(radial) if len(axis.coils) == 2}  # fmt: skip


def loop_of(rig: RigFile, p: TwinParams, settings: Mapping[str, float], zero: tuple[float, ...]) -> linear.Loop:
    """The radial axes as the controller's settings have them."""
    radial, bound = layout_of(rig).radial, rig.capabilities.gains
    gains = {}
    for key in ("kp", "ki", "kd"):
        named, own = getattr(bound, key), getattr(p.control, key)
        names = [named if isinstance(named, str) else named.get(a.name, "") for a in radial]
        gains[key] = np.array([settings.get(name, own[k]) for k, name in enumerate(names)])
    bias = np.array(
        [p.control.bias[k] if len(a.coils) == 1 else _bias(rig, a.bearing, settings) for k, a in enumerate(radial)]
    )
    return linear.loop(p, bias, gains, np.array(zero[: len(radial)]))


def _bias(rig: RigFile, bearing: str, settings: Mapping[str, float]) -> float:
    """A: what the parameter says that the capabilities bind, else what the controller begins with."""
    parameter = rig.capabilities.bias.get(bearing, "")
    return settings[parameter] if parameter in settings else bias_of(nominal_of(rig), bearing)


def offsets(p: TwinParams) -> tuple[float, ...]:
    """Displacement from each axis' magnetic centre while every probe reads zero, m."""
    zero = -np.array(p.position_offset) / np.array(p.position_gain)
    looking = np.array(p.probe).reshape(8, 16)[:4].T
    seen = np.abs(looking).sum(axis=1) > 0
    at = np.linalg.pinv(looking[seen], rcond=1e-9) @ zero[seen]
    radial = np.array(p.axis).reshape(8, 16)[:4].T[: p.radial] @ at + np.array(p.offset)[: p.radial]
    along = np.array(p.probe_x) != 0
    axial = [p.sense_x * float((zero[along] / np.array(p.probe_x)[along]).mean()) + p.offset_x] if p.axial else []
    return (*(float(x) for x in radial), *axial)
