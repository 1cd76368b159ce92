"""From windows and facts to estimates: speeds and their ratio, and what the balance of torques expects of them.

Everything goes through one model, so that what speeds and expectations share (scatter of the same windows, current sensors,
the facts) cancels in their differences as it does in the machine.

Means are of both directions. A torque that acts one way whatever way the rotor turns drops out, such as that of unequal
segments which carry the shaft, i_y (g_1 - g_3) alpha_tau/4, or of a shaft off the motor's magnetic centre; so does the
product of an angle of the commutation that turns with the direction (a lag) and one that does not (the encoder's zero).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bench.calibration import Calibration
from bench.errors import AnalysisError
from bench.rigfile import RigFile
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence, propagate
from procedures.maximum_speed import fit
from procedures.maximum_speed.plan import NAMES, SHARINGS, WORDS, Plan
from procedures.maximum_speed.steps import Window, by_sharing
from procedures.servomotor.conventions import conventions
from procedures.shared.certificates import certified, certified_sensors
from procedures.spindown.estimates import drive_drag, held_by, square

Array = npt.NDArray[np.float64]
WAYS = {1: "forward", -1: "backward"}
SEEN = 3  # numbers of a window that scatter together: speed, torque current, bound
UNITS = {"speed": "rad/s", "predicted": "rad/s", "ripple": "rad/s", "ratio": "1", "ratio_predicted": "1",
         "torque_slope": "N m s/rad", "apart": "rad/s", "ratio_apart": "1", "slope_apart": "N m s/rad"}  # fmt: skip


@dataclass(frozen=True)
class Shared:
    """The windows of one sharing: `speed` rad/s, torque current of each segment along the torque (4,) A, `bound` A by the
    formula, `sizes` of i_x, i_y A, `lag` rad of the currents behind the field: means of both directions. `seen` (windows, 3)
    of each direction less their mean: speed, torque current, bound; `counts` rad/s, u of the speed by the encoder."""

    windows: tuple[Window, ...]
    speed: float
    currents: Array
    bound: float
    sizes: Array
    lag: float
    seen: Mapping[str, Array]
    counts: float

    @property
    def current(self) -> float:
        """Torque current, as the sensors read it, A."""
        return float(self.currents.mean())


@dataclass(frozen=True)
class Result:
    """What was found: `of` each sharing, estimates by name (`speed_half`, ...), the drag at the run's own bias."""

    of: Mapping[str, Shared]
    estimates: Mapping[str, Estimate]
    drag: Estimate
    constant: Estimate  # torque that acts at any speed, N m: the rotor's and the drive's
    per_A: Estimate  # torque per ampere in the mean over a turn, N m/A
    square_A2: float
    time_constant_s: float  # J/B
    turned: float  # M gamma_0t, rad: the encoder's zero in the electrical turn


def gathered(windows: list[Window], sharing: str, counts: int) -> Shared:
    """The windows of one sharing.

    Raises:
        AnalysisError: a direction has fewer than two.
    """
    ways = {d: by_sharing(windows, sharing, d) for d in (1, -1)}
    if min(len(found) for found in ways.values()) < 2:
        raise AnalysisError(f"{WORDS[sharing]}: found fewer than two runs in a direction (was the run stopped early?)")
    rows = {d: np.array([[w.speed, d * w.segments.mean(), w.told.bound] for w in found]) for d, found in ways.items()}
    seen = {WAYS[d]: r - r.mean(axis=0) for d, r in rows.items()}
    means = {d: np.mean([w.segments for w in found], axis=0) for d, found in ways.items()}
    both = (*ways[1], *ways[-1])
    u = math.sqrt(sum(fit.count_u(w.turning, counts) ** 2 for w in both)) / len(both)
    along = sum(d * np.mean([w.told.along.mean() for w in found]) for d, found in ways.items()) / 2
    # a lag turns with the direction, and so does the torque current: what it puts across the field does not
    across = sum(np.mean([w.told.across.mean() for w in found]) for found in ways.values()) / 2
    return Shared(
        windows=both,
        speed=float(np.mean([r[:, 0].mean() for r in rows.values()])),
        currents=(means[1] - means[-1]) / 2,
        bound=float(np.mean([r[:, 2].mean() for r in rows.values()])),
        sizes=np.mean([w.told.sizes for w in both], axis=0),
        lag=float(np.arctan2(-across, along)),
        seen=seen,
        counts=u,
    )


def evaluate(windows: list[Window], plan: Plan, rig: RigFile, facts: Mapping[str, Calibration]) -> Result:
    """Every estimate; `facts` by procedure.

    Raises:
        AnalysisError: a direction is missing.
    """
    of = {s: gathered(windows, s, plan.encoder_counts) for s in SHARINGS}
    pairs = held_by(conventions(rig), True)
    held = {c: float(np.mean([w.coils[c] for w in windows])) for pair in pairs for c in pair}
    inputs = _inputs(rig, facts, of, held)
    model = _Model(rig, of, held, pairs, facts["spindown"].settings)
    found = propagate(model, inputs)
    extra = {name: found.pop(name) for name in ("drag", "constant", "per_A")}
    return Result(
        of, {name: _with_unit(name, e) for name, e in found.items()} | _ripples(of), **extra,
        square_A2=square(held, pairs, {k: e.value for k, e in inputs.items()}),
        turned=rig.machine["pole_pairs"].value * facts["torque-constant"].values["gamma_0t"].value,
        time_constant_s=facts["spindown"].values["J_z"].value / extra["drag"].value,
    )  # fmt: skip


def _with_unit(name: str, e: Estimate) -> Estimate:
    unit = next(u for start, u in sorted(UNITS.items(), key=lambda x: -len(x[0])) if name.startswith(start))
    return Estimate(e.value, unit, e.sensitivities, e.sampler)


@dataclass(frozen=True)
class _Model:
    """The balance of torques as a function of its inputs."""

    rig: RigFile
    of: Mapping[str, Shared]
    held: Mapping[str, float]
    pairs: Sequence[tuple[str, str]]
    drag_at: Mapping[str, float]

    def __call__(self, p: dict[str, float]) -> dict[str, float]:
        low, high = self.drag_at["bias_A"] ** 2, self.drag_at["bias_high_A"] ** 2
        drag = p["B"] + (p["B_high"] - p["B"]) * (square(self.held, self.pairs, p) - low) / (high - low)
        constant = p["T_c"] + p["drive"]
        turned = self.rig.machine["pole_pairs"].value * p["gamma_0t"]
        per_A = (p["alpha_tau"] - p["ripple"]) * math.cos(turned)
        gains = np.array([p[f"segment_{k}"] for k in range(4)])
        weights = gains / gains.mean() / np.array([p[f"gain_m{k}"] for k in range(4)])
        out: dict[str, float] = {"drag": drag, "constant": constant, "per_A": per_A}
        current, speed, bound = {}, {}, {}
        for s, name in NAMES.items():
            speed[name] = self.of[s].speed + p[f"speed_{s}"]
            current[name] = float(weights @ self.of[s].currents) / 4 + p[f"current_{s}"]
            bound[name] = self.of[s].bound + p[f"bound_{s}"]
            predicted = (per_A * current[name] - constant) / drag
            out |= {
                f"speed_{name}": speed[name],
                f"predicted_{name}": predicted,
                f"apart_{name}": speed[name] - predicted,
            }
        ratio, slope = (
            speed["op"] / speed["half"],
            per_A * (current["op"] - current["half"]) / (speed["op"] - speed["half"]),
        )
        return out | {
            "ratio": ratio, "ratio_predicted": bound["op"] / bound["half"], "torque_slope": slope,
            "ratio_apart": ratio - out["predicted_op"] / out["predicted_half"], "slope_apart": slope - drag,
        }  # fmt: skip


def _inputs(
    rig: RigFile, facts: Mapping[str, Calibration], of: Mapping[str, Shared], held: Mapping[str, float]
) -> dict[str, Estimate]:
    drag, torque, machine = facts["spindown"].values, facts["torque-constant"].values, rig.machine
    out = {name: drag[name] for name in ("B", "B_high", "T_c")}
    out |= {name: torque[name] for name in ("alpha_tau", "gamma_0t")}
    out["drive"] = drive_drag(rig)
    out["ripple"] = certified(
        "machine/torque_ripple", machine["torque_ripple"], "ripple of the torque at the home angle"
    )
    for k in range(4):
        out[f"segment_{k}"] = _one_of(machine["segment_gain"], f"machine/segment_gain/{k + 1}", k)
    segments = {f"m{k}": c for k, c in enumerate(conventions(rig).segments)}
    out |= certified_sensors(rig, {**segments, **{c: c for c in held}})
    for s, shared in of.items():
        out |= scatter(s, shared.seen)
        count = Influence(id=f"encoder/{s}", name="counts of the encoder", u=shared.counts, unit="rad/s", kind="B",
                          distribution="normal")  # fmt: skip
        out[f"speed_{s}"] = out[f"speed_{s}"] + Estimate.of(0.0, count)
    return out


def _one_of(t: Toleranced, identity: str, k: int) -> Estimate:
    return certified(identity, t, f"torque of segment {k + 1} over the mean of the four")


def scatter(sharing: str, of: Mapping[str, Array]) -> dict[str, Estimate]:
    """Zeros with what the means of speed, torque current and bound over both directions scatter by, together: `of` each
    direction by itself, (n, 3) less their mean. Where i_x is nothing one way noise takes several times as much torque."""
    out = [Estimate.exact(0.0)] * SEEN
    for way, seen in of.items():
        n = len(seen)
        covariance = seen.T @ seen / (n - 1) / n / 4
        scale = np.sqrt(np.diag(covariance))
        scale = np.where(scale > 0, scale, 1.0)
        root = np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-9 * np.eye(SEEN)) * scale[:, None]
        for k in range(SEEN):
            part = Influence(
                id=f"scatter/{sharing}/{way}/{k + 1}", name=f"scatter of the runs, {WORDS[sharing]}, {way} ({k + 1})",
                u=1.0, unit="1",
                kind="A", distribution="normal", dof=float(n - 1), source=f"{n} runs",
            )  # fmt: skip
            for row in range(k, SEEN):
                out[row] = out[row] + Estimate.of(0.0, part) * float(root[row, k])
    return {f"{name}_{sharing}": e for name, e in zip(("speed", "current", "bound"), out, strict=True)}


def _ripples(of: Mapping[str, Shared]) -> dict[str, Estimate]:
    """The speed's ripple by sharing, mean of both directions."""
    out = {}
    for s, name in NAMES.items():
        total = Estimate.exact(0.0, "rad/s")
        for d, way in WAYS.items():
            found = fit.ripple(np.array([w.swings for w in of[s].windows if w.direction == d]))
            n = len(found.off)
            u = math.sqrt(float((found.off**2).sum()) / (n - 1) / n)
            scatter = Influence(id=f"scatter/ripple/{s}/{way}", name=f"scatter of the runs, {way}", u=u, unit="rad/s", kind="A",
                                distribution="normal", dof=float(n - 1))  # fmt: skip
            total = total + Estimate.of(found.size, scatter) * 0.5
        out[f"ripple_{name}"] = total
    return out
