"""What every make-safe does: it sends commands and takes their answers for progress, and waits while something goes forward."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING

from bench import runlog
from bench.cli.patience import Patience
from bench.cli.witness import Witness
from bench.errors import LinkError, Refused

if TYPE_CHECKING:
    from drivers.controller import Controller

logger = logging.getLogger("bench.make-safe")
SAFE = ("OFF", "FAULT")
GIVE_UP_S = 10.0  # without progress, until the next means
END_S = 3 * GIVE_UP_S  # and until nothing more is waited for
LOOK_S, ASK_S = 0.05, 0.5


def send(controller: Controller, patience: Patience, name: str, slow: Callable[[], bool] | None = None) -> None:
    """A command, which is repeated while `slow`. One that was answered and accepted is progress, however long that took."""
    before = controller.sight.answered_ns
    controller.command(name, slow)
    if controller.sight.answered_ns != before:
        patience.went_on()


def obeyed(controller: Controller, patience: Patience, name: str) -> bool:
    """Send a command to a controller that may be in no state for it; whether it was accepted."""
    try:
        send(controller, patience, name)
    except (Refused, LinkError) as error:
        logger.warning("make safe: %s", error)
        return False
    return True


def until(
    controller: Controller, patience: Patience, seen: Witness, done: Callable[[], bool], limit_s: float, what: str,
    asks: Callable[[], bool] = lambda: False,
) -> None:  # fmt: skip
    """Wait, and say for what, while something goes forward. The state is asked for where telemetry does not tell it, or where
    `asks` says so.

    Raises:
        LinkError: nothing has for so long, or the link is dead.
    """
    while True:
        patience.look()
        seen.look(patience)
        if done():
            return
        if (still := patience.still_s) >= limit_s:
            raise LinkError(f"waited {still:.0f} s for {what}; nothing went forward")
        if (line := patience.line(what, limit_s)) is not None:
            runlog.show(logger, line)
        if not controller.sight.told or asks():
            patience.every(ASK_S, controller.ask_state)
        controller.clock.sleep(LOOK_S)
