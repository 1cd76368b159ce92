"""From ramps to the phase angle of lift-off, and what it should be by what other procedures found, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.uncertainty import Estimate, Influence
from procedures.lift_off import fit
from procedures.lift_off.plan import Plan
from procedures.lift_off.steps import Dwell, Held, Ramped, Rest, read_ramps, read_table
from procedures.servomotor.conventions import Servomotor, conventions
from procedures.servomotor.parameters import stated
from procedures.shared.certificates import certified, certified_gain, certified_sensors
from procedures.shared.gradients import by_inputs, linearised
from procedures.shared.step_table import StepTable

Array = npt.NDArray[np.float64]
EARLY_N, EARLY_HALF_N = (0.033, 0.27), (0.015, 0.15)
"""An end goes by so much force early, within so much more, the second number times sin^2 of how far the force is turned: the
loop that holds x answers the noise of its probe, which lifts by that sine; a push of a few milliseconds is enough where the
ring hardly carries; and the ramp goes on meanwhile."""
ASIDE_N = 0.015  # by how much that differs between the signs of gamma
RIPPLE = 0.025  # of the force constants (T 5.25), over the rotor's angle
COUNT_RAD = math.pi / 4096 / 2  # where the rotor stands within its encoder's count: half of what it may be off
AWAY_N = (
    0.03  # what the statics leave out: a side pull, 0.04 N/A^2 (T Table 5.3) 5 A times what segments differ by, 0.15 A
)
WRITE_S = 0.005  # within which a write of gamma acts: a request and its reply


@dataclass(frozen=True)
class Analysis:
    """`gammas` (N, 2) rad of the lifts below and above, by repeat; `estimates` by quantity, `zero_predicted` rad, `surplus` N,
    `carried` A and by how much that is `more` than in force-coupling beside them; `lifted` are indices into the ramps' samples,
    None where the end stayed down. `limit_A` is what i_y took on the ring."""

    rest: StepTable[Rest]
    dwells: StepTable[Dwell] | None
    held: StepTable[Held] | None
    ramps: Sequence[Ramped]
    lifted: Sequence[int | None]
    gammas: Array
    estimates: dict[str, Estimate]
    limit_A: float


def evaluate(recording: Recording[Plan], rest: StepTable[Rest]) -> Analysis:
    """Angles and prediction, as far as the run went."""
    machine, plan = conventions(recording.rig), recording.plan
    dwells, held, ramps = read_table(recording, Dwell), read_table(recording, Held), read_ramps(recording)
    (probe,) = machine.positions_of("yo")
    depth = {d: float(dwells.mean[probe][k]) for k, d in enumerate(dwells.labels)} if dwells is not None else {}
    lifted = [_leaves(r, depth, plan) for r in ramps]
    gammas = _paired(ramps, lifted)
    inputs = fit_inputs(recording)
    low = _lowest(
        machine, rest, dwells, held, [r.before(k) for r, k in zip(ramps, lifted, strict=True) if k is not None]
    )
    found = {} if dwells is None else {"rest_depth": _depth(low["yo"], inputs["gain_yo"])}
    limit, slope = math.nan, math.nan
    if held is not None:
        predicted, limit, slope = _predicted(machine, low, dwells, held, inputs)
        found |= predicted | _carried(recording, machine, held, inputs)
    if len(gammas):
        values = {name: e.value for name, e in inputs.items()}
        turned = float(gammas[:, 1].mean() - gammas[:, 0].mean()) / 2 + values["gamma_0"]
        force = math.sin(values["pole_pairs"] * (turned - values["gamma_0"])) ** 2
        ripple = [fit.ripple(values, limit, turned, off, RIPPLE) for off in _off(ramps, lifted)]
        found |= _angles(gammas, slope, force, (ripple[0], ripple[1]), plan)
    return Analysis(rest, dwells, held, ramps, lifted, gammas, found, limit)


def _lowest(
    machine: Servomotor, rest: StepTable[Rest], dwells: StepTable[Dwell] | None, held: StepTable[Held] | None,
    before: Sequence[Mapping[str, float]],
) -> dict[str, Array]:  # fmt: skip
    """Readings (n,) m by axis of the shaft with its outboard end on the ring: just before each lift, where the ring carries
    nothing and is not pressed; without a lift by gamma, on the loaded ring; with a lift at once, at rest, where of the other
    probes what they read with the end up is taken."""
    if before:
        return {axis: np.array([b[axis] for b in before]) for axis in machine.positions}
    if dwells is not None:
        return {axis: dwells.mean[channel] for axis, channel in machine.positions.items()}
    up, (x, y) = rest if held is None else held, machine.positions_of("xo", "yo")
    deep = {"yo": -np.hypot(rest.mean[x], rest.mean[y])}  # at rest it may lie beside the lowest place of its ring
    return {axis: deep.get(axis, up.mean[channel]) for axis, channel in machine.positions.items()}


def _leaves(r: Ramped, depth: Mapping[Dwell, float], plan: Plan) -> int | None:
    rest = depth.get(Dwell(r.labels.repeat, r.labels.way))
    return None if rest is None else fit.leaves(r.t, r.y, r.touches, rest, plan.confirm_s)


def _paired(ramps: Sequence[Ramped], lifted: Sequence[int | None]) -> Array:
    """(N, 2) of the repeats that lifted either way."""
    by = {
        (r.labels.repeat, r.labels.way): float(r.gamma[k]) for r, k in zip(ramps, lifted, strict=True) if k is not None
    }
    whole = [k for k in sorted({repeat for repeat, _ in by}) if (k, 1) in by and (k, -1) in by]
    return np.array([[by[k, -1], by[k, 1]] for k in whole]).reshape(-1, 2)


def _depth(reading: Array, gain: Estimate) -> Estimate:
    u = float(np.std(reading, ddof=1)) / math.sqrt(len(reading)) if len(reading) > 1 else 0.0
    scatter = Influence(
        "scatter/rest_depth", "scatter of the rests", u, "m", "A", "normal", float(max(len(reading) - 1, 1))
    )
    return Estimate(float(-reading.mean()), "m", {scatter: 1.0} if u else {}) / gain


def _off(ramps: Sequence[Ramped], lifted: Sequence[int | None]) -> tuple[float, float]:
    """How far the rotor stands off its home angle when the end goes, rad: what differs between the signs of gamma, which is in
    half the difference of the angles, and what both share, which is in their middle."""
    done = [(r.labels.way, r.turned(k)) for r, k in zip(ramps, lifted, strict=True) if k is not None]
    below, above = (float(np.mean([angle for way, angle in done if way == wanted])) for wanted in (-1, 1))
    return abs(above - below) / 2 + COUNT_RAD, abs(above + below) / 2 + COUNT_RAD


def _angles(
    gammas: Array, slope: float, square: float, ripple_N: tuple[float, float], plan: Plan
) -> dict[str, Estimate]:  # fmt: skip
    """Half difference and mean of both angles, each from what the repeats gave; `slope` N/rad, `square` sin^2 of how far the
    force is turned, `ripple_N` in each."""
    out = {}
    at, half = (one[0] + one[1] * square for one in (EARLY_N, EARLY_HALF_N))
    early = Estimate.of(at, _bound("lift/early", "motion at the threshold", half, "N"))
    early = early + Estimate.of(0.0, _product("lift/ripple", ripple_N[0]))
    aside = Estimate.of(0.0, _bound("lift/aside", "motion at the threshold, one way", ASIDE_N, "N"))
    aside = aside + Estimate.of(0.0, _product("lift/ripple-aside", ripple_N[1]))
    late = Estimate.of(0.0, _bound("lift/write", "when gamma begins to turn", WRITE_S * plan.rate_rad_s, "rad"))
    ways: tuple[tuple[str, Array, Estimate], ...] = (
        ("gamma_lift", (gammas[:, 1] - gammas[:, 0]) / 2, early * (1 / slope) + late if slope > 0 else late),
        ("gamma_zero", gammas.mean(axis=1), aside * (1 / slope) if slope > 0 else Estimate.exact(0.0)),
    )
    for name, values, more in ways:
        u = float(np.std(values, ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else 0.0
        scatter = Influence(
            f"scatter/{name}", "scatter of the repeats", u, "rad", "A", "normal", float(max(len(values) - 1, 1))
        )
        total = Estimate(float(values.mean()), "rad", {scatter: 1.0} if u else {}) + more
        out[name] = Estimate(total.value, "rad", total.sensitivities)
    return out


def _product(identity: str, half_N: float) -> Influence:
    """Of ripple times angle, each anywhere within its range: small values are likelier."""
    name = "ripple of the force off the home angle"
    return Influence(identity, name, half_N / math.sqrt(6), "N", "B", "triangular")


def _bound(identity: str, name: str, half: float, unit: str) -> Influence:
    return Influence(identity, name, half / math.sqrt(3), unit, "B", "rectangular")


def _predicted(
    machine: Servomotor, low: Mapping[str, Array], dwells: StepTable[Dwell] | None, held: StepTable[Held],
    inputs: dict[str, Estimate],
) -> tuple[dict[str, Estimate], float, float]:  # fmt: skip
    """`gamma_predicted` and `zero_predicted` rad, where there are any, and `surplus` N, the motor's force at gamma = 0 beyond
    what lifts the end; i_y at its limit A; and the growth of the force with gamma N/rad where it lifts."""
    below = {axis: float(x.mean()) for axis, x in low.items()}
    above = {axis: float(held.mean[channel].mean()) for axis, channel in machine.positions.items()}
    carrying = held.stack(machine.segments).mean(axis=1)
    at_limit = None if dwells is None else dwells.stack(machine.segments).mean(axis=1)

    def limit(p: Mapping[str, float]) -> float:
        return p["limit"] if at_limit is None else fit.currents(p, at_limit)[1]

    def load(p: Mapping[str, float]) -> tuple[float, float]:
        y, x = (fit.at_motor(p, a, above[f"{a}i"] - below[f"{a}i"], above[f"{a}o"] - below[f"{a}o"]) for a in "yx")
        return fit.load(p, carrying, y, x)

    def model(p: dict[str, float]) -> dict[str, float]:
        first, last, _ = fit.thresholds(p, *load(p), limit(p))
        at_zero = fit.surplus(p, *load(p), limit(p), 0.0)
        return {"gamma_predicted": (last - first) / 2, "zero_predicted": (last + first) / 2, "surplus": at_zero}

    values = {name: e.value for name, e in inputs.items()}
    slope = fit.thresholds(values, *load(values), limit(values))[2]
    found = by_inputs(model, inputs)
    away = {name: Estimate.of(0.0, _bound(f"statics/{name}", "side pull", AWAY_N, "N")) for name in found}
    told = {"surplus": _in("N", found["surplus"] + away["surplus"])}
    if slope > 0:  # else it lifts at once, and there is no angle
        told |= {name: _in("rad", found[name] + away[name] * (1 / slope)) for name in found if name != "surplus"}
    return told, limit(values), slope


def _carried(
    recording: Recording[Plan], machine: Servomotor, held: StepTable[Held], inputs: dict[str, Estimate]
) -> dict[str, Estimate]:
    """`carried` A: the force that holds the end up at the probes' zero over the y winding's constant, freed of the zero of the
    commutation; `more`: than force-coupling found, where that was handed on. Sensors and force constant cancel in it."""
    above = {axis: float(held.mean[channel].mean()) for axis, channel in machine.positions.items()}
    currents = held.stack(machine.segments).mean(axis=1)

    def model(p: Mapping[str, float]) -> dict[str, float]:
        y, x = (fit.at_motor(p, a, above[f"{a}i"], above[f"{a}o"]) for a in "yx")
        return {"carried": fit.load(p, currents, y, x)[1] / fit.constants(p)[0]}

    found = {"carried": _in("A", linearised(model, inputs)["carried"])}
    before = recording.calibration("force-coupling").values.get("carried")
    return found if before is None else {**found, "more": _in("A", found["carried"] - before)}


def _in(unit: str, e: Estimate) -> Estimate:
    return Estimate(e.value, unit, e.sensitivities, e.sampler)


def fit_inputs(recording: Recording[Plan]) -> dict[str, Estimate]:
    """What the prediction needs besides the steps: calibrations, and certificates of the rig file as influences by identity."""
    rig, g = recording.rig, recording.rig.geometry
    motor, stiffness, coupling = (
        recording.calibration(name).values for name in ("force-constant", "negative-stiffness", "force-coupling")
    )
    machine = conventions(rig)
    inputs = {
        "alpha_d": motor["alpha_d@0"],
        "chi": motor["alpha_dx"] / motor["alpha_d"],
        "alpha_c": coupling["alpha_c"],
        "gamma_0": coupling["gamma_0"],
        "alpha_x_prime": stiffness["alpha_x_prime"],
        "pole_pairs": Estimate.exact(rig.machine["pole_pairs"].value),
        "limit": Estimate.exact(stated(rig, "motor.segment_limit").default),
    }
    for key, name in (("l_is", "com_to_inboard_sensor"), ("l_os", "com_to_outboard_sensor"), ("z_oa", "com_to_outboard_amb"),
                      ("motor_to_outboard", "motor_to_outboard_amb")):  # fmt: skip
        inputs[key] = certified(f"geometry/{name}", g[name])
    for axis, channel in machine.positions.items():
        inputs[f"gain_{axis}"] = certified_gain(rig, channel)
    return inputs | certified_sensors(rig, {f"m{k}": c for k, c in enumerate(machine.segments, 1)})
