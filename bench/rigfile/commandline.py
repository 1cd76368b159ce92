"""How the messages of a rig's DBC are said to a controller that has a command line: data, so that another firmware with another
one needs a rig file and no code. What `bench.wire.commandline` fixes (tags, checksums, events, blocks) is not said here.

In a line, `{name}` stands for the value of that parameter as it was last set, `{value}` for the one that is set now, `{key}`
for its own key; what has `words` stands for the word of its value. The number after the first `=` of a reply is the value in
force.
"""

from __future__ import annotations

import re
import string
from collections.abc import Iterator, Mapping
from typing import Final

from pydantic import Field

from bench.rigfile.part import Part

CAPTURED: Final = ("channels", "rate", "length", "before", "trigger")
"""What the line that arms a capture may say."""
COUNTED: Final = ("size", "samples", "trigger", "tick", "divider", "crc")
"""What a capture's state tells beside its state."""


class Spoken(Part):
    """How one parameter is said. `set` and `get` empty: it is not said, it is held by the bench until a line asks for it.
    `words` are what its values 0, 1, 2… are called, `at` lines of their own for single values."""

    set: str = ""
    get: str = ""
    words: tuple[str, ...] = ()
    at: Mapping[str, str] = {}


class CaptureLines(Part):
    """How captures are asked for. `triggers` and `states`: the protocol's word to the line's. `told`: which word of the reply
    about its state tells each of COUNTED (`bytes=1024`); its first word is the capture's number, the second the state."""

    arm: str
    state: str
    cancel: str
    read: str
    triggers: Mapping[str, str] = Field(min_length=1)
    states: Mapping[str, str] = Field(min_length=1)
    told: Mapping[str, str] = {}
    called: Mapping[str, str] = {}
    """What the firmware calls a channel, where it is not the rig file's name for it."""
    none: tuple[int, ...] = ()
    """Errors that say that there is no capture."""


class CommandLine(Part):
    """The rig file's table `commandline`.

    `opening`: said when the link is opened and after a restart; the first is what `events` hears of a restart. `commands`: the
    name of a value of `Command.code` to its line. `errors`: the number of an error to a status of the replies. `stream`: the
    number of the blocks that are telemetry: u16 sequence, then what follows the tick; their offset is the tick.
    """

    prompt: str = ""
    opening: tuple[str, ...] = ()
    heartbeat: str
    commands: Mapping[str, str] = {}
    identity: Mapping[str, str] = {}
    simulated: str = ""
    """What stands in the reply to IDENTIFY where a simulation answers."""
    restart: tuple[str, ...] = ()
    """Names of events, or beginnings of lines, that tell of a restart."""
    errors: Mapping[str, str] = {}
    refused: str = "UNKNOWN"
    """Status of errors that are not among those."""
    set: str = "set {key} {value}"
    get: str = "get {key}"
    spoken: Mapping[str, Spoken] = {}
    capture: CaptureLines | None = None
    stream: int = Field(0xFFFF, ge=0, le=0xFFFF)
    baudrate_first: int | None = Field(None, gt=0)
    """Rate at power-up, where it is another one than that of the link."""
    baudrate_line: str = ""

    def of(self, key: str) -> Spoken:
        """How a parameter is said."""
        return self.spoken.get(key, Spoken(set=self.set, get=self.get))


def fields(line: str) -> Iterator[str]:
    """Names in braces of a line.

    Raises:
        ValueError: braces that do not fit.
    """
    for _, name, spec, conversion in string.Formatter().parse(line):
        if name is None:
            continue
        if spec or conversion or not re.fullmatch(r"[\w.]+", name):
            raise ValueError(f"{line!r}: found {{{name}}}; expected a name in braces")
        yield name


def filled(line: str, values: Mapping[str, str]) -> str:
    """A line with its names replaced.

    Raises:
        KeyError: a name without a value.
    """
    return re.sub(r"\{([\w.]+)\}", lambda found: values[found[1]], line)
