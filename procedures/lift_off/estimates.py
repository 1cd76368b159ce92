"""From ramps to the phase angle of lift-off, and what it should be by what other procedures found, with influences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.recording import Recording
from bench.rigfile import RigFile
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
EARLY_HALF = (0.02, 0.2)
"""How early an end goes is known within so many N and so much of itself (`fit.early`): its residues, and masses, gains and
stiffnesses of another machine."""
ASIDE_N = 0.015  # by how much that differs between the signs of gamma
RIPPLE = 0.025  # of the force constants (T 5.25), over the rotor's angle
WITHIN = 1 / 4  # of a count: where the rotor stands within it, half of what it may be off
AWAY_N = (
    0.03  # what the statics leave out: a side pull, 0.04 N/A^2 (T Table 5.3) 5 A times what segments differ by, 0.15 A
)
LEAST_N_RAD = 10.0  # 0.2 N/deg: a force that grows by less with gamma tells no angle; the interval is wide then
PRESSED_N = 1.5  # of the stator's pull, at most: at rest over 100 N press the end into its ring, up to 4 um deeper
WRITE_S = 0.005  # within which a write of gamma acts: a request and its reply


@dataclass(frozen=True)
class Analysis:
    """`gammas` (N, 2) rad of the lifts below and above, by repeat; `estimates` by quantity, `zero_predicted` rad, `surplus` N,
    `carried` A and by how much that is `more` than in force-coupling beside them; `lifted` are indices into the ramps' samples,
    None where the end stayed down. `limit_A` is what i_y took on the ring, `newtons_A` the y winding's constant N/A."""

    rest: StepTable[Rest]
    dwells: StepTable[Dwell] | None
    held: StepTable[Held] | None
    ramps: Sequence[Ramped]
    lifted: Sequence[int | None]
    gammas: Array
    estimates: dict[str, Estimate]
    limit_A: float
    newtons_A: float


@dataclass(frozen=True)
class Statics:
    """The values of the inputs; `load` (L_x, L_y) N that the motor has to give, and i_y at its limit, A."""

    values: Mapping[str, float]
    load: tuple[float, float]
    limit_A: float

    def turned(self, gammas: Array) -> float:
        """By which gamma the force is turned, from the commutation's zero, in the mean of lifts below and above, rad."""
        return float(gammas[:, 1].mean() - gammas[:, 0].mean()) / 2 + self.values["gamma_0"]


def evaluate(recording: Recording[Plan], rest: StepTable[Rest]) -> Analysis:
    """Angles and prediction, as far as the run went."""
    machine, plan = conventions(recording.rig), recording.plan
    dwells, held, ramps = read_table(recording, Dwell), read_table(recording, Held), read_ramps(recording)
    (probe,) = machine.positions_of("yo")
    depth = {d: float(dwells.mean[probe][k]) for k, d in enumerate(dwells.labels)} if dwells is not None else {}
    lifted = [_leaves(r, depth, plan) for r in ramps]
    gammas = _paired(ramps, lifted)
    inputs = fit_inputs(recording)
    before = [r.before(k) for r, k in zip(ramps, lifted, strict=True) if k is not None]
    low = _lowest(recording.rig, rest, dwells, held, before)
    found = {} if dwells is None else {"rest_depth": _depth(low["yo"], inputs["gain_yo"])}
    limit = math.nan
    if held is not None:
        predicted, statics = _predicted(machine, low, dwells, held, inputs, lifts=len(gammas) > 0)
        found |= predicted | _carried(recording, machine, held, inputs)
        limit = statics.limit_A
        if len(gammas):
            found |= _angles(gammas, statics, ramps, lifted, plan)
    newtons_A = fit.constants({name: e.value for name, e in inputs.items()})[0]
    return Analysis(rest, dwells, held, ramps, lifted, gammas, found, limit, newtons_A)


def _lowest(
    rig: RigFile, rest: StepTable[Rest], dwells: StepTable[Dwell] | None, held: StepTable[Held] | None,
    before: Sequence[Mapping[str, float]],
) -> dict[str, Array]:  # fmt: skip
    """Readings (n,) m by axis of the shaft with its outboard end on the ring: just before each lift, where the ring carries
    nothing and is not pressed; without a lift by gamma, on the loaded ring. With a lift at once it was never seen so: the depth
    is that at rest, beneath where it may lie aside; sideways the end stands as when it is up; and the inboard loop holds the
    plane of its actuators, not of its probes, about which the inboard reading goes as a lever."""
    machine = conventions(rig)
    if before:
        return {axis: np.array([b[axis] for b in before]) for axis in machine.positions}
    if dwells is not None:
        return {axis: dwells.mean[channel] for axis, channel in machine.positions.items()}
    up, (x, y) = rest if held is None else held, machine.positions_of("xo", "yo")
    low = {axis: up.mean[channel] for axis, channel in machine.positions.items()}
    depth, g = -np.hypot(rest.mean[x], rest.mean[y]), {name: q.value for name, q in rig.geometry.items()}
    lever = (g["com_to_inboard_sensor"] - g["com_to_inboard_amb"]) / (
        g["com_to_inboard_amb"] + g["com_to_outboard_sensor"]
    )
    return {**low, "yo": depth, "yi": low["yi"] - lever * (depth - low["yo"])}


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


def _off(ramps: Sequence[Ramped], lifted: Sequence[int | None], count_rad: float) -> tuple[float, float]:
    """How far the rotor stands off its home angle when the end goes, rad: what differs between the signs of gamma, which is in
    half the difference of the angles, and what both share, which is in their middle."""
    done = [(r.labels.way, r.turned(k)) for r, k in zip(ramps, lifted, strict=True) if k is not None]
    below, above = (float(np.mean([angle for way, angle in done if way == wanted])) for wanted in (-1, 1))
    return abs(above - below) / 2 + WITHIN * count_rad, abs(above + below) / 2 + WITHIN * count_rad


def _early(
    gammas: Array, statics: Statics, ramps: Sequence[Ramped], lifted: Sequence[int | None], plan: Plan
) -> tuple[Estimate, Estimate, tuple[float, float]]:
    """By how much gamma has to be turned further than where the end went, below and above, rad, and how fast the force grows
    there, N/rad. The growth is taken where the end was seen to go, whatever was predicted."""
    p, found = statics.values, []
    for column, way in enumerate((-1, 1)):
        gamma = float(gammas[:, column].mean())
        shaken = [r.shaken(k) for r, k in zip(ramps, lifted, strict=True) if k is not None and r.labels.way == way]
        first, second = fit.growth(p, *statics.load, statics.limit_A, gamma, way)
        rate = max(fit.further(first, second, fit.NEAR_N)[1], LEAST_N_RAD) * plan.rate_rad_s
        early = fit.early(p, math.sqrt(float(np.mean(np.square(shaken)))), gamma, rate)
        further, slope = fit.further(first, second, early)
        found.append((early, further, max(slope, LEAST_N_RAD)))
    early = (found[0][0] + found[1][0]) / 2
    influence = _bound("lift/early", "motion at the threshold", EARLY_HALF[0] + EARLY_HALF[1] * early, "N")
    below, above = (Estimate(further, "rad", {influence: 1 / slope}) for _, further, slope in found)
    return below, above, (found[0][2], found[1][2])


def _angles(
    gammas: Array, statics: Statics, ramps: Sequence[Ramped], lifted: Sequence[int | None], plan: Plan
) -> dict[str, Estimate]:  # fmt: skip
    """Half difference and mean of both angles, each from what the repeats gave."""
    out = {}
    below, above, slopes = _early(gammas, statics, ramps, lifted, plan)
    by_N = (1 / slopes[0] + 1 / slopes[1]) / 2
    ripple = [
        Estimate.of(0.0, _product(name, fit.ripple(statics.values, statics.limit_A, statics.turned(gammas), off, RIPPLE)))
        for name, off in zip(("lift/ripple", "lift/ripple-aside"), _off(ramps, lifted, math.tau / plan.encoder_counts),
                             strict=True)
    ]  # fmt: skip
    aside = Estimate.of(0.0, _bound("lift/aside", "motion at the threshold, one way", ASIDE_N, "N"))
    late = Estimate.of(0.0, _bound("lift/write", "when gamma begins to turn", WRITE_S * plan.rate_rad_s, "rad"))
    ways: tuple[tuple[str, Array, Estimate], ...] = (
        ("gamma_lift", (gammas[:, 1] - gammas[:, 0]) / 2, (above + below) * 0.5 + ripple[0] * by_N + late),
        ("gamma_zero", gammas.mean(axis=1), (above - below) * 0.5 + (aside + ripple[1]) * by_N),
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
    inputs: dict[str, Estimate], lifts: bool,
) -> tuple[dict[str, Estimate], Statics]:  # fmt: skip
    """`gamma_predicted` and `zero_predicted` rad, where there are any, and `surplus` N, the motor's force at gamma = 0 beyond
    what lifts the end. Where it should lift at once and `lifts` by gamma, `gamma_predicted` is 0: what is seen contradicts
    that, or there are angles within its interval. An end that was never seen on its ring with the other one up has none."""
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
    if dwells is None:
        half = PRESSED_N / 2
        pressed = Estimate.of(half, _bound("statics/pressed", "ring pressed at rest", half, "N"))
        return {"surplus": _in("N", told["surplus"] + pressed)}, Statics(values, load(values), limit(values))
    if slope > 0:  # else it lifts at once, and there is no angle
        told |= {name: _in("rad", found[name] + away[name] * (1 / slope)) for name in found if name != "surplus"}
    elif lifts and slope == 0:
        told["gamma_predicted"] = _in("rad", found["gamma_predicted"])
    return told, Statics(values, load(values), limit(values))


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
