"""What a rig file calls the readings of a simulated machine: a machine has its own names, a rig file has its."""

from __future__ import annotations

from collections.abc import Mapping

from bench import units
from bench.rigfile import RigFile
from bench.rigfile.binding import (
    LEVITATION_COMMANDS,
    LEVITATION_MODES,
    STAGE_COMMANDS,
    STAGE_MODES,
    Binding,
)
from bench.rigfile.bit import Bit
from bench.rigfile.capabilities import Capabilities
from bench.rigfile.messages import Message, MessageMap
from bench.rigfile.model import Sensor
from sim_backend.machine import Machine

TELEMETRY = "Telemetry"
MESSAGES = (TELEMETRY, "Heartbeat", "Command", "CommandReply", "ParamSet", "ParamGet", "ParamReply")
CONTROLLER = ("state", "fault", "flags", "host_age", "supply")
WORDS, WORD = 48, 16  # the machine's own telemetry: where its sixteen-bit numbers begin, after sequence and tick


def channels_by_reading(rig: RigFile) -> Mapping[str, str]:
    """The rig's channel of each reading, by the signal that it is bound to. A reading that is no signal of the telemetry, but
    recorded inside the controller alone, goes by its own name."""
    by_signal = {c.signal.partition(".")[2]: name for name, c in rig.channels.items()}
    return by_signal | {reading: name for name, reading in stated_readings(rig).items()}


def sensors_by_reading(rig: RigFile) -> Mapping[str, Sensor]:
    """The certified sensors by the readings that their channels are."""
    reading = {channel: name for name, channel in channels_by_reading(rig).items()}
    return {reading.get(channel, channel): sensor for channel, sensor in rig.sensors.items()}


def stated_readings(rig: RigFile) -> Mapping[str, str]:
    """The machine's reading of a channel, where `[simulation.readings]` says it."""
    stated = rig.simulation.get("readings", {})
    return {str(k): str(v) for k, v in stated.items()} if isinstance(stated, dict) else {}


def reading_of(rig: RigFile, channel: str) -> str:
    """The machine's own name of a channel, of a rig whose DBC has the machine's names."""
    bound = rig.channels.get(channel)
    return stated_readings(rig).get(channel, channel) if bound is None else bound.signal.partition(".")[2]


def own_words(messages: MessageMap, machine: Machine, binding: Binding) -> bool:
    """Whether a DBC has all that the simulated controller says by names of its own, where it says it: messages of
    docs/reference/protocol.md, and telemetry in one message of sixteen-bit numbers."""
    if any(name not in messages.messages for name in MESSAGES) or binding != Binding():
        return False
    known = {s.name: s for s in messages[TELEMETRY].signals}
    if any(name not in known for name in (*machine.channels, *machine.windings, *CONTROLLER)):
        return False
    modes, asked = (LEVITATION_MODES, LEVITATION_COMMANDS) if machine.levitates else (STAGE_MODES, STAGE_COMMANDS)
    codes = (("state", modes), ("fault", ("NONE",)))
    if any(name not in known[signal].choices.values() for signal, names in codes for name in names):
        return False
    commands = {s.name: s for s in messages["Command"].signals}
    named = set(commands["code"].choices.values()) if "code" in commands else set()
    return set(asked) <= named and _in_words(messages[TELEMETRY])


def _in_words(message: Message) -> bool:
    first, second, *rest = message.signals
    counters = [(s.name, s.start, s.length, s.little_endian) for s in (first, second)]
    words = [(s.start, s.length, s.little_endian, s.is_float) for s in rest]
    return counters == [("seq", 0, 16, True), ("tick", 16, 32, True)] and words == [
        (WORDS + WORD * k, WORD, True, False) for k in range(len(rest))
    ]


def tellable(rig: RigFile, machine: Machine) -> frozenset[str]:
    """Names of all that a simulated machine and its controller can tell, for the channels of a rig file."""
    if machine.columns is not None:
        return frozenset(
            (*machine.columns(rig), *warming(rig, machine), *CONTROLLER, *(b.channel for b in bits(rig).values()))
        )
    base = (*machine.channels, *machine.windings, *CONTROLLER, *(b.channel for b in bits(rig).values()))
    names = tuple(dict.fromkeys((*base, *rig.channels)))
    _, goals = machine.places(machine.defects, {name: k for k, name in enumerate(names)})
    return frozenset((*base, *(names[k] for k in goals)))


def bits(rig: RigFile) -> Mapping[str, Bit]:
    """Where the rig file's capabilities say each status: `status.contact.RING`, `status.current_limit` and the like."""
    return bits_of(rig.capabilities)


def bits_of(capabilities: Capabilities) -> Mapping[str, Bit]:
    """The same of capabilities by themselves."""
    status = capabilities.status
    said = {f"status.contact.{ring}": bit for ring, bit in status.contact.items()}
    return said | {f"status.{key}": bit for key, bit in status if isinstance(bit, Bit)}


def warming(rig: RigFile, machine: Machine) -> Mapping[str, float]:
    """Temperatures that the controller tells, and how far each is above the first, K. Where the rows are the rig's channels,
    these are its other channels in kelvin."""
    if machine.columns is None:
        return machine.windings
    told = machine.columns(rig)
    kelvin = (n for n, c in rig.channels.items() if c.unit in units.UNITS and units.UNITS[c.unit].si == "K")
    return {name: 0.0 for name in kelvin if name not in told}


def told_as(rig: RigFile, channel: str, known: frozenset[str]) -> str | None:
    """The reading that a bound controller tells as a channel: what `[simulation.readings]` says, else the one of the channel's
    own name, else of its signal's; for what the envelope watches as the supply `supply`. None where the machine has none."""
    stated = stated_readings(rig)
    if channel in stated:
        return stated[channel] if stated[channel] in known else None
    signal = rig.channels[channel].signal.partition(".")[2] if channel in rig.channels else channel
    found = next((name for name in (channel, signal) if name in known), None)
    return "supply" if found is None and channel == rig.envelope.supply else found
