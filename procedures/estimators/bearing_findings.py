"""What can be wrong with eccentric positions: signals, wiring, and models that do not describe the machine."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, coverage_factor, welch_satterthwaite
from procedures.estimators import bearing
from procedures.estimators.bearing import AXES, Positions, Statics
from procedures.estimators.bearing_data import CURRENTS, POSITIONS, Held
from procedures.estimators.bearing_estimates import Analysis, fit_inputs

Array = npt.NDArray[np.float64]
FATAL = ("stuck-channel", "clipped", "contact", "sensor-polarity", "planes-exchanged", "axes-exchanged", "set-point-not-followed",
         "coils-exchanged", "gravity-reversed", "model-fails")  # fmt: skip
"""Findings after which the numbers mean nothing: none is given."""
FLAGS = (
    (1, "saturated", "a coil was at its current limit"),
    (2, "saturated", "a coil was at its voltage limit"),
    (4, "contact", "the shaft touched the inboard touchdown ring"),
    (8, "contact", "the shaft touched the outboard touchdown ring"),
    (32, "contact", "the shaft touched the axial stop"),
    (64, "clipped", "a position sensor was beyond its range"),
)  # bits of the telemetry signal `flags`
FOLLOWS = 0.6  # a reading may answer a set point by this much less or more (the integrators are slow)
BETTER = 4.0  # times smaller must a sum of squares be with other wiring, to suspect the wiring
ONE_IN_A_THOUSAND = 1.7  # times the 95 % expanded uncertainty


class Tolerances(Protocol):
    """The part of a plan that these checks need."""

    @property
    def average_s(self) -> float: ...
    @property
    def max_speed_m_s(self) -> float: ...
    @property
    def max_misfit(self) -> float: ...
    @property
    def min_ratio(self) -> float: ...
    @property
    def max_lost(self) -> float: ...
    @property
    def coupled(self) -> bool: ...


def of_signals(held: Held, tilted: Held, plan: Tolerances) -> Iterator[Finding]:
    """Lost samples, stuck channels, flags, and a shaft that moves within a step."""
    share = held.lost / np.maximum(held.expected, 1)
    if share.max() > plan.max_lost:
        text = f"{held.lost.sum() / held.expected.sum():.2%} of the samples inside steps are missing ({share.max():.2%} in the " \
               f"worst step; {plan.max_lost:.2%} is allowed). Look at the link: load, cable, gateway."  # fmt: skip
        yield Finding("missing-samples", text, held.where(share), Effect.INDETERMINATE)
    for channel in (*POSITIONS, *CURRENTS):
        still = held.spread[channel] == 0
        if still.any():
            text = (
                f"{channel} does not move at all in {int(still.sum())} of {still.size} steps; a live sensor has noise."
            )
            yield Finding("stuck-channel", text, channel, Effect.ERROR)
    for bit, code, text in FLAGS:
        for data in (held, tilted):
            hit = (data.flags & bit) != 0
            if hit.any():
                said = f"{text} in {int(hit.sum())} of {hit.size} positions"
                yield Finding(
                    code, said, data.where(hit.astype(float)), Effect.ERROR if code in FATAL else Effect.INDETERMINATE
                )
    speed = np.abs([held.drift[c] for c in POSITIONS]).max(axis=0) / (plan.average_s / 2)
    if speed.max() > plan.max_speed_m_s:
        text = f"the shaft moves at up to {speed.max() * 1e6:.2g} µm/s within a step, {plan.max_speed_m_s * 1e6:.2g} µm/s are " \
               "allowed: its weight is not what the magnets carry alone. Settle longer."  # fmt: skip
        yield Finding("unsettled", text, held.where(speed), Effect.INDETERMINATE)


def expected(rig: RigFile) -> Array:
    """What a reading of each axis (rows) does per set point y, z (m) and psi, theta (rad): T (2.17)."""
    l_is, l_os = (rig.geometry[f"com_to_{b}_sensor"].value for b in ("inboard", "outboard"))
    return np.array([[1, 0, 0, -l_is], [0, 1, l_is, 0], [1, 0, 0, l_os], [0, 1, -l_os, 0]])


def followed(held: Held, tilted: Held) -> Array:
    """The same as found: each reading's answer to the four set points, by least squares."""
    n, m = len(held), len(tilted)
    design = np.zeros((n + m, 5))
    design[:n, 0], design[:n, 1] = held.labels["y_m"], held.labels["z_m"]
    design[n:, 2], design[n:, 3] = tilted.labels["psi_rad"], tilted.labels["theta_rad"]
    design[:, 4] = 1
    read = np.array([np.concatenate([held.mean[c], tilted.mean[c]]) for c in POSITIONS])
    out: Array = np.linalg.lstsq(design, read.T, rcond=None)[0][:4].T
    return out


def of_wiring(held: Held, tilted: Held, rig: RigFile) -> Iterator[Finding]:
    """Each reading follows its own set points: not another axis', not the other plane's, not backwards."""
    want, have = expected(rig), followed(held, tilted)
    scale = np.array([1, 1, *[0.5 * np.abs(want[:, 2:]).max()] * 2])

    def off(row: Array, model: Array) -> float:
        return float(np.abs((row - model) / scale).max())

    for k, axis in enumerate(AXES):
        if off(have[k], want[k]) <= FOLLOWS:
            continue
        others = [(off(have[k], s * want[j]), j, s) for j in range(4) for s in (1, -1)]
        least, j, s = min(others)
        if least > FOLLOWS:
            text = f"pos_{axis} follows y by {have[k][0]:+.2f}, z by {have[k][1]:+.2f}, psi by {have[k][2] * 1e3:+.0f} µm/mrad and " \
                   f"theta by {have[k][3] * 1e3:+.0f} µm/mrad; no reading of this rig should. A sensor clips, sticks or is " \
                   "miscalibrated, or the controller does not hold."  # fmt: skip
            yield Finding("set-point-not-followed", text, f"pos_{axis}", Effect.ERROR)
        elif s < 0 and j == k:
            yield Finding("sensor-polarity", f"pos_{axis} answers its set points backwards: the probe's polarity is wrong.",
                          f"pos_{axis}", Effect.ERROR)  # fmt: skip
        else:
            code = "planes-exchanged" if AXES[j][0] == axis[0] else "axes-exchanged"
            text = f"pos_{axis} answers as pos_{AXES[j]} should{' and backwards' if s < 0 else ''}: " \
                   f"{'planes' if code == 'planes-exchanged' else 'axes'} are exchanged in the wiring or in the map."  # fmt: skip
            yield Finding(code, text, f"pos_{axis}", Effect.ERROR)


def wirings(k: int) -> Iterator[tuple[str, str, int, int, int]]:
    """Other wirings of axis k: code, words, whose coils, sign of the coils, sign of gravity."""
    axis = AXES[k]
    yield "coils-exchanged", f"as if the coils i_{axis}_p and i_{axis}_n were exchanged", k, -1, 1
    yield "gravity-reversed", ("as if gravity pulled the other way along this axis: it is turned by 180°, or both the coils "
                               "and the probe of this axis are the other way round"), k, 1, -1  # fmt: skip
    for j, other in enumerate(AXES):
        if j != k:
            yield (
                "coils-exchanged",
                f"by the currents of axis {other}: the coils of {axis} and {other} are exchanged",
                j,
                1,
                1,
            )


@dataclass(frozen=True)
class Judged:
    """How one wiring of one axis fits: sum of squared residuals (N^2), greatest one (N), beta, offset, and whether that is a
    magnet within its gap."""

    chi2: float
    worst: float
    beta: float
    offset: float
    sane: bool
    residuals: Array


def _judged(s: Statics, k: int, gap: float, j: int, coils: int) -> Judged:
    """Axis k with the coils of axis j, p and n exchanged where `coils` is below zero."""
    p, n = (s.p[j], s.n[j]) if coils > 0 else (s.n[j], s.p[j])
    try:
        fit = bearing.nonlinear(s.r[k], p, n, s.force[k], gap)
    except AnalysisError:
        return Judged(float("inf"), float("inf"), 0.0, 0.0, False, np.zeros_like(s.force[k]))
    beta, offset = (float(x) for x in fit.terms)
    inside = abs(offset) + float(np.abs(s.r[k]).max()) < gap
    return Judged(fit.chi2, float(np.abs(fit.residuals).max()), beta, offset, beta > 0 and inside, fit.residuals)


def of_models(held: Held, tilted: Held, rig: RigFile, plan: Tolerances) -> Iterator[Finding]:
    """Does the model describe each axis as it is wired, and would another wiring do so better? At the drawing's gap.

    The tilts count: without them both planes of an axis move alike, and their coils could be exchanged unseen."""
    one, two = held.means(), tilted.means()
    means = Positions(*(np.concatenate(x, axis=1) for x in ((one.read, two.read), (one.p, two.p), (one.n, two.n))))
    names = (*held.names, *tilted.names)
    values = {name: e.value for name, e in fit_inputs(rig, plan.coupled).items()}
    by_gravity = {g: bearing.statics(means, values | {"gravity": g * values["gravity"]}) for g in (1, -1)}
    for k, axis in enumerate(AXES):
        load = float(np.abs(by_gravity[1].force[k]).mean())
        found = _judged(by_gravity[1], k, values["gap"], k, 1)
        if found.sane and found.worst <= plan.max_misfit * load:
            continue
        best: tuple[float, str, str] = (found.chi2 / BETTER if found.sane else float("inf"), "", "")
        for code, words, j, coils, down in wirings(k):
            other = _judged(by_gravity[down], k, values["gap"], j, coils)
            if other.sane and other.worst <= 2 * plan.max_misfit * load:
                best = min(best, (other.chi2, code, words))
        if best[1]:
            yield Finding(best[1], f"axis {axis} carries {best[2]}. As wired, the fit gives beta {found.beta:.3g} N m²/A² with residuals "
                          f"up to {found.worst * 1e3:.0f} mN of {load:.2f} N.", axis, Effect.ERROR)  # fmt: skip
        elif not found.sane:
            yield Finding("model-fails", f"axis {axis}: beta {found.beta:.3g} N m²/A², offset {found.offset * 1e6:+.0f} µm is no magnet, "
                          "and no other wiring of its coils explains it.", axis, Effect.ERROR)  # fmt: skip
        else:
            at = names[int(np.argmax(np.abs(found.residuals)))]
            yield Finding("misfit", f"axis {axis}: one position is {found.worst / load:.1%} of its load off the nonlinear model "
                          f"({plan.max_misfit:.1%} allowed), at {at}. A position that was disturbed, or a reading that is not "
                          "proportional.", axis, Effect.INDETERMINATE)  # fmt: skip


def of_results(a: Analysis, plan: Tolerances) -> Iterator[Finding]:
    """The gap that the data ask for, the offset's sign, and the comparison with the linear model."""
    yield from _gaps(a, plan)
    for axis in AXES:
        e, ratio = a.estimates[f"offset_{axis}"], a.estimates[f"misfit_ratio_means_{axis}"].value
        if e.value + expanded(e) < 0:
            yield Finding("offset-against-load", f"axis {axis}: the shaft is {-e.value * 1e6:.0f} µm below the magnetic centre where the "
                          "sensors read zero; this stand's offsets are above it, towards the coils that carry. Either the stand was "
                          "changed, or a sign is wrong (T Table 2.2 prints one that goes with gravity above zero).",
                          axis, Effect.INDETERMINATE)  # fmt: skip
        if ratio < plan.min_ratio:
            yield Finding("linear-suffices", f"axis {axis}: the linear model leaves {ratio:.3g} times what the nonlinear one does over "
                          f"batch means, at least {plan.min_ratio:g} is expected: the offset does not show, or the "
                          "nonlinear model fits no better.", axis, Effect.INDETERMINATE)  # fmt: skip
    gap, bias = a.values["gap"], a.bias_A
    both = []
    for axis in AXES:
        k, stiffness = bearing.slopes(a.fits[axis].fit, gap, bias)
        f = a.fits[axis].linear.terms
        both.append(
            f"{axis}: {f[0]:.3g} N/A and {f[1] * 1e-3:.3g} N/mm, true slopes {k:.3g} and {stiffness * 1e-3:.3g}"
        )
    sample, batch = (1e3 * max(x[k] for x in a.noise_N.values()) for k in (0, 1))
    yield Finding("models-compared", f"the linear model without intercept (T 2.9) is no model of the slopes: {'; '.join(both)}. Residual "
                  f"sums are over {a.samples} samples with {sample:.2g} mN of noise ({batch:.2g} mN in a batch's mean).")  # fmt: skip


def expanded(e: Estimate) -> float:
    """k u for 95 %; for a judgement the shape of the distribution is not worth a Monte Carlo."""
    return coverage_factor(welch_satterthwaite(e)) * e.u


def _gaps(a: Analysis, plan: Tolerances) -> Iterator[Finding]:
    said = ", ".join(f"{axis} {g.value * 1e6:.1f} ± {expanded(g) * 1e6:.1f}" for axis, g in a.gaps.items())
    drawing, result = a.drawing, a.gap
    text = f"gaps that the positions ask for (µm, 95 %): {said}; the drawing has {drawing.value * 1e6:.1f} ± " \
           f"{expanded(drawing) * 1e6:.1f}; used: {result.value * 1e6:.1f} ± {expanded(result) * 1e6:.1f}"  # fmt: skip
    for axis, g in a.gaps.items():
        off = g - drawing
        if abs(off.value) > ONE_IN_A_THOUSAND * expanded(off):
            suspect = "the coupling's spring" + ("" if plan.coupled else " (is it off?)")
            yield Finding("gap-inconsistent", f"axis {axis} behaves as if its gap were {g.value * 1e6:.0f} µm, the drawing has "
                          f"{drawing.value * 1e6:.0f} µm. Suspect pos_{axis}'s gain, {suspect}, or a current sensor of this axis.",
                          axis, Effect.INDETERMINATE)  # fmt: skip
    yield Finding("gap-from-data", text)
