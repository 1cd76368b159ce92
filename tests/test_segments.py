"""Long messages on classic CAN: segments of ISO 15765-2 by hand, what is lost or doubled on the way, any bytes at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.link.frames import FD, SENT, FrameBatch, empty_batch, frame, joined
from bench.link.segments import Segments, of_controller, of_host
from bench.rigfile import load_rig
from bench.rigfile.messages import load_messages

RIG = load_rig("amb5dof")
MAP = load_messages(RIG.dbc_text, classic=True)
ARM, READ, FLOW, STATUS, TELEMETRY = (
    MAP[n].identifier for n in ("CaptureArm", "CaptureRead", "CaptureFlow", "CaptureStatus", "Telemetry")
)
PAYLOAD = bytes(range(1, 33))  # 32 bytes, as CaptureArm and CaptureStatus have
# 0x1020: first frame, 32 bytes, of which 6; then 21, 22, ... with 7 each: 6 + 3 x 7 = 27, the last one has 5
BY_HAND = (
    "10 20 01 02 03 04 05 06", "21 07 08 09 0A 0B 0C 0D", "22 0E 0F 10 11 12 13 14", "23 15 16 17 18 19 1A 1B",
    "24 1C 1D 1E 1F 20",
)  # fmt: skip


def seen(batch: FrameBatch) -> list[tuple[int, str]]:
    return [(int(f["id"]), f["data"][: f["length"]].tobytes().hex(" ").upper()) for f in batch]


def carried(sender: Segments, taker: Segments, batch: FrameBatch, lost: frozenset[int] = frozenset()) -> FrameBatch:
    """What arrives of `batch` over a bus that loses the frames of these numbers."""
    number, arrived, way = 0, [empty_batch()], sender.outgoing(batch)
    while len(way):
        kept = np.array([number + k not in lost for k in range(len(way))])
        number += len(way)
        came, answers = taker.incoming(way[kept])
        arrived.append(came)
        kept = np.array([number + k not in lost for k in range(len(answers))], bool)
        number += len(answers)
        _, way = sender.incoming(answers[kept])
    return joined(arrived)


def test_the_frames_by_hand() -> None:
    host, controller = of_host(MAP), of_controller(MAP)
    first = host.outgoing(frame(ARM, PAYLOAD, t_ns=5, flags=SENT))
    assert seen(first) == [(ARM, BY_HAND[0])]
    came, flow = controller.incoming(first)
    assert len(came) == 0
    assert seen(flow) == [(STATUS, "30 00 00")]
    nothing, rest = host.incoming(flow)
    assert len(nothing) == 0
    assert seen(rest) == [(ARM, text) for text in BY_HAND[1:]]
    assert rest["flags"].tolist() == [SENT] * 4
    whole, none = controller.incoming(rest)
    assert seen(whole) == [(ARM, PAYLOAD.hex(" ").upper())]
    assert len(none) == 0


def test_the_answer_is_let_go_on_by_flow_control_of_its_own() -> None:
    host, controller = of_host(MAP), of_controller(MAP)
    came, flow = host.incoming(controller.outgoing(frame(STATUS, PAYLOAD)))
    assert len(came) == 0
    assert seen(flow) == [(FLOW, "30 00 00")]
    taken_out, rest = controller.incoming(flow)
    assert len(taken_out) == 0
    assert seen(host.incoming(rest)[0]) == [(STATUS, PAYLOAD.hex(" ").upper())]


def test_flow_control_of_an_upload_goes_through() -> None:
    """The controller's blocks are let go on under the same identifier: with nothing of this under way it is theirs."""
    go_on = frame(FLOW, bytes.fromhex("300000"))
    assert seen(of_controller(MAP).incoming(go_on)[0]) == [(FLOW, "30 00 00")]


def test_other_messages_are_left_alone() -> None:
    batch = joined([frame(TELEMETRY, bytes(8)), frame(MAP["CaptureAsk"].identifier, bytes(8))])
    for end in (of_host(MAP), of_controller(MAP)):
        assert end.outgoing(batch) is batch
        came, answers = end.incoming(batch)
        assert came is batch
        assert len(answers) == 0


@pytest.mark.parametrize("number", range(6))  # first frame, flow control, four consecutive frames
def test_one_lost_frame_costs_the_message_and_the_next_one_arrives(number: int) -> None:
    host, controller = of_host(MAP), of_controller(MAP)
    request = frame(ARM, PAYLOAD)
    assert len(carried(host, controller, request, frozenset({number}))) == 0
    assert seen(carried(host, controller, request)) == [(ARM, PAYLOAD.hex(" ").upper())]


def test_doubled_frames_do_no_harm() -> None:
    host, controller = of_host(MAP), of_controller(MAP)
    _, flow = controller.incoming(host.outgoing(frame(ARM, PAYLOAD)))
    _, rest = host.incoming(joined([flow, flow]))
    assert len(rest) == 4
    assert seen(controller.incoming(np.repeat(rest, 2))[0]) == [(ARM, PAYLOAD.hex(" ").upper())]


def test_destroyed_frames_are_none() -> None:
    host, controller = of_host(MAP), of_controller(MAP)
    first = host.outgoing(frame(ARM, PAYLOAD))
    first["flags"] |= 4
    assert len(controller.incoming(first)[1]) == 0


@settings(max_examples=100)
@given(st.lists(st.tuples(st.sampled_from((ARM, READ, FLOW, STATUS, TELEMETRY)), st.binary(max_size=8)), max_size=30))
def test_any_frames_are_taken_without_a_word(frames: list[tuple[int, bytes]]) -> None:
    batch = joined([empty_batch(), *(frame(i, payload) for i, payload in frames)])
    for end in (of_host(MAP), of_controller(MAP)):
        end.outgoing(joined([frame(ARM, PAYLOAD), frame(STATUS, PAYLOAD)]))
        came, answers = end.incoming(batch)
        assert len(came) <= len(batch)
        assert max([0, *answers["length"].tolist()]) <= 8
        assert not (answers["flags"] & FD).any()


def test_a_link_is_classic_by_its_rates_and_settings() -> None:
    link = RIG.link
    assert not link.classic
    slow = link.model_copy(update={"data_bitrate": None})
    assert slow.classic
    assert not slow.model_copy(update={"options": {"fd": True}}).classic
    assert not slow.model_copy(update={"url": "can:socketcan:can0?fd=true"}).classic
    assert slow.model_copy(update={"url": "can:socketcan:can0?fd=false"}).classic
    assert not slow.model_copy(update={"url": "serial:/dev/ttyUSB0"}).classic
    assert not slow.model_copy(update={"bitrate": None}).classic


def test_only_what_is_longer_than_a_frame_goes_in_segments() -> None:
    shorter = replace(MAP["CaptureArm"], length=8)
    assert of_host(replace(MAP, messages={**MAP.messages, "CaptureArm": shorter})).outgoing(frame(ARM, bytes(8)))[
        "length"
    ].tolist() == [8]
