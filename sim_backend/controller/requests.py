"""What hosts ask of the simulated controller, by the messages of its DBC: those of docs/reference/protocol.md by their names,
and any others as the rig file binds them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

from bench.link.codec import Decoder
from bench.rigfile import RigFile
from bench.rigfile.binding import COMMANDS
from bench.rigfile.capture import MESSAGES as CAPTURES
from bench.rigfile.messages import MessageMap
from sim_backend.controller.asked import Asked, Recogniser, met, wanted
from sim_backend.controller.capture_port import CapturePort
from sim_backend.controller.meanings import state_codes
from sim_backend.controller.ownership import Ownership
from sim_backend.controller.parameters import Parameters
from sim_backend.controller.states import States

MAP_VERSION: Final = 2
THE_HOST: Final = 1  # session of a host whose messages have none
ANY_NUMBER: Final = ("ParamSet", "CaptureArm")  # refused by what they ask for, where that is not a number
Tell = Callable[[str, Mapping[str, float]], None]
Values = dict[str, float]


class Requests:
    """Takes the messages of hosts at the plant's present.

    In a message with parameters and commands the parameters come first. A parameter that is a signal is written when the
    signal says other than what is in force; outside its range, or where it may not be written now, it stays. While SPIN is
    what was obeyed last and stands, another `speed_ref` acts at once: nothing else could ask for it.

    Args:
        rig: with binding and parameters.
        messages: the device's own map.
        tick: tells the plant's.
    """

    def __init__(
        self, rig: RigFile, messages: MessageMap, tick: Callable[[], int], owner: Ownership, parameters: Parameters,
        states: States, captures: CapturePort | None,
    ) -> None:  # fmt: skip
        self._binding, self._map, self._tick = rig.binding, messages, tick
        self._owner, self._parameters, self._states, self._captures = owner, parameters, states, captures
        there = messages.messages
        known = [n for n in COMMANDS if rig.binding.knows(n, messages)]
        replied = {n for n in known if "CommandReply" in there and _by_command(rig.binding.command(n), messages)}
        self._codes = {n: wanted(rig.binding.command(n), messages) for n in known if n in replied}
        self._asked, self._commands = Asked(rig, messages), Recogniser(rig, messages, frozenset(replied))
        self._spinning = False
        handlers: dict[str, Callable[[Values, Tell], None]] = {
            name: partial(self._bound, name) for name in sorted(self._asked.messages | self._commands.messages)
        }
        handlers |= {"ParamSet": self._set, "ParamGet": self._get, "Claim": self._claim}
        handlers |= {"Command": self._command} if replied else {}
        handlers |= {name: partial(self._capture, name) for name in CAPTURES[:4] if captures is not None}
        handlers[rig.binding.heartbeat] = self._heartbeat
        stated = rig.devices["controller"].map_version  # it is that rig's controller, whichever map that has
        self._map_version = MAP_VERSION if stated is None else stated
        self._handlers = {
            there[n].identifier: (Decoder(there[n]), handler) for n, handler in handlers.items() if n in there
        }

    @property
    def hears(self) -> frozenset[int]:
        """Identifiers of the messages that it takes."""
        return frozenset(self._handlers)

    def take(self, identifier: int, data: bytes, tell: Tell) -> None:
        """A message of a host; one of another length than the DBC's is none. `tell` sends an answer."""
        if identifier not in self._handlers:
            return
        decoder, handler = self._handlers[identifier]
        if len(data) != decoder.message.length:
            return
        values, name = decoder.decode_one(data), decoder.message.name
        if all(map(math.isfinite, values.values())) or name in ANY_NUMBER or name in self._asked.messages:
            handler(values, tell)

    def _session(self, v: Mapping[str, float]) -> int:
        """Whose message it is: one that does not say so is the owner's, or of a host without a name."""
        return int(v["session"]) if "session" in v else self._owner.session or THE_HOST

    @property
    def _resting(self) -> bool:
        return self._states.at_rest

    def _heartbeat(self, v: Values, _: Tell) -> None:
        whose = int(v["session"]) if "session" in v else None
        self._owner.beat(whose, int(v[self._binding.heartbeat_counter]), self._tick())

    def _claim(self, v: Values, tell: Tell) -> None:
        tell("Owner", self._owner.claim(v, self._tick(), self._resting))

    def _bound(self, message: str, v: Values, _: Tell) -> None:
        """A message of the controller's own: parameters first, then the commands that are newly recognised."""
        session, tick = self._session(v), self._tick()
        changes = self._asked.changes(message, v, self._parameters.values)
        commands = self._commands.take(message, v)
        if not (changes or commands) or not self._owner.takes(session, tick, self._resting):
            return
        before = self._parameters.own["speed_ref"]
        for name, value in changes.items():
            self._parameters.set(name, value, True, self._states.resting)
        for name in commands:
            self._obey(name)
        if self._spinning and self._parameters.own["speed_ref"] != before and "SPIN" in self._commands.standing:
            self._states.obey("SPIN")

    def _obey(self, name: str) -> bool:
        if name == "IDENTIFY":
            return True
        obeyed = self._states.obey(name)
        self._spinning = name == "SPIN" if obeyed else self._spinning
        return obeyed

    def _command(self, v: Values, tell: Tell) -> None:
        """The protocol's Command, which is answered."""
        given = {f"Command.{signal}": value for signal, value in v.items()}
        name = next((n for n, w in self._codes.items() if met(w, given)), "")
        if not name:
            status = "UNKNOWN"
        elif not self._owner.takes(self._session(v), self._tick(), self._resting):
            status = "WRONG_SESSION"
        elif name == "IDENTIFY" or not (status := self._owner.repeated("Command", v)):
            status = "OK" if self._states.obey(name) else "WRONG_STATE"
            if name not in ("IDENTIFY", "RELEASE"):  # which is answered whole each time, and which ends the owner
                self._owner.answered("Command", v, status)
        if name == "IDENTIFY" and status == "OK":
            tell("Identity", {"protocol": 1, "map_version": self._map_version, "serial": 0})
        echoed: Values = {str(signal): v[signal] for signal in ("code", "token") if signal in v}
        tell("CommandReply", {**echoed, "status": self._status("CommandReply", status), "state": self._state()})

    def _set(self, v: Values, tell: Tell) -> None:
        index = int(v["index"])
        mine = self._owner.may_write(int(v["session8"])) if "session8" in v else True
        answer = self._parameters.write(index, v["value"], mine, self._states.resting)
        self._reply(index, answer, v, tell)

    def _get(self, v: Values, tell: Tell) -> None:
        index = int(v["index"])
        self._reply(index, self._parameters.read(index), v, tell)

    def _reply(self, index: int, answer: tuple[str, float], v: Values, tell: Tell) -> None:
        status = self._status("ParamReply", answer[0])
        tell("ParamReply", {"index": index, "status": status, "token": v.get("token", 0), "value": answer[1]})

    def _capture(self, message: str, v: Values, tell: Tell) -> None:
        assert self._captures is not None
        self._captures.receive(message, v, self._tick(), self._owner, self._resting, tell)

    def _status(self, message: str, name: str) -> int:
        """The code of a status; of one that the DBC does not name the first that is not OK."""
        choices = self._map[message].signal("status").choices
        codes = {said: code for code, said in choices.items()}
        return codes.get(name, min((c for c, said in choices.items() if said != "OK"), default=1))

    def _state(self) -> int:
        known = {s.name: s for s in self._map["CommandReply"].signals}
        return state_codes(self._binding, known["state"].choices)[self._states.state] if "state" in known else 0


def _by_command(binding: Mapping[str, int | float | str], messages: MessageMap) -> bool:
    """Whether a command is asked for by the protocol's Command alone, with a code that the DBC has."""
    try:
        return (
            bool(binding) and {p.partition(".")[0] for p in binding} == {"Command"} and bool(wanted(binding, messages))
        )
    except KeyError:
        return False
