"""What is asked of a controller: commands and parameters, by the messages of the rig file, recorded, read back."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

from bench import units
from bench.errors import BenchError, NoReply, Refused
from bench.link.session import Session
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.envelope import Envelope
from drivers.dialogue import Dialogue, commanded, status_of

logger = logging.getLogger("drivers.orders")
STANDING = {"OFF": "DISABLE", "READY": "ENABLE"}
"""Commands that keep a state as it is."""
EFFECTS = {"LAND": ("LANDING", "COASTING", "READY"), "DISABLE": ("OFF",)}
"""States that a command leads to; of one that is sent under a condition, and so not repeated once its effect is seen."""


class Orders:
    """Commands and parameters. `mode` tells the controller's, `wait` lets the clock run until something is true."""

    def __init__(
        self, rig: RigFile, dialogue: Dialogue, session: Session, envelope: Envelope, mode: Callable[[], str],
        wait: Callable[..., None],
    ) -> None:  # fmt: skip
        self.rig, self._dialogue, self._session, self._envelope = rig, dialogue, session, envelope
        self._mode, self._wait = mode, wait
        self._commanded: set[str] = set()  # messages that a command was sent by
        self.recorder: Recorder | None = None
        for p in rig.parameters.values():
            if p.signal:
                message, _, signal = p.signal.partition(".")
                dialogue.hold(message, signal, self._raw(p.signal, p.default))

    def write(self, values: Mapping[str, float]) -> None:
        """Write parameters (SI) and check what the controller reads back. Those that are signals of one message go in one
        message, at the place of the first of them; the others one after the other.

        Raises:
            InterlockError: the envelope refuses one; nothing was sent.
            Refused: the controller refuses, or reads back something else.
            BenchError: the controller cannot be told now.
            NoReply: it does not answer.
        """
        for parameter, value in values.items():
            self._envelope.check_parameter(parameter, value)
        for message, of_one in self._by_message(values):
            if message:
                self._write_signals(message, of_one)
                continue
            for parameter, value in of_one.items():
                self._write_indexed(parameter, value)

    def _by_message(self, values: Mapping[str, float]) -> list[tuple[str, dict[str, float]]]:
        """Values with the message whose signals they are; "" for those that are asked by their index."""
        out: list[tuple[str, dict[str, float]]] = []
        for parameter, value in values.items():
            message = (self.rig.parameters[parameter].signal or "").partition(".")[0]
            there = next((of_one for name, of_one in out if name == message and message), None)
            if there is None:
                out.append((message, {parameter: value}))
            else:
                there[parameter] = value
        return out

    def _write_signals(self, message: str, values: Mapping[str, float]) -> None:
        signals = {}
        for parameter, value in values.items():
            p = self.rig.parameters[parameter]
            assert p.signal
            if p.when == "resting" and self._mode() not in STANDING:  # nobody answers: the refusal must be ours
                raise BenchError(f"parameter {parameter} can be written at rest only; the controller is {self._mode()}")
            signals[p.signal.partition(".")[2]] = self._raw(p.signal, value)
        standing, at = self._standing(message), None
        for parameter, value in values.items():
            at = self._tell(parameter, value, at)  # they go together, whatever the computer does meanwhile
        self._send_held(message, {**standing, **signals})

    def _write_indexed(self, parameter: str, value: float) -> None:
        self._tell(parameter, value)
        p = self.rig.parameters[parameter]
        request = {"index": float(p.index or 0), "value": value}
        if any(s.name == "session8" for s in self.rig.messages["ParamSet"].signals):
            request["session8"] = self._session.low_byte
        reply = self._dialogue.ask("ParamSet", request, "ParamReply", f"the reply to {parameter}", self._wait)
        status = status_of(self.rig.messages["ParamReply"], reply)
        if status != "OK":
            raise Refused(
                f"the controller refuses {parameter} = {value:g} {p.unit}: {status} in state {self._mode()}; in force is "
                f"{reply['value']:g} {p.unit}"
            )
        if not _reads_back(reply["value"], value):
            raise Refused(f"{parameter}: wrote {value!r}, the controller reads back {reply['value']!r}")

    def _tell(self, parameter: str, value: float, at_ns: int | None = None) -> int | None:
        if self.recorder is None:
            return None
        return self.recorder.event("parameter", t_ns=at_ns, name=parameter, value=value)

    def restore(self) -> tuple[str, ...]:
        """Set every parameter that another host left elsewhere to the rig file's value, at rest; the names of those.
        A controller that cannot be asked is taken at its word.

        Raises:
            NoReply: it does not answer.
            Refused: it refuses.
        """
        if not self._dialogue.has("ParamGet") or self._mode() not in STANDING:
            return ()
        asked = {p.index: (name, p) for name, p in self.rig.parameters.items() if p.index is not None}
        found = self._dialogue.ask_all(
            "ParamGet", [{"index": float(i)} for i in asked], "ParamReply", "index", self._wait
        )
        other = []
        for index, (name, p) in asked.items():
            reply = found[float(index)]
            known = status_of(self.rig.messages["ParamReply"], reply) == "OK"
            if known and not _reads_back(reply["value"], p.default):
                self.write({name: p.default})
                other.append(f"{name} {reply['value']:g}")
        return tuple(other)

    def get(self, parameter: str) -> float:
        """Read a parameter, SI.

        Raises:
            BenchError: the controller does not know it (Refused), or it is one that can only be written.
            NoReply: it does not answer.
        """
        p = self.rig.parameters[parameter]
        if p.index is None:
            raise BenchError(
                f"parameter {parameter} is a signal that the host sends; the controller cannot be asked for it"
            )
        reply = self._dialogue.ask(
            "ParamGet", {"index": p.index}, "ParamReply", f"the value of {parameter}", self._wait
        )
        if status_of(self.rig.messages["ParamReply"], reply) != "OK":
            raise Refused(f"the controller does not know parameter {parameter} (index {p.index})")
        return reply["value"]

    def _raw(self, path: str, value: float) -> float:
        """A value in SI in the unit of its signal."""
        message, _, signal = path.partition(".")
        unit = units.UNITS[self.rig.messages[message].signal(signal).unit]
        return (value - unit.offset) / unit.factor

    def command(self, name: str, again: Callable[[], bool] = lambda: True) -> None:
        """Ask for a command; `again` looks whether it may be repeated (`Dialogue.ask`).

        Raises:
            BenchError: the controller has none of that name, or refuses (Refused).
            NoReply: no reply.
        """
        messages = self.rig.messages
        if not self.rig.binding.knows(name, messages):
            raise BenchError(
                f"the controller has no command {name}: {self.rig.path} names none under devices.controller.binding.commands. "
                "Next: name it there, or do by hand what it asks for"
            )
        if self.recorder is not None:
            self.recorder.event("command", name=name)
        for message, values in commanded(self.rig, name).items():
            self._commanded.add(message)
            if message != "Command" or not self._dialogue.has("CommandReply"):
                self._send_held(message, values)
                continue
            if any(s.name == "session" for s in messages[message].signals):
                values["session"] = self._session.number
            try:
                reply = self._dialogue.ask(message, values, "CommandReply", f"the reply to {name}", self._wait, again)
            except NoReply:
                if self._mode() not in EFFECTS.get(name, ()):
                    raise
                logger.warning("%s was not answered; taken as obeyed, as the state is %s", name, self._mode())
                continue
            status = status_of(messages["CommandReply"], reply)
            if status == "WRONG_SESSION":
                raise Refused(f"the controller refuses {name}: another host owns it")
            if status == "WRONG_STATE" and self._dialogue.asked > 1:
                # A firmware that executes a repeat again: it has obeyed the first one. What the state becomes is waited for.
                logger.warning("%s was answered when it was repeated, with WRONG_STATE: taken as obeyed", name)
            elif status != "OK":
                raise Refused(f"the controller refuses {name}: {status} in state {self._mode()}")

    def ask_state(self) -> None:
        """Send what changes nothing and is answered by the state (IDENTIFY), where the controller has that; whoever takes
        its frames sees the answer.

        Raises:
            LinkError: the link is lost.
        """
        if not self._dialogue.has("CommandReply") or not self.rig.binding.knows("IDENTIFY", self.rig.messages):
            return
        for message, values in commanded(self.rig, "IDENTIFY").items():
            if any(s.name == "session" for s in self.rig.messages[message].signals):
                values["session"] = self._session.number
            self._dialogue.begin(message, values)

    def _send_held(self, message: str, values: dict[str, float]) -> None:
        owned = any(s.name == "session" for s in self.rig.messages[message].signals)
        self._dialogue.send_held(message, {**values, "session": self._session.number} if owned else values)

    def _standing(self, message: str) -> dict[str, float]:
        """A parameter may share its message with commands. Before the first command the message must ask for the state
        that the controller is in, or it would ask for whatever zero means.

        Raises:
            BenchError: the controller is in a state that no command of ours keeps; nothing was sent.
        """
        commands = self.rig.binding.commands
        shared = any(path.partition(".")[0] == message for c in commands for path in commands[c])
        if message in self._commanded or not shared:
            return {}
        if self._mode() not in STANDING:
            raise BenchError(
                f"message {message} carries commands too, and the controller is {self._mode()}: what to command with the "
                "parameter is unknown; nothing was sent. Next: land the rotor, then write parameters"
            )
        return commanded(self.rig, STANDING[self._mode()]).get(message, {})


def _reads_back(found: float, wanted: float) -> bool:
    """Whether a controller's float32 is what was written."""
    return abs(found - wanted) <= 1e-12 + 1e-6 * abs(wanted)
