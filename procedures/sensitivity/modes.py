"""Bending modes that the plan does not name: where a scan shows one, and lines about it.

A mode adds r/((f_0 - f) + i zeta f_0) to an open loop near its frequency f_0: a circle in the complex plane, nearly all of it
within a few half-power widths 2 zeta f_0, and often the place where the gain can rise least. Lines that stand farther apart
than that see only the tails, r/(f_0 - f), which do not depend on the damping. All tails of one mode together are looked for
here, by a matched filter; what is there is then resolved by lines of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bench.analysis.responses import Response
from procedures.sensitivity.estimates import FINEST, binary
from procedures.sensitivity.injection import Comb, combs
from procedures.sensitivity.plan import Plan
from procedures.sensitivity.steps import shared_noise

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
REACH, DEGREE = 10, 3  # lines to either side of a place, and of the polynomial through what is no mode
PLACES = 4  # that are looked at from one line to the next
CHANCE = 1e-3  # that noise alone asks for lines where no mode is, in an axis: they cost some seconds and change nothing
MOST = 4  # modes of an axis
ABOUT = 4  # steps of the scan to either side of a mode
BESIDE = 2  # steps of the scan that the plan's lines about a mode must reach beyond it: a circle has two sides


def unnamed(scans: Sequence[Response], plan: Plan) -> list[Comb]:
    """Lines about each bending mode that the scans show and the plan does not name, the strongest first."""
    if not scans:
        return []
    hz, z, power = (
        np.concatenate(parts) for parts in zip(*((r.hz, r.values, shared_noise(r)) for r in scans), strict=True)
    )
    left, out, seen = z.copy(), list[Comb](), np.zeros(0)
    step = plan.scan_step_hz
    for _ in range(MOST + len(plan.modes_hz)):
        found = _strongest(hz, left, power, plan, seen)
        if found is None:
            break
        at, shape = found
        seen = np.append(seen, at)
        left = left - shape
        if all(abs(at - mode) > plan.mode_within_hz - BESIDE * step for mode in plan.modes_hz):
            fine = max(binary(plan.mode_damping * at), FINEST)
            low = fine * math.floor((at - ABOUT * step) / fine)
            out += combs(low, fine, min(at + ABOUT * step, plan.high_hz), plan.amplitude_A)
    return out[:MOST]


def _strongest(hz: Array, z: Complex, power: Array, plan: Plan, seen: Array) -> tuple[float, Complex] | None:
    """Where a mode stands out most, Hz, and what it gives (m,); None where noise alone may give as much. Not about places
    `seen` already: what is left there is of a mode that is damped otherwise."""
    best, found = -math.log(CHANCE / (PLACES * hz.size)), None
    for k in range(REACH, hz.size - REACH):
        near = slice(k - REACH, k + REACH + 1)
        x, root = (hz[near] - hz[k]) / plan.scan_step_hz, 1 / np.sqrt(power[near])
        smooth, _ = np.linalg.qr(np.vander(x, DEGREE + 1) * root[:, None])
        for place in hz[k] + (hz[k + 1] - hz[k]) * np.arange(PLACES) / PLACES:
            if seen.size and np.abs(seen - place).min() < ABOUT * plan.scan_step_hz:
                continue
            shape = 1 / (place - hz + 1j * plan.mode_damping * place)
            own = shape[near] * root
            own = own - smooth @ (smooth.T @ own)
            size = float(np.vdot(own, own).real)
            strength = complex(np.vdot(own, z[near] * root)) / size
            if abs(strength) ** 2 * size > best:
                best, found = abs(strength) ** 2 * size, (float(place), strength * shape)
    return found
