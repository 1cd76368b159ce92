"""What each estimator truly does in the loop: the drawn machine itself, over many moments, with its true velocity at hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from sim_backend.controller.controls import in_force
from sim_backend.core.plant import LEVITATE, TICK_S
from sim_backend.machine import Numbers, Truth
from sim_backend.machines.amb1dof.params import ControlParams
from sim_backend.machines.amb1dof.plant import TRACE, Plant
from sim_backend.motion import CompareAsked

Array = npt.NDArray[np.float64]
SPREAD_S = 0.6  # over which the moments lie at which a switch or a load comes: whole times of both filters' pattern
SWITCHES, LOADS = 96, 144  # how many moments: what is left of their noise is a quarter of that of ten repeats
SWITCHED, LOADED = ("velocity_error", "disturbance_error", "y_50_100"), ("peak", "integral", "quiet", "velocity_noise")
MOTIONS = ("y_50_100", *LOADED)  # of the shaft: what is read, over the sensor's gain
AT = {name: k for k, name in enumerate(TRACE)}


def compare(rig: RigFile, drawn: Truth, asked: CompareAsked) -> Mapping[tuple[str, str], float]:
    """Geometric means over the moments by quantity and estimator, and their ratios (`a / b`)."""
    logs = dict[tuple[str, str], float]()
    for names, of, one in ((SWITCHED, asked.engaged, _switched), (LOADED, asked.loaded, _loaded)):
        for estimator, changed in of.items():
            used = in_force(rig, drawn.machine, {**asked.settings, **changed})
            found = np.array([one(drawn, asked, used, k) for k in range(SWITCHES if one is _switched else LOADS)])
            for name, values in zip(names, found.T, strict=True):
                logs[name, estimator] = float(np.log(values).mean())
    gain = math.log(drawn.plant.position_gain)
    logs = {(name, estimator): log - gain * (name in MOTIONS) for (name, estimator), log in logs.items()}
    switched, loaded = [*asked.engaged], [*asked.loaded]
    pairs = [(n, e, switched[-1]) for n in SWITCHED for e in switched[:-1]]
    pairs += [(n, e, loaded[0]) for n in LOADED for e in loaded[1:]]
    logs |= {(f"{n}_ratio", f"{a} / {b}"): logs[n, a] - logs[n, b] for n, a, b in pairs}
    return {key: math.exp(log) for key, log in logs.items()}


def _plant(drawn: Truth, used: Numbers, k: int, compensate: float) -> Plant:
    known = {f.name for f in fields(ControlParams)} & set(used)
    control = {name: used[name] * drawn.defects.get(f"factor_{name}", 1.0) for name in known}
    plant = Plant(drawn.plant, 1000 + k, control=ControlParams(**{**control, "compensate": compensate}))
    plant.put(0.0)
    plant.mode = LEVITATE
    return plant


def _moment(k: int) -> int:
    """Ticks: evenly spread, however many there are."""
    return round(SPREAD_S / TICK_S * ((k * 0.6180339887498949) % 1.0))


def _switched(drawn: Truth, asked: CompareAsked, used: Numbers, k: int) -> tuple[float, ...]:
    plant = _plant(drawn, used, k, 0.0)
    plant.run(round(1.5 / TICK_S) + _moment(k))
    lead = plant.run(round(asked.lead_s / TICK_S), 1)[1]
    plant.set("compensate", 1.0)
    y = plant.run(round(0.1 / TICK_S), 1)[1][:, AT["position"]]
    v = lead[:, AT["true_velocity"]] * drawn.plant.position_gain
    w, t = drawn.plant.harmonic_rate, np.arange(len(lead)) * TICK_S
    told = lead[:, AT["load"]] + lead[:, AT["harmonic"]]
    design = np.column_stack([np.ones(len(t)), np.cos(w * t), np.sin(w * t)])
    left = told - design @ np.linalg.lstsq(design, told, rcond=None)[0]
    return _rms(lead[:, AT["velocity"]] - v) / _rms(v), _rms(left), _rms(y[round(0.05 / TICK_S) :])


def _loaded(drawn: Truth, asked: CompareAsked, used: Numbers, k: int) -> tuple[float, ...]:
    plant = _plant(drawn, used, k, 1.0)
    plant.run(round(asked.calm_s / TICK_S) + _moment(k))
    lead = plant.run(round(asked.lead_s / TICK_S), 1)[1]
    plant.load((1 - drawn.defects["load_lost"]) * drawn.values[f"masses.{asked.load}"] * drawn.values["site.gravity"],
               drawn.values["load_rise_s"])  # fmt: skip
    y = plant.run(round(1.0 / TICK_S), 1)[1][:, AT["position"]]
    off = np.abs(y - lead[:, AT["position"]].mean())
    v = lead[:, AT["velocity"]]
    power = np.abs(np.fft.rfft(v - v.mean())) ** 2
    fast = float(np.sqrt(2 * power[np.fft.rfftfreq(len(v), TICK_S) >= 100.0].sum())) / len(v)
    return float(off.max()), float(off.sum() * TICK_S), float(lead[:, AT["position"]].std()), fast


def _rms(x: Array) -> float:
    return float(np.sqrt((x**2).mean()))
