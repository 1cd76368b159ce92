"""What a virtual rig truly does in a procedure of motion, where that follows from the plan and not from the machine alone.

The same machine runs without noise and rounding under the same settings; its quantities go by `name@where`, as a
campaign's table names them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from bench.cli.truths import (
    actuator,
    cogging,
    coils,
    decoupling,
    delays,
    emf,
    following,
    friction,
    gate,
    held,
    linear_rotary,
    loads,
    motor,
    one_axis,
    positioned,
    pull,
    reluctance,
    rotor,
    turning,
    weights,
)
from bench.cli.truths.settings import Found
from bench.errors import BenchError
from bench.procedure import Measured
from bench.rigfile.aliases import known_as

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def truth_of_motion(done: Simulated) -> dict[str, float]:
    """By `name@where`; nothing for a procedure whose quantities are the machine's, for a machine that does not tell what
    it does, and where a run gave nothing to compare."""
    of = TRUTHS.get(done.procedure.name)
    try:
        if of is None or not any(isinstance(r, Measured) for r in done.results):
            return {}
        aliases = done.recording.rig.aliases
        return {known_as(aliases, f"{name}@{where}" if where else name): value for name, where, value in of(done)}
    except BenchError:
        return {}


TRUTHS: Mapping[str, Callable[[Any], Found]] = {
    "step": rotor.step,
    "tracking": rotor.tracking,
    "unbalance": rotor.unbalance,
    "compensation": rotor.unbalance,
    "balance": rotor.balance,
    "run-up": rotor.passage,
    "coast-down": rotor.passage,
    "sensitivity": rotor.sensitivity,
    "loop-response": linear_rotary.loops,
    "spindown": motor.spindown,
    "angle-step": motor.angle,
    "maximum-speed": motor.maximum_speed,
    "derivative": one_axis.derivative,
    "load-balancing": motor.circle,
    "estimator-compare": one_axis.compare,
    "load-response": loads.answers,
    "mission": linear_rotary.mission,
    "current-step": linear_rotary.currents,
    "unstable-pole": held.pole,
    "pull-ratio": pull.pulls,
    "actuator-constant": actuator.constants,
    "sensor-delay": delays.probes,
    "emf-constant": emf.constants,
    "cogging-map": cogging.harmonics,
    "runout-map": turning.runout,
    "coil-map": coils.shares,
    "gate-margin": gate.margins,
    "step-following": following.steps,
    "sine-following": following.sines,
    "decoupling": decoupling.crossed,
    "bearing-constant": weights.constants,
    "positioning": positioned.figures,
    "map-zero": reluctance.zeros,
    "inductance-map": reluctance.inductances,
    "static-characteristics": reluctance.statics,
    "axis-friction": friction.of_axes,
    "axis-breakaway": friction.breakaway,
    "axis-inertia": friction.inertia,
}
