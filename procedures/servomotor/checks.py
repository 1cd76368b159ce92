"""What can be wrong with steps in which the motor or the AMBs hold a displaced shaft. Each check names its suspect.

Thresholds are chosen so that a sound rig trips one in fewer than one run in a thousand; each is stated where it stands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.rigfile.roles import ANGLE
from procedures.servomotor.conventions import Servomotor
from procedures.shared import signals
from procedures.shared.step_table import Labels, StepTable

Array = npt.NDArray[np.float64]

FATAL = ("stuck-channel", "segment-sign")
"""Findings after which a fit means nothing and is not attempted."""
IDLE_A = 0.02  # the mean of four sensors' offsets is less
UNBALANCED_A = 0.5  # half the sum of opposite segments is the torque current: at rest within 0.1 A


def of_signals(
    data: StepTable[Labels], machine: Servomotor, channels: Sequence[str], max_lost: float
) -> Iterator[Finding]:  # fmt: skip
    """Lost samples, stuck channels, saturation and contact."""
    yield from signals.losses(data.lost, data.expected, max_lost, data.where)
    yield from signals.stuck(data.spread, channels)
    yield from signals.flagged(data.flags, limits(machine), data.where)


def limits(machine: Servomotor) -> tuple[signals.Meaning, ...]:
    """Flags that stand for a limit that was reached, with what they are called."""
    return (
        (machine.amb_limit, "current-saturated", "an AMB amplifier was at its limit"),
        (machine.segment_limit, "current-saturated", "a motor segment was at its limit"),
        (machine.contact_inboard, "contact", "the rotor touched the inboard touchdown bearing"),
        (machine.contact_outboard, "contact", "the rotor touched the outboard touchdown bearing"),
    )


def segments(mean: Mapping[str, Array | float], machine: Servomotor) -> Iterator[Finding]:
    """Signs of the segments' `mean` currents in A while the motor carries: opposite ones carry opposite currents (T 6.9; at
    rest there is hardly a torque current), and segment 1 a positive one, because it lifts."""
    names = machine.segments
    one, two, three, four = (float(np.mean(mean[c])) for c in names)
    for a, b, name_a, name_b, lifts in (
        (one, three, names[0], names[2], True), (four, two, names[3], names[1], False)
    ):  # fmt: skip
        if abs(a + b) / 2 > UNBALANCED_A:
            suspect = f"{name_a} or {name_b}" if not lifts else name_a if a < 0 else name_b
            yield Finding(
                "segment-sign",
                f"{name_a} reads {a:+.2f} A and {name_b} {b:+.2f} A: opposite segments that hold a shaft at rest carry "
                f"opposite currents. Look at the sign of {suspect}, and at whether both segments get their currents.",
                suspect,
                Effect.ERROR,
            )
    if one < 0 < three:
        yield Finding(
            "segment-sign",
            f"{names[0]} reads {one:+.2f} A and {names[2]} {three:+.2f} A: the motor pushes down while it lifts. Both sensors "
            "have the wrong sign, or the segments are exchanged.",
            f"{names[0]}, {names[2]}",
            Effect.ERROR,
        )


def idle(coils: Sequence[Mapping[str, float]], machine: Servomotor, where: Sequence[str]) -> Iterator[Finding]:
    """The outboard AMB while the motor carries its end: mean currents A by coil, of steps that are called `where`."""
    means = [abs(float(np.mean([of[c] for c in machine.coils_of("xo", "yo")]))) for of in coils]
    if max(means) > IDLE_A:
        yield Finding(
            "not-idle",
            f"the outboard AMB's coils carry {max(means):.3f} A on average while the motor should carry ({IDLE_A} A allowed): "
            "the drag is of another state.",
            where[int(np.argmax(means))],
            Effect.INDETERMINATE,
        )


def at_edge(data: StepTable[Labels], count_rad: float) -> Iterator[Finding]:
    """The rotor at the edges it was sent to: its encoder reads now one count and now the other.

    A reading that is 0 or one count c, the latter with probability p, has the mean p c and the variance p (1 - p) c^2: from
    both follows c.
    """
    mean, spread = np.abs(data.mean[ANGLE]), data.spread[ANGLE]
    between = spread > 0.05 * count_rad
    found = float(np.median((spread**2 + mean**2)[between] / mean[between])) if between.any() else 0.0
    if between.mean() < 0.8 or abs(found / count_rad - 1) > 0.05:
        seen = f"two readings {found * 1e3:.3f} mrad apart" if between.any() else "one reading throughout"
        yield Finding(
            "rotor-off-edge",
            f"in {int(between.sum())} of {between.size} steps the rotor stands at an edge of its encoder's count, with {seen}; "
            f"expected all steps, and {count_rad * 1e3:.3f} mrad. Look at count_rad, and at the friction of the rotor.",
            data.where(np.where(between, 0.0, 1.0)),
            Effect.ERROR,
        )


def settled(
    data: StepTable[Labels],
    offsets: Mapping[str, Array],
    drifts: Mapping[str, Array],
    max_position_m: float,
    max_drift_A: float,
) -> Iterator[Finding]:
    """Settled means where the reference is and standing still. `offsets` (N,) m are mean positions less their
    references, `drifts` (N,) A the drift of each control current within the step, by name.

    The drift allowed in position is twice the offset allowed, because the noise of a difference of half means is twice
    that of the mean.
    """
    moving = {c: np.abs(data.drift[c]) for c in offsets}
    for values, limit, what, unit, scale in (
        (offsets, max_position_m, "mean position off its reference", "µm", 1e6),
        (moving, 2 * max_position_m, "drift of the position", "µm", 1e6),
        (drifts, max_drift_A, "drift of the current", "mA", 1e3),
    ):
        name = max(values, key=lambda c, v=values: float(np.abs(v[c]).max()))
        worst = np.abs(values[name])
        if worst.max() > limit:
            yield Finding(
                "unsettled",
                f"{what} within a step: {worst.max() * scale:.3g} {unit} ({name}) at worst, {limit * scale:.3g} {unit} "
                f"allowed; {int((worst > limit).sum())} of {worst.size} steps. Settle longer, or look at the integrator.",
                data.where(worst),
                Effect.INDETERMINATE,
            )


def creeping(drift_A: Mapping[str, float], u_A: Mapping[str, float], max_creep_A: float) -> Iterator[Finding]:
    """Currents that change over the sequence at equal positions: more than `max_creep_A` and five standard uncertainties.

    `drift_A` is what a current, i_x, i_y or that of an AMB, changes by from the first step to the last. The amplifiers
    close their loops on their own sensors, so a sensor that drifts shows as a demand that drifts.
    """
    pairs = {"i_x": "segments 2 and 4", "i_y": "segments 1 and 3"}
    for name, change in drift_A.items():
        if abs(change) > max(max_creep_A, 5 * u_A[name]):
            yield Finding(
                "drifting-sensor",
                f"{name} changes by {change * 1e3:+.2f} mA over the sequence with the shaft where it was "
                f"({max_creep_A * 1e3:.2f} mA allowed): a current sensor of {pairs.get(name, 'that AMB')} drifts, or the "
                "load does. The sequence is mirrored, so that a steady drift does not reach the result; an unsteady one does.",
                name,
                Effect.INDETERMINATE,
            )


def misfit(data: StepTable[Labels], residuals: Array, span: float, what: str, max_misfit: float) -> Iterator[Finding]:
    """Residuals (N,) beyond `max_misfit` of the range `span`, both in one unit: the model does not describe the machine."""
    worst = np.abs(residuals)
    if worst.max() > max_misfit * span:
        yield Finding(
            "misfit",
            f"{what}: one step is {worst.max() / span:.2%} of the range off the model ({max_misfit:.2%} allowed). "
            "A reading that is not proportional, a step that was disturbed, or a machine that the model does not describe.",
            data.where(worst),
            Effect.INDETERMINATE,
        )
