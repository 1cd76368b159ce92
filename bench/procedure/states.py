"""Transitions between rig states: the one place that knows their order.

OFF -> READY -> LEVITATED -> SPINNING and back. Levitation is not released while the rotor turns above the landing speed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from bench.procedure.rig import Rig
from bench.procedure.roles import RigState

ORDER = (RigState.OFF, RigState.READY, RigState.LEVITATED, RigState.SPINNING)


def transition(rig: Rig, target: RigState) -> None:
    """Bring the rig to a state, step by step; nothing happens when it is there.

    SPINNING is reached by a procedure that sets a speed; asking for it here means LEVITATED at least.
    """
    goal = min(ORDER.index(target), ORDER.index(RigState.LEVITATED))
    while (here := ORDER.index(rig.levitation.state)) != goal:
        if here > goal:
            _down(rig, ORDER[here])
        elif ORDER[here] is RigState.OFF:
            rig.levitation.enable()
        else:
            rig.levitation.levitate()
        if here < goal and ORDER.index(rig.levitation.state) <= here:
            raise RuntimeError(f"the rig stays in {ORDER[here]}")
        if here == ORDER.index(RigState.SPINNING) and goal == ORDER.index(RigState.LEVITATED):
            continue


def _down(rig: Rig, here: RigState) -> None:
    if here is RigState.SPINNING:
        rig.rotation.stop()
    elif here is RigState.LEVITATED:
        rig.rotation.stop()
        rig.levitation.land()
    else:
        rig.levitation.disable()


@contextmanager
def within_reach(rig: Rig) -> Iterator[None]:
    """Where an operator works on the machine: one with a DC link is landed and switched off before, since nobody is asked to
    touch it else (`bench.cli.touching`), and is back in its state afterwards; any other stays as it is."""
    before = rig.levitation.state
    if rig.file.capabilities.dc_link is not None:
        transition(rig, RigState.OFF)
    yield
    transition(rig, before)
