"""What can be wrong with pulses at a locked rotor, and with the map that they make."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from bench.findings import Effect, Finding
from bench.rigfile import RigFile
from procedures.inductance_map import fit
from procedures.inductance_map.estimates import Result
from procedures.inductance_map.model import MAP, Terms
from procedures.inductance_map.plan import Plan
from procedures.inductance_map.residuals import Left, by_depth, harmonics, left, torques
from procedures.inductance_map.steps import Taken
from procedures.stages.stators import axis, phases, poles

READY = "READY"
APART = 4.5  # standard uncertainties that what should be alike may lie apart
GAINS = 3.0  # standard uncertainties of a reading's gain: beyond what a certificate allows one phase against the mean of all
ALIGNED = math.radians(12)  # by which a phase may be aligned elsewhere than its place in the stator says
REACHED = 0.9  # of the pulses' usual current
ONE = 0.99  # of a correlation: two numbers that are one
FEWEST = 8  # places


def of_signals(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Nothing locked or captured, another state, no pulses, readings with a wrong sign."""
    if len(taken) < FEWEST:
        yield Finding("too-few-places", f"found {len(taken)} places; expected {FEWEST} (was the run stopped early?)", "",
                      Effect.ERROR)  # fmt: skip
        return
    some = phases(rig)
    for t in taken:
        if other := [s for s in t.states if rig.binding.mode(s) != READY]:
            text = f"the controller was in {', '.join(other)}: other phases may have carried current."
            yield Finding("not-let-go", text, t.place.name, Effect.ERROR)
            return
        if missing := [p.name for p in some if p.name not in t.shots]:
            yield Finding(
                "pulse-not-captured", f"of {', '.join(missing)} there is no capture.", t.place.name, Effect.ERROR
            )
            return
        if missing := [p.name for p in some if t.pulses.get(p.name) is None]:
            text = f"of {', '.join(missing)} there is no current that a pulse makes."
            yield Finding("no-pulse", text, t.place.name, Effect.ERROR)
            return
    yield from _signs(taken, rig)


def _signs(taken: Sequence[Taken], rig: RigFile) -> Iterator[Finding]:
    for p in phases(rig):
        ohm = np.array([pulse.resistance for t in taken if (pulse := t.pulses[p.name]) is not None])
        if (ohm <= 0).any():
            text = f"u/i is {ohm.min():.3g} Ohm: its current or its voltage is read with the wrong sign."
            yield Finding("sign-reversed", text, p.name, Effect.ERROR)


def of_order(taken: Sequence[Taken], rig: RigFile) -> Iterator[Finding]:
    """Phases that are aligned where another one should be, stators that are exchanged: nothing could be fitted."""
    n, some = poles(rig), phases(rig)
    angle, x = np.array([t.angle for t in taken]), np.array([t.x for t in taken])
    for p in some:
        henry = np.array([_henry(t, p.name) for t in taken])
        deep = 1 + p.side * x / max(2 * np.abs(x).max(), 1e-9)  # roughly how the overlap goes
        design = np.column_stack([deep, deep * np.cos(n * angle), deep * np.sin(n * angle), p.side * x])
        terms, *_ = np.linalg.lstsq(design, henry, rcond=None)
        off = (math.atan2(terms[2], terms[1]) / n - p.aligned + math.pi / n) % (2 * math.pi / n) - math.pi / n
        if abs(off) > ALIGNED:
            text = (f"it is aligned {math.degrees(off):+.3g}° from where its stator has it: phases are exchanged, or "
                    "the encoder's zero is another one.")  # fmt: skip
            yield Finding("phase-elsewhere", text, p.name, Effect.ERROR)
        elif np.corrcoef(henry, p.side * x)[0, 1] < -0.3:
            text = "its inductance falls where the mover should be deeper in: stators are exchanged, or x counts backwards."
            yield Finding("stators-exchanged", text, p.name, Effect.ERROR)


def _henry(t: Taken, name: str) -> float:
    pulse = t.pulses[name]
    assert pulse is not None
    few = slice(0, max(3, len(pulse.up.current) // 3))
    return float((pulse.up.flux[few] / pulse.up.current[few]).mean())


def of_pulses(taken: Sequence[Taken], rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """Pulses that are not what they should be: too weak, too low, with other phases."""
    some = phases(rig)
    found = {p.name: [pulse for t in taken if (pulse := t.pulses[p.name]) is not None] for p in some}
    volts = {name: float(np.median([p.highest for p in each])) for name, each in found.items()}
    amperes = {name: float(np.median([abs(p.current) for p in each])) for name, each in found.items()}
    usual, most = float(np.median(list(volts.values()))), float(np.median(list(amperes.values())))
    for name in found:
        concerned = (f"gain@{name}",)
        if volts[name] < plan.weak * usual:
            text = f"its pulses have {volts[name]:.3g} V, those of the others {usual:.3g} V."
            yield Finding("amplifier-weak", text, name, Effect.INDETERMINATE, concerned)
        if amperes[name] < REACHED * most:
            text = f"its pulses come to {amperes[name]:.3g} A, those of the others to {most:.3g} A: less is seen of saturation."
            yield Finding("current-not-reached", text, name, Effect.INDETERMINATE, (*concerned, "saturation"))
    other = max(((s.other, f"{name}, {t.place.name}") for t in taken for name, s in t.shots.items()), default=(0.0, ""))
    if other[0] > plan.max_other_A:
        text = (
            f"another phase carried {other[0]:.3g} A: its amplifier is closed, and the phases' coupling is in the flux."
        )
        yield Finding("others-carry", text, other[1], Effect.INDETERMINATE)


def of_results(r: Result, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """A lock that gives way, phases that saturate apart, what the formula lacks, numbers that the pulses do not part."""
    yield from _lock(r, rig, plan)
    yield from _saturation(r, rig)
    yield from _leakage(r, rig, plan)
    for k, p in enumerate(r.phases):
        up, down = fit.flanks(r.found, r.rows, k)
        if abs(up - down) > plan.max_apart:
            text = (f"fluxes on the way up are {up - down:+.1%} more than on the way down: hysteresis, u and i of different "
                    "times, or a resistance that is not that of the flanks.")  # fmt: skip
            yield Finding("flanks-apart", text, p.name, Effect.INDETERMINATE)
    of = left(r)
    yield from _formula(of, r, plan)
    matrix, u = fit.correlations(r.found), np.sqrt(np.diag(r.found.covariance))
    for a in range(len(MAP)):
        for b in range(a):
            if abs(matrix[a, b]) > ONE and {MAP[a], MAP[b]} != {"zero_1", "zero_2"}:
                text = (f"the pulses show them together: correlation {matrix[a, b]:+.4f}, u {u[a]:.2g} and {u[b]:.2g}. More "
                        "positions tell them apart.")  # fmt: skip
                yield Finding("not-separated", text, f"{MAP[b]}, {MAP[a]}", Effect.NOTE, (MAP[a], MAP[b]))


def _lock(r: Result, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    give = float(r.found.terms[MAP.index("give")])
    most = float(np.abs(torques(r)).max())
    turned = abs(give) * most
    angle = axis(rig, "angle")
    count = angle.pitch.value if angle is not None and angle.pitch is not None else math.inf
    went = max((s.went[1] for t in r.taken for s in t.shots.values()), default=0.0)
    if turned > plan.max_yield_rad or went > plan.max_yield_rad + 2 * count:
        text = (f"it turns by {math.degrees(turned):.2g}° under {most:.2g} N m, as fluxes have it, and readings by up to "
                f"{math.degrees(went):.2g}° in a pulse. It grows with the torque, as saturation does.")  # fmt: skip
        yield Finding("lock-gives-way", text, "lock", Effect.INDETERMINATE)


def _saturation(r: Result, rig: RigFile) -> Iterator[Finding]:
    """Iron of one kind saturates at one current: a phase that does not has another gain of its current's reading."""
    at = Terms(len(r.rows.x)).each("saturation")
    each, scatter = r.found.terms[at], np.sqrt(np.diag(r.found.scatter))[at]
    share = each / each.mean() - 1
    for k, p in enumerate(r.phases):
        known = rig.sensors[p.current].gain.standard_uncertainty
        if abs(share[k]) > math.hypot(GAINS * known, APART * scatter[k] / each[k]):
            text = (f"it saturates at {share[k]:+.2%} of the others' current as its current is read: its reading has another "
                    "gain, or its teeth are not theirs.")  # fmt: skip
            yield Finding("phase-saturates-apart", text, p.name, Effect.INDETERMINATE, (f"gain@{p.name}", "saturation"))


def _leakage(r: Result, rig: RigFile, plan: Plan) -> Iterator[Finding]:
    """What flux goes past the mover is alike in coils that are alike. L_l g_u/g_i times g_i i_s has the gain of the voltage
    alone: a phase that has more of it has another gain."""
    at = Terms(len(r.rows.x))
    slices = at.each("leakage"), at.each("saturation")
    product = r.found.terms[slices[0]] * r.found.terms[slices[1]]
    scatter = np.hypot(*(np.sqrt(np.diag(r.found.scatter))[s] / r.found.terms[s] for s in slices))
    share = product / product.mean() - 1
    for k, p in enumerate(r.phases):
        known = rig.sensors[p.voltage].gain.standard_uncertainty
        if abs(share[k]) > plan.leakage_share + math.hypot(GAINS * known, APART * scatter[k]):
            text = (f"its leakage is {share[k]:+.2%} from the others': another gain of its voltage, or its coil's ends "
                    "are not theirs.")  # fmt: skip
            yield Finding("leakage-apart", text, p.name, Effect.INDETERMINATE, (f"gain@{p.name}", "leakage", "slope"))


def _formula(of: Left, r: Result, plan: Plan) -> Iterator[Finding]:
    found = harmonics(of, r.rows.poles)
    name = max(found, key=lambda n: abs(found[n][0]) if abs(found[n][0]) > APART * found[n][1] else 0.0)
    size, u = found[name]
    if abs(size) > APART * u:
        text = f"fluxes have a {name} times the angle of {size:+.3%} of the aligned one beyond the formula, u {u:.1g}."
        if abs(size) > plan.max_residual:
            yield Finding("harmonic-left", text, "angle", Effect.INDETERMINATE)
        else:
            yield Finding("harmonic-seen", text, "angle", Effect.NOTE)
    overlap, size, u = max(by_depth(of, r), key=lambda d: abs(d[1]))
    if abs(size) > plan.max_residual and abs(size) > APART * u:
        text = (
            f"with {overlap * 1e3:.3g} mm in a stator, fluxes have {size:+.2%} of the greatest one beyond the formula."
        )
        yield Finding("fringe-left", text, "overlap", Effect.INDETERMINATE, ("fringe", "length", "overlap", "centre"))
