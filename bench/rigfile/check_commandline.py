"""What is wrong with a rig file's table `commandline`: lines that name what is not there, words that no message has."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from bench.rigfile import linkurl
from bench.rigfile.commandline import CAPTURED, COUNTED, CommandLine, fields
from bench.rigfile.messages import MessageMap
from bench.rigfile.model import RigFile

KEY = "commandline"
REPLIES = ("CommandReply", "ParamReply")
Found = tuple[str, str, str]


def problems_of(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    """Key, found and expected of everything in the table that leads nowhere."""
    spoken_to = rig.link.url.startswith("cli:")
    lines = rig.commandline
    if lines is None:
        if spoken_to:
            yield KEY, "nothing", f"the table [commandline], which a link such as {linkurl.EXAMPLES['cli']} goes by"
        return
    yield from _filled(f"{KEY}.heartbeat", lines.heartbeat, ("counter",))
    yield from _commands(lines, messages)
    yield from _parameters(rig, lines)
    yield from _errors(lines, messages)
    yield from _captures(rig, lines, messages)


def _filled(key: str, line: str, known: Collection[str]) -> Iterator[Found]:
    """Names in braces that nothing stands for."""
    try:
        unknown = [name for name in fields(line) if name not in known]
    except ValueError as error:
        yield key, line, str(error)
        return
    if unknown:
        yield key, f"{{{'}, {'.join(unknown)}}}", f"names among {', '.join(known)}"
    if "\n" in line or "*" in line or not line.isascii():
        yield key, repr(line), "one line of printable ASCII without *"


def _commands(lines: CommandLine, messages: MessageMap) -> Iterator[Found]:
    command = messages.messages.get("Command")
    codes = [] if command is None else [x for s in command.signals if s.name == "code" for x in s.choices.values()]
    for name, line in lines.commands.items():
        if name not in codes:
            yield f"{KEY}.commands.{name}", "no such value of Command.code in the DBC", f"one of {', '.join(codes)}"
        yield from _filled(f"{KEY}.commands.{name}", line, ())
    identity = messages.messages.get("Identity")
    told = [] if identity is None else [s.name for s in identity.signals]
    for name in lines.identity:
        if name not in told:
            yield (
                f"{KEY}.identity.{name}",
                "no such signal of Identity in the DBC",
                f"one of {', '.join(told) or 'none'}",
            )


def _parameters(rig: RigFile, lines: CommandLine) -> Iterator[Found]:
    known = (*rig.parameters, "key", "value")
    for place, line in (("set", lines.set), ("get", lines.get)):
        yield from _filled(f"{KEY}.{place}", line, known)
    for name, spoken in lines.spoken.items():
        if name not in rig.parameters:
            yield f"{KEY}.spoken.{name}", "no such parameter", "a key of [parameters]"
        for place, line in (("set", spoken.set), ("get", spoken.get), *((f"at.{v}", x) for v, x in spoken.at.items())):
            yield from _filled(f"{KEY}.spoken.{name}.{place}", line, known)


def _errors(lines: CommandLine, messages: MessageMap) -> Iterator[Found]:
    known = {x for m in REPLIES if m in messages.messages for s in messages[m].signals if s.name == "status"
             for x in s.choices.values()}  # fmt: skip
    for code, status in (*lines.errors.items(), ("refused", lines.refused)):
        if known and status not in known:
            yield f"{KEY}.errors.{code}", status, f"a status of {' or '.join(REPLIES)}: {', '.join(sorted(known))}"


def _captures(rig: RigFile, lines: CommandLine, messages: MessageMap) -> Iterator[Found]:
    if rig.capture is None:
        return
    captures = lines.capture
    if captures is None:
        yield f"{KEY}.capture", "nothing", "how a capture is asked for: the rig file has a table [capture]"
        return
    yield from _filled(f"{KEY}.capture.arm", captures.arm, CAPTURED)
    yield from _filled(f"{KEY}.capture.read", captures.read, ("offset", "length"))
    for kind, line in captures.triggers.items():
        yield from _filled(f"{KEY}.capture.triggers.{kind}", line, ("channel", "level"))
    states = messages["CaptureStatus"].signal("state").choices.values() if "CaptureStatus" in messages.messages else ()
    for name in captures.states:
        if name not in states:
            yield f"{KEY}.capture.states.{name}", "no such state of CaptureStatus", f"one of {', '.join(states)}"
    for name in captures.called:
        if name not in rig.capture.channels:
            yield f"{KEY}.capture.called.{name}", "no such channel", "a key of [capture.channels]"
    for name in captures.told:
        if name not in COUNTED:
            yield f"{KEY}.capture.told.{name}", "nothing that a capture tells", f"one of {', '.join(COUNTED)}"
