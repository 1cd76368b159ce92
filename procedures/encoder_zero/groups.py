"""What is stepped, in which order, how long it takes: motors of one loop share what it asks for, and are looked at together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.capabilities_of_loops import CurrentStep, ForceCurrent, InjectedLoop
from procedures.encoder_zero.plan import Plan
from procedures.position_loops.injection import USUAL_HZ, ability
from procedures.position_loops.motors import electrical_turn
from procedures.shared.rates import rate_of

ALONG, ACROSS = "along", "across"
PLACES = 2  # a quarter of an electrical turn apart: there currents of unequal gains turn the other way
UNKNOWN_S = 0.25  # of a loop whose gains the rig file does not tell
STIFFER = (0.8, 1.0, 1.2)  # by which cogging may change the stiffness of a loop


@dataclass(frozen=True)
class Group:
    """Motors that one position loop drives by one reference."""

    loop: str
    motors: tuple[str, ...]

    @property
    def stepped(self) -> tuple[tuple[str, str], ...]:
        """Motor and way of each current: along the field of all, across it of all but the last. These are as many as there are
        unknowns: two of each motor, up to a scale."""
        return (*((m, ALONG) for m in self.motors), *((m, ACROSS) for m in self.motors[:-1]))


@dataclass(frozen=True)
class Setting:
    """A current of one sign at a place: `trial` is the motor whose zero is changed meanwhile, nothing where none is."""

    loop: str
    place: int
    trial: str
    motor: str
    way: str
    repeat: int
    sign: int


def zeros(rig: RigFile) -> dict[str, ForceCurrent]:
    """By motor, those whose zero the controller keeps and whose current along the field it steps."""
    return {name: one for name, one in rig.capabilities.force_currents.items() if one.along and one.zero}


def step_of(rig: RigFile, motor: str) -> CurrentStep:
    """The current along the field of a motor."""
    return rig.capabilities.current_steps[zeros(rig)[motor].along]


def loop_of(rig: RigFile, loop: str) -> InjectedLoop:
    """A position loop.

    Raises:
        Lacking: the rig file tells of none.
    """
    return ability(rig).loops[loop]


def groups(rig: RigFile, plan: Plan | None = None) -> tuple[Group, ...]:
    """Those of the plan's motors, each whole: one motor alone of several would not tell its zero. All without a plan."""
    known = zeros(rig)
    wanted = {known[m].loop for m in (plan.motors if plan is not None else ()) or known if m in known}
    loops = [loop for loop in dict.fromkeys(one.loop for one in known.values()) if loop in wanted]
    return tuple(Group(loop, tuple(m for m, one in known.items() if one.loop == loop)) for loop in loops)


def parameter_of(rig: RigFile, motor: str, way: str) -> str:
    """What steps a current."""
    return step_of(rig, motor).parameter if way == ALONG else zeros(rig)[motor].added


def captured(rig: RigFile, group: Group) -> tuple[str, ...]:
    """Channels of a capture: where the mover stands, and both currents of each motor."""
    steps = [step_of(rig, m) for m in group.motors]
    return (loop_of(rig, group.loop).channel, *(c for s in steps for c in (s.along, s.across)))


def set_point(rig: RigFile, loop: str) -> str:
    """The parameter that sends the mover along a loop.

    Raises:
        Lacking: the rig file tells of none.
    """
    at, channel = rig.capabilities.motion, loop_of(rig, loop).channel
    for name, shown in () if at is None else ((at.place, at.place_channel), (at.angle, at.angle_channel)):
        if shown == channel:
            return name
    raise Lacking(f"capabilities.motion: found no set point that {channel} follows")


def target(rig: RigFile, group: Group, place: int) -> float:
    """Where the mover is sent, m or rad."""
    period = electrical_turn(rig, group.motors[0]).value
    return rig.parameters[set_point(rig, group.loop)].default + place * period / (2 * PLACES)


def slowest_s(rig: RigFile, loop: str) -> float:
    """The longest time constant of a position loop by its gains, s: of M s^3 + k_D s^2 + k_P s + k_I, cogging stiffening or
    softening it; k_P/k_I where the rig file does not tell what it moves."""
    one = loop_of(rig, loop)
    kp, ki, kd = (rig.parameters[n].default if n in rig.parameters else 0.0 for n in (one.kp, one.ki, one.kd))
    if not kp or not ki:
        return UNKNOWN_S
    table, _, name = one.inertia.partition("/")
    moved = rig.machine[name].value * one.share if table == "machine" and name in rig.machine else 0.0
    rates = [max(np.roots([moved, kd, k * kp, ki]).real) for k in STIFFER if moved]
    return float(max([-1 / r for r in rates if r < 0], default=kp / ki))


def settle_s(rig: RigFile, plan: Plan, group: Group) -> float:
    """Waited for after each step."""
    return max(plan.least_s, plan.time_constants * slowest_s(rig, group.loop))


def rate(rig: RigFile, plan: Plan) -> float:
    """Of captures, Hz."""
    return rate_of(rig, plan.rate_hz, USUAL_HZ)


def settings_of(group: Group, place: int, trial: str, repeats: int) -> Iterator[Setting]:
    """Of each current + and -, - and +, and so on: what drifts evenly is in neither."""
    for motor, way in group.stepped:
        for repeat in range(repeats):
            for sign in (1, -1) if repeat % 2 == 0 else (-1, 1):
                yield Setting(group.loop, place, trial, motor, way, repeat, sign)


TRIAL_REPEATS = 1


def count(rig: RigFile, plan: Plan) -> int:
    """How many currents are set."""
    of = groups(rig, plan)
    once = sum(2 * len(g.stepped) * PLACES * plan.repeats for g in of)
    return once + (sum(2 * len(g.stepped) * len(g.motors) * TRIAL_REPEATS for g in of) if plan.trial_rad else 0)
