"""Transitions between rig states: the one place that knows their order.

OFF -> READY -> LEVITATED -> SPINNING and back; of a machine that does not levitate, OFF -> READY -> HELD -> MOVING and back.
Levitation is not released while the rotor turns above the landing speed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from bench.procedure.rig import Rig
from bench.procedure.roles import RigState

LEVITATION = (RigState.OFF, RigState.READY, RigState.LEVITATED, RigState.SPINNING)
STAGE = (RigState.OFF, RigState.READY, RigState.HELD, RigState.MOVING)
ENABLED, CARRIED, DRIVEN = 1, 2, 3
"""Places in either order: ready, held, and on the move."""


def transition(rig: Rig, target: RigState) -> None:
    """Bring the rig to a state, step by step; nothing happens when it is there.

    SPINNING and MOVING are reached by a procedure that sets a speed or a wave; asking for them here means that the machine is
    held at least.
    """
    order = STAGE if rig.motion is not None else LEVITATION
    goal = min(order.index(target), CARRIED)
    while (here := order.index(rig.levitation.state)) != goal:
        if here > goal:
            _down(rig, here)
        else:
            _up(rig, here)
        if here < goal and order.index(rig.levitation.state) <= here:
            raise RuntimeError(f"the rig stays in {order[here]}")


def _up(rig: Rig, here: int) -> None:
    if here < ENABLED:
        rig.levitation.enable()
    elif rig.motion is not None:
        rig.motion.home()
        rig.motion.hold()
    else:
        rig.levitation.levitate()


def _down(rig: Rig, here: int) -> None:
    if here == ENABLED:
        rig.levitation.disable()
    elif rig.motion is not None:
        if here == DRIVEN:
            rig.motion.stop()
        else:
            rig.motion.let_go()
    else:
        rig.rotation.stop()
        if here == CARRIED:
            rig.levitation.land()


@contextmanager
def within_reach(rig: Rig) -> Iterator[None]:
    """Where an operator works on the machine: one with a DC link is landed and switched off before, since nobody is asked to
    touch it else (`bench.cli.touching`), and is back in its state afterwards; any other stays as it is."""
    before = rig.levitation.state
    if rig.file.capabilities.dc_link is not None:
        transition(rig, RigState.OFF)
    yield
    transition(rig, before)
