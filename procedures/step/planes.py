"""Do the readings of the two planes belong to the bearings that they are told of? Whose currents answer them, while the shaft
rests before each step.

What a bearing's currents do at rest is mostly the controller's answer to the noise and the small motions that its own plane's
probes see: of a plane's samples (this one and the two before it) some 60 to 70 % of the variance of its own bearing's control
current follows by least squares, and some 0 to 13 % of the other bearing's. The excess of the own over the other, of both
bearings together, is found for each step alone from fits to all of them; steps are independent. Its mean over its standard
uncertainty is held against Student's t: where neither plane is nearer to either bearing, a finding comes by chance with
FALSE_ALARM, and with a sound stand, which is 25 standard uncertainties and more from there, never.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.recording import Recording, Step
from bench.rigfile.roles import ANGLE, SPEED
from procedures.amb_rotor.conventions import conventions
from procedures.step import capturing
from procedures.step.steps import ORDERS, STEP, TURNING_RAD_S
from procedures.step.turning import marked

Array = npt.NDArray[np.float64]
FALSE_ALARM = 1e-4
BACK = 3  # samples of a reading that a current can answer
FEWEST = 50  # samples of a step's rest


def find_exchanged(recording: Recording[Any]) -> Iterator[Finding]:
    """A finding for each axis whose readings of the two planes answer for each other's bearings."""
    for axis in dict.fromkeys(str(s.labels["axis"]) for s in recording.steps(STEP)):
        steps = [s for s in recording.steps(STEP) if s.labels["axis"] == axis]
        alike: dict[tuple[str, float], list[Step]] = {}
        for step in steps if axis != "x" else ():
            alike.setdefault((str(step.labels["setting"]), float(step.labels["speed_rad_s"])), []).append(step)
        if any(is_crossed([read_rest(step, axis) for step in of]) for of in alike.values()):
            text = (
                f"while the shaft rests, the {axis} currents of each bearing answer the readings of the other plane: "
                f"readings or currents of {axis} are exchanged between the planes."
            )
            yield Finding("planes-exchanged", text, axis, Effect.ERROR)


def read_rest(step: Step, axis: str) -> Array:
    """Before a step, without what turns with the shaft: readings (m) and control currents (A) of both planes, (4, n)."""
    machine = conventions(step.recording.rig)
    along = machine.along(axis)
    places, pairs = [machine.position(a) for a in along], [machine.pair(a) for a in along]
    names = (*places, *(name for pair in pairs for name in pair), *marked(step.recording.rig))
    data = capturing.read(step, names)
    written = [e["t_ns"] for e in step.recording.events("parameter")
               if e["name"] in machine.point(axis, 0.0) and step.start_ns <= e["t_ns"] < step.end_ns]  # fmt: skip
    rest = data["t_ns"] <= (written[0] if written else step.start_ns)
    x = np.array([*(data[name] for name in places), *(data[p] - data[n] for p, n in pairs)])[:, rest]
    t, phase = np.linspace(-1, 1, x.shape[1]), np.unwrap(data[ANGLE][rest])
    turning = rest.any() and float(np.median(data[SPEED][rest])) > TURNING_RAD_S
    orders = [f(n * phase) for n in ORDERS for f in (np.cos, np.sin)] if turning else []
    design = np.array([np.ones_like(t), t, *orders]).T
    return np.asarray(x - (design @ np.linalg.lstsq(design, x.T, rcond=None)[0]).T)


def is_crossed(steps: Sequence[Array]) -> bool:
    """Of steps at rest (4, n): whether the currents answer the other plane, and do so beyond chance."""
    from scipy.special import stdtrit

    used = [x for x in steps if x.shape[1] >= FEWEST]
    if len(used) < 3:
        return False
    excess = np.zeros(len(used))
    for bearing in range(2):
        currents = [x[2 + bearing, BACK - 1 :] for x in used]
        total = float(np.mean([c @ c for c in currents]))
        if total == 0:
            return False
        own, other = (_left(used, currents, plane) for plane in (bearing, 1 - bearing))
        excess += (other - own) / total / 2
    u = float(excess.std(ddof=1)) / len(used) ** 0.5
    return bool(excess.mean() < -float(stdtrit(len(used) - 1, 1 - FALSE_ALARM)) * u)


def _left(steps: Sequence[Array], currents: Sequence[Array], plane: int) -> Array:
    """Of each step, the sum of squares that a plane's readings leave of a bearing's current."""
    past = [np.array([x[plane, BACK - 1 - k : x.shape[1] - k] for k in range(BACK)]).T for x in steps]
    terms = np.linalg.lstsq(np.concatenate(past), np.concatenate(currents), rcond=None)[0]
    return np.array([float(((c - p @ terms) ** 2).sum()) for c, p in zip(currents, past, strict=True)])
