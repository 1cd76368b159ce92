"""What truly crosses over from an axis that moves to one that is held, on a drawn machine: the same machine and controller,
moved by the same sine, looked at beside its encoders, every 50 us.

The cross force is what the held axis gets beyond kappa times what was asked for it, kappa being the true force of one that is
asked for, in the mean over the places of the motion: of a difference of two demands, both ways, at rest, by the true map.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from bench.rigfile import RigFile
from sim_backend.core.plant import Array
from sim_backend.machine import Truth
from sim_backend.machines.rlsrm.device import control_of
from sim_backend.machines.rlsrm.params import ControlParams, PlantParams
from sim_backend.machines.rlsrm.plant import AXES, LOOP_TICKS, TRACE, Plant, distribute, slopes
from sim_backend.stage_motion import DecouplingAsked

FORCES: Final = ("force", "torque")
TRIED: Final = (0.1, 0.01)  # N, N m: demands on the held axis that kappa is the slope between
PLACES: Final = 60  # over a period
HALF: Final = math.sqrt(2 * math.log(2))  # a Gauss function is a half there, standard deviations
BEAT_S: Final = 0.02
AT: Final = {name: k for k, name in enumerate(TRACE)}


def decoupling(rig: RigFile, drawn: Truth, asked: DecouplingAsked) -> Mapping[str, float]:
    """`crossed`, of what was drawn and of the controller with what it has of the asked settings."""
    del rig
    had = {name: value * drawn.defects.get(f"factor_{name}", 1.0) for name, value in asked.settings.items()}
    return crossed(drawn.plant.plant, control_of(had), asked)


def crossed(p: PlantParams, c: ControlParams, asked: DecouplingAsked) -> Mapping[str, float]:
    """Of one axis moved and the other one held: `excursion`, `swing`, effective value `cross`, `peak`, `slope`."""
    moved, held = AXES.index(asked.moved), AXES.index(asked.held)
    n = round(asked.period_s / (LOOP_TICKS * 50e-6))
    seen, swung, force, wanted, others, sent = (np.empty((asked.periods, n)) for _ in range(6))
    for k, rows in enumerate(_periods(p, c, asked, moved)):
        ticks = rows[::LOOP_TICKS][:n]
        both = [_seen(p, ticks, axis) for axis in (held, moved)]
        seen[k], swung[k] = both[0] - ticks[:, AT[f"ref_{asked.held}"]], both[1]
        sent[k] = ticks[:, AT[f"ref_{asked.moved}"]]
        force[k] = rows[: n * LOOP_TICKS, AT[FORCES[held]]].reshape(n, -1).mean(axis=1)
        wanted[k], others[k] = (ticks[:, AT[f"asked_{FORCES[axis]}"]] for axis in (held, moved))
    if not np.ptp(swung):  # a machine that cannot move
        return {}
    kappa = scale(p, c, asked)
    on = _sliding(sent[0], asked.sliding)
    cross, other = (_centred(x, asked, on) for x in (force - kappa * wanted, others))
    return {
        "excursion": float(np.abs(seen).max()), "swing": float(np.ptp(swung)) / 2,
        "cross": math.sqrt(float((cross**2).mean())), "peak": float(np.abs(cross).max()),
        "slope": float(cross @ other / (other @ other)) if other.any() else 0.0,
    }  # fmt: skip


def _periods(p: PlantParams, c: ControlParams, asked: DecouplingAsked, moved: int) -> Iterator[Array]:
    """Rows of every tick of each period, the first one left out."""
    kind, size, period = [0.0, 0.0], [0.0, 0.0], [1.0, 1.0]
    kind[moved], size[moved], period[moved] = 1.0, asked.amplitude, asked.period_s
    waves = {
        "wave": tuple(kind),
        "amplitude": tuple(size),
        "period": tuple(period),
        "phase": (0.0, 0.0),
        "offset": (0.0, 0.0),
    }
    plant = Plant(p, replace(c, **waves, speed=(0.0, 0.0)))  # type: ignore[arg-type]  # a sine is given, not sent
    plant.switch(on=True, x=True, angle=True)
    plant.run(asked.period_s, 0)
    for _ in range(asked.periods):
        yield plant.run(asked.period_s, 1)


def _seen(p: PlantParams, rows: Array, axis: int) -> Array:
    """Place as an encoder without rounding would have it, with its edges where they are."""
    x: Array = rows[:, AT[f"true_{AXES[axis]}"]]
    own = x * (1 + p.scale) if axis == 0 else x + p.once * np.sin(x - p.once_phase)
    out: Array = own + (p.edge[axis] - (0.5 if p.truncate[axis] else 0.0)) * p.pitch[axis]
    return out


def _sliding(sent: Array, share: float) -> Array:
    """Where a set point (n,), which may come late to its wave, goes faster than a share of its greatest speed."""
    f = np.fft.rfft(sent)[1]
    phase = math.atan2(f.imag, f.real)  # of a cosine
    turns = 2 * math.pi * np.arange(len(sent)) / len(sent)
    return np.asarray(np.abs(np.sin(turns + phase)) >= share)


def _centred(x: Array, asked: DecouplingAsked, on: Array) -> Array:
    """Mean over the periods, smoothed, where the moved axis slides, without its mean there."""
    whole = x.reshape(-1)
    f = np.arange(whole.size // 2 + 1) / (asked.period_s * len(x))
    smooth = np.fft.irfft(np.fft.rfft(whole) * np.exp(-0.5 * (HALF * f / asked.smooth_hz) ** 2), whole.size)
    some = smooth.reshape(x.shape).mean(axis=0)[on]
    out: Array = some - some.mean()
    return out


def scale(p: PlantParams, c: ControlParams, asked: DecouplingAsked) -> float:
    """True force of one that is asked for along the held axis, in the mean over where the moved one slides."""
    moved, held = AXES.index(asked.moved), AXES.index(asked.held)
    rub = p.coulomb if moved == 0 else p.coulomb * p.bearing_radius
    found = []
    for turn in np.arange(PLACES) / PLACES * 2 * math.pi:
        if abs(math.cos(turn)) < asked.sliding:
            continue
        at, against = [0.0, 0.0], [0.0, 0.0]
        at[moved], against[moved] = asked.amplitude * math.sin(turn), math.copysign(rub, math.cos(turn))
        both = []
        for way in (1, -1):
            against[held] = way * TRIED[held]
            both.append(given(p, c, (at[0], at[1]), (against[0], against[1]))[held])
        found.append((both[0] - both[1]) / (2 * TRIED[held]))
    return float(np.mean(found))


def given(p: PlantParams, c: ControlParams, at: tuple[float, float], asked: tuple[float, float]) -> tuple[float, float]:
    """True force and torque of a demand at rest."""
    wanted, *_ = distribute(c, *at, *asked)
    off = np.array(p.current_offset) - np.array(c.current_zero)
    told = np.where(wanted > 0, np.maximum(wanted - off, 0.0) / np.array(p.current_gain), 0.0)
    true = np.zeros(6)
    true[[int(k) for k in p.wired]] = told
    q = p.map.saturation**2 * (np.sqrt(1 + (true / p.map.saturation) ** 2) - 1)
    _, along, around = slopes(p.map, *at)
    return float(along @ q), float(around @ q)
