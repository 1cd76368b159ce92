"""Which ways a plan sweeps: from where to where, how fast, by which parameters of the controller."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bench.rigfile import RigFile
from procedures.cogging_map.plan import Plan
from procedures.position_loops.injection import ability
from procedures.position_loops.motors import around, electrical_turn, motors

HARMONICS = 3  # of cogging that are fitted; the third is looked for and should not be there


@dataclass(frozen=True)
class Way:
    """A map of a loop: it begins at `low` and is `length` m or rad long, of which each of `turns` whole turns of the current's
    phase has `per` periods of cogging; `lead` is gone on either side, at `speed`. Parameters: the set point, its `rate`, and
    `feedforward` of every motor (none: the controller has none)."""

    loop: str
    low: float
    length: float
    turns: int
    per: int
    lead: float
    speed: float
    set_point: str
    rate: str
    feedforward: tuple[str, ...]

    @property
    def ends(self) -> tuple[float, float]:
        """Set points between which it is swept."""
        return self.low - self.lead, self.low + self.length + self.lead

    @property
    def seconds(self) -> float:
        """Of one sweep."""
        return (self.length + 2 * self.lead) / self.speed

    @property
    def first(self) -> int:
        """Periods of cogging on the map."""
        return self.turns * self.per

    @property
    def signals(self) -> tuple[int, ...]:
        """Periods on the map of each harmonic of cogging."""
        return tuple(k * self.first for k in range(1, HARMONICS + 1))

    @property
    def orders(self) -> tuple[int, ...]:
        """Those, and of what else is there: once and twice the map (a shaft out of round), once and twice a turn of
        the phase (offsets and gains of the coils' sensors)."""
        others = {1, 2, self.turns, 2 * self.turns} - set(self.signals)
        return (*self.signals, *sorted(others))

    def period_s(self, harmonic: int) -> float:
        """Of a harmonic of cogging, at its speed."""
        return self.length / (harmonic * self.first) / self.speed


def loops(rig: RigFile, plan: Plan) -> tuple[str, ...]:
    """Those that the plan wants, of all that are known and are moved by a set point."""
    motion = rig.capabilities.motion
    known = dict.fromkeys(one.loop for one in rig.capabilities.force_currents.values() if one.cogging)
    channels = () if motion is None else (motion.place_channel, motion.angle_channel)
    moved = [x for x in known if ability(rig).loops[x].channel in channels]
    return tuple(x for x in moved if plan.loops == "all" or around(rig, x) == (plan.loops == "around"))


def way(rig: RigFile, plan: Plan, loop: str) -> Way:
    """The map of a loop."""
    driving, motion = motors(rig, loop), rig.capabilities.motion
    assert motion is not None
    name, one = next(iter(driving.items()))
    turn, turns_round = electrical_turn(rig, name).value, around(rig, loop)
    length = plan.turns_around * 2 * math.pi if turns_round else plan.turns_along * turn
    fed = tuple(dict.fromkeys(m.feedforward for m in driving.values() if m.feedforward))
    return Way(
        loop=loop,
        low=plan.from_rad if turns_round else plan.from_m,
        length=length,
        turns=round(length / turn),
        per=one.cogging,
        lead=plan.lead * length,
        speed=plan.speed_rad_s if turns_round else plan.speed_m_s,
        set_point=motion.angle if turns_round else motion.place,
        rate=motion.angle_rate if turns_round else motion.place_rate,
        feedforward=fed,
    )


def fed(plan: Plan, one: Way) -> tuple[bool, ...]:
    """With the feedforward, and without where it is asked for and there is any."""
    return (True, False) if plan.feedforward == "both" and one.feedforward else (True,)
