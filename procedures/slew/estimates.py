"""From swings to estimates: scatter over the periods, the start of the sine, the encoder, the torque constant."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.uncertainty import Estimate, Influence
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified_gain
from procedures.slew.fit import Gains, Passes, Swing, Tracking, answered, passes, starts, tracking
from procedures.slew.plan import Plan

Array = npt.NDArray[np.float64]
DESIGN_NM_A, DESIGN_SHARE = 2.87, 0.1  # T Table 6.2, and how far a machine may be from it
RIPPLE_NM_A = 0.02  # T Table 5.3, beta_4: ripple of the torque constant that one angle's calibration does not show
SURE = 5  # standard uncertainties
FOLLOWING = ("error_rms", "error_peak", "amplitude_ratio", "lag")  # what a detent or a friction gets into
COUNTED = 0.1  # share of the counts' variance that the assumption of evenly spread counts may be wrong by


@dataclass(frozen=True)
class Result:
    """Swings with their starts, estimates by frequency, and what the slowest swing says of the torque; `torque` A is the
    amplitude of its torque current at its frequency."""

    swings: tuple[tuple[Swing, float], ...]
    tracking: Mapping[float, Mapping[str, Estimate]]
    passes: Passes
    detent: Estimate
    friction: Estimate
    torque: float


def evaluate(recording: Recording[Plan], swings: Sequence[Swing], gains: Gains) -> Result:
    """Every estimate.

    Raises:
        AnalysisError: a record is too short, or the slowest swing does not cover a period of the detent.
    """
    plan = recording.plan
    count = 2 * math.pi / plan.encoder_counts
    begun, half = starts(swings, gains)
    started = tuple(zip(swings, begun, strict=True))
    found = {s.hz: _tracking(s, t_0, half, count) for s, t_0 in started}
    slowest, t_0 = min(started, key=lambda pair: pair[0].hz)
    through = passes(slowest, t_0, plan.detent_order)
    torque = _torque_constant(recording) * _segment_gain(recording)
    detent, friction = _detent(through, torque), _friction(through, torque)
    return Result(started, found, through, detent, friction, answered(slowest, t_0))


def _tracking(s: Swing, t_0: float, half: float, count: float) -> dict[str, Estimate]:
    where = f"{s.hz:g} Hz"
    middle, early, late = (tracking(s, t, count) for t in (t_0, t_0 - half, t_0 + half))

    def estimate(name: str, unit: str, of: Callable[[Tracking], Array]) -> Estimate:
        """Mean over the periods; a shift of the start acts by the larger of its two effects."""
        shifts = [float(of(moved).mean() - of(middle).mean()) for moved in (early, late)]
        worst = max(shifts, key=abs)
        timing = _rectangular("start", "start of the sine", half, "s")
        return _scatter(f"{name}/{where}", unit, of(middle)) + timing * (worst / half)

    encoder = _rectangular(f"encoder/{where}", "encoder count", count / 2, "rad")
    rms = estimate("error_rms", "rad", lambda x: x.rms)
    left = COUNTED * count**2 / 12 / (2 * max(rms.value, count / 12**0.5))
    return {
        "error_rms": rms + _rectangular(f"counts/{where}", "variance of the encoder counts", left, "rad"),
        "error_peak": estimate("error_peak", "rad", lambda x: x.peak) + encoder,
        "amplitude_ratio": estimate("amplitude_ratio", "1", lambda x: x.ratio),
        "lag": estimate("lag", "s", lambda x: x.lag),
    }


def _scatter(identity: str, unit: str, values: Array) -> Estimate:
    u = float(values.std(ddof=1)) / math.sqrt(len(values))
    influence = Influence(id=f"scatter/{identity}", name="scatter of the periods", u=u, unit=unit, kind="A",
                          distribution="normal", dof=float(len(values) - 1), source=f"{len(values)} periods")  # fmt: skip
    return Estimate.of(float(values.mean()), influence)


def _rectangular(identity: str, name: str, half: float, unit: str, source: str = "") -> Estimate:
    """Zero, within a half width."""
    influence = Influence(id=identity, name=name, u=half / math.sqrt(3), unit=unit, kind="B", distribution="rectangular",
                          source=source)  # fmt: skip
    return Estimate.of(0.0, influence)


def _torque_constant(recording: Recording[Plan]) -> Estimate:
    """N m/A, from the calibration or the design value."""
    if recording.plan.torque_constant == "calibration":
        ripple = _rectangular("torque/ripple", "ripple of the torque constant", RIPPLE_NM_A, "N m/A", "T Table 5.3")
        return recording.calibration("torque-constant").values["alpha_tau"] + ripple
    return DESIGN_NM_A + _rectangular("torque/design", "torque constant by design", DESIGN_SHARE * DESIGN_NM_A, "N m/A",
                                      "T Table 6.2, within a tenth (house choice)")  # fmt: skip


def _segment_gain(recording: Recording[Plan]) -> Estimate:
    """One, with what the gains of the segments' current sensors do to the torque current."""
    out, turning = Estimate.exact(1.0), conventions(recording.rig).turning
    for channel in (c for c in turning if c in recording.rig.sensors):
        gain = certified_gain(recording.rig, channel)
        out = out - (gain - gain.value) * (1 / len(turning))
    return out


def _detent(p: Passes, torque: Estimate) -> Estimate:
    """Amplitude from cosine and sine. Their noise adds to its square, and is taken off."""
    c, s = float(p.cosine.mean()), float(p.sine.mean())
    n = len(p.cosine)
    noise = (p.cosine.var(ddof=1) + p.sine.var(ddof=1)) / n
    size = math.hypot(c, s)
    amplitude = math.sqrt(max(size**2 - float(noise), 0.0))
    along = (p.cosine * c + p.sine * s) / max(size, 1e-300)
    return (_scatter("detent", "A", along) - size + amplitude) * torque


def _friction(p: Passes, torque: Estimate) -> Estimate:
    return _scatter("friction", "A", p.friction) * torque


def findings(result: Result, plan: Plan) -> Iterator[Finding]:
    """A swing of another size than was told; a detent or a friction that is larger than the plan allows; a detent that is lost
    in the noise."""
    detent, friction = result.detent, result.friction
    yield from _scaled(result, plan.kp_theta)
    if detent.value > plan.max_detent_N_m:
        yield Finding(
            "large-detent",
            f"{detent.value:.3f} N m of torque goes with {plan.detent_order} times the angle ({plan.max_detent_N_m:g} N m "
            "allowed): the rotor catches. Look for iron where there should be none, or a segment that is out.",
            "detent", Effect.INDETERMINATE, FOLLOWING,
        )  # fmt: skip
    elif detent.value < 3 * detent.u:
        text = f"the detent of {detent.value * 1e3:.1f} mN m is within three standard uncertainties of nothing."
        yield Finding("detent-not-resolved", text, "detent")
    if abs(friction.value) > plan.max_friction_N_m:
        yield Finding(
            "friction",
            f"moving takes {friction.value:.3f} N m ({plan.max_friction_N_m:g} N m allowed): something rubs or brakes, or a "
            "backwards torque sensor makes it negative.",
            "friction", Effect.INDETERMINATE, (*FOLLOWING, "detent"),
        )  # fmt: skip


def _scaled(result: Result, kp: float) -> Iterator[Finding]:
    """The slowest swing against the amplitude that was told.

    The real part of k_p + k_i / (j w) + k_d j w / (1 + j w T) is k_p or more, so that the error which the controller acts on is
    at most the torque current over k_p: the angle's amplitude is nearer than that to the reference's.
    """
    slowest = min((s for s, _ in result.swings), key=lambda s: s.hz)
    ratio = result.tracking[slowest.hz]["amplitude_ratio"]
    allowed = result.torque / (kp * slowest.amplitude) + SURE * ratio.u
    if abs(ratio.value - 1) > allowed:
        yield Finding(
            "reference-scaled",
            f"at {slowest.hz:g} Hz the angle swings by {ratio.value:.4f} of what the reference was told, where by its torque "
            f"current the controller sees an error of {allowed:.2%} at most: its reference swings by another amplitude than it "
            "was told, or k_p is less than the plan's.",
            f"{slowest.hz:g} Hz", Effect.INDETERMINATE, FOLLOWING,
        )  # fmt: skip
