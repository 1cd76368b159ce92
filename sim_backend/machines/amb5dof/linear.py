"""The AMB stand's y axes with each law, linearised about the centred shaft at standstill, tick by tick: rigid shaft, current
loops, one sample of delay, notch and derivative filters, integrators. Damping and frequency follow from its eigenvalues."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from sim_backend.core import TICK_S
from sim_backend.machines.amb5dof.params import AmbParams
from sim_backend.machines.amb5dof.plant import ccs

Array = npt.NDArray[np.float64]
Feedback = Callable[[Array, Array, Array, float], tuple[Array, Array]]
"""Of filtered readings, their rates, the integrals and the set point of y: references of both bearings, and the integrals
after the tick."""
LAWS = ("pid", "ccs", "cac")
SLOW_HZ, FAST_HZ = 10.0, 250.0  # where the rigid modes are; slower are the integrators, faster the filters
PLANT, APPLIED, PAST, PREVIOUS, FILTERED, SUM, SIZE = 0, 6, 8, 16, 18, 20, 22


def slowest(p: AmbParams, settings: Mapping[str, float], law: str) -> tuple[float, float]:
    """Natural frequency in Hz and damping ratio of the least damped rigid mode; damping is negative where it grows."""
    values = np.linalg.eigvals(matrix(p, settings, law)).astype(complex)
    poles = np.log(values[abs(values) > 1e-6]) / TICK_S
    rigid = [s for s in poles if SLOW_HZ < abs(s) / (2 * math.pi) < FAST_HZ and s.imag > 1.0]
    if not rigid:
        return 0.0, 1.0
    s = min(rigid, key=lambda s: -s.real / abs(s))
    return float(abs(s) / (2 * math.pi)), float(-s.real / abs(s))


def matrix(p: AmbParams, settings: Mapping[str, float], law: str) -> Array:
    """What a tick makes of the state: (22, 22); y, theta, their rates, two currents, two references acting, notch memory
    (eight), last readings, filtered rates and integrals (two each)."""
    tick = loop(p, settings, law)
    return np.array([tick(unit, 0.0) for unit in np.eye(SIZE)]).T


def loop(p: AmbParams, settings: Mapping[str, float], law: str) -> Callable[[Array, float], Array]:
    """One tick: of the state (see `matrix`) and the set point of y."""
    moved, driven = _plant(p, law, settings)
    feedback = _pid(settings) if law == "pid" else _flatness(settings, law)
    notches = [notch(settings[f"notch{k}_hz"], settings[f"notch{k}_q"]) for k in (1, 2)]
    keep = 1 / (1 + 2 * math.pi * settings["derivative_hz"] * TICK_S)
    read = np.array([[1, -p.l_is], [1, p.l_os]]) * np.array([[p.position_gain[0]], [p.position_gain[2]]])

    def tick(x: Array, goal: float) -> Array:
        out = np.zeros(SIZE)
        at = read @ x[PLANT : PLANT + 2]
        for k, (b0, b1, b2, a1, a2) in enumerate(notches):
            past, kept = (
                x[PAST + 4 * k : PAST + 4 * k + 4].reshape(2, 2),
                out[PAST + 4 * k : PAST + 4 * k + 4].reshape(2, 2),
            )
            made = b0 * at + past[0]
            kept[0], kept[1] = b1 * at - a1 * made + past[1], b2 * at - a2 * made
            at = made
        rate = keep * x[FILTERED : FILTERED + 2] + (1 - keep) * (at - x[PREVIOUS : PREVIOUS + 2]) / TICK_S
        reference, out[SUM : SUM + 2] = feedback(at, rate, x[SUM : SUM + 2], goal)
        out[PLANT:APPLIED] = moved @ x[PLANT:APPLIED] + driven @ x[APPLIED:PAST]
        out[APPLIED:PAST], out[PREVIOUS:FILTERED], out[FILTERED:SUM] = reference, at, rate
        return out

    return tick


def _slopes(beta: float, gap: float, xi: float, force: float, law: str, bias: float) -> tuple[float, float]:
    """dF/di and dF/dxi of T (2.4b) where the coils give `force` (positive); i is what both coils change by with opposite
    signs, or the upper one alone."""
    near, far = gap - xi, gap + xi
    if law == "cac":
        upper = near * math.sqrt(force / beta)
        return 2 * beta * upper / near**2, 2 * force / near
    di = ccs(force, beta, gap, xi, bias)
    p, n = bias + di, bias - di
    return 2 * beta * (p / near**2 + n / far**2), 2 * beta * (p**2 / near**3 + n**2 / far**3)


def _plant(p: AmbParams, law: str, settings: Mapping[str, float]) -> tuple[Array, Array]:
    """A tick of shaft and current loops: (6, 6) and (6, 2)."""
    from scipy import linalg  # the other machine starts without it

    span = p.l_ia + p.l_oa
    down, drawn = -p.mass * p.gravity_y, -p.coupling * p.coupling_offset[0]  # the coupling draws at -l_c
    weights = ((down * p.l_oa + drawn * (p.l_oa + p.l_c)) / span, (down * p.l_ia + drawn * (p.l_ia - p.l_c)) / span)
    a = np.zeros((8, 8))
    a[0, 2] = a[1, 3] = 1
    planes = np.array([[1, -p.l_ia], [1, p.l_oa]])
    acts = np.array([[1 / p.mass, 1 / p.mass], [-p.l_ia / p.inertia, p.l_oa / p.inertia]])
    pairs = [_slopes(p.beta[2 * b], p.gap, p.offset[2 * b], weights[b], law, settings["bias"]) for b in (0, 1)]
    per_current, per_place = (np.diag(x) for x in zip(*pairs, strict=True))
    coupling = np.array([1, -p.l_c])
    a[2:4, 0:2] = acts @ per_place @ planes - np.outer([1 / p.mass, -p.l_c / p.inertia], p.coupling * coupling)
    a[2:4, 4:6] = acts @ per_current
    a[4:6, 4:6], a[4:6, 6:8] = -p.amplifier_rate * np.eye(2), p.amplifier_rate * np.eye(2)
    whole = linalg.expm(a * TICK_S)
    return whole[:6, :6], whole[:6, 6:]


def notch(hz: float, q: float) -> tuple[float, float, float, float, float]:
    """b0, b1, b2, a1, a2 of the law's notch filter; none where `hz` is 0."""
    if hz <= 0:
        return 1.0, 0.0, 0.0, 0.0, 0.0
    g = math.tan(math.pi * hz * TICK_S)
    per = 1 / (1 + g / q + g * g)
    return (1 + g * g) * per, 2 * (g * g - 1) * per, (1 + g * g) * per, 2 * (g * g - 1) * per, (1 - g / q + g * g) * per


def _pid(s: Mapping[str, float]) -> Feedback:
    def feedback(at: Array, rate: Array, total: Array, goal: float) -> tuple[Array, Array]:
        error = at - goal
        return total - s["kp"] * error - s["kd"] * rate, total - s["ki"] * TICK_S * error

    return feedback


def _flatness(s: Mapping[str, float], law: str) -> Feedback:
    """T (2.14) to (2.17) and the inversion's slopes on the controller's own idea of the machine."""
    l_ia, l_oa, l_is, l_os = (s[f"model_l_{name}"] for name in ("ia", "oa", "is", "os"))
    span = l_ia + l_oa
    back = np.linalg.inv(np.array([[1, -l_is], [1, l_os]]))
    planes = np.array([[1, -l_ia], [1, l_oa]])
    share = np.linalg.inv(np.array([[1, 1], [-l_ia, l_oa]]))  # forces of the sum and of the moment
    coupling = s["model_coupling"] * np.outer([1, -s["model_l_c"]], [1, -s["model_l_c"]])
    inertia = np.diag([s["model_mass"], s["model_inertia"]])
    weight = -s["model_mass"] * s["model_gravity_y"]
    loads = (weight * l_oa / span, weight * l_ia / span)
    pairs = [
        _slopes(s[f"model_beta_y{b}"], s["model_gap"], s[f"model_offset_y{b}"], load, law, s["bias"])
        for b, load in zip("io", loads, strict=True)
    ]
    per_current, per_place = (np.array(x) for x in zip(*pairs, strict=True))

    def feedback(at: Array, rate: Array, total: Array, goal: float) -> tuple[Array, Array]:
        q = back @ at
        error = q - np.array([goal, 0.0])
        total = total + s["integral"] * TICK_S * error
        v = -s[f"k2_{law}"] * (back @ rate) - s["k1"] * error - s["k0"] * total
        force = share @ (inertia @ v + coupling @ q)
        return (force - per_place * (planes @ q)) / per_current, total

    return feedback
