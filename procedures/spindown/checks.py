"""What can be wrong with a spindown, and what its data can say about it. Each check names its suspect.

Thresholds are chosen so that a sound rig trips one in fewer than one run in a thousand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.roles import SPEED
from bench.uncertainty import Estimate
from procedures.servomotor.checks import idle
from procedures.servomotor.conventions import Servomotor
from procedures.servomotor.direction import of_probe
from procedures.shared.leastsquares import linear
from procedures.spindown.estimates import Drag, drive_drag, stated_inertia
from procedures.spindown.plan import Plan
from procedures.spindown.steps import RunDown

Array = npt.NDArray[np.float64]
RELEASED_A = 0.02  # the certificates allow 4 mA of offset each, noise averages out
SAME_SPEED = 5e-3
LARGEST_OFFSET_N_m = 0.02  # 4 mA of every segment's sensor are a little over 11 mN m
LARGEST_CARRYING_N_m = 0.1
"""While the motor carries, segments 1 and 3 have 4 A that give no torque but by their difference: 1 % of either segment and
0.3 % of either sensor are 75 mN m, and 20 um off the motor's magnetic centre another 9 mN m."""
LARGEST_WAVE_RAD = 1.5e-3  # a sound run-down leaves 0.45 mrad rms, the counts of the encoder
COUNT_N_m = 0.01  # of the drive's torque
SURE = 3.0  # standard uncertainties beyond what is stated
BRAKES = 2.5  # of the drive's constant torque: 8 of 10 000 sound drives are beyond 5 mN m by 2.5 times 2
LOWERED = "lowered"  # event: the drive did not bring the shaft to the speed asked for
TICK_S = 0.45e-3  # the speed is a mean over a sample, the angle its last value


def before_fits(recording: Recording[Any]) -> Iterator[Finding]:
    """Checks that need no run-down: the encoder's direction, and whether the speed was reached."""
    yield from of_probe(recording)
    for bias, event in {e["bias_A"]: e for e in recording.events(LOWERED)}.items():
        text = (
            f"at {bias:g} A the drive brings the shaft to {abs(event['held']):.1f} rad/s and little further, of "
            f"{abs(event['wanted']):.1f} rad/s asked for: run-downs start there."
        )
        yield Finding("speed-lowered", text, f"{bias:g} A")
    for event in recording.events("not-reached"):
        yield Finding(
            "speed-not-reached",
            f"the shaft did not reach {event['wanted']:+.1f} rad/s within its time; it turned at "
            f"{event['reached']:+.1f} rad/s. Does something hold it, or is the motor's commutation wrong?",
            str(event["by"]), Effect.ERROR,
        )  # fmt: skip
    for step in recording.steps("spin"):
        data = step.read(SPEED)[SPEED]
        wanted = float(step.labels["speed_rad_s"])
        if len(data) and abs(data.mean() - wanted) > 0.05 * abs(wanted):
            wrong_way = data.mean() * wanted < 0
            yield Finding(
                "encoder-direction" if wrong_way else "speed-not-reached",
                f"asked for {wanted:+.1f} rad/s the shaft reads {data.mean():+.1f} rad/s"
                + (": the encoder counts backwards against the drive." if wrong_way else "."),
                f"{step.labels['bias_A']:g} A", Effect.ERROR,
            )  # fmt: skip


def of_runs(runs: Sequence[RunDown], machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    """Checks of each run-down: losses, contact, currents that should not be there, speed against angle."""
    lost = [r.lost / max(r.expected, 1) for r in runs]
    if max(lost) > plan.max_lost:
        text = (
            f"{max(lost):.2%} of the samples of a run-down are missing ({plan.max_lost:.2%} is allowed). Look at the link: "
            "load, cable, gateway."
        )
        yield Finding("missing-samples", text, runs[int(np.argmax(lost))].where, Effect.INDETERMINATE)
    for bit, code, text in ((machine.amb_limit, "current-saturated", "an AMB amplifier was at its limit"),
                            (machine.contact, "contact", "the rotor touched a touchdown bearing")):  # fmt: skip
        hit = [r for r in runs if r.flags & bit]
        if hit:
            yield Finding(code, f"{text} in {len(hit)} of {len(runs)} run-downs", hit[0].where, Effect.INDETERMINATE)
    yield from _released(runs, machine, plan)
    yield from _same_level(runs, plan)


def _released(runs: Sequence[RunDown], machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    """No torque current of the motor: none in any segment, or where they carry the shaft none in their mean (T 6.9). And no
    current in the AMB that should be idle then."""
    torque = [abs(r.segments.mean()) if plan.motor_carries else abs(r.segments).max() for r in runs]
    if max(torque) > RELEASED_A:
        worst = runs[int(np.argmax(torque))]
        one = machine.segments[int(np.argmax(abs(worst.segments)))]
        which = "the mean of the segments" if plan.motor_carries else one
        yield Finding("not-released", f"{which} carries {max(torque):.3f} A while the rotor should coast "
                      f"({RELEASED_A} A allowed): the motor is not released.", worst.where, Effect.INDETERMINATE)  # fmt: skip
    if plan.motor_carries:
        yield from idle([r.coils for r in runs], machine, [r.where for r in runs])


def _same_level(runs: Sequence[RunDown], plan: Plan) -> Iterator[Finding]:
    """Speed at the start by the channel, freed of its filter, against that by the angle."""
    tau = 1 / (2 * math.pi * plan.speed_filter_hz) - TICK_S
    off = []
    for r in runs:
        a, s = r.of_angle, r.of_speed
        if s is None:
            continue
        expected = (a.speed + a.c / a.b) / (1 - a.b * tau) - a.c / a.b
        off.append((s.speed / expected - 1, r.where))
    worst, where = max(off, key=lambda found: abs(found[0]), default=(0.0, ""))
    if abs(worst) > SAME_SPEED:
        yield Finding(
            "speed-and-angle-disagree",
            f"the speed channel starts {worst:+.2%} off the derivative of the angle ({SAME_SPEED:.1%} allowed): the scale "
            "of one of them is wrong.", where, Effect.INDETERMINATE,
        )  # fmt: skip


def of_result(runs: Sequence[RunDown], angle: Drag, speed: Drag | None, plan: Plan) -> Iterator[Finding]:
    """Checks of the result: both fits agree, repeats agree, directions agree, friction is that of a free rotor."""
    yield from _agreement(angle, speed) if speed is not None else _angle_alone(runs)
    yield from _repeats(angle)
    yield from _directions(angle, LARGEST_CARRYING_N_m if plan.motor_carries else LARGEST_OFFSET_N_m)
    yield from _shape(runs)
    coulomb = angle.estimates["T_c"]
    if coulomb.value > plan.max_coulomb_N_m:
        yield Finding(
            "braked",
            f"a constant torque of {coulomb.value:.3f} N m slows the rotor; a levitated one has at most "
            f"{plan.max_coulomb_N_m:g} N m. A drive or brake that still holds, or something rubs.", "T_c", Effect.INDETERMINATE,
            ("B", "B_high", "J_z"),
        )  # fmt: skip
    elif coulomb.value < -3 * coulomb.u - 1e-3:
        yield Finding("driven", f"a constant torque of {-coulomb.value:.3f} N m drives the coasting rotor in both directions.",
                      "T_c", Effect.INDETERMINATE)  # fmt: skip


def _angle_alone(runs: Sequence[RunDown]) -> Iterator[Finding]:
    """Nothing judges the angle by the speed: the run-down is over before the filter is."""
    short = [r for r in runs if r.of_speed is None]
    lasted = min(float(r.t[-1]) for r in short)
    text = (
        f"{len(short)} of {len(runs)} run-downs, down to {lasted:.2f} s, are too short for the filtered speed: the results are "
        "those of the angle, from the release on, and no speed stands beside them."
    )
    yield Finding("angle-alone", text, short[0].where)


def _agreement(angle: Drag, speed: Drag) -> Iterator[Finding]:
    """The inertia cancels in the difference, because both share it."""
    texts, bad = [], False
    for name in ("B", "T_c"):
        a, s = angle.estimates[name], speed.estimates[name]
        apart = s - a
        bad |= abs(apart.value) > 5 * apart.u
        unit = "N m s/rad" if name == "B" else "N m"
        texts.append(f"{name} by the speed less by the angle: {apart.value:+.2g} {unit} (u {apart.u:.1g})")
    text = "; ".join(texts)
    if bad:
        yield Finding("speed-and-angle-disagree", f"{text}; five u are allowed.", "speed, angle", Effect.INDETERMINATE)
    else:
        yield Finding("speed-and-angle-agree", text, "speed, angle")


def _repeats(drag: Drag) -> Iterator[Finding]:
    from scipy import special

    for name, r in drag.rates.items():
        if r.ratio_dof and r.ratio > max(special.chdtri(r.ratio_dof, 1e-5) / r.ratio_dof, 1) * 3:
            yield Finding(
                "repeats-disagree",
                f"repeated run-downs scatter {math.sqrt(r.ratio):.1f} times as far as the residuals of the fits let expect; "
                "their scatter is what the uncertainty is made of.", name,
            )  # fmt: skip
            spread = math.sqrt(float(r.covariance[0, 0])) / float(r.values[0])
            if spread > 5e-3:
                yield Finding("not-repeatable", f"b scatters by {spread:.2%}: something changes between run-downs.", name,
                              Effect.INDETERMINATE)  # fmt: skip


def _directions(drag: Drag, largest_N_m: float) -> Iterator[Finding]:
    for name, r in drag.rates.items():
        forward, backward = r.by_direction[1], r.by_direction[-1]
        apart, u = float(forward[0] - backward[0]), 2 * math.sqrt(float(r.covariance[0, 0]))
        if abs(apart) > 5 * u and abs(apart) > 5e-3 * float(r.values[0]):
            text = f"the decay is {forward[0]:.4f} 1/s forward and {backward[0]:.4f} 1/s backward: something acts one way only."
            yield Finding("direction-dependent", text, name, Effect.INDETERMINATE)
    torque = drag.torque
    if abs(torque.value) > 3e-3:
        effect = Effect.INDETERMINATE if abs(torque.value) > largest_N_m else Effect.NOTE
        text = f"{torque.value * 1e3:+.1f} mN m drives the released rotor forward; the mean over both directions is free of it."
        yield Finding("constant-torque", text, "both directions", effect)


def _shape(runs: Sequence[RunDown]) -> Iterator[Finding]:
    """The residuals of the angle are counts of the encoder; a model that does not fit leaves waves much larger."""
    rms = [float(np.sqrt(np.mean(r.of_angle.fit.residuals**2))) for r in runs]
    worst = int(np.argmax(rms))
    if rms[worst] > LARGEST_WAVE_RAD:
        yield Finding(
            "drag-not-linear",
            f"viscous and constant drag leave residuals of {rms[worst] * 1e3:.1f} mrad rms in the angle "
            f"({LARGEST_WAVE_RAD * 1e3:g} mrad allowed): "
            "the drag has another shape, or changes during the run-down.", runs[worst].where, Effect.INDETERMINATE,
        )  # fmt: skip


def of_drive(recording: Recording[Any], drag: Drag) -> Iterator[Finding]:
    """What the drive's own stream says: off while coasting, and as much constant torque at held speeds as the run-downs find,
    but for its own drag. The inertia is not in the drive's torque; the viscous part drops out of the line over the speed."""
    name = next((n for n, d in recording.rig.devices.items() if "drive" in d.roles), "")
    names = {c.name for c in recording.streams[name].channels} if name in recording.streams else set()
    yield from drives_on(recording, names)
    torque = next((n for n in sorted(names) if n.endswith("torque")), None)
    if torque is None:
        return
    steps = [s for s in recording.steps("spin") if s.labels["by"] == "drive" and s.labels["group"] == "low"]
    held = [(float(s.labels["speed_rad_s"]), s.read(torque)[torque]) for s in steps]
    found = constant_torque([(w, x) for w, x in held if len(x) >= 2])
    if found is None:
        return
    own, u = drive_drag(recording.rig), math.hypot(found[1], drag.seen.u)
    reach = stated_reach(own)
    apart = drag.seen.value - found[0] - own.value
    if abs(apart) > reach + BRAKES * u:
        yield Finding(
            "drive-brakes",
            f"the drive gives {found[0] * 1e3:.1f} mN m of constant torque to hold the rotor at its speeds, the run-downs show "
            f"{drag.seen.value * 1e3:.1f} mN m: {(apart + own.value) * 1e3:+.1f} mN m act only while it coasts "
            f"({own.value * 1e3:g} ± {reach * 1e3:g} mN m of drag are stated for the drive). "
            "The drive brakes, or a detent holds the rotor at the slow ones of these speeds.", name, Effect.INDETERMINATE,
        )  # fmt: skip


def constant_torque(held: Sequence[tuple[float, Array]]) -> tuple[float, float] | None:
    """Torque at no speed and its u, N m, from held speeds (signed, rad/s) and the readings (n,) N m of each; None without two
    speeds both ways. The mean over both directions at each speed is free of a constant torque of the released motor, which
    drives one way and brakes the other."""
    ways: dict[float, dict[bool, list[float]]] = {}
    for w, x in held:
        ways.setdefault(round(abs(w), 3), {True: [], False: []})[w > 0].append(math.copysign(1, w) * float(np.mean(x)))
    both = {w: (np.mean(of[True]) + np.mean(of[False])) / 2 for w, of in ways.items() if of[True] and of[False]}
    if len(both) < 2:
        return None
    speeds, variance = np.array(list(both)), np.full(len(both), _variance([x for _, x in held]) / 2)
    fit = linear(np.column_stack([np.ones_like(speeds), speeds]), np.array(list(both.values())), variance)
    return float(fit.terms[0]), float(fit.u[0])


def _variance(held: Sequence[Array]) -> float:
    """Of the mean of a drive's readings, (N m)^2: they scatter by what the shaft meets as it turns, much the same at each
    speed, and where they are alike the drive's resolution is left (rectangular)."""
    scatter = [float(np.var(x, ddof=1)) / len(x) for x in held if len(x) > 1]
    return max(COUNT_N_m**2 / 12, float(np.mean(scatter)) if scatter else 0.0)


def of_inertia(rig: RigFile, drag: Drag) -> Iterator[Finding]:
    """The inertia by the ring against the rig file's: a wrong ring scales everything, and nothing else shows it."""
    measured = drag.estimates.get("J_z")
    if measured is None or "polar_inertia" not in rig.machine:
        return
    stated = stated_inertia(rig)
    apart, reach = measured.value - stated.value, stated_reach(stated)
    if abs(apart) > reach + SURE * measured.u:
        yield Finding(
            "inertia-contradicted",
            f"the ring gives {measured.value:.5g} kg m^2, the rig file {stated.value:.5g} ± {reach:.2g} kg m^2: they "
            "contradict each other. Weigh and measure the ring; compare polar_inertia with the drawing.",
            "J_z", Effect.INDETERMINATE,
        )  # fmt: skip


def stated_reach(stated: Estimate) -> float:
    """How far a stated value may be off: half the width of its interval, all of it where that has ends."""
    rectangular = all(i.distribution == "rectangular" for i in stated.sensitivities)
    return stated.u * math.sqrt(3) if rectangular else 2 * stated.u


def _told(labels: Mapping[str, Any]) -> str:
    """Which run-down: by its bias, or its number."""
    return f"{labels['bias_A']:g} A" if "bias_A" in labels else f"run {int(labels['repeat']) + 1}"


def drives_on(recording: Recording[Any], names: set[str]) -> Iterator[Finding]:
    """Torque, or running, while the rotor should coast, by the channels' `names`."""
    for name in sorted(names):
        if not name.endswith(("torque", "running")):
            continue
        limit = 0.05 if name.endswith("torque") else 0.5
        for step in recording.steps("coast"):
            values = step.read(name)[name][1:]  # the first reading may be from before
            if len(values) and abs(values).max() > limit:
                yield Finding("drive-not-off", f"{name} reads {abs(values).max():.3g} while the rotor should coast.",
                              _told(step.labels), Effect.INDETERMINATE)  # fmt: skip
                break
