"""The first words with a controller: who owns it, and is it the one that the rig file means."""

from __future__ import annotations

from collections.abc import Callable, Collection

from bench.clock import Clock
from bench.errors import ConfigError
from bench.link.session import Session
from bench.rigfile import RigFile
from drivers.dialogue import Dialogue

LISTEN_S = 0.15  # for another host, before the first heartbeat
TAKEOVER_S = 1.5  # an owner that has gone is forgotten a second after its last heartbeat
Wait = Callable[[Callable[[], bool], float, str], None]


def claim(dialogue: Dialogue, rig: RigFile, session: Session, clock: Clock, wait: Wait) -> None:
    """Own the controller; nothing is asked of one that knows no owners.

    Raises:
        ConfigError: another host owns it; the text names it and since when.
        LinkError: no answer.
    """
    if not dialogue.has("Claim"):
        return
    deadline = clock.now_ns() + round(TAKEOVER_S * 1e9)
    while True:
        answer = dialogue.ask("Claim", session.fields(), "Owner", "the answer to Claim", wait)
        owner = Session.of(answer)
        if owner.number == session.number:
            return
        if clock.now_ns() >= deadline:
            raise ConfigError(
                f"rig {rig.name} is in use: its controller obeys {owner}; expected one bench per rig. "
                "Next: wait for that run or stop it"
            )
        clock.sleep(0.1)


def identify(dialogue: Dialogue, rig: RigFile, session: Session, wait: Wait) -> dict[str, float]:
    """Compare the controller's protocol and message map with the rig file's.

    Returns:
        What it says that it is, by the names of its Identity: a `serial` of 0 is a simulated controller's. Nothing of one that
        is not asked.

    Raises:
        ConfigError: they differ.
        LinkError: no answer.
    """
    device = rig.devices["controller"]
    stated = {"protocol": device.protocol, "map_version": device.map_version}
    if not dialogue.has("Identity") or stated == {"protocol": None, "map_version": None}:
        return {}
    values = {"session": session.number, "code": rig.messages.code("Command", "code", "IDENTIFY")}
    found = dialogue.ask("Command", values, "Identity", "the controller's Identity", wait)
    for key, expected in stated.items():
        if expected is not None and int(found[key]) != expected:
            raise ConfigError(
                f"the controller says {key} {found[key]:g}; rig file {rig.path}: devices.controller.{key}: expected "
                f"{expected}. Next: use the DBC and rig file of this firmware, or update the firmware"
            )
    return {name: float(value) for name, value in found.items() if name not in ("token", "session")}


def alone(others: Collection[str], link: str) -> None:
    """Refuse a controller without owners to which another host talks: it would obey both.

    Raises:
        ConfigError: messages of a host have come in.
    """
    if others:
        raise ConfigError(
            f"link {link}: another host talks to this controller ({', '.join(sorted(others))}); expected one bench per "
            "rig. Next: end that one"
        )
