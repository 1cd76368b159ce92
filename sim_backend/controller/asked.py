"""What a host asks for by messages of any DBC: commands that are recognised, and parameters that are signals."""

from __future__ import annotations

from collections.abc import Mapping

from bench import units
from bench.rigfile import RigFile
from bench.rigfile.binding import COMMANDS
from bench.rigfile.messages import MessageMap, Signal


class Recogniser:
    """Commands by the values of signals, as the rig file binds them.

    A command is recognised when all signals of its binding have its values: a number in the signal's own unit, or a name of
    its value table. A signal has the value that came last; one whose message has not come yet has none. A command is obeyed
    when it is newly recognised, that is when it was not before the message that has just come. So a level that stays is
    obeyed once, however often the host repeats the message with all its signals because a parameter in it changed; a
    CLEAR_FAULT that is left standing clears no fault that comes later; and what was refused in one state is not obeyed in the
    next, unless it is taken back and asked for again. An edge is a level that the host takes back. Of several that are newly
    recognised at once each is obeyed, in the order of `bench.rigfile.binding.COMMANDS`, MAKE_SAFE after all that move.

    Args:
        rig: with the binding.
        messages: the device's own map.
        but: commands that are recognised by other means.
    """

    def __init__(self, rig: RigFile, messages: MessageMap, but: frozenset[str] = frozenset()) -> None:
        names = [n for n in COMMANDS if n not in but and rig.binding.knows(n, messages)]
        self._wanted = {n: wanted(rig.binding.command(n), messages) for n in names}
        self._seen: dict[str, float] = {}
        self.standing: frozenset[str] = frozenset()
        """What is recognised at present."""

    @property
    def messages(self) -> frozenset[str]:
        """Names of the messages that commands are recognised by."""
        return frozenset(path.partition(".")[0] for values in self._wanted.values() for path in values)

    def take(self, message: str, values: Mapping[str, float]) -> tuple[str, ...]:
        """A message with all its values, in their own units: the commands that it asks for."""
        self._seen |= {f"{message}.{name}": value for name, value in values.items()}
        before, self.standing = self.standing, frozenset(n for n, w in self._wanted.items() if met(w, self._seen))
        return tuple(n for n in self._wanted if n in self.standing and n not in before)


def wanted(binding: Mapping[str, int | float | str], messages: MessageMap) -> dict[str, tuple[float, float]]:
    """Values by path, and how near a signal must come to each."""
    out = {}
    for path, value in binding.items():
        message, _, name = path.partition(".")
        s = messages[message].signal(name)
        number = float(messages.code(message, name, value)) if isinstance(value, str) else float(value)
        out[path] = number, 1e-6 * abs(number) + 1e-12 if s.is_float else 0.5 * abs(s.scale)
    return out


def met(values: Mapping[str, tuple[float, float]], seen: Mapping[str, float]) -> bool:
    """Whether every signal has its value, as near as `wanted` says."""
    return all(path in seen and abs(seen[path] - value) <= near for path, (value, near) in values.items())


class Asked:
    """Parameters that are signals of a message. Their values are asked for whenever the message comes."""

    def __init__(self, rig: RigFile, messages: MessageMap) -> None:
        self._by_message: dict[str, list[tuple[str, Signal]]] = {}
        for name, p in rig.parameters.items():
            if p.signal:
                message, _, signal = p.signal.partition(".")
                self._by_message.setdefault(message, []).append((name, messages[message].signal(signal)))

    @property
    def messages(self) -> frozenset[str]:
        """Names of the messages that carry parameters."""
        return frozenset(self._by_message)

    def changes(self, message: str, values: Mapping[str, float], in_force: Mapping[str, float]) -> dict[str, float]:
        """Parameters (SI) whose signals in a message say other than what is in force, to half a step."""
        out = {}
        for name, s in self._by_message.get(message, ()):
            unit = units.UNITS[s.unit]
            asked = values[s.name] * unit.factor + unit.offset
            step = 1e-6 * abs(asked) if s.is_float else 0.5 * abs(s.scale * unit.factor)
            if not abs(asked - in_force[name]) <= step:
                out[name] = asked
        return out
