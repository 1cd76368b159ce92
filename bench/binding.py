"""How a controller's own messages are used: data of the rig file, so that a new controller needs no code.

What is left out has the names of docs/reference/protocol.md. A controller whose DBC has no `CommandReply`, `ParamReply`,
`Claim` or `Identity` does without: commands are then judged by the state that follows.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Literal

from bench.messages import MessageMap
from bench.part import Part

if TYPE_CHECKING:
    from bench.rigfile import RigFile

Mode = Literal["OFF", "READY", "LIFTING", "LEVITATED", "SPINNING", "LANDING", "COASTING", "FAULT"]
MODES: tuple[Mode, ...] = ("OFF", "READY", "LIFTING", "LEVITATED", "SPINNING", "LANDING", "COASTING", "FAULT")
COMMANDS = ("ENABLE", "DISABLE", "LEVITATE", "LAND", "SPIN", "STOP", "MAKE_SAFE", "CLEAR_FAULT", "IDENTIFY", "RELEASE")
NEEDED = ("ENABLE", "DISABLE", "LEVITATE", "LAND")


class Binding(Part):
    """Message and signal names, and what a controller's own words mean.

    `telemetry`: the first message carries `sequence` and `tick`, further ones (classic CAN) the low bits of the
    sequence in `counter`. `commands`: our command to values by "Message.signal". `states`: a name in the DBC's value
    table of channel `state` to one of MODES. `no_fault`: names in that of channel `fault` that mean none.
    """

    telemetry: tuple[str, ...] = ("Telemetry",)
    sequence: str = "seq"
    tick: str = "tick"
    counter: str = "count"
    heartbeat: str = "Heartbeat"
    heartbeat_counter: str = "counter"
    commands: Mapping[str, Mapping[str, int | float | str]] = {}
    states: Mapping[str, Mode] = {}
    no_fault: tuple[str, ...] = ("NONE",)

    def command(self, name: str) -> Mapping[str, int | float | str]:
        """Values by "Message.signal" that ask for a command."""
        return self.commands.get(name, {"Command.code": name})

    def mode(self, state: str) -> Mode | None:
        """What a state of the controller amounts to; None for a name that means nothing here."""
        found = self.states.get(state, state)
        return next((m for m in MODES if m == found), None)


def find(messages: MessageMap, path: str) -> str:
    """What is wrong with "Message.signal" ("" if nothing)."""
    message, _, signal = path.partition(".")
    if message not in messages.messages:
        return f"no message {message!r} in the DBC"
    known = [s.name for s in messages[message].signals]
    return "" if signal in known else f"message {message} has no signal {signal!r}; it has {', '.join(known)}"


def problems_of(rig: RigFile, messages: MessageMap) -> Iterator[tuple[str, str, str]]:
    """Key, found and expected of everything in the binding that leads nowhere."""
    b = rig.binding
    key = "devices.controller.binding"
    paths = {f"{key}.sequence": f"{b.telemetry[0]}.{b.sequence}", f"{key}.tick": f"{b.telemetry[0]}.{b.tick}",
             f"{key}.heartbeat": f"{b.heartbeat}.{b.heartbeat_counter}"}  # fmt: skip
    paths |= {f"{key}.telemetry": f"{m}.{b.counter}" for m in b.telemetry[1:]}
    for name in (*NEEDED, *b.commands):
        for path, value in b.command(name).items():
            paths[f"{key}.commands.{name}"] = path
            wrong = find(messages, path)
            message, _, signal = path.partition(".")
            if not wrong and isinstance(value, str) and value not in messages[message].signal(signal).choices.values():
                known = ", ".join(messages[message].signal(signal).choices.values()) or "no names"
                yield f"{key}.commands.{name}", f"{path} = {value!r}", f"a name of its value table: {known}"
    for name in b.commands:
        if name not in COMMANDS:
            yield f"{key}.commands.{name}", "an unknown command", f"one of {', '.join(COMMANDS)}"
    for where, path in paths.items():
        if wrong := find(messages, path):
            yield where, wrong, f"a message and signal of {rig.link.dbc}, or `{where}` set to this controller's own"
    for name in ("state", "fault", "speed"):
        if name not in rig.channels:
            yield f"channels.{name}", "nothing", f"the channel `{name}`: the bench watches it while the machine moves"
    yield from _states(rig, messages, key)


def _states(rig: RigFile, messages: MessageMap, key: str) -> Iterator[tuple[str, str, str]]:
    channel = rig.channels.get("state")
    if channel is None or find(messages, channel.signal):
        return
    message, _, signal = channel.signal.partition(".")
    for state in messages[message].signal(signal).choices.values():
        if rig.binding.mode(state) is None:
            yield f"{key}.states.{state}", "nothing", f"what {state} amounts to: one of {', '.join(MODES)}"
