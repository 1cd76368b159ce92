"""A rig's message map as another laboratory would have it: other identifiers and names, big-endian signals of other widths in
other places, telemetry in two messages, states of its own; and its rig file bound to it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from bench.rigfile import RigFile, load_rig
from bench.rigfile.messages import Signal

RIGS = Path(__file__).resolve().parent.parent / "rigs"
STATES = {"OFF": "Aus", "READY": "Bereit", "LIFTING": "Hebt", "LEVITATED": "Schwebt", "SPINNING": "Dreht",
          "LANDING": "Setzt ab", "COASTING": "Laeuft aus", "FAULT": "Gestoert"}  # fmt: skip
CODES = {mode: 3 * k + 2 for k, mode in enumerate(STATES)}
BITS = ("Netz", "Halten", "Drehen", "Absetzen", "Bremsen", "Sicher", "Quittung")
LEVELS = {"DISABLE": (), "ENABLE": ("Netz",), "LEVITATE": ("Netz", "Halten"), "SPIN": ("Netz", "Halten", "Drehen"),
          "STOP": ("Netz", "Halten", "Bremsen"), "LAND": ("Netz", "Absetzen"), "MAKE_SAFE": ("Netz", "Sicher"),
          "CLEAR_FAULT": ("Quittung",)}  # fmt: skip
WIDTHS = {"state": 5, "fault": 6, "flags": 9, "pulses": 16, "host_age": 14, "supply": 15, "temp": 15, "pos": 18,
          "speed": 18, "i": 16}  # fmt: skip
FIRST = 21  # readings in the first of two messages
SECOND_ID, LEVELS_ID, PULSE_ID = 0x301, 0x040, 0x031
Signals = list[tuple[str, int, Signal]]
"""A signal's new name, its width, and what it is made of."""


def foreign(rig: str, toml: str, folder: Path, *, replies: bool = True) -> str:
    """A rig file and its DBC in `folder`; `toml` with the native signals. With `replies` commands and parameters keep the
    messages of the protocol by their names (elsewhere and laid out otherwise), so that every reply comes when it always did;
    else commands are levels, and parameters signals of other messages, without replies."""
    native = load_rig(rig)
    told = [s for s in native.messages["Telemetry"].signals if s.name not in ("seq", "tick")]
    called = {s.name: f"Wert{k}" for k, s in enumerate(reversed(told), 1)}
    (folder / f"{rig}.dbc").write_text(_dbc(native, called, replies), encoding="utf-8")
    (folder / f"{rig}.toml").write_text(_bound(native, toml, called, replies), encoding="utf-8")
    return str(folder / f"{rig}.toml")


def _dbc(native: RigFile, called: Mapping[str, str], replies: bool) -> str:
    telemetry = native.messages["Telemetry"]
    told = [(called[s.name], WIDTHS.get(s.name) or WIDTHS.get(s.name.partition("_")[0], s.length), s)
            for s in reversed(telemetry.signals[2:])]  # fmt: skip
    first = [("Lauf", 12, telemetry.signal("seq")), ("Uhr", 34, telemetry.signal("tick")), *told[: _first(replies)]]
    second = [("Rest", 8, telemetry.signal("seq")), *told[_first(replies) :]]
    lines = ['VERSION "1"\n', "NS_ :\n", "BS_:\n", "BU_: Pult Regler\n"]
    lines += [_message(0x300, "Proben", "Regler", first)]
    lines += [] if replies else [_message(SECOND_ID, "Proben2", "Regler", second)]
    lines.append(_message(PULSE_ID, "Puls", "Pult", [("Zaehler", 7, telemetry.signal("seq"))]))
    if replies:
        others = [m for name, m in native.messages.messages.items() if name not in ("Telemetry", "Heartbeat")]
        lines += [
            _message(m.identifier + 0x150, m.name, "Pult", [(s.name, s.length, s) for s in m.signals]) for m in others
        ]
    else:
        bit = native.messages["Command"].signal("token")
        lines.append(_message(LEVELS_ID, "Wunsch", "Pult", [(name, 1, bit) for name in BITS]))
        units = [p.unit.replace("1", "", p.unit == "1") for p in native.parameters.values()]
        value = native.messages["ParamSet"].signal("value")
        for k, part in enumerate(_parts(native)):
            numbers: Signals = [(f"Groesse{p}", 32, replace(value, unit=units[p])) for p in part]
            lines.append(_message(LEVELS_ID + 1 + k, f"Vorgabe{k}", "Pult", numbers))
    return "\n".join([*lines, *_attributes(native, called, replies)])


def _first(replies: bool) -> int:
    """How many readings are in the first message: all where timing must be as it was, for two are complete only together."""
    return 64 if replies else FIRST


def _parts(native: RigFile) -> list[range]:
    """Parameters, by their numbers in the file, message by message."""
    return [range(at, min(at + 16, len(native.parameters))) for at in range(0, len(native.parameters), 16)]


def _message(identifier: int, name: str, sender: str, signals: Signals) -> str:
    """Signals one after the other, the most significant bit of each first."""
    lines, at = [], 0
    for new, bits, s in signals:
        if s.is_float:
            at += -at % 8
        sign = "-" if s.signed or s.is_float else "+"
        lines.append(
            f' SG_ {new} : {8 * (at // 8) + 7 - at % 8}|{bits}@0{sign} ({s.scale!r},{s.offset!r}) [0|0] "{s.unit}" X'
        )
        at += bits
    length = next(n for n in (*range(9), 12, 16, 20, 24, 32, 48, 64) if 8 * n >= at)
    return f"BO_ {identifier} {name}: {length} {sender}\n" + "\n".join(lines).replace('" X', '" Vector__XXX') + "\n"


def _attributes(native: RigFile, called: Mapping[str, str], replies: bool) -> Iterable[str]:
    """Periods, CAN FD, value tables, floats."""
    yield 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\nBA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","StandardCAN_FD";'
    yield 'BA_DEF_DEF_ "GenMsgCycleTime" 0;\nBA_DEF_DEF_ "VFrameFormat" "StandardCAN_FD";'
    periods = {0x300: 1, **({} if replies else {SECOND_ID: 1}), PULSE_ID: 20}
    yield from (f'BA_ "GenMsgCycleTime" BO_ {identifier} {ms};' for identifier, ms in periods.items())
    telemetry = native.messages["Telemetry"]
    where = {s.name: 0x300 if k < _first(replies) else SECOND_ID for k, s in enumerate(reversed(telemetry.signals[2:]))}
    states = " ".join(f'{CODES[mode]} "{name}"' for mode, name in STATES.items())
    yield f"VAL_ {where['state']} {called['state']} {states} ;"
    faults = " ".join(f'{code} "{name.title()}"' for code, name in telemetry.signal("fault").choices.items())
    yield f"VAL_ {where['fault']} {called['fault']} {faults} ;"
    if not replies:
        yield from (
            f"SIG_VALTYPE_ {LEVELS_ID + 1 + k} Groesse{p} : 1;" for k, part in enumerate(_parts(native)) for p in part
        )
        return
    for m in native.messages.messages.values():
        for s in m.signals if m.name not in ("Telemetry", "Heartbeat") else ():
            table = (
                {CODES[n]: STATES[n] for n in s.choices.values()}
                if s.name == "state" and m.name == "CommandReply"
                else s.choices
            )
            if table:
                yield f"VAL_ {m.identifier + 0x150} {s.name} " + " ".join(f'{k} "{n}"' for k, n in table.items()) + " ;"
            if s.is_float:
                yield f"SIG_VALTYPE_ {m.identifier + 0x150} {s.name} : 1;"


def _bound(native: RigFile, toml: str, called: Mapping[str, str], replies: bool) -> str:
    message = {new: "Proben" if k < _first(replies) else "Proben2" for k, new in enumerate(called.values())}
    readings = dict(re.findall(r'(?m)^(\w+) = \{ signal = "Telemetry\.(\w+)"', toml))
    toml = re.sub(r'"Telemetry\.(\w+)"', lambda m: f'"{message[called[m[1]]]}.{called[m[1]]}"', toml)
    telemetry = '["Proben"]' if replies else '["Proben", "Proben2"]'
    binding = ["[devices.controller.binding]", f"telemetry = {telemetry}", 'sequence = "Lauf"', 'tick = "Uhr"',
               'counter = "Rest"', 'heartbeat = "Puls"', 'heartbeat_counter = "Zaehler"', 'no_fault = ["None"]',
               "[devices.controller.binding.states]", *(f'"{name}" = "{mode}"' for mode, name in STATES.items())]  # fmt: skip
    if not replies:
        place = {name: f"Vorgabe{k // 16}.Groesse{k}" for k, name in enumerate(native.parameters)}
        numbers = {p.index: place[name] for name, p in native.parameters.items()}
        at, end, plans = (toml.index(f"\n[{name}") for name in ("parameters]", "capture]", "plans"))
        asked = re.sub(r"\{ index = (\d+)", lambda m: f'{{ signal = "{numbers[int(m[1])]}"', toml[at:end])
        toml = toml[:at] + asked + toml[plans:]  # captures are messages of the protocol, with replies
        toml = re.sub(r"(?m)^asked = .*\n", "", toml)  # of a motor: what captures alone show
        toml = re.sub(r"protocol = 1\nmap_version = 2\n", "", toml)
        binding.append("[devices.controller.binding.commands]")
        for command, on in LEVELS.items():
            said = ", ".join(f'"Wunsch.{bit}" = {int(bit in on)}' for bit in BITS)
            binding.append(f"{command} = {{ {said} }}")
    at = toml.index("\n[devices.operator]")
    toml = f"{toml[:at]}\n" + "\n".join(binding) + f"\n{toml[at:]}"
    own = "\n".join(
        f'{channel} = "{reading}"' for channel, reading in readings.items() if channel not in ("state", "fault")
    )
    return f"{toml}\n[simulation.readings]\n{own}\n"
