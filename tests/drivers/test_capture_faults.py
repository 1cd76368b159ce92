"""Uploads of captures over a link that loses, doubles or spoils frames, ends or comes back; a controller that restarts."""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np
import pytest
from capture_stand import Stand

from bench.errors import BenchError, DeviceFault, LinkError
from bench.link.frames import FrameBatch

BLOCKS, PIECES = 0x200, 0x201
KINDS = pytest.mark.parametrize("kind", ["can", "serial"])


def meanwhile(stand: Stand, change: Callable[[FrameBatch], FrameBatch]) -> None:
    """Change what comes from the controller from now on."""
    receive = stand.machine.link.receive
    stand.machine.link.receive = lambda: change(receive().copy())  # type: ignore[method-assign]


def of_uploads(batch: FrameBatch) -> np.ndarray:
    return np.flatnonzero((batch["id"] == BLOCKS) | (batch["id"] == PIECES))


@KINDS
def test_a_sound_link_needs_one_attempt(kind: str) -> None:
    stand = Stand(kind)
    assert stand.recorded(0.5) == stand.uploaded()
    assert stand.capture._uploads.failures == 0


@KINDS
@pytest.mark.parametrize("fault", ["drop=0.02@0.8", "duplicate=0.2@0.8", "corrupt=0.02@0.8", "reorder=0.01@0.8"])
def test_lost_doubled_and_destroyed_frames(kind: str, fault: str) -> None:
    stand = Stand(kind, [fault])
    buffer = stand.recorded(0.25)
    stand.controller.clock.sleep(0.6)  # the fault has begun
    assert stand.uploaded() == buffer


@KINDS
def test_a_lost_block_is_asked_for_again_from_where_it_is_missing(kind: str) -> None:
    stand, asked = Stand(kind), list[tuple[int, int]]()
    buffer = stand.recorded(2.0)
    seen = 0

    def lose(batch: FrameBatch) -> FrameBatch:
        nonlocal seen
        mine = of_uploads(batch)
        first, seen = seen, seen + len(mine)
        return np.delete(batch, mine[(np.arange(first, seen) >= 2200) & (np.arange(first, seen) < 2220)])

    meanwhile(stand, lose)
    begin = stand.capture._dialogue.begin

    def noted(message: str, values: dict) -> int:
        asked.append((int(values["offset"]), int(values["length"])))
        return begin(message, values)

    stand.capture._dialogue.begin = noted  # type: ignore[method-assign, assignment]
    begin_ns = stand.machine.now_ns()
    assert stand.uploaded() == buffer
    assert stand.machine.now_ns() - begin_ns < (
        0.85e9 if kind == "can" else 1.2e9
    )  # no waiting: the loss is seen at once
    if kind == "can":
        assert asked == [(0, 131072), (131072, 28928), (131072, 14464), (145536, 14464)]
    else:
        assert asked == [(0, 160000), (2200 * 57, 20 * 57)]


@KINDS
def test_a_spoilt_block(kind: str) -> None:
    """Bits that change although the frame's own CRC holds: a block has a CRC, pieces have the whole buffer's."""
    stand = Stand(kind)
    buffer, done = stand.recorded(0.5), False

    def spoil(batch: FrameBatch) -> FrameBatch:
        nonlocal done
        mine = of_uploads(batch)
        if len(mine) > 3 and not done:
            done = True
            batch["data"][mine[2], 20] ^= 0x10
        return batch

    meanwhile(stand, spoil)
    assert stand.uploaded() == buffer
    assert done


def test_a_block_from_elsewhere_is_not_taken() -> None:
    """Such as the answer to an earlier request."""
    stand = Stand("can")
    buffer, begin, asked = stand.recorded(0.05), stand.capture._dialogue.begin, 0

    def other(message: str, values: dict) -> int:
        nonlocal asked
        asked += 1
        return begin(message, {**values, "offset": 8, "length": values["length"] - 8} if asked == 1 else values)

    stand.capture._dialogue.begin = other  # type: ignore[method-assign, assignment]
    assert stand.uploaded() == buffer
    assert stand.capture._uploads.failures == 1


@KINDS
def test_what_is_always_spoilt_is_an_error(kind: str) -> None:
    stand = Stand(kind)
    stand.recorded(0.1)

    def spoil(batch: FrameBatch) -> FrameBatch:
        batch["data"][of_uploads(batch), 20] ^= 0x10
        return batch

    meanwhile(stand, spoil)
    told = "did not arrive whole in 12 attempts" if kind == "can" else "came 2 times, and their CRC-32 is"
    with pytest.raises(LinkError, match=told):
        stand.uploaded()


@KINDS
def test_a_link_that_comes_back(kind: str) -> None:
    stand = Stand(kind, ["disconnect@1.0+0.4"], reconnect_s=2.0)
    buffer = stand.recorded(0.6)
    stand.controller.clock.sleep(0.95 - (stand.machine.now_ns() - stand.begun_ns) * 1e-9)
    assert stand.uploaded() == buffer
    assert (stand.machine.now_ns() - stand.begun_ns) * 1e-9 > 1.4
    assert stand.capture._uploads.failures > 0


@KINDS
def test_a_link_that_does_not(kind: str) -> None:
    stand = Stand(kind, ["disconnect@1.0"])
    stand.recorded(0.6)
    stand.controller.clock.sleep(0.95 - (stand.machine.now_ns() - stand.begun_ns) * 1e-9)
    with pytest.raises(LinkError, match="unplugged"):
        stand.uploaded()


@KINDS
def test_a_controller_that_restarts_in_mid_upload(kind: str) -> None:
    stand = Stand(kind, ["reboot@1.0"])
    stand.recorded(0.6)
    stand.controller.clock.sleep(0.95 - (stand.machine.now_ns() - stand.begun_ns) * 1e-9)
    with pytest.raises((DeviceFault, BenchError), match="restarted"):
        stand.uploaded()


def test_after_a_restart_the_next_capture_is_a_new_one() -> None:
    stand = Stand("can", ["reboot@1.0"])
    stand.recorded(0.2)
    stand.controller.guarded = False  # as in make-safe
    stand.controller.clock.sleep(1.5)
    with pytest.raises(BenchError, match=r"does not have it any more \(OK, IDLE\): did it restart"):
        stand.capture.wait(0.1)
    data = stand.recorded(0.1)
    uploaded = stand.capture.upload()
    assert zlib.crc32(data) == stand.machine.device.captures.memory.crc  # type: ignore[union-attr]
    now = stand.machine.now_ns()
    assert 0 < now - uploaded.start_ns < 1_000_000_000  # on the sample clock of the new segment
    assert uploaded.first_tick < 20_000


def test_a_controller_that_does_not_answer_reads() -> None:
    stand = Stand("can")
    stand.recorded(0.1)
    meanwhile(stand, lambda batch: np.delete(batch, of_uploads(batch)))
    with pytest.raises(LinkError, match="at byte 0 of 8000 did not arrive whole in 12 attempts"):
        stand.uploaded()
