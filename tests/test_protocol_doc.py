"""docs/reference/protocol.md: its tables follow the DBC and rig file, its bytes the codec and wire modules, its list of
commands the simulated controller, and its C functions work."""

from __future__ import annotations

import ctypes
import itertools
import os
import re
import shutil
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

from bench.errors import ConfigError
from bench.link.codec import Decoder, encode
from bench.link.frames import FD, empty_batch, frame
from bench.link.session import Session
from bench.rigfile import capture, load_rig, protocoldoc
from bench.rigfile.messages import Message
from bench.wire import captureblock, isotp, packet, slcan
from drivers import controller, dialogue, handshake, slcan_bus, waiting
from sim_backend.controller import ownership
from sim_backend.controller.controller import MAP_VERSION, SimulatedController
from sim_backend.truth import draw

PAGE = Path(__file__).parent.parent / "docs" / "reference" / "protocol.md"
TEXT = PAGE.read_text(encoding="utf-8")
PROSE = " ".join(TEXT.split())
RIG = load_rig("tsbs12")
MESSAGES = RIG.messages
FRAMES = re.findall(r"^```frame (\w+)\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
PACKETS = re.findall(r"^```packet ([\w ]+)\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
STATES = list(MESSAGES["Telemetry"].signal("state").choices.values())
MOVING = ("LIFTING", "LEVITATED", "SPINNING", "COASTING", "LANDING")


def table(heading: str) -> list[list[str]]:
    """The rows of the table whose head starts so."""
    part = TEXT[TEXT.index(f"\n| {heading} ") + 1 :].split("\n\n")[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in part.splitlines()[2:]]


def hexed(text: str) -> bytes:
    """Bytes as the page writes them, with `(31 times 00)` for many."""
    full = re.sub(r"\((\d+) times ([0-9A-F]{2})\)", lambda m: m[2] * int(m[1]), text)
    return bytes.fromhex(re.sub(r"\((\d+) digits 0\)", lambda m: "0" * int(m[1]), full))


def value_of(message: Message, signal: str, text: str) -> float:
    """A value of a worked frame: a number, or the name of a code."""
    choices = message.signal(signal).choices
    if text in choices.values():
        return MESSAGES.code(message.name, signal, text)
    return float(int(text, 16)) if text.startswith("0x") else float(text)


def worked(name: str, block: str) -> tuple[bytes, dict[str, float], str]:
    """The payload, the values and the line of a worked frame; each signal's own bytes are checked on the way."""
    message, payload, values, line = MESSAGES[name], b"", {}, ""
    for row in block.splitlines():
        found = re.fullmatch(r"(\w+) +(\"[^\"]*\"|\S+)(?: {2,}(.*)| (\(.*\)))?", row)
        assert found, row
        signal, text, shown = found[1], found[2], found[3]
        if signal == "line":
            line = text + (f" {found[4]}" if found[4] else "")
            continue
        if signal == "name":
            fields = Session(0, 0, text.strip('"')).fields()
            new = {key: float(fields[key]) for key in fields if key.startswith("name")}
        else:
            new = {signal: value_of(message, signal, text)}
        at = len(payload)
        payload += hexed(shown)
        assert encode(message, new)[at : len(payload)] == payload[at:], row
        values.update(new)
    return payload, values, line


def test_generated_sections_are_up_to_date() -> None:
    assert protocoldoc.replaced(TEXT, protocoldoc.sections(RIG)) == TEXT, (
        "run: python -m bench.rigfile.protocoldoc --into docs/reference/protocol.md"
    )


def test_a_stale_page_is_rewritten_and_one_without_markers_refused(tmp_path: Path) -> None:
    stale = TEXT.replace("| 0x023 | Identity | 8 |", "| 0x023 | Identity | 7 |")
    assert stale != TEXT
    assert protocoldoc.replaced(stale, protocoldoc.sections(RIG)) == TEXT
    page = tmp_path / "page.md"
    page.write_text(stale, encoding="utf-8")
    assert protocoldoc.main(["tsbs12", "--into", str(page)]) == 0
    assert page.read_text(encoding="utf-8") == TEXT
    with pytest.raises(ConfigError, match="generated section codes: found 0"):
        protocoldoc.replaced(TEXT.replace("<!-- end of codes -->", ""), protocoldoc.sections(RIG))


def test_a_page_of_one_rig_has_its_telemetry_and_its_parameters(tmp_path: Path) -> None:
    page = tmp_path / "rig.md"
    page.write_text(
        "\n".join(protocoldoc.marked(name, "stale text") for name in ("telemetry", "parameters")), encoding="utf-8"
    )
    assert protocoldoc.main(["tsbs12", "--own", "--into", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "stale text" not in text
    assert "| 6–7 | `pos_xi` | i16 | 2e-08 | m |" in text
    assert "| 1 | `bias_i` | A | 3 | 0 to 5 | resting |\n" in text
    told = RIG.parameters["bias_i"].model_copy(update={"about": "of the inboard AMB"})
    one = RIG.model_copy(update={"parameters": {**RIG.parameters, "bias_i": told}})
    assert "| resting | of the inboard AMB |" in protocoldoc.own_sections(one)["parameters"]


def test_the_page_of_captures_is_up_to_date_and_its_bytes_are_right() -> None:
    page, rig = PAGE.with_name("captures.md").read_text(encoding="utf-8"), load_rig("amb5dof")
    assert protocoldoc.replaced(page, protocoldoc.capture_sections(rig)) == page, (
        "run: python -m bench.rigfile.protocoldoc amb5dof --captures --into docs/reference/captures.md"
    )
    shown = re.findall(r"^(?:[0-9A-F]{2} )+[0-9A-F]{2}$", page, re.MULTILINE)
    arm = {"session": 7, "token": 1, "trigger": 3, "channels0": 15, "divider": 1, "length": 10000, "before": 1000}
    read = {"number": 3, "offset": 4096, "length": 3, "token": 2}
    block = captureblock.block(3, 4096, b"\xaa\xbb\xcc")
    assert [bytes.fromhex(text) for text in shown] == [
        encode(rig.messages["CaptureArm"], arm), encode(rig.messages["CaptureRead"], read), *isotp.segments(block, 64)
    ]  # fmt: skip


@pytest.mark.parametrize("rig", ["amb5dof", "amb1dof", "tsbs6", "lira", "rlsrm"])
def test_the_page_of_a_rig_is_up_to_date(rig: str) -> None:
    page = PAGE.with_name(f"{rig}.md").read_text(encoding="utf-8")
    assert protocoldoc.replaced(page, protocoldoc.own_sections(load_rig(rig))) == page, (
        f"run: python -m bench.rigfile.protocoldoc {rig} --own --into docs/reference/{rig}.md"
    )


def test_every_message_is_worked_byte_by_byte() -> None:
    """But those of captures, which docs/reference/captures.md works."""
    assert {name for name, _ in FRAMES} | set(capture.MESSAGES) == set(MESSAGES.messages)


@pytest.mark.parametrize(("name", "block"), FRAMES, ids=[f"{k}-{n}" for k, (n, _) in enumerate(FRAMES)])
def test_worked_frames(name: str, block: str) -> None:
    message = MESSAGES[name]
    payload, values, line = worked(name, block)
    assert set(values) == {s.name for s in message.signals}
    assert encode(message, values) == payload
    decoded, wrong = Decoder(message).decode(frame(message.identifier, payload))
    assert wrong == 0
    assert {signal: column[0] for signal, column in decoded.items()} == pytest.approx(values, rel=1e-12, abs=1e-12)
    written = re.sub(r" \((\d+) digits 0\)", lambda m: "0" * int(m[1]), line)
    assert slcan.line(message.identifier, payload, fd=True, brs=True) == written.encode() + b"\r"
    assert slcan.parse(written.encode()) == (message.identifier, payload, True, -1, True)


@pytest.mark.parametrize(("names", "block"), PACKETS, ids=["crc16", "crc32"])
def test_worked_packets(names: str, block: str) -> None:
    rows = re.findall(r"^(content|crc|packet) +((?:[0-9A-F]{2}\s+)+)", block, re.MULTILINE)
    content, crc, whole = (bytes.fromhex(text) for _, text in rows)
    assert packet.crc(content) == crc
    assert bytes(cobs.encode(content + crc)) + b"\0" == whole
    taken = packet.unpack(whole[:-1])
    golden = {name: worked(name, text)[0] for name, text in FRAMES}  # the last of a name
    assert taken.messages == [(MESSAGES[name].identifier, golden[name]) for name in names.split()]
    assert packet.packet(taken.sequence, taken.tick, taken.messages) == whole
    caption = TEXT[: TEXT.index(f"```packet {names}\n")].rstrip().splitlines()[-1]
    assert f"(0x{int.from_bytes(crc, 'little'):X})" in caption
    assert f"over {len(content)} bytes" in caption
    assert {"Heartbeat": (5, 0), "Telemetry Owner": (258, 46612)}[names] == (taken.sequence, taken.tick)


def test_both_lengths_of_crc_are_worked() -> None:
    assert [names for names, _ in PACKETS] == ["Heartbeat", "Telemetry Owner"]
    assert packet.crc(b"123456789") == (0x29B1).to_bytes(2, "little")
    long = b"123456789" * 15
    assert int.from_bytes(packet.crc(long), "little") == crc32(long)  # the sum of nine digits is too short for it
    assert crc32(b"123456789") == 0xCBF43926


def crc32(data: bytes) -> int:
    """As the page describes it, bit by bit."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)  # 0x04C11DB7 reflected
    return crc ^ 0xFFFFFFFF


@pytest.fixture(scope="module")
def functions(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The C functions of the page."""
    folder = tmp_path_factory.mktemp("page")
    code = "\n".join(re.findall(r"^```c\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE))
    (folder / "page.c").write_text(f"#include <stddef.h>\n#include <stdint.h>\n{code}", encoding="utf-8")
    compiler = os.environ.get("CC") or next(c for c in ("cc", "gcc", "clang") if shutil.which(c))
    subprocess.run([compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-o",
                    str(folder / "page.so"), str(folder / "page.c")], check=True)  # fmt: skip
    library = ctypes.CDLL(str(folder / "page.so"))
    for function in (library.cobs_encode, library.cobs_decode):
        function.restype, function.argtypes = ctypes.c_size_t, [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_char_p]
    return library


def call(function: Callable[..., int], data: bytes) -> bytes:
    out = ctypes.create_string_buffer(len(data) + len(data) // 254 + 2)
    length = function(data, len(data), out)
    return out.raw[:length]


def with_zeros(size: int, at: list[int]) -> bytes:
    return bytes(0 if k in at else 7 for k in range(size))


LONG = st.builds(with_zeros, st.integers(250, 515), st.lists(st.integers(0, 515), max_size=3))


@given(data=st.binary(max_size=40) | LONG)
def test_cobs_in_c(functions: ctypes.CDLL, data: bytes) -> None:
    assert call(functions.cobs_encode, data) == cobs.encode(data)
    if data:
        assert call(functions.cobs_decode, cobs.encode(data)) == data


@given(data=st.binary(max_size=20))
def test_cobs_in_c_of_anything(functions: ctypes.CDLL, data: bytes) -> None:
    try:
        expected = bytes(cobs.decode(data))
    except cobs.DecodeError:
        expected = b""
    assert call(functions.cobs_decode, data) == expected


def test_rates_and_lengths_of_slcan() -> None:
    text = PROSE[PROSE.index("Codes of rates") : PROSE.index("Bits of")]
    codes = {code: int(kbit) * 1000 for code, kbit in re.findall(r"`([SY]\d)` (\d+)", text)}
    assert codes == {code: rate for rate, code in {**slcan.BITRATES, **slcan.DATA_BITRATES}.items()}
    found = re.search(r"`9` to `F` are ([\d, \n]+) bytes", PROSE)
    assert found
    assert tuple(map(int, found[1].split(","))) == slcan.LENGTHS[9:]
    setup = slcan.setup(1_000_000, 5_000_000).decode().split("\r")[:-1]
    assert " CR ".join(f"`{line}`" for line in setup[1:]) + " CR and `V` CR" in PROSE
    assert f"at most {slcan.LONGEST_LINE} characters" in PROSE
    assert f"waits {slcan_bus.ANSWER_S:g} s at most" in PROSE


def state_rows() -> list[tuple[str, str]]:
    return [(row[0], state) for row in table("command | allowed in") for state in STATES]


@pytest.fixture(scope="module")
def device() -> SimulatedController:
    return SimulatedController(RIG, draw(RIG, 1, {}))


@pytest.mark.parametrize(("command", "state"), state_rows())
def test_commands_are_allowed_where_the_page_says(device: SimulatedController, command: str, state: str) -> None:
    allowed, leads = next(row[1:] for row in table("command | allowed in") if row[0] == command)
    device.states.state, device.states.fault = state, "HEARTBEAT_LOST" if state == "FAULT" else "NONE"
    reply = ask(device, command)
    status = MESSAGES["CommandReply"].signal("status").choices[int(reply["status"])]
    after = MESSAGES["CommandReply"].signal("state").choices[int(reply["state"])]
    listed = STATES if allowed == "all" else allowed.split(", ")
    assert status == ("OK" if state in listed else "WRONG_STATE")
    if first := re.match("|".join(STATES), leads if status == "OK" and command != "MAKE_SAFE" else ""):
        assert after == first[0]
    elif command == "MAKE_SAFE":  # the device stands still, so it is slow enough to land
        assert after == {"READY": "OFF", **dict.fromkeys(MOVING, "LANDING")}.get(state, state)
    else:
        assert after == state


TOKENS = itertools.cycle(range(256))


def ask(device: SimulatedController, command: str) -> dict[str, float]:
    code = MESSAGES.code("Command", "code", command)
    payload = encode(MESSAGES["Command"], {"session": 0x11, "code": code, "token": next(TOKENS)})
    out = device.advance(0, frame(MESSAGES["Command"].identifier, payload, flags=FD), 0)
    values, _ = Decoder(MESSAGES["CommandReply"]).decode(out if len(out) else empty_batch())
    return {name: float(column[0]) for name, column in values.items()}


def test_tables_name_every_state_command_fault_and_status() -> None:
    assert [row[0] for row in table("state | amplifiers")] == STATES
    commands = MESSAGES["Command"].signal("code").choices.values()
    assert [row[0] for row in table("command | allowed in")] == list(commands)
    faults = MESSAGES["Telemetry"].signal("fault").choices.values()
    assert ["NONE", *(row[0] for row in table("fault | when"))] == list(faults)
    told = {row[0] for row in table("status | when")}
    assert told == set(MESSAGES["ParamReply"].signal("status").choices.values())


def test_numbers_of_the_host_and_of_the_rig() -> None:
    rows = dict(table("what | how long"))
    assert struct.unpack("<I", b"\x12\xb6\0\0")[0] == 10 * (4660 + 1)  # the worked Telemetry keeps to seq and tick
    assert rows["Telemetry"] == "every 10 ticks, 1 ms"
    assert MESSAGES["Telemetry"].period_s == pytest.approx(10 * RIG.devices["controller"].tick_s)
    assert rows["Heartbeat"] == f"every {MESSAGES['Heartbeat'].period_s * 1e3:g} ms"
    assert rows["`watchdog_s`"] == f"{RIG.parameters['watchdog_s'].default * 1e3:g} ms by default"
    assert (
        rows["reply to a request"]
        == f"at once; the host waits {waiting.SILENCE_S:g} s, or `watchdog_s` where that is longer"
    )
    assert (
        rows["telemetry missing: the link is lost"] == f"{waiting.SILENCE_S:g} s, or `watchdog_s` where that is longer"
    )
    assert rows["first telemetry after opening"] == f"within {controller.FIRST_S:g} s"
    assert rows["a request without a reply"] == f"is sent {dialogue.ATTEMPTS} times in all"
    assert rows["silent owner at rest may be replaced"] == f"after {ownership.TAKEOVER_S:g} s"
    assert rows["the host keeps asking for ownership"] == f"{handshake.TAKEOVER_S:g} s"
    known = RIG.devices["controller"]
    assert f"`protocol` is {known.protocol} for this page. `map_version` is {known.map_version} " in PROSE
    assert known.map_version == MAP_VERSION
