"""The TSBS machine as six phases in two segments (T chapter 7): the same shaft and magnets, another drive and another frame.

Segments 1, 2 and 3, 4 share an amplifier each, whose current is a vector: q along the field, d across it. In place of the four
amplitudes its controller tells q1, d1, q2, d2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from sim_backend.machines.tsbs import machine, quantities
from sim_backend.machines.tsbs.machine import TSBS
from sim_backend.machines.tsbs.params import PlantParams
from sim_backend.machines.tsbs.plant import CHANNELS, TRACE

PAIRS = ("i_q1", "i_d1", "i_q2", "i_d2")
CALLED = dict(zip(machine.SEGMENTS, PAIRS, strict=True))
TOLD = tuple(CALLED.get(name, name) for name in CHANNELS)
TRACED = tuple(f"unused_{name[-1]}" if name.startswith("i_d") else CALLED.get(name, name) for name in TRACE)
LITERAL = ("literal_7_6b", "literal_7_13", "literal_7_14", "literal_7_18")
"""Equations of chapter 7 in the controller as they are printed, 1; of (7.14) the minus of force alone, 2."""
DEFECTS = {**TSBS.defects, **dict.fromkeys(LITERAL, 0.0)}


def stated(rig: RigFile) -> dict[str, Toleranced]:
    """As that of twelve phases."""
    return machine.stated(rig, PAIRS)


def params(v: Mapping[str, float], d: Mapping[str, float]) -> PlantParams:
    """The plant, and what is planted in its controller."""
    plant = machine.params(v, d, PAIRS)
    planted: dict[str, Any] = {name: d[name] for name in LITERAL}
    return replace(plant, phases=6.0, **planted)


def constants(p: PlantParams, settings: Mapping[str, float]) -> dict[str, float]:
    """Those of the machine, and the forces per ampere of i_y along and of i_x across its own frame, with the segments' gains
    (T chapter 7: alpha_t = sqrt 2 alpha_d, alpha_n = sqrt 2 alpha_c)."""
    gain = sum(p.segment_gain) / 4
    turned = math.cos(p.pole_pairs * p.gamma_zero)
    own = {"alpha_t": math.sqrt(2) * p.alpha_d * gain * turned, "alpha_n": math.sqrt(2) * p.alpha_c * gain * turned}
    return quantities.quantities(p, (settings["bias_i"], settings["bias_o"])) | own


TSBS6 = replace(
    TSBS, name="tsbs6", stated=stated, defects=DEFECTS, params=params, quantities=constants, channels=TOLD,
    places=partial(machine.places, channels=TOLD), spoil=partial(machine.spoil, first=PAIRS[0]), traced=lambda _: TRACED,
    motions=replace(TSBS.motions, speeds=None),
)  # fmt: skip
