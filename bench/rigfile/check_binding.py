"""What is wrong with a rig file's binding: names that lead nowhere, values that do not fit, counters that wrap too soon."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping

from bench.rigfile.binding import COMMANDS
from bench.rigfile.messages import MessageMap, Signal
from bench.rigfile.model import RigFile
from bench.rigfile.roles import SPEED, told_in
from bench.rigfile.stage import is_stage
from bench.rigfile.turned import turned

NEEDED = ("ENABLE", "DISABLE", "LEVITATE", "LAND", "MAKE_SAFE")
"""Commands that no run and no make-safe can do without; the others are asked for only where the controller has them."""
STAGE_NEEDED = ("ENABLE", "DISABLE", "HOLD", "STOP", "LET_GO", "MAKE_SAFE")
"""Those of a machine that does not levitate."""

PROTOCOL = {
    "Command": ("code",), "CommandReply": ("status",), "ParamSet": ("index", "value"), "ParamGet": ("index",),
    "ParamReply": ("status", "value"), "Claim": ("session", "since", "name0", "name8"),
    "Owner": ("session", "since", "name0", "name8"), "Identity": ("protocol", "map_version"),
}  # fmt: skip
"""Messages of docs/reference/protocol.md that mean something by their name, and signals that they cannot be without."""

ANSWERS = {"ParamSet": "ParamReply", "ParamGet": "ParamReply", "Claim": "Owner", "CommandReply": "Command",
           "Identity": "Command"}  # fmt: skip

FEWEST_COUNT_BITS = 4

LONGEST_COUNTER = 48

KEY = "devices.controller.binding"

Found = tuple[str, str, str]

WRAP_S = 1.0  # counters must not come round within this: a loss, or a restart, would not show


def _needed(rig: RigFile) -> tuple[str, ...]:
    """NEEDED, and STOP where something may turn the shaft; those of a stage where nothing levitates."""
    if is_stage(rig):
        return STAGE_NEEDED
    return (*NEEDED, "STOP") if turned(rig) else NEEDED


def find(messages: MessageMap, path: str) -> str:
    """What is wrong with "Message.signal" ("" if nothing)."""
    message, _, signal = path.partition(".")
    if message not in messages.messages:
        return f"no message {message!r} in the DBC"
    known = [s.name for s in messages[message].signals]
    return "" if signal in known else f"message {message} has no signal {signal!r}; it has {', '.join(known) or 'none'}"


def problems_of(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    """Key, found and expected of everything in the binding that leads nowhere, or where it must not."""
    yield from _names(rig, messages)
    yield from _commands(rig, messages)
    yield from _told_apart(rig, messages)
    yield from _counters(rig, messages)
    yield from _heartbeat(rig, messages)
    yield from _protocol(rig, messages)
    yield from _channels(rig, messages)
    yield from _multiplexed(rig, messages)


def _multiplexed(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    """Messages that the bench reads or sends hold all their signals in every frame; others may do as they like."""
    b = rig.binding
    used = [(f"{KEY}.telemetry", m) for m in b.telemetry] + [(f"{KEY}.heartbeat", b.heartbeat)]
    used += [(f"{KEY}.commands.{n}", path.partition(".")[0])
             for n in dict.fromkeys((*_needed(rig), *b.commands)) for path in b.command(n)]  # fmt: skip
    used += [(f"parameters.{n}.signal", p.signal.partition(".")[0]) for n, p in rig.parameters.items() if p.signal]
    used += [(f"message {m}", m) for m in PROTOCOL]
    yield from multiplexed(used, messages)


def multiplexed(used: Iterable[tuple[str, str]], messages: MessageMap) -> Iterator[Found]:
    """Of keys and the messages that they use, those that are multiplexed; each message once."""
    first = {name: key for key, name in reversed([*used])}
    for name, key in first.items():
        if name in messages.messages and messages[name].multiplexed:
            yield key, f"{name}, which is multiplexed", "a message that holds all of its signals in every frame"


def signal_at(messages: MessageMap, path: str) -> Signal | None:
    """The signal at "Message.signal", if there is one."""
    if find(messages, path):
        return None
    message, _, signal = path.partition(".")
    return messages[message].signal(signal)


def plain(s: Signal) -> bool:
    """Whether a signal is an unsigned whole number that stands for itself, as counters and codes must."""
    return not (s.signed or s.is_float) and s.scale == 1 and s.offset == 0


def _names(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    b = rig.binding
    paths = {f"{KEY}.sequence": f"{b.telemetry[0]}.{b.sequence}", f"{KEY}.tick": f"{b.telemetry[0]}.{b.tick}",
             f"{KEY}.heartbeat": f"{b.heartbeat}.{b.heartbeat_counter}"}  # fmt: skip
    further = [
        (f"{KEY}.counter" if m in messages.messages else f"{KEY}.telemetry", f"{m}.{b.counter}")
        for m in b.telemetry[1:]
    ]
    for where, path in (*paths.items(), *further):
        if wrong := find(messages, path):
            yield where, wrong, f"a message and signal of {rig.link.dbc}, or `{where}` set to this controller's own"
    for m in sorted({m for m in b.telemetry if b.telemetry.count(m) > 1}):
        yield f"{KEY}.telemetry", f"{m} twice", "each message once"


def _commands(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    b = rig.binding
    for name in b.commands:
        if name not in COMMANDS:
            yield f"{KEY}.commands.{name}", "an unknown command", f"one of {', '.join(COMMANDS)}"
    for name in dict.fromkeys((*_needed(rig), *b.commands)):
        key = f"{KEY}.commands.{name}"
        if not b.command(name):
            yield key, "no values", 'what to send, such as { "Control.mode" = 3 }'
        for path, value in b.command(name).items():
            signal = signal_at(messages, path)
            if signal is None:
                own = f'`{key}` set to this controller\'s own: {name} = {{ "Message.signal" = value }}'
                yield key, find(messages, path), f"a message and signal of {rig.link.dbc}, or {own}"
            elif isinstance(value, str):
                known = ", ".join(signal.choices.values()) or "no names"
                if value not in signal.choices.values():
                    yield key, f"{path} = {value!r}", f"a name of its value table: {known}"
                elif (signal.scale, signal.offset) != (1, 0):
                    yield (
                        key,
                        f"{path}, a code with scale {signal.scale:g} and offset {signal.offset:g}",
                        "scale 1, offset 0",
                    )
            elif not fits(signal, float(value)):
                yield key, f"{path} = {value!r}", "a value that its bits can hold"


def _told_apart(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    """No command may be asked for by the way, by all the values of another one."""
    asked = {n: _codes(rig.binding.command(n), messages) for n in COMMANDS if rig.binding.knows(n, messages)}
    known = {name: codes for name, codes in asked.items() if codes}
    for one, other in itertools.permutations(known, 2):
        same = known[one] == known[other]
        if known[one].items() <= known[other].items() and (not same or one < other):
            found = f"the same values as {other}" if same else f"values that are all among those of {other}"
            yield (f"{KEY}.commands.{one}", found, f"a signal that has another value in {one} than in {other}: a controller "
                   "could not tell which is meant")  # fmt: skip


def _codes(binding: Mapping[str, int | float | str], messages: MessageMap) -> dict[str, float]:
    """Raw values by path; empty where one leads nowhere."""
    out: dict[str, float] = {}
    for path, value in binding.items():
        s = signal_at(messages, path)
        if s is None or (isinstance(value, str) and value not in s.choices.values()):
            return {}
        number = next(k for k, v in s.choices.items() if v == value) if isinstance(value, str) else value
        raw = (float(number) - s.offset) / s.scale
        out[path] = raw if s.is_float else round(raw)
    return out


def fits(s: Signal, value: float) -> bool:
    """Whether a signal can carry a value (in its own unit)."""
    if s.is_float:
        return s.length > 32 or abs(value) < 3.4e38
    raw = (value - s.offset) / s.scale
    low, high = (-(1 << s.length - 1), (1 << s.length - 1) - 1) if s.signed else (0, (1 << s.length) - 1)
    return low - 0.5 <= raw <= high + 0.5


def _counters(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    b = rig.binding
    sync = b.telemetry[0]
    for key, path in (("sequence", f"{sync}.{b.sequence}"), ("tick", f"{sync}.{b.tick}"),
                      *(("telemetry", f"{m}.{b.counter}") for m in b.telemetry[1:])):  # fmt: skip
        s = signal_at(messages, path)
        if s is not None and not plain(s):
            yield (
                f"{KEY}.{key}",
                f"{path} signed, scaled or a float",
                "an unsigned whole number with scale 1 and offset 0",
            )
        elif s is not None and key == "telemetry" and s.length < FEWEST_COUNT_BITS:
            yield f"{KEY}.{key}", f"{path} of {s.length} bits", f"at least {FEWEST_COUNT_BITS} bits"
    if sync not in messages.messages:
        return
    period, tick_s = messages[sync].period_s, rig.devices["controller"].tick_s
    if not period:
        yield f"{KEY}.telemetry", f"{sync} without a period", f'BA_ "GenMsgCycleTime" of {sync} in {rig.link.dbc}, ms'
    for key, path, unit_s, least_s in (("sequence", f"{sync}.{b.sequence}", period, WRAP_S),
                                       ("tick", f"{sync}.{b.tick}", tick_s, 2 * WRAP_S)):  # fmt: skip
        s = signal_at(messages, path)
        if s is not None and unit_s and unit_s * 2**s.length <= least_s:
            found = f"{path} of {s.length} bits, which comes round after {unit_s * 2**s.length:.2g} s"
            yield f"{KEY}.{key}", found, f"more bits: a loss or a restart within {WRAP_S:g} s must show"
        if s is not None and s.length > LONGEST_COUNTER:
            yield f"{KEY}.{key}", f"{path} of {s.length} bits", f"at most {LONGEST_COUNTER} bits"


def _heartbeat(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    b = rig.binding
    s = signal_at(messages, f"{b.heartbeat}.{b.heartbeat_counter}")
    if s is not None and not plain(s):
        yield (f"{KEY}.heartbeat_counter", f"{b.heartbeat}.{s.name} signed, scaled or a float",
               "an unsigned whole number with scale 1 and offset 0")  # fmt: skip
    written = {path.partition(".")[0] for name in b.commands for path in b.command(name)}
    written |= {p.signal.partition(".")[0] for p in rig.parameters.values() if p.signal}
    if b.heartbeat in written:
        yield (f"{KEY}.heartbeat", f"{b.heartbeat}, which also carries commands or parameters",
               "a message of its own: its other signals are sent as zero, every time")  # fmt: skip


def _protocol(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    """Messages that mean something by their name must be what the protocol says, or have another name."""
    for name, needed in PROTOCOL.items():
        if name not in messages.messages:
            continue
        used = name != "Command" or "CommandReply" in messages.messages or "Identity" in messages.messages
        known = {s.name for s in messages[name].signals}
        missing = [s for s in needed if s not in known]
        if missing and used:
            yield (f"message {name}", f"no signal {', '.join(missing)}",
                   "the layout of docs/reference/protocol.md, or another name: this one has a meaning there")  # fmt: skip
        other = ANSWERS.get(name)
        if other is not None and other not in messages.messages:
            yield f"message {name}", f"no message {other}", f"{other} too, or another name for {name}"
    device = rig.devices["controller"]
    if "Identity" not in messages.messages:
        for key in ("protocol", "map_version"):
            if getattr(device, key) is not None:
                yield (
                    f"devices.controller.{key}",
                    str(getattr(device, key)),
                    "a message Identity in the DBC, or no such key",
                )
    if any(p.index is not None for p in rig.parameters.values()) and "ParamSet" not in messages.messages:
        yield "parameters", "an index, and no message ParamSet in the DBC", "`signal` for each parameter, or ParamSet"


def _channels(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    telemetry = rig.binding.telemetry
    for name in ("state", "fault"):
        if name not in rig.channels:
            yield f"channels.{name}", "nothing", f"the channel `{name}`: the bench watches it while the machine moves"
    if turned(rig) and not told_in(rig, SPEED):
        yield "mark.speed", "nothing", "the channel that tells the speed: the bench watches it while the machine moves"
    for name, channel in rig.channels.items():
        s = signal_at(messages, channel.signal)
        if s is None:
            continue
        if channel.signal.partition(".")[0] not in telemetry:
            yield f"channels.{name}.signal", channel.signal, f"a signal of the telemetry: {', '.join(telemetry)}"
        if name in ("state", "fault", "flags") and (not plain(s) or s.length > 16):
            yield (
                f"channels.{name}.signal",
                f"{channel.signal}, signed, scaled or too long",
                "an unsigned code of up to 16 bits",
            )
