"""What a rig's DBC must call by the simulated machine's own names, so that the machine can be simulated over it."""

from __future__ import annotations

from collections.abc import Iterator

from bench.errors import ConfigError, Problem
from bench.rigfile import RigFile
from bench.rigfile.messages import MessageMap, load_messages
from sim_backend.machine import Machine

TELEMETRY = "Telemetry"
MESSAGES = (TELEMETRY, "Heartbeat", "Command", "CommandReply", "ParamSet", "ParamGet", "ParamReply")
CONTROLLER = ("state", "fault", "flags", "host_age", "supply")


def unspoken(rig: RigFile, machine: Machine) -> Iterator[Problem]:
    """Messages and signals of telemetry that the DBC lacks by the names that the simulated controller uses."""
    try:
        messages = load_messages(rig.dbc_text)
    except ConfigError:  # told by whoever reads the rig file
        return
    expected = (
        f"those names, which the simulated {machine.name} speaks; a machine with its own runs with --backend live"
    )
    if lacking := [name for name in MESSAGES if name not in messages.messages]:
        yield Problem(rig.link.dbc, "BO_", f"no message {', '.join(lacking)}", expected)
    elif lacking := _signals(messages, machine):
        yield Problem(rig.link.dbc, f"BO_ {TELEMETRY}", f"no signal {', '.join(lacking)}", expected)


def _signals(messages: MessageMap, machine: Machine) -> list[str]:
    there = {s.name for s in messages[TELEMETRY].signals}
    return [name for name in (*machine.channels, *machine.windings, *CONTROLLER) if name not in there]
