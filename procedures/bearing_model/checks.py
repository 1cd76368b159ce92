"""What can be wrong with eccentric positions besides the wiring: signals, and models that do not describe the machine."""

from __future__ import annotations

import math
from collections.abc import Iterator
from statistics import NormalDist

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.uncertainty import Estimate, Influence, coverage_factor, welch_satterthwaite
from procedures.amb_rotor import magnetics
from procedures.amb_rotor.keys import gap_key
from procedures.amb_rotor.machine import AmbRotor
from procedures.amb_rotor.places import Held
from procedures.bearing_model.estimates import Analysis
from procedures.bearing_model.inputs import as_printed
from procedures.bearing_model.plan import Plan
from procedures.shared import signals

FATAL = (
    "stuck-channel",
    "sensor-clipped",
    "contact",
    "sensor-polarity",
    "planes-exchanged",
    "axes-exchanged",
    "set-point-not-followed",
    "coils-exchanged",
    "gravity-reversed",
    "model-fails",
)
"""Findings after which the numbers mean nothing: none is given."""
CONTRADICTED = 4.0  # times its u may an adjustment be: one rig in some hundred by chance, of about fifty inputs
FALSE_MISFIT = 1e-3  # of sound runs, in which noise alone may look like a misfit
ALIKE = 0.9  # of the greatest: inputs that act alike are suspected together


def of_signals(held: Held, tilted: Held, plan: Plan) -> Iterator[Finding]:
    """Lost samples, stuck channels, flags, and a shaft that moves within a step."""
    yield from signals.losses(held.lost, held.expected, plan.max_lost, held.where)
    yield from signals.stuck(held.spread, (*held.machine.stations.channels, *held.machine.currents))
    yield from _flags(held, tilted)
    speed = np.abs([held.drift[c] for c in held.machine.stations.channels]).max(axis=0) / (plan.average_s / 2)
    if speed.max() > plan.max_speed_m_s:
        text = (
            f"the shaft moves at up to {speed.max() * 1e6:.2g} µm/s within a step, {plan.max_speed_m_s * 1e6:.2g} µm/s "
            "are allowed: its weight is not what the magnets carry alone. Settle longer."
        )
        yield Finding("unsettled", text, held.where(speed), Effect.INDETERMINATE)


def _meanings(m: AmbRotor) -> Iterator[tuple[int, str, str]]:
    """Flags that speak against a position: bits, the finding's code, its words."""
    yield m.current_limit, "current-saturated", "a coil was at its current limit"
    yield m.voltage_limit, "voltage-saturated", "a coil was at its voltage limit"
    for plane, bit in m.rings.items():
        yield bit, "contact", f"the shaft touched the {plane} touchdown ring"
    yield m.axial_stop, "contact", "the shaft touched the axial stop"
    yield m.sensor_range, "sensor-clipped", "a position sensor was beyond its range"


def _flags(held: Held, tilted: Held) -> Iterator[Finding]:
    for bit, code, text in _meanings(held.machine):
        effect = Effect.ERROR if code in FATAL else Effect.INDETERMINATE
        for data in (held, tilted):
            hit = (data.flags & bit) != 0
            if hit.any():
                said = f"{text} in {int(hit.sum())} of {hit.size} positions"
                yield Finding(code, said, data.where(hit.astype(float)), effect)


def of_results(a: Analysis, plan: Plan) -> Iterator[Finding]:
    """The gap that the data ask for, the offset's sign, and the comparison with the linear model."""
    yield from _adjustments(a, plan)
    for axis in a.held.machine.axes:
        offset, known = a.estimates[f"offset_{axis}"], a.offsets_known.get(axis, 0.0)
        if known > 0 and offset.value + expanded(offset) < 0:
            text = (
                f"axis {axis}: the shaft is {-offset.value * 1e6:.0f} µm below the magnetic centre where the sensors "
                "read zero; this stand's offsets are above it, towards the coils that carry. Either the stand was "
                "changed, or a sign is wrong (T Table 2.2 prints one that goes with gravity above zero)."
            )
            yield Finding("offset-against-load", text, axis, Effect.INDETERMINATE, (f"beta_{axis}", f"offset_{axis}"))
    for where, plane in a.held.machine.planes.items():
        if f"misfit_ratio_{where}" not in a.estimates:
            continue
        ratio = min(a.estimates[f"{k}_{where}"].value for k in ("misfit_ratio", "misfit_ratio_means"))
        if ratio < plan.min_ratio:
            text = (
                f"{where} AMB: the linear model leaves {ratio:.3g} times what the nonlinear one does, at least "
                f"{plan.min_ratio:g} is expected: the offset does not show at this bias, or the nonlinear model fits no "
                "better."
            )
            axes = [a.held.machine.axes[k] for k in plane if a.held.machine.axes[k] in a.fits]
            doubted = tuple(
                f"{q}_{name}" for q in ("beta", "offset") for name in axes
            )  # the ratio itself is what it is
            effect = Effect.INDETERMINATE if any(a.offsets_known.get(name) for name in axes) else Effect.NOTE
            yield Finding("linear-suffices", text, where, effect, doubted)
    yield _compare(a)
    if bare := [axis for axis in a.held.machine.axes if axis not in a.fits]:
        text = (f"{' and '.join(bare)} carry none of the weight: their magnetic offsets are told, their force constants not, "
                "since without a known force any would do.")  # fmt: skip
        yield Finding("no-load", text, ", ".join(bare))


def of_runout(rig: RigFile) -> Iterator[Finding]:
    """A file that tells no runout leaves out what is by far the largest of an offset, and its interval."""
    if not as_printed(rig) and rig.shaft is not None and rig.shaft.runout is None:
        text = (
            "the rig file does not tell the runout of what the probes look at (shaft.runout): offsets and their intervals "
            "hold for the angle at which the shaft rested. Their means over a turn differ by what each probe reads of "
            "runout there, a micrometre or two of a ground shaft. State it with its uncertainty."
        )
        yield Finding("runout-untold", text)


def _compare(a: Analysis) -> Finding:
    """The linear model's two numbers beside the bearing's slopes, and the noise under both residual sums."""
    said = []
    for axis, f in a.fits.items():
        gap = a.adjusted.values[gap_key(a.held.machine, axis)]
        one, two = f.linear.terms
        true = "true slopes not told without a bias"
        if axis in a.bias_A:
            k, stiffness = magnetics.slopes(f.terms, gap, a.bias_A[axis])
            true = f"true slopes {k:.3g} and {stiffness * 1e-3:.3g}"
        said.append(f"{axis}: {one:.3g} N/A and {two * 1e-3:.3g} N/mm, {true}")
    sample, batch = (1e3 * max(x[k] for x in a.noise_N.values()) for k in (0, 1))
    text = (
        f"the linear model without intercept (T 2.9) is no model of the slopes: {'; '.join(said)}. Residual sums are "
        f"over {a.samples} samples with {sample:.2g} mN of noise ({batch:.2g} mN in a batch's mean)."
    )
    return Finding("models-compared", text)


def expanded(e: Estimate) -> float:
    """k u for 95 %; for a judgement the shape of the distribution is not worth a Monte Carlo."""
    return coverage_factor(welch_satterthwaite(e)) * e.u


def _adjustments(a: Analysis, plan: Plan) -> Iterator[Finding]:
    """Do the positions fit the certificates, and what is left then?"""
    pulls = a.adjusted.pulls
    worst = max(abs(v) for v in pulls.values())
    if worst > CONTRADICTED:
        suspects = sorted((n for n, v in pulls.items() if abs(v) >= ALIKE * worst), key=lambda n: -abs(pulls[n]))
        listed = ", ".join(_told(a, name) for name in suspects[:4])
        spring = "" if plan.coupled else " The plan says that the coupling is off: is it?"
        text = f"the positions contradict a certificate by {worst:.1f} standard deviations. Suspect: {listed}.{spring}"
        yield Finding("certificate-contradicted", text, influence(a, suspects[0]).id, Effect.INDETERMINATE)
    for k, axis in enumerate(a.held.machine.axes):
        if axis not in a.fits:
            continue
        load, left = float(np.abs(a.statics.force[k]).mean()), np.abs(a.adjusted.residuals[k])
        if left.max() > max(plan.max_misfit * load, _by_noise(a, axis, plan)):
            text = (
                f"axis {axis}: one position is {left.max() / load:.1%} of its load off the nonlinear model with everything "
                f"adjusted ({plan.max_misfit:.1%} allowed), at {a.held.where(left)}. A position that was disturbed, or a "
                "reading that is not proportional."
            )
            place = next(where for where, plane in a.held.machine.planes.items() if k in plane)
            doubted = (f"beta_{axis}", f"offset_{axis}", f"misfit_ratio@{place}", f"misfit_ratio_means@{place}")
            yield Finding("misfit", text, axis, Effect.INDETERMINATE, doubted)
    told = []
    for key in dict.fromkeys(gap_key(a.held.machine, axis) for axis in a.held.machine.axes):
        gap, drawing = a.adjusted.estimates[key], a.inputs[key]
        name = "gap" if key == "gap" else influence(a, key).name
        told.append(f"{name} {gap.value * 1e6:.1f} ± {expanded(gap) * 1e6:.1f} µm "
                    f"(95 %), the drawing has {drawing.value * 1e6:.1f} ± {expanded(drawing) * 1e6:.1f} µm")  # fmt: skip
    left = 1e3 * float(np.sqrt((a.adjusted.residuals**2).mean()))
    text = (
        f"{'; '.join(told)}; the adjustment leaves {left:.2g} mN rms; the certificate that is "
        f"contradicted most is {_told(a, max(pulls, key=lambda n: abs(pulls[n])))}"
    )
    yield Finding("adjusted", text)


def _by_noise(a: Analysis, axis: str, plan: Plan) -> float:
    """What noise alone leaves of the greatest residual, N, in all but one run of a thousand: an axis that carries little has
    more of it than half a per cent of its load. The noise is that of its batches, which says nothing of the model."""
    tries = 2 * sum(a.adjusted.residuals[k].size for k, name in enumerate(a.held.machine.axes) if name in a.fits)
    times = NormalDist().inv_cdf(1 - FALSE_MISFIT / tries)
    return times * a.noise_N[axis][1] / math.sqrt(plan.batches)


def _told(a: Analysis, name: str) -> str:
    return f"{influence(a, name).name} ({a.adjusted.pulls[name]:+.1f})"


def influence(a: Analysis, name: str) -> Influence:
    """The one that an input has: certificates are influences by themselves."""
    return next(iter(a.inputs[name].sensitivities))
