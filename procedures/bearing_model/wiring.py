"""Is each reading, and each coil, the one it is said to be? From the answers to set points, and from the fits."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.amb_rotor import magnetics
from procedures.amb_rotor.conventions import conventions
from procedures.amb_rotor.keys import gap_key
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.magnetics import Positions, Statics
from procedures.amb_rotor.places import Held
from procedures.bearing_model.estimates import find_unloaded
from procedures.bearing_model.inputs import fit_inputs
from procedures.bearing_model.plan import Plan

Array = npt.NDArray[np.float64]
FOLLOWS = 0.6  # a reading may answer a set point by this much less or more (the integrators are slow)
SUSPECT = 0.05  # of the load: certificates within their tolerances leave a third of it before they are adjusted
ALIKE = 0.9  # cosine between two probes that look the same way
CENTRED = (
    0.3  # of the bias over the gap, that the control current of an axis without a load falls with the displacement
)
BETTER = 4.0  # times smaller must a sum of squares be with other wiring, to suspect the wiring


def model_answers(rig: RigFile) -> Array:
    """What each reading (rows) does per set point y, z (m) and psi, theta (rad): T (2.17)."""
    return conventions(rig).stations.reads


def fit_answers(held: Held, tilted: Held) -> Array:
    """The same as found: each reading's answer to the four set points, by least squares."""
    n, m = len(held), len(tilted)
    design = np.zeros((n + m, 5))
    design[:n, 0], design[:n, 1] = held.labels["y_m"], held.labels["z_m"]
    design[n:, 2], design[n:, 3] = tilted.labels["psi_rad"], tilted.labels["theta_rad"]
    design[:, 4] = 1
    read = np.array([np.concatenate([held.mean[c], tilted.mean[c]]) for c in held.machine.stations.channels])
    out: Array = np.linalg.lstsq(design, read.T, rcond=None)[0][:4].T
    return out


def of_wiring(held: Held, tilted: Held, rig: RigFile) -> Iterator[Finding]:
    """Each reading follows its own set points: not another axis', not the other plane's, not backwards."""
    want, have = model_answers(rig), fit_answers(held, tilted)
    scale = np.array([1, 1, *[0.5 * np.abs(want[:, 2:]).max()] * 2])

    def off(row: Array, model: Array) -> float:
        return float(np.abs((row - model) / scale).max())

    for k in range(len(want)):
        if off(have[k], want[k]) <= FOLLOWS:
            continue
        least, j, sign = min((off(have[k], s * want[j]), j, s) for j in range(len(want)) for s in (1, -1))
        yield _answers(held.machine, k, have[k]) if least > FOLLOWS else _answers_as(held.machine, k, j, sign)


def _answers(machine: AmbRotor, k: int, row: Array) -> Finding:
    """A reading that answers as none of this rig should."""
    name = machine.stations.channels[k]
    text = (
        f"{name} follows y by {row[0]:+.2f}, z by {row[1]:+.2f}, psi by {row[2] * 1e3:+.0f} µm/mrad and "
        f"theta by {row[3] * 1e3:+.0f} µm/mrad; no reading of this rig should. A sensor clips, sticks or is "
        "miscalibrated, or the controller does not hold."
    )
    return Finding("set-point-not-followed", text, name, Effect.ERROR)


def _answers_as(machine: AmbRotor, k: int, j: int, sign: int) -> Finding:
    """Reading k that answers as reading j should, or its reverse."""
    name, other = (machine.stations.channels[i] for i in (k, j))
    if j == k:
        text = f"{name} answers its set points backwards: the probe's polarity is wrong."
        return Finding("sensor-polarity", text, name, Effect.ERROR)
    one, two = (machine.stations.probes[i].angle.value for i in (name, other))
    what = "planes" if abs(math.cos(one - two)) > ALIKE else "axes"
    text = (
        f"{name} answers as {other} should{' and backwards' if sign < 0 else ''}: "
        f"{what} are exchanged in the wiring or in the map."
    )
    return Finding(f"{what}-exchanged", text, name, Effect.ERROR)


@dataclass(frozen=True)
class Wiring:
    """Another wiring of an axis: finding's code, words, whose coils, sign of the coils and of gravity."""

    code: str
    words: str
    coils_of: int
    coils: int = 1
    gravity: int = 1


def wirings(machine: AmbRotor, k: int) -> list[Wiring]:
    """What else axis k could be."""
    axis = machine.axes[k]
    swapped = f"as if the coils {' and '.join(machine.pair(axis))} were exchanged"
    turned = (
        "as if gravity pulled the other way along this axis: it is turned by 180°, or both the coils "
        "and the probe of this axis are the other way round"
    )
    by_other = "by the currents of axis {other}: the coils of {axis} and {other} are exchanged"
    return [
        Wiring("coils-exchanged", swapped, k, coils=-1),
        Wiring("gravity-reversed", turned, k, gravity=-1),
        *(
            Wiring("coils-exchanged", by_other.format(axis=axis, other=other), j)
            for j, other in enumerate(machine.axes)
            if j != k
        ),
    ]


@dataclass(frozen=True)
class Judged:
    """How one wiring of one axis fits: sum of squared residuals (N^2), beta, offset (m), whether that is a magnet within
    its gap, and the residuals (N)."""

    chi2: float
    beta: float
    offset: float
    sane: bool
    residuals: Array

    @property
    def worst(self) -> float:
        """Greatest residual, N."""
        return float(np.abs(self.residuals).max())


def _judge(s: Statics, k: int, gap: float, coils_of: int, coils: int) -> Judged:
    """Axis k with the coils of axis `coils_of`, p and n exchanged where `coils` is below zero."""
    j = coils_of
    p, n = (s.p[j], s.n[j]) if coils > 0 else (s.n[j], s.p[j])
    try:
        fit = magnetics.nonlinear(s.r[k], p, n, s.force[k], gap)
    except AnalysisError:
        return Judged(float("inf"), 0.0, 0.0, False, np.full_like(s.force[k], np.inf))
    beta, offset = (float(x) for x in fit.terms)
    inside = abs(offset) + float(np.abs(s.r[k]).max()) < gap
    return Judged(fit.chi2, beta, offset, beta > 0 and inside, fit.residuals)


def of_models(held: Held, tilted: Held, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Does the model describe each axis as it is wired, and would another wiring do so better? At the drawing's gap.

    The tilts count: without them both planes of an axis move alike, and their coils could be exchanged unseen."""
    one, two = held.means(), tilted.means()
    read, p, n = (np.concatenate(x, axis=1) for x in ((one.read, two.read), (one.p, two.p), (one.n, two.n)))
    means = Positions(read, p, n, held.machine)
    values = {name: e.value for name, e in fit_inputs(rig, plan.coupled).items()}
    by_gravity = {g: magnetics.statics(means, values | {"gravity": g * values["gravity"]}) for g in (1, -1)}
    unloaded = find_unloaded(held, values)
    for k, axis in enumerate(held.machine.axes):
        gap = values[gap_key(held.machine, axis)]
        if k in unloaded:
            yield from _without_load(by_gravity[1], k, gap, axis)
            continue
        load = float(np.abs(by_gravity[1].force[k]).mean())
        found = _judge(by_gravity[1], k, gap, k, 1)
        if not found.sane or found.worst > SUSPECT * load:
            yield from _explain(held.machine, k, found, by_gravity, gap, load)


def _without_load(s: Statics, k: int, gap: float, axis: str) -> Iterator[Finding]:
    """Without a load both coils pull alike, (i_b + i)/(i_b - i) = (gap - xi)/(gap + xi): the control current falls by the bias
    over the gap for each metre, and rises where the coils are exchanged."""
    bias, control = (s.p[k] + s.n[k]) / 2, (s.p[k] - s.n[k]) / 2
    slope = float(np.polyfit(s.r[k], control, 1)[0])
    if slope > -CENTRED * float(bias.mean()) / gap:
        text = (
            f"axis {axis}, which carries no weight, takes {slope * 1e-3:+.2f} mA of control current for each micrometre; "
            f"{-float(bias.mean()) / gap * 1e-3:+.2f} mA are expected: its coils, or their current sensors, are exchanged."
        )
        yield Finding("coils-exchanged", text, axis, Effect.ERROR)


def _explain(
    machine: AmbRotor, k: int, found: Judged, by_gravity: dict[int, Statics], gap: float, load: float
) -> Iterator[Finding]:
    """What is wrong with axis k, which fits as `found`: another wiring, or no magnet at all; else the adjustment shows it."""
    axis = machine.axes[k]
    least, best = found.chi2 / BETTER if found.sane else float("inf"), None
    for w in wirings(machine, k):
        other = _judge(by_gravity[w.gravity], k, gap, w.coils_of, w.coils)
        if other.sane and other.worst <= 2 * SUSPECT * load and other.chi2 < least:
            least, best = other.chi2, w
    if best:
        text = (
            f"axis {axis} carries {best.words}. As wired, the fit gives beta {found.beta:.3g} N m²/A² with residuals "
            f"up to {found.worst * 1e3:.0f} mN of {load:.2f} N."
        )
        yield Finding(best.code, text, axis, Effect.ERROR)
    elif not found.sane:
        text = (
            f"axis {axis}: beta {found.beta:.3g} N m²/A², offset {found.offset * 1e6:+.0f} µm is no magnet, "
            "and no other wiring of its coils explains it."
        )
        yield Finding("model-fails", text, axis, Effect.ERROR)
