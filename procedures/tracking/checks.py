"""What can be wrong with a tracking test, and what its data can say about it. Each check names its suspect."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from bench.errors import AnalysisError
from bench.findings import Effect, Finding
from bench.uncertainty import Estimate
from procedures.amb_rotor.geometry import centre, nominal
from procedures.shared import signals
from procedures.shared.sines import known_frequency, unknown_frequency
from procedures.tracking.drift import Drift, drift
from procedures.tracking.estimates import TIMING_TICKS
from procedures.tracking.plan import Plan
from procedures.tracking.points import written_apart
from procedures.tracking.requires import upper_and_lower
from procedures.tracking.steps import Orbit

FATAL = (
    "stuck-channel",
    "reference-missing",
    "reference-frequency",
    "axes-exchanged",
    "sensor-polarity",
    "sensor-clipped",
    "start-not-seen",
)
FOLLOWED = 0.5  # of what the set points ask of a probe
APPLIED, OFF_HZ = 0.3, 2e-3  # share of the amplitude, relative error of the frequency
CLEAR = 8.0  # jump of the current at the start, over the noise of a sample
HELD = 5  # samples in a row at an extreme: a sensor that clips
STEADY = 0.01  # of the speed
APART_RAD = 1e-3  # of the reference: half of what phases are known to
PARTS = 0.02  # share of samples at a limit that a smooth reference does not explain


def of_signals(orbits: Sequence[Orbit], plan: Plan) -> Iterator[Finding]:
    """Lost samples, channels that stand still or clip, a reference that is not what was planned."""
    lost, expected = np.array([(o.step.lost(), o.step.expected()) for o in orbits], dtype=float).T
    yield from signals.losses(lost, expected, plan.max_lost, lambda share: orbits[int(np.argmax(share))].where)
    for o in orbits:
        upper, lower = upper_and_lower(o.machine)
        rows = (
            *zip(o.machine.stations.channels, o.path.readings, strict=True),
            *zip(upper, o.upper, strict=True),
            *zip(lower, o.lower, strict=True),
        )
        for name, values in rows:
            if np.ptp(values) == 0:
                yield Finding("stuck-channel", f"{name} does not move at all during an orbit.", name, Effect.ERROR)
        yield from _clipping(o)
        yield from _of_points(o) if o.path.points else _of_reference(o, o.law in plan.judged)
        if plan.speed_rad_s:
            off = float(np.abs(o.speed - plan.speed_rad_s).max()) / plan.speed_rad_s
            if off > STEADY:
                yield Finding(
                    "speed-off",
                    f"the speed is up to {off:.1%} off {plan.speed_rad_s * 30 / math.pi:.0f} r/min.",
                    o.where,
                    Effect.INDETERMINATE,
                    (f"@{o.where}",),
                )


def _clipping(o: Orbit) -> Iterator[Finding]:
    """A live sensor has noise also where it is greatest; one that clips repeats its limit."""
    found = False
    for name, x in zip(o.machine.stations.channels, o.path.readings, strict=True):
        for limit in (x.max(), x.min()):
            if signals.longest_at(x, limit) >= HELD:
                found = True
                yield Finding(
                    "sensor-clipped",
                    f"{name} stays at {limit * 1e6:+.1f} µm for {HELD} samples and more: it clips there.",
                    name,
                    Effect.ERROR,
                )
    if not found and (o.flags & o.machine.sensor_range).any():
        yield Finding(
            "sensor-clipped", "the controller reports a position sensor beyond its range.", o.where, Effect.ERROR
        )


def _of_reference(o: Orbit, judged: bool) -> Iterator[Finding]:
    facts, wave = nominal(o.step.recording.rig, o.t_0), o.path.wave
    q = centre(o.path.readings, facts)[:2]
    t, sizes = o.path.t - o.path.t[0], (wave.y, wave.z)
    planned = [hz for hz, _, _ in wave.axes]
    greater = int(np.argmax(sizes))
    own = [known_frequency(t, x, hz).amplitude for x, hz in zip(q, planned, strict=True)]
    if o.clear < CLEAR:
        yield Finding(
            "start-not-seen",
            f"the coil currents show no start of the reference ({o.clear:.1f} times their noise): its phase is not known. "
            "Either it was not applied, or current sensors of one bearing are exchanged, so that the answers cancel.",
            o.where,
            Effect.ERROR,
        )
    try:
        hz = unknown_frequency(t, q[greater]).hz
    except AnalysisError:
        hz = math.nan
    if abs(hz / planned[greater] - 1) > OFF_HZ and np.ptp(q[greater]) > APPLIED * 2 * sizes[greater]:
        yield Finding(
            "reference-frequency",
            f"the rotor moves at {hz:.4g} Hz; the reference should have {planned[greater]:g} Hz.",
            o.where,
            Effect.ERROR,
        )
    elif max(own) < APPLIED * max(sizes) or not math.isfinite(hz):
        yield Finding(
            "reference-missing",
            f"the rotor moves by {own[0] * 1e6:.2g} and {own[1] * 1e6:.2g} µm at "
            f"{wave.hz:g} Hz; the "
            f"reference should have {wave.y * 1e6:g} and {wave.z * 1e6:g} µm: it is not applied.",
            o.where,
            Effect.ERROR,
        )
    elif judged and not (o.flags & o.machine.contact).any():
        yield from _of_drift(o, drift(o.whole, facts))


def _of_points(o: Orbit) -> Iterator[Finding]:
    """Does the shaft go where the set points are, each axis along its own?"""
    facts, wave = nominal(o.step.recording.rig, o.t_0), o.path.wave
    if o.clear < CLEAR:
        text = (f"the coil currents show no answer to set points ({o.clear:.1f} times their noise): their delay is not known. "
                "Steps of the reference are larger with fewer points or a larger ellipse (y_m, z_m); else suspect the current "
                "sensors of one bearing to be exchanged, so that the answers cancel.")  # fmt: skip
        yield Finding("start-not-seen", text, o.where, Effect.ERROR)
    q, t = centre(o.path.readings, facts)[:2], o.path.t - o.path.t[0]
    own = [known_frequency(t, x, wave.hz).amplitude for x in q]
    if max(own) < APPLIED * max(wave.y, wave.z):
        text = (f"the shaft moves by {own[0] * 1e6:.2g} and {own[1] * 1e6:.2g} µm at {wave.hz:g} Hz; the set points by "
                f"{wave.y * 1e6:g} and {wave.z * 1e6:g} µm: they are not followed.")  # fmt: skip
        yield Finding("reference-missing", text, o.where, Effect.ERROR)
    else:
        yield from _of_probes(o)
        yield from _of_writes(o)


def _of_writes(o: Orbit) -> Iterator[Finding]:
    """Set points of one place that were written apart: the shaft goes an ellipse of its own, and tilts, by as much."""
    names = [*o.machine.points({"y": 0.0, "z": 0.0})]
    apart, hz = written_apart(o.step, names), o.path.wave.hz
    if 2 * math.pi * hz * apart > APART_RAD:
        text = (f"the set points of one place were written up to {apart * 1e3:.2g} ms apart, {360 * hz * apart:.2g}° of a "
                f"revolution at {hz:g} Hz: the shaft followed one, then the other. Bind them to signals of one message, which "
                "the bench writes at once, or go slower (points_hz).")  # fmt: skip
        yield Finding("set-points-apart", text, o.where, Effect.INDETERMINATE, (f"@{o.where}",))


def _of_probes(o: Orbit) -> Iterator[Finding]:
    """Each probe reads what its place and direction make of the set points: nudges, and gravity, show some probes only."""
    points = o.path.points
    if points is None:
        return
    at = np.clip(np.searchsorted(points.t, o.path.t, side="right") - 1, 0, len(points.t) - 1)
    asked = o.machine.stations.reads[:, :2] @ np.array([points.y[at], points.z[at]])
    for name, read, should in zip(o.machine.stations.channels, o.path.readings, asked, strict=True):
        should = should - should.mean()
        share = float(read @ should / (should @ should))
        if share < FOLLOWED:
            code, suspect = ("axes-exchanged", "its reading exchanged with another probe's")
            if share < -FOLLOWED:
                code, suspect = "sensor-polarity", "the sign of its reading"
            text = (f"{name} moves by {share:+.2f} of what the set points ask of the shaft where it stands, the others as they "
                    f"should: suspect {suspect}.")  # fmt: skip
            yield Finding(code, text, name, Effect.ERROR)


def _of_drift(o: Orbit, found: Drift | None) -> Iterator[Finding]:
    """A frequency that is a little off: its phase, which counts from the start, runs away by more than the budget has of it."""
    if found is None or not found.plain or abs(found.ahead_s) <= TIMING_TICKS * o.path.wave.tick:
        return
    text = (
        f"the rotor's phase drifts as if the reference ran at {o.path.wave.hz * (1 + found.off):.8g} Hz, not at "
        f"{o.path.wave.hz:g} Hz: since its start it is {abs(found.ahead_s) * 1e3:.2g} ms "
        f"{'ahead' if found.off > 0 else 'behind'}."
    )
    yield Finding("reference-frequency", text, o.where, Effect.ERROR)


def of_results(orbits: Sequence[Orbit], results: Mapping[str, Mapping[str, Estimate]], plan: Plan) -> Iterator[Finding]:
    """Contact, saturation, coils that should be off, and the laws side by side."""
    for o in orbits:
        judged = o.law in plan.judged
        yield from _of_contact(o, results[o.law]["ring_distance"], Effect.INDETERMINATE if judged else Effect.NOTE)
        current, voltage = o.machine.current_limit, o.machine.voltage_limit
        for bit, what in ((current, "current"), (voltage, "voltage")):
            share = float((o.flags & bit != 0).mean())
            if share > 0:
                bad = judged and share > PARTS
                yield Finding(
                    f"{what}-saturated",
                    f"a coil's {what} was at its limit in {share:.2%} of the samples.",
                    o.where,
                    Effect.INDETERMINATE if bad else Effect.NOTE,
                    (f"@{o.where}",),
                )
        low = results[o.law].get("lower_current")
        if low is not None and o.law == "CAC" and not o.path.turn_s and low.value - 2 * low.u > plan.max_lower_A:
            yield Finding(
                "lower-coils-on",
                f"the lower coils carry up to {low.value:.3f} A with CAC ({plan.max_lower_A:g} A "
                "allowed): they should be off.",
                o.where,
                Effect.INDETERMINATE,
                (f"@{o.where}",),
            )
    yield Finding("laws-compared", "; ".join(_said(o, results[o.law]) for o in orbits) + ".")


def _of_contact(o: Orbit, left: Estimate, effect: Effect) -> Iterator[Finding]:
    told = float((o.flags & o.machine.contact != 0).mean())
    if told > 0:
        sides = [plane for plane, bit in o.machine.rings.items() if (o.flags & bit).any()]
        places = [f"the {' and '.join(sides)} ring"] if sides else []
        places += ["the axial stop"] if (o.flags & o.machine.axial_stop).any() else []
        text = f"the rotor touches {' and '.join(places)} in {told:.1%} of the samples"
        if sides:
            room = f"{left.value * 1e6:.1f} ± {2 * left.u * 1e6:.1f} µm"
            text += f"; by its positions {room} are left to {'the ring' if len(places) > 1 else 'it'}"
        yield Finding("contact", f"{text}.", o.where, effect, (f"@{o.where}",))
        if sides and left.value > 3 * left.u:  # of the axial stop the positions say nothing
            yield Finding(
                "contact-not-seen",
                "the controller reports contact, the positions show none: look at the "
                "sensors' gain "
                "and zero, or at what lies between rotor and ring.",
                o.where,
                Effect.INDETERMINATE,
                (f"@{o.where}",),
            )
    elif o.ring_distance(nominal(o.step.recording.rig, o.t_0)) < 0:
        yield Finding(
            "contact-unreported",
            f"by its positions the rotor is at a ring ({left.value * 1e6:.1f} ± "
            f"{2 * left.u * 1e6:.1f} µm are left), but the controller reports no contact.",
            o.where,
            Effect.INDETERMINATE,
            (f"@{o.where}",),
        )


def _said(o: Orbit, r: Mapping[str, Estimate]) -> str:
    touched = f"contact in {float((o.flags & o.machine.contact != 0).mean()):.0%} of the samples"
    if o.path.points:
        peak, rms = r["contour_peak"], r["contour_rms"]
        late_s = r["phase_lag_y"].value / (2 * math.pi * o.path.wave.hz)
        return (f"{o.law or 'as set'}: off the ellipse by {peak.value * 1e6:.2f} ± {2 * peak.u * 1e6:.2f} µm at most, "
                f"{rms.value * 1e6:.2f} µm rms, {abs(late_s) * 1e3:.1f} ms {'behind' if late_s > 0 else 'ahead'} in y, "
                f"{touched}")  # fmt: skip
    y, z, psi, theta = (r[n] for n in ("error_peak_y", "error_peak_z", "tilt_psi", "tilt_theta"))
    low = r["lower_current"]
    return (
        f"{o.law}: peaks {y.value * 1e6:.1f} ± {2 * y.u * 1e6:.1f} µm in y, {z.value * 1e6:.1f} ± "
        f"{2 * z.u * 1e6:.1f} µm in z, "
        f"tilts {psi.value * 1e6:.0f} and {theta.value * 1e6:.0f} µrad, lower coils up to {low.value:.2f} A, "
        f"{touched}"
    )
