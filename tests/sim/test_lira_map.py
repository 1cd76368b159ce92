"""The rig file `lira`: its map by hand, its parameters and captures as the firmware has them."""

from __future__ import annotations

import math
import re
from functools import cache

import pytest

from bench.link.codec import encode
from bench.rigfile import RigFile, load_rig
from bench.rigfile.check import problems_of
from sim_backend.machines.lira.params import ControlParams
from sim_backend.machines.lira.plant import DQ
from sim_backend.machines.lira.settings import MEASUREMENTS, SETTINGS

AXES = ("x1", "x2", "y1", "y2", "z", "gamma")


@cache
def rig() -> RigFile:
    return load_rig("lira")


def test_the_rig_file_is_sound() -> None:
    assert [str(p) for p in problems_of(rig())] == []


def test_telemetry_byte_by_byte() -> None:
    """48 bytes, little endian: 1 um is 100, 8 mm 8000, a quarter turn 16384, 3 A 3000, 400 V 40000, 20 ms 20."""
    values = {"seq": 0x0102, "tick": 0x020304, "x1": 1e-6, "x2": -1e-6, "y1": 0.3e-6, "z": 8e-3, "gamma": math.pi / 2,
              "i_d_R1": 3.0, "i_q_R1": -1.0, "i_q_L": 1.5, "u_dc": 400.0, "state": 4, "fault": 2,
              "limited": 3, "speed": -1.0, "host_age": 0.02}  # fmt: skip
    first, last = "0201 04030200 6400 9cff 1e00 0000 401f 0040 b80b 18fc", "dc05 409c 04 02 0300 38ff 1400"
    expected = first + 7 * "0000" + last
    message = rig().messages["Telemetry"]
    assert encode(message, values) == bytes.fromhex(expected)
    assert (message.length, message.period_s, message.identifier) == (48, 0.002, 0x100)
    heartbeat = rig().messages["Heartbeat"]
    assert encode(heartbeat, {"counter": 0x1234}) == bytes.fromhex("00000000 3412 0000")


def told(toml: str) -> list[str]:
    return [str(p) for p in problems_of(RigFile.parse(toml, rig().dbc_text, "lira.toml"))]


def test_a_bus_needs_the_messages_of_blocks() -> None:
    """In pieces, as over this rig's own link, a capture comes without them, and asks for no block."""
    bus = rig().toml_text.replace(
        f'url = "{rig().link.url}"', 'url = "slcan:/dev/ttyACM0"\nbitrate = 1e6\ndata_bitrate = 5e6'
    )
    assert [p for p in told(bus) if "capture:" in p] == [
        "lira.toml: capture: found no message CaptureFlow, CaptureBlock in the DBC; expected the messages of "
        "docs/reference/captures.md",
        "lira.toml: capture: CaptureRead.form: found no value named BLOCK; expected a value table (VAL_ of the DBC) as in "
        "docs/reference/captures.md",
    ]


@pytest.mark.parametrize(("measures", "turned"), [("angle", False), ("stroke", True)])
def test_what_holds_an_angle_is_not_turned(measures: str, turned: bool) -> None:
    """A motor that nothing tells an angle of may spin: its controller must know STOP."""
    toml = rig().toml_text.replace('measures = "angle"', f'measures = "{measures}"')
    toml = toml.replace('[mark]\nspeed = "speed"\n', "").replace('STOP = "halt"\n', "")
    toml = re.sub(r"^speed = .*\n", "", toml, flags=re.MULTILINE)
    dbc = rig().dbc_text.replace(' 5 "STOP"', "")
    found = [str(p) for p in problems_of(RigFile.parse(toml, dbc, "lira.toml"))]
    assert any("commands.STOP: found" in p for p in found) == turned


def test_no_message_has_an_owner() -> None:
    """Who types on a command line is not asked for a name."""
    signals = {s.name for m in rig().messages.messages.values() for s in m.signals}
    assert not signals & {"session", "session8"}
    assert not {"Claim", "Owner"} & rig().messages.messages.keys()


def test_parameters_are_those_of_the_command_line() -> None:
    control = ControlParams()
    told = [(n, p.index, p.default, p.low, p.high) for n, p in rig().parameters.items() if (p.index or 0) < 100]
    assert [t[:2] for t in told] == [(s.name, k) for k, s in enumerate(SETTINGS, 1)]
    for (_, _, *numbers), s in zip(told, SETTINGS, strict=True):
        assert numbers == pytest.approx([getattr(control, s.field), s.low, s.high], rel=1e-8), s.name
    later = {p.index: n for n, p in rig().parameters.items() if (p.index or 0) >= 100}
    assert [later[100 + k] for k in range(6)] == [f"ref_{a}" for a in AXES]
    assert [later[110 + k] for k in range(10)] == [f"step_{name}" for name in DQ]


def test_captures_are_the_firmwares_measurements() -> None:
    spec = rig().capture
    assert spec is not None
    told = [(n, c.index, c.type, c.scale, c.unit) for n, c in spec.channels.items()]
    assert told == [(m.name, k, "i16", m.lsb, m.unit) for k, m in enumerate(MEASUREMENTS)]
    assert told[52:62] == [(f"i_{n}", 52 + k, "i16", 4e-4, "A") for k, n in enumerate(DQ)]
    assert told[62:] == [("wave", 62, "i16", 2**-15, "1"), ("held", 63, "i16", 1.0, "1")]
    assert spec.memory_bytes == 32 << 20
