"""How a controller's own messages are used: data of the rig file, so that a new controller needs no code.

What is left out has the names of docs/reference/protocol.md. A controller whose DBC has no `CommandReply`, `ParamReply`,
`Claim` or `Identity` does without: commands are then judged by the state that follows.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from bench.rigfile.messages import MessageMap
from bench.rigfile.part import Part

if TYPE_CHECKING:
    pass

Mode = Literal["OFF", "READY", "LIFTING", "LEVITATED", "SPINNING", "LANDING", "COASTING", "HOMING", "HOLDING", "MOVING",
               "STOPPING", "FAULT"]  # fmt: skip
LEVITATION_MODES: tuple[Mode, ...] = (
    "OFF",
    "READY",
    "LIFTING",
    "LEVITATED",
    "SPINNING",
    "LANDING",
    "COASTING",
    "FAULT",
)
STAGE_MODES: tuple[Mode, ...] = ("OFF", "READY", "HOMING", "HOLDING", "MOVING", "STOPPING", "FAULT")
"""Of a machine that does not levitate: its axes are held, or move."""
MODES: tuple[Mode, ...] = tuple(dict.fromkeys((*LEVITATION_MODES, *STAGE_MODES)))
STAGE_HELD: tuple[Mode, ...] = ("HOLDING", "MOVING", "STOPPING")
HELD: tuple[Mode, ...] = ("LEVITATED", "SPINNING", *STAGE_HELD)
"""In which the rotor, or the axes of a stage, are held by their controller."""
UNKNOWN, UNSEEN = "UNKNOWN", "UNSEEN"  # a state that has no name, and one that nothing tells
LEVITATION_COMMANDS = (
    "ENABLE",
    "DISABLE",
    "LEVITATE",
    "LAND",
    "SPIN",
    "STOP",
    "MAKE_SAFE",
    "CLEAR_FAULT",
    "IDENTIFY",
    "RELEASE",
)
STAGE_COMMANDS = ("ENABLE", "DISABLE", "HOME", "HOLD", "MOVE", "STOP", "LET_GO", "MAKE_SAFE", "CLEAR_FAULT", "IDENTIFY",
                  "RELEASE")  # fmt: skip
COMMANDS = tuple(dict.fromkeys((*LEVITATION_COMMANDS, *STAGE_COMMANDS)))


class Binding(Part):
    """Message and signal names, and what a controller's own words mean.

    `telemetry`: the first message carries `sequence` and `tick`, further ones (classic CAN) the low bits of the
    sequence in `counter`. `commands`: our command to values by "Message.signal". `states`: a name in the DBC's value
    table of channel `state` to one of MODES. `no_fault`: names in that of channel `fault` that mean none. `samples`: whether a
    sample of positions and currents is the mean of the readings of its period, or its last reading; either ends a tick before
    the sample's time.
    """

    telemetry: Annotated[tuple[str, ...], Field(min_length=1)] = ("Telemetry",)
    sequence: str = "seq"
    tick: str = "tick"
    counter: str = "count"
    heartbeat: str = "Heartbeat"
    heartbeat_counter: str = "counter"
    commands: Mapping[str, Mapping[str, int | float | str]] = {}
    states: Mapping[str, Mode] = {}
    no_fault: tuple[str, ...] = ("NONE",)
    samples: Literal["mean", "reading"] = "mean"

    def command(self, name: str) -> Mapping[str, int | float | str]:
        """Values by "Message.signal" that ask for a command."""
        return self.commands.get(name, {"Command.code": name})

    def knows(self, name: str, messages: MessageMap) -> bool:
        """Whether the controller has a command: one that the rig file states, or one of the protocol's own."""
        if name in self.commands:
            return True
        command = messages.messages.get("Command")
        return command is not None and any(s.name == "code" and name in s.choices.values() for s in command.signals)

    def mode(self, state: str) -> Mode | None:
        """What a state of the controller amounts to; None for a name that means nothing here."""
        found = self.states.get(state, state)
        return next((m for m in MODES if m == found), None)
