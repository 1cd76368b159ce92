"""What can be wrong with a lift by the phase angle, and what its prediction says of it. Each check names its suspect."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from bench.rigfile.roles import ANGLE
from bench.uncertainty import Estimate, interval
from procedures.lift_off.estimates import Analysis
from procedures.lift_off.plan import Plan
from procedures.lift_off.steps import LAST
from procedures.servomotor import carrying
from procedures.servomotor.conventions import Servomotor, radial_currents
from procedures.servomotor.parameters import stated
from procedures.shared import signals

Array = npt.NDArray[np.float64]
FATAL = ("stuck-channel", "contact-silent")
SURE = 1.5  # times the interval: three standard uncertainties
LOAD = 0.25  # of the weight's share: magnetic centre and probe's zero, 30 um times 280 N/mm, 17 %; force constant 3 %; rest
MORE_N = 0.18  # 20 g on the hook, or 0.5 um of the probe's zero
FULL = 0.98  # of the limit: where i_x gets there nothing is left to balance what goes sideways
LIGHT_N = 1.0  # an end that presses less is thrown up by noise now and then, and may be taken up by the start's motion
LIES = 0.5  # share of a dwell with contact from which on the end lay on its ring
TOLD = 0.99  # share of the samples with contact on a ring that carries; of sound rigs all but single ones
FEW = 4  # counts of the encoder by which the rotor moves while it is held
DEPTH_M = 30e-6  # clearance 5 um, probe's zero 10 um, its gain 2.5 um, with room


def of_signals(
    a: Analysis, machine: Servomotor, touching: tuple[list[float], list[float]], plan: Plan
) -> Iterator[Finding]:
    """Losses, channels that stand, contact that is not told on the ring; `touching`: share of the samples with contact at the
    outboard end, of each rest and of each dwell. An end that presses lightly truly bounces in its dwell."""
    tables = [table for table in (a.rest, a.dwells, a.held) if table is not None]
    for table in tables:
        yield from signals.losses(table.lost, table.expected, plan.max_lost, table.where)
        yield from signals.stuck(table.spread, (*machine.segments, *machine.positions_of("yi", "yo", "xi", "xo")))
    pressed = "surplus" in a.estimates and interval(a.estimates["surplus"]).high < -LIGHT_N
    if (least := min((*touching[0], *(share for share in touching[1] if pressed and share >= LIES)))) < TOLD:
        yield Finding(
            "contact-silent",
            f"the outboard end lies on its ring and the controller tells its contact in {100 * least:.1f} % of the samples "
            f"({100 * TOLD:.0f} % expected): a lift is known by its end. Look at the channel that tells it.",
            "capabilities.status.contact", Effect.ERROR,
        )  # fmt: skip
    if a.held is not None:
        yield from signals.flagged(
            a.held.flags,
            ((machine.contact, "contact", "the rotor touched a touchdown bearing after its lift"),),
            a.held.where,
        )


def of_lifts(a: Analysis, rig: RigFile, machine: Servomotor, touching: list[float], plan: Plan) -> Iterator[Finding]:
    """Whether the end lay on its ring before each lift, and was lifted by each."""
    zero = _at_zero(a, touching)
    if zero:
        yield Finding(
            "lifts-at-zero",
            f"the motor lifts the outboard end at gamma = 0{_so_predicted(a)}: there is no phase angle to be measured.",
            zero, Effect.INDETERMINATE,
        )  # fmt: skip
        return
    yield from _on_the_ring(a, rig, machine, plan)
    yield from _balanced(a, stated(rig, "motor.segment_limit").default)
    stays = [r for r, k in zip(a.ramps, a.lifted, strict=True) if k is None]
    if stays:
        most = math.degrees(plan.gamma_max_rad)
        yield Finding(
            "does-not-lift",
            f"the outboard end stays on its ring up to {most:.2f}°. Look at the motor's current, and at what weighs on the "
            "shaft.",
            str(stays[0].labels), Effect.INDETERMINATE,
        )  # fmt: skip


def _at_zero(a: Analysis, touching: list[float]) -> str:
    """The lift that came before gamma was turned; "" where there is none."""
    turned = {(r.labels.repeat, r.labels.way) for r in a.ramps}
    up = [str(x) for x in (() if a.held is None else a.held.labels) if (x.repeat, x.way) not in turned]
    off = [
        str(x) for x, share in zip(() if a.dwells is None else a.dwells.labels, touching, strict=True) if share < LIES
    ]
    return next(iter((*up, *off)), "")


def _so_predicted(a: Analysis) -> str:
    if (e := a.estimates.get("surplus")) is None:
        return ""
    found = interval(e)
    said = "as predicted" if found.high >= -LIGHT_N else "against the prediction"
    return f", {said}: its force is {e.value:+.1f} N ({found.low:+.1f} N to {found.high:+.1f} N) beyond what lifts it"


def _on_the_ring(a: Analysis, rig: RigFile, machine: Servomotor, plan: Plan) -> Iterator[Finding]:
    dwells = a.dwells
    if dwells is None:
        return
    (probe,) = machine.positions_of("yo")
    i_y = radial_currents(*(dwells.mean[c] for c in machine.segments))[1]
    told = stated(rig, "motor.segment_limit").default
    if (worst := float(np.ptp(dwells.mean[probe]))) > plan.max_depth_m or float(
        dwells.ptp[probe].max()
    ) > 2 * plan.max_depth_m:
        yield Finding(
            "restless", f"the outboard end lies {worst * 1e6:.1f} µm apart on its ring from lift to lift, or moves there "
            f"({plan.max_depth_m * 1e6:.1f} µm allowed).", dwells.where(np.abs(dwells.mean[probe])), Effect.INDETERMINATE,
        )  # fmt: skip
    off = i_y - told
    worst_A = float(off[np.argmax(np.abs(off))])
    if abs(worst_A) > (allowed := (1 - plan.limit_share) * told):
        yield Finding(
            "not-at-limit",
            f"i_y takes {told + worst_A:.3f} A on the ring, and the controller was told to give up to {told:.3f} A "
            f"({allowed:.3f} A off allowed): the end is lifted by another current than that. Look at the "
            "segments' limit.",
            dwells.where(np.abs(off)), Effect.INDETERMINATE,
        )  # fmt: skip


def _balanced(a: Analysis, told_A: float) -> Iterator[Finding]:
    """Whether i_x had room until the end went; the mean of so many samples, for single ones are noisy."""
    full = [r for r, k in zip(a.ramps, a.lifted, strict=True) if _largest(r.i_x[:k]) > FULL * told_A]
    if full:
        yield Finding(
            "sideways-limit",
            f"i_x is at its limit of {told_A:.2f} A before the end goes: nothing balances what the turned i_y pushes sideways, "
            "the end rolls along its ring, and an angle of lift-off would be another one. A smaller clearance or more current "
            "lifts earlier.",
            str(full[0].labels), Effect.INDETERMINATE,
        )  # fmt: skip


def _largest(i: Array) -> float:
    return float(np.abs(np.convolve(i, np.ones(LAST) / LAST, "valid")).max()) if len(i) >= LAST else 0.0


def of_rotor(a: Analysis, plan: Plan) -> Iterator[Finding]:
    """The rotor's angle: its torque shares the segments with the force."""
    turned = [
        (float(np.abs(r.angle[: len(r.t) if k is None else k]).max()), r)
        for r, k in zip(a.ramps, a.lifted, strict=True)
    ]
    allowed = max(plan.max_angle_rad, FEW * math.tau / plan.encoder_counts)
    if turned and (worst := max(turned, key=lambda one: one[0]))[0] > allowed:
        yield Finding(
            "angle-moved",
            f"the rotor is {math.degrees(worst[0]):.2f}° off its home angle while gamma is turned "
            f"({math.degrees(allowed):.2f}° allowed): i_x and i_y leave too little for the torque, or something "
            "turns it.",
            ANGLE, Effect.INDETERMINATE,
        )  # fmt: skip


def of_place(a: Analysis, rig: RigFile, machine: Servomotor) -> Iterator[Finding]:
    """Where the ring is, and what the shaft weighs, by the rig file."""
    clearance, depth = rig.geometry["clearance"].value, a.estimates.get("rest_depth", Estimate.exact(math.nan)).value
    if abs(depth - clearance) > DEPTH_M:
        yield Finding(
            "ring-elsewhere",
            f"the outboard end lies {depth * 1e6:.0f} µm under its probe's zero; the rig file has a clearance of "
            f"{clearance * 1e6:.0f} µm. Look at the probe's gain and zero, and at the ring.",
            machine.positions["yo"], Effect.INDETERMINATE,
        )  # fmt: skip
    if a.held is None:
        return
    yield from _as_before(a)
    i_y = float(radial_currents(*(a.held.mean[c] for c in machine.segments))[1].mean())
    told = carrying.told_weight_N(rig)
    if told is not None and abs(i_y / (weight := told * carrying.lever(rig) / a.newtons_A) - 1) > LOAD:
        yield Finding(
            "load-unexpected",
            f"i_y is {i_y:.2f} A with the end up, and the shaft's weight should take {weight:.2f} A: something hangs on the "
            "shaft or holds it.",
            "i_y", Effect.INDETERMINATE,
        )  # fmt: skip


def _as_before(a: Analysis) -> Iterator[Finding]:
    """Whether the motor carries what it did in force-coupling."""
    if (more := a.estimates.get("more")) is None:
        return
    i, force = interval(more), a.newtons_A * more.value
    if abs(more.value) > max(MORE_N / a.newtons_A, SURE * (i.high - i.low) / 2):
        yield Finding(
            "load-changed",
            f"the motor holds the end up with {a.estimates['carried'].value:.3f} A, {more.value:+.3f} A from what it took in "
            f"force-coupling: {force:+.2f} N. Something hangs on the shaft, or was taken off, or the outboard probe's zero has "
            "moved since.",
            "i_y", Effect.INDETERMINATE,
        )  # fmt: skip


def of_prediction(a: Analysis) -> Iterator[Finding]:
    """Angle and zero against what other procedures found."""
    pairs = (
        ("gamma_lift", "gamma_predicted", "lift-disagrees", "the phase angle of lift-off",
         "Look at the scale of gamma in the controller, the motor's current and the probes since those runs."),
        ("gamma_zero", "zero_predicted", "zero-moved", "the middle of both phase angles",
         "Was the encoder moved since force-coupling, or do two segments differ?"),
    )  # fmt: skip
    for name, other, code, what, look in pairs:
        if name not in a.estimates or other not in a.estimates:
            continue
        off, ratio = compared(a.estimates[name], a.estimates[other])
        known, by = (math.degrees(a.estimates[key].value) for key in (name, other))
        by_facts = f"it should be {by:.3f}°" if by or name != "gamma_lift" else "it should be none: they lift at 0"
        said = f"{what} is {known:.3f}°, by the motor's constants {by_facts}: {math.degrees(off.value):+.3f}°, E_n {ratio:.2f}"
        if ratio > SURE:
            yield Finding(code, f"{said} ({SURE:g} allowed). {look}", name, Effect.INDETERMINATE, (name,))
        elif name == "gamma_lift":
            yield Finding("as-predicted", f"{said}.", name)


def compared(found: Estimate, predicted: Estimate) -> tuple[Estimate, float]:
    """Their difference, and the share of its expanded uncertainty that it is, to the side of zero."""
    off = found - predicted
    i = interval(off)
    side = off.value - i.low if off.value > 0 else i.high - off.value
    return off, abs(off.value) / side if side > 0 else math.inf
