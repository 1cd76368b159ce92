"""Every message of tsbs12, and the telemetry of amb5dof, byte by byte, written by hand from the message map's description."""

from __future__ import annotations

import pytest

from bench.link.codec import Decoder, encode
from bench.link.frames import frame
from bench.rigfile import capture, load_rig
from bench.rigfile.messages import MessageMap

TELEMETRY = [
    ("seq", 4660, "34 12"),  # 0x1234, low byte first
    ("tick", 74565, "45 23 01 00"),  # 0x00012345
    ("pos_xi", 50e-6, "C4 09"),  # 50 um / 20 nm = 2500 = 0x09C4
    ("pos_yi", -100e-6, "78 EC"),  # -100 um / 20 nm = -5000; 65536 - 5000 = 60536 = 0xEC78
    ("pos_xo", 0.0, "00 00"),
    ("pos_yo", 20e-9, "01 00"),  # one step
    ("pos_z", -20e-9, "FF FF"),  # one step down
    ("angle", -1.5707963267948966, "00 C0"),  # -pi/2 / (2 pi / 65536) = -16384; 65536 - 16384 = 0xC000
    ("speed", 40.0, "40 1F"),  # 40 / 0.005 = 8000 = 0x1F40
    ("i_xi_p", 3.0, "70 17"),  # 3 / 0.0005 = 6000 = 0x1770
    ("i_xi_n", 2.5, "88 13"),  # 5000 = 0x1388
    ("i_yi_p", 4.0, "40 1F"),  # 8000 = 0x1F40
    ("i_yi_n", 2.0, "A0 0F"),  # 4000 = 0x0FA0
    ("i_xo_p", 3.0005, "71 17"),  # 6001 = 0x1771
    ("i_xo_n", -0.0005, "FF FF"),  # -1
    ("i_yo_p", 12.0, "C0 5D"),  # 24000 = 0x5DC0
    ("i_yo_n", 0.1, "C8 00"),  # 200 = 0x00C8
    ("i_z_p", 1.5, "B8 0B"),  # 3000 = 0x0BB8
    ("i_z_n", 16.3835, "FF 7F"),  # 32767, the top of the range
    ("i_m1", -16.384, "00 80"),  # -32768, the bottom of the range
    ("i_m2", 1.0, "D0 07"),  # 2000 = 0x07D0
    ("i_m3", -1.0, "30 F8"),  # 65536 - 2000 = 63536 = 0xF830
    ("i_m4", -2.5, "78 EC"),  # 65536 - 5000 = 0xEC78
    ("supply", 48.0, "C0 12"),  # 48 / 0.01 = 4800 = 0x12C0
    ("temp_i", 293.15, "83 72"),  # 29315 = 0x7283
    ("temp_o", 300.0, "30 75"),  # 30000 = 0x7530
    ("temp_m", 353.0, "E4 89"),  # 35300 = 0x89E4
    ("state", 3, "03 00"),  # LEVITATED
    ("fault", 4, "04 00"),  # HEARTBEAT_LOST
    ("flags", 21, "15 00"),  # bits 0, 2 and 4: 1 + 4 + 16
    ("host_age", 0.08, "50 00"),  # 80 ms / 1 ms = 80 = 0x50
]

STAND = [
    ("seq", 4660, "34 12"),
    ("tick", 74565, "45 23 01 00"),
    ("pos_yi", -71e-6, "44 E4"),  # -71 um / 10 nm = -7100; 65536 - 7100 = 58436 = 0xE444
    ("pos_zi", 50e-6, "88 13"),  # 5000 = 0x1388
    ("pos_yo", 10e-9, "01 00"),  # one step
    ("pos_zo", -10e-9, "FF FF"),  # one step down
    ("pos_x", 327.67e-6, "FF 7F"),  # 32767, the top of the range
    ("angle", 1.5707963267948966, "00 40"),  # pi/2 / (2 pi / 65536) = 16384 = 0x4000
    ("speed", 1466.0625, "A1 5B"),  # 14 000 r/min: 1466.0625 * 16 = 23457 = 0x5BA1
    ("i_yi_p", 1.0, "88 13"),  # 1 / 0.0002 = 5000
    ("i_yi_n", 3.0, "98 3A"),  # 15000 = 0x3A98
    ("i_zi_p", 0.0002, "01 00"),
    ("i_zi_n", -0.0002, "FF FF"),
    ("i_yo_p", 0.5, "C4 09"),  # 2500 = 0x09C4
    ("i_yo_n", 1.2, "70 17"),  # 6000 = 0x1770
    ("i_zo_p", 2.0, "10 27"),  # 10000 = 0x2710
    ("i_zo_n", 0.0, "00 00"),
    ("i_x_p", 1.1, "7C 15"),  # 5500 = 0x157C
    ("i_x_n", 0.9, "94 11"),  # 4500 = 0x1194
    ("u_i", 48.0, "80 BB"),  # 48000 = 0xBB80
    ("u_o", 12.0, "E0 2E"),  # 12000 = 0x2EE0
    ("u_x", 1.3, "14 05"),  # 1300 = 0x0514
    ("pulses", 65535, "FF FF"),
    ("supply", 48.0, "C0 12"),
    ("temp_i", 293.15, "83 72"),
    ("temp_o", 300.0, "30 75"),
    ("temp_x", 353.0, "E4 89"),
    ("state", 4, "04 00"),  # SPINNING
    ("fault", 3, "03 00"),  # OVERSPEED
    ("flags", 114, "72 00"),  # bits 1, 4, 5 and 6: 2 + 16 + 32 + 64
    ("host_age", 0.02, "14 00"),
]

OWNED = [
    ("session", 305419896, "78 56 34 12"),  # 0x12345678
    ("since", 1767225600, "00 B9 55 69"),  # 2026-01-01T00:00:00Z = 0x6955B900
    ("name0", 0x406C6F727261, "61 72 72 6F 6C 40"),  # "arrol@" first byte lowest
    ("name1", 0x000000626C, "6C 62 00 00 00 00"),  # "lb"
    *((f"name{k}", 0, "00 00 00 00 00 00") for k in range(2, 9)),
    ("spare", 0, "00 00"),
]

GOLDEN: dict[str, tuple[int, list[tuple[str, float, str]]]] = {
    "Telemetry": (0x100, TELEMETRY),
    "Heartbeat": (0x010, [
        ("session", 3735928559, "EF BE AD DE"),  # 0xDEADBEEF
        ("counter", 513, "01 02"),  # 2 * 256 + 1
        ("spare", 0, "00 00"),
    ]),
    "Command": (0x011, [
        ("session", 1, "01 00 00 00"),
        ("code", 4, "04"),  # SPIN
        ("token", 254, "FE"),
        ("spare", 0, "00 00"),
    ]),
    "ParamSet": (0x012, [
        ("index", 35, "23 00"),  # 2 * 16 + 3
        ("value", -40.0, "00 00 20 C2"),  # -1.25 * 2^5: sign 1, exponent 127 + 5 = 0x84, fraction 0.25 -> 0xC2200000
        ("token", 7, "07"),
        ("session8", 205, "CD"),  # 12 * 16 + 13, the low byte of session 0x1234ABCD
    ]),
    "ParamGet": (0x013, [("index", 258, "02 01"), ("token", 9, "09"), ("spare", 0, "00")]),  # 256 + 2
    "CommandReply": (0x021, [
        ("code", 6, "06"),  # CLEAR_FAULT
        ("token", 11, "0B"),
        ("status", 3, "03"),  # WRONG_STATE
        ("state", 7, "07"),  # FAULT
    ]),
    "ParamReply": (0x022, [
        ("index", 1, "01 00"),
        ("status", 2, "02"),  # OUT_OF_RANGE
        ("token", 128, "80"),
        ("value", 3.0, "00 00 40 40"),  # 1.5 * 2^1: exponent 128 = 0x80, fraction 0.5 -> 0x40400000
    ]),
    "Claim": (0x014, OWNED),
    "Owner": (0x024, OWNED),
    "Identity": (0x023, [
        ("protocol", 1, "01 00"),
        ("map_version", 258, "02 01"),
        ("serial", 4000000000, "00 28 6B EE"),  # 0xEE6B2800
    ]),
}  # fmt: skip


@pytest.fixture(scope="module")
def messages() -> MessageMap:
    return load_rig("tsbs12").messages


def test_every_message_has_a_golden_frame(messages: MessageMap) -> None:
    """But those of captures, which tests/test_capture_messages.py has."""
    assert GOLDEN.keys() | set(capture.MESSAGES) == messages.messages.keys()
    for name, (_, signals) in GOLDEN.items():
        assert [n for n, _, _ in signals] == [s.name for s in messages[name].signals], name


@pytest.mark.parametrize("name", GOLDEN)
def test_bytes_to_values(messages: MessageMap, name: str) -> None:
    identifier, signals = GOLDEN[name]
    payload = bytes.fromhex("".join(text for _, _, text in signals))
    values, wrong = Decoder(messages[name]).decode(frame(identifier, payload))
    assert wrong == 0
    for signal, value, _ in signals:
        assert values[signal].tolist() == [pytest.approx(value, rel=1e-14, abs=0)], signal


@pytest.mark.parametrize("name", GOLDEN)
def test_values_to_bytes(messages: MessageMap, name: str) -> None:
    identifier, signals = GOLDEN[name]
    payload = encode(messages[name], {signal: value for signal, value, _ in signals})
    assert payload.hex(" ").upper() == " ".join(text for _, _, text in signals)
    assert messages[name].identifier == identifier
    assert messages[name].length == len(payload)
    assert messages[name].fd


def test_telemetry_of_the_amb_stand() -> None:
    message = load_rig("amb5dof").messages["Telemetry"]
    assert [n for n, _, _ in STAND] == [s.name for s in message.signals]
    text = " ".join(text for _, _, text in STAND)
    values, wrong = Decoder(message).decode(frame(0x100, bytes.fromhex(text)))
    assert wrong == 0
    for signal, value, _ in STAND:
        assert values[signal].tolist() == [pytest.approx(value, rel=1e-14, abs=0)], signal
    assert encode(message, {signal: value for signal, value, _ in STAND}).hex(" ").upper() == text


def test_all_other_messages_of_the_amb_stand_are_the_same(messages: MessageMap) -> None:
    other = load_rig("amb5dof").messages
    assert other.messages.keys() == messages.messages.keys() >= set(capture.MESSAGES)
    assert [n for n in messages.messages if other[n] != messages[n]] == ["Telemetry"]
    for name in ("state", "fault"):
        assert other["Telemetry"].signal(name).choices == messages["Telemetry"].signal(name).choices


@pytest.mark.parametrize(
    ("message", "signal", "names"),
    [
        ("Telemetry", "state", "OFF READY LIFTING LEVITATED SPINNING LANDING COASTING FAULT"),
        ("CommandReply", "state", "OFF READY LIFTING LEVITATED SPINNING LANDING COASTING FAULT"),
        ("Telemetry", "fault", "NONE CONTACT OVERCURRENT OVERSPEED HEARTBEAT_LOST LEVITATION_LOST SENSOR LIFT_TIMEOUT "
                               "OVERTEMPERATURE"),
        ("Command", "code", "DISABLE ENABLE LEVITATE LAND SPIN STOP CLEAR_FAULT MAKE_SAFE IDENTIFY RELEASE"),
        ("CommandReply", "code", "DISABLE ENABLE LEVITATE LAND SPIN STOP CLEAR_FAULT MAKE_SAFE IDENTIFY RELEASE"),
        ("CommandReply", "status", "OK UNKNOWN OUT_OF_RANGE WRONG_STATE WRONG_SESSION READ_ONLY"),
        ("ParamReply", "status", "OK UNKNOWN OUT_OF_RANGE WRONG_STATE WRONG_SESSION READ_ONLY"),
    ],
)  # fmt: skip
def test_codes_have_their_names(messages: MessageMap, message: str, signal: str, names: str) -> None:
    for number, name in enumerate(names.split()):
        assert messages.code(message, signal, name) == number
    assert len(messages[message].signal(signal).choices) == len(names.split())


def test_periods_and_senders(messages: MessageMap) -> None:
    assert messages["Telemetry"].period_s == pytest.approx(1e-3)
    assert messages["Heartbeat"].period_s == pytest.approx(20e-3)
    sent = {n for n, m in messages.messages.items() if m.sender == "Host"}
    assert sent - set(capture.MESSAGES) == {"Heartbeat", "Command", "ParamSet", "ParamGet", "Claim"}
