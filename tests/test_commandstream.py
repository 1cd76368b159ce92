"""Messages over a command line: golden lines and frames worked out by hand, repetitions, restarts, anything at all."""

from __future__ import annotations

import struct
from functools import cache, reduce

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.link.codec import Decoder, encode, places_of
from bench.link.commandstream import CommandStream
from bench.link.frames import FrameBatch, frame, payload
from bench.rigfile import RigFile, load_rig
from bench.wire.captureblock import piece_of
from bench.wire.commandline import block
from drivers.beat import Beat, Encoder, WriterSpec

OPENING = 3  # lines of the rig's own: their tags are 0 to 2


@cache
def rig() -> RigFile:
    return load_rig("lira")


def line(text: str) -> bytes:
    """With its checksum, made without the code under test."""
    return f"{text}*{reduce(lambda a, b: a ^ b, text.encode()):02X}\n".encode()


def reply(text: str) -> bytes:
    return line(text).replace(b"\n", b"\r\n")


class Host:
    """A stream that has said its opening."""

    def __init__(self) -> None:
        self.stream = CommandStream(rig())
        self.stream.opening()

    def say(self, message: str, **values: float) -> bytes:
        m = rig().messages[message]
        return self.stream.encode(frame(m.identifier, encode(m, values)))

    def hear(self, data: bytes) -> list[tuple[str, dict[str, float]]]:
        return [read(one) for one in np.split(batch, len(batch))] if len(batch := self.stream.feed(data, 5)) else []

    def ask(self, text: str, message: str, **values: float) -> tuple[str, dict[str, float]]:
        """Say a message, answer its line with a text."""
        tag = self.say(message, **values).split(b" ")[0].decode()
        (told,) = self.hear(reply(f"{tag} {text}"))
        return told


def read(one: FrameBatch) -> tuple[str, dict[str, float]]:
    m = next(m for m in rig().messages.messages.values() if m.identifier == one["id"][0])
    return m.name, Decoder(m).decode_one(payload(one[0]))


def index(key: str) -> int:
    found = rig().parameters[key].index
    assert found is not None
    return found


def test_the_opening_ends_what_waits_and_says_the_rig_files_lines() -> None:
    assert CommandStream(rig()).opening() == b"\n\n" + line("0 echo off") + line("1 prompt off") + line("2 stream 500")


def test_a_parameter_is_set_and_its_value_in_force_told() -> None:
    host = Host()
    assert host.say("ParamSet", index=index("kp.b"), value=7e5, token=9) == line("3 set kp.b 700000")
    (told,) = host.hear(reply("3 ok kp.b=650000 N/m"))
    assert told == ("ParamReply", {"index": index("kp.b"), "status": 0, "token": 9, "value": 650000})
    assert host.say("ParamGet", index=index("kp.b"), token=10) == line("4 get kp.b")


@pytest.mark.parametrize(
    ("error", "status"), [("3 range kp.b 0..2e6", "OUT_OF_RANGE"), ("4 state", "WRONG_STATE"), ("77", "UNKNOWN")]
)
def test_errors_have_the_rig_files_names(error: str, status: str) -> None:
    name, told = Host().ask(f"err {error}", "ParamSet", index=index("kp.b"), value=1, token=1)
    assert (name, told["value"]) == ("ParamReply", 1)
    assert told["status"] == rig().messages.code("ParamReply", "status", status)


def test_what_is_not_said_is_held_and_stands_in_the_line_that_wants_it() -> None:
    host = Host()
    assert host.say("ParamSet", index=index("rate_z"), value=0.25, token=4) == b""
    ((name, told),) = host.hear(b"")
    assert (name, told["token"], told["value"]) == ("ParamReply", 4, 0.25)
    assert host.say("ParamSet", index=index("ref_z"), value=0.014) == line("3 ref z 0.0140000004 0.25 40")


def test_words_stand_for_values() -> None:
    host = Host()
    for key, value in (("inject_place", 1), ("inject_amplitude", 2e-6), ("inject_hz", 40)):
        host.say("ParamSet", index=index(key), value=value)
    assert host.say("ParamSet", index=index("inject_axis"), value=4) == line("3 inj z ref 1.99999999e-06 40")
    assert host.say("ParamSet", index=index("inject_axis"), value=-1) == line("4 inj off")


def test_commands_are_lines_and_tell_the_state() -> None:
    host = Host()
    lift = rig().messages.code("Command", "code", "LEVITATE")
    assert host.say("Command", code=lift, token=3) == line("3 lift")
    (told,) = host.hear(reply("3 ok LIFT"))
    assert told == ("CommandReply", {"code": lift, "token": 3, "status": 0, "state": 3})
    name, refused = host.ask("err 4 state=OFF", "Command", code=lift, token=4)
    assert (name, refused["status"]) == ("CommandReply", rig().messages.code("CommandReply", "status", "WRONG_STATE"))


def test_identity() -> None:
    host = Host()
    code = rig().messages.code("Command", "code", "IDENTIFY")
    name, told = host.ask("ok model=lira serial=SB-0021 fw=1.0 map=1 protocol=1", "Command", code=code)
    assert (name, told) == ("Identity", {"protocol": 1, "map_version": 1, "serial": 21})
    assert not host.stream.simulated
    assert (
        host.ask("ok serial=SIM-0018 map=1 protocol=1 simulated=yes", "Command", code=code, token=1)[1]["serial"] == 0
    )
    assert host.stream.simulated


def test_a_request_that_comes_again_is_the_same_line_until_it_is_answered() -> None:
    host = Host()
    first = host.say("ParamGet", index=index("m"), token=1)
    assert host.say("ParamGet", index=index("m"), token=1) == first
    assert len(host.hear(reply("3 ok m=1.34 kg"))) == 1
    assert host.hear(reply("3 ok m=1.34 kg")) == []
    assert host.stream.counts.late == 1
    assert host.say("ParamGet", index=index("m"), token=1) == line("4 get m")


def test_telemetry() -> None:
    host = Host()
    values = struct.pack("<H16hHBBHhH", 513, 1, -2, 3, -4, 8000, -16384, *range(10), 40001, 4, 2, 9, -200, 20)
    ((name, told),) = host.hear(block(0xFFFF, 280_000, values))
    assert name == "Telemetry"
    assert (told["seq"], told["tick"], told["z"], told["i_q_L"]) == (
        513,
        280_000,
        pytest.approx(8e-3),
        pytest.approx(9e-3),
    )
    assert (told["x2"], told["gamma"]) == (pytest.approx(-2e-8), pytest.approx(-np.pi / 2))
    assert (told["u_dc"], told["state"], told["fault"], told["limited"]) == (pytest.approx(400.01), 4, 2, 9)
    assert (told["speed"], told["host_age"]) == (pytest.approx(-1.0), pytest.approx(0.02))
    assert host.hear(block(0xFFFF, 280_000, values[:-1])) == []
    assert host.stream.counts.damaged == 1


def test_captures() -> None:
    host = Host()
    arm = {"channels0": 1, "channels1": 1 << 20, "divider": 8, "length": 100, "before": 10, "token": 5}
    assert host.say("CaptureArm", **arm) == line("3 cap arm 10000000000001 35000 100 10 now")
    ((name, told),) = host.hear(reply("3 ok 7 bytes=400"))
    assert (name, told["number"], told["size"], told["memory"], told["state"]) == ("CaptureStatus", 7, 400, 1 << 25, 1)
    told = host.ask(
        "ok 7 done bytes=400 samples=100 trigger=10 tick=81 every=8 channels=2 crc=305419896", "CaptureAsk", token=6
    )[1]
    assert (told["state"], told["tick"], told["divider"], told["crc"]) == (3, 81, 8, 0x12345678)
    assert host.say("CaptureRead", number=7, offset=1024, length=400, token=7) == line("5 cap read 1024 400")
    batch = host.stream.feed(block(7, 1024, bytes(range(200))), 0)
    found = [piece_of(payload(one)) for one in batch]
    assert b"".join(p.data for p in found if p) == bytes(range(200))
    assert next(p.offset for p in found if p) == 1024
    told = host.ask("err 10 no capture", "CaptureAsk", token=8)[1]
    assert told["status"] == rig().messages.code("CaptureStatus", "status", "NO_CAPTURE")


def test_a_trigger_names_its_channel() -> None:
    code = rig().messages.code("CaptureArm", "trigger", "RISES")
    said = Host().say("CaptureArm", channels0=1, trigger=code, source=0, level=1.5, divider=1, length=10)
    assert said == line("3 cap arm 1 280000 10 0 level i_f1 1.5")


@pytest.mark.parametrize("told", [b"! 12 boot power\r\n", b"lira firmware 1.0\r\n"])
def test_after_a_restart_the_opening_is_due_again(told: bytes) -> None:
    host = Host()
    host.say("ParamGet", index=index("m"), token=1)
    host.hear(told)
    assert host.stream.due() == b"\n\n" + line("4 echo off") + line("5 prompt off") + line("6 stream 500")
    assert host.stream.due() == b""
    assert host.hear(reply("3 ok m=1.34 kg")) == []


def test_a_heartbeat_is_the_same_from_either_process() -> None:
    host = Host()
    m = rig().messages["Heartbeat"]
    places = places_of(m.signal("counter"))
    writer = Encoder(WriterSpec("lines", 3, arguments={"heartbeat": "hb {counter}", "places": [*places]}))
    beat = Beat(m.identifier, encode(m, {}), places, m.fd)
    assert host.say("Heartbeat", counter=517) == writer.encode(beat.frame(517)) == line("hb 517")
    assert host.hear(reply("- ok 517")) == []


def test_echo_prompt_and_events_are_no_replies() -> None:
    host = Host()
    host.say("ParamGet", index=index("m"), token=1)
    came = b"3 get m*55\r\nlira> ! 5 state CURRENT\r\nlira> " + reply("3 ok m=1.34 kg")
    assert [name for name, _ in host.hear(came)] == ["ParamReply"]
    assert (host.stream.counts.events, host.stream.counts.dropped) == (1, 1)


def test_what_stands_before_the_opening_is_heard_is_nothing_lost() -> None:
    """Prompts, the echo of the first line and text of its start, as a controller that has just started says them."""
    host = Host()
    first, second, third = host.stream.opening().decode().strip().split("\n")
    host.hear(f"\r\nlira> \r\nlira> {first}\r\n".encode() + b"lira> " + reply(f"{first.split()[0]} ok off"))
    assert host.stream.counts.dropped == 0
    host.hear(f"{second[1:]}\r\n{third}x\r\n".encode())
    assert host.stream.counts.dropped == 2
    host.hear(b"lira firmware 1.0\r\n! 0 boot power\r\nlira> lira firmware 1.0\r\n")
    again = host.stream.due().decode().strip().split("\n")[0]
    host.hear(f"\r\nlira> {again}\r\n".encode())
    assert (host.stream.counts.dropped, host.stream.counts.restarts) == (2, 3)
    host.hear(f"{first}\r\n".encode())
    assert host.stream.counts.dropped == 3  # that opening is over


@given(
    st.lists(
        st.binary(max_size=80)
        | st.sampled_from([reply("3 ok"), reply("3 ok x=nan"), reply("4 err"), reply("4 ok done done")])
    )
)
def test_anything_at_all_is_taken(pieces: list[bytes]) -> None:
    host = Host()
    host.say("ParamGet", index=index("m"), token=1)
    host.say("CaptureAsk", token=2)
    for piece in pieces:
        for one in host.stream.feed(piece, 0):
            assert one["length"] <= 64
