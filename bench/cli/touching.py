"""Before anybody is asked to reach into a machine: what it must be, and what they are told of it.

A DC link keeps its charge when the amplifiers are off. So nobody is asked to touch a machine with one before its voltage was
read below the bound twice, at instants of the controller's own clock that lie apart: a reading that is repeated, or that was
left behind when telemetry ended, says nothing of the present.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING

from bench import runlog
from bench.errors import InterlockError, NotDischarged
from bench.rigfile.capabilities_of_power import DcLink

if TYPE_CHECKING:
    from drivers.controller import Controller

logger = logging.getLogger("bench.touching")
APART_NS = 200_000_000  # at least, between the two readings
FRESH_NS = 500_000_000  # how old the last of them may be
PATIENCE = 3.0  # times what the link may take
LOOK_S = 0.05
TOLD_S = 2.0  # from line to line of what is waited for
STANDS = {
    "READY": "The amplifiers are on.",
    "LEVITATED": "The shaft levitates and the amplifiers are on: touch nothing but what you are asked to.",
    "SPINNING": "The shaft levitates and may turn, and the amplifiers are on: touch nothing but what you are asked to.",
    "HOLDING": "The axes are held and the amplifiers are on: touch nothing but what you are asked to.",
}
MOVES = "The shaft may move, and the amplifiers are on: touch nothing but what you are asked to."


def standing(controller: Controller) -> Callable[[], str]:
    """What a person is told of a machine that is on; nothing of one that is off."""

    def told() -> str:
        mode = controller.mode
        return "" if mode == "OFF" else STANDS.get(mode, MOVES)

    return told


def approach(controller: Controller) -> Callable[[], str]:
    """What waits until the DC link is discharged, and tells by what that was seen; nothing for a rig file without one.

    The returned function raises:
        InterlockError: the machine is not off.
        NotDischarged: its DC link was not seen below the bound in time.
    """
    link = controller.rig.capabilities.dc_link

    def seen() -> str:
        if link is None:
            return ""
        controller.require_landed()
        if controller.mode != "OFF":
            raise InterlockError(
                f"nobody may touch the machine in state {controller.mode}: its DC link is fed. Next: switch it off first"
            )
        volts = _discharged(controller, link)
        return f"The machine is off and its shaft lies; the DC link reads {volts:.0f} V, below {link.safe:g} V."

    return seen


def _discharged(c: Controller, link: DcLink) -> float:
    """The voltage, once it is below the bound and was before."""
    begun, low, told = c.clock.now_ns(), None, c.clock.now_ns()
    while True:
        if c.mode != "OFF":
            raise InterlockError(
                f"nobody may touch the machine: it went into state {c.mode} while its DC link discharged"
            )
        at, volts, now = c.telemetry.newest_ns, c.reading(link.channel), c.clock.now_ns()
        if at <= begun or not abs(volts) < link.safe:  # NaN is no voltage below it
            low = None
        elif low is None:
            low = at
        if low is not None and at - low >= APART_NS and now - at <= FRESH_NS:
            return volts
        if (now - begun) * 1e-9 > PATIENCE * link.discharged_s:
            raise NotDischarged(_why(link, volts, (now - begun) * 1e-9))
        if (now - told) * 1e-9 > TOLD_S:
            told = now
            runlog.show(logger, f"wait for the DC link: {volts:.0f} V; it must read below {link.safe:g} V")
        c.clock.sleep(LOOK_S)


def _why(link: DcLink, volts: float, waited_s: float) -> str:
    return (
        f"DC link ({link.channel}): found {volts:.0f} V {waited_s:.0f} s after the machine was seen off; expected two "
        f"readings below {link.safe:g} V within {link.discharged_s:g} s. Nobody was asked to touch it. Next: keep hands away, "
        "wait until it reads less or discharge it as its manual says, and look at what discharges it"
    )
