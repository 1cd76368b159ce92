"""A capture's buffer over the link, in parts: by ISO-TP on CAN, by pieces in serial packets. What does not arrive, or not as
it was sent, is asked for again from where it is missing."""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np

from bench.clock import Clock
from bench.errors import BenchError, LinkError
from bench.link import Link
from bench.link.frames import ERROR, FrameBatch
from bench.rigfile import RigFile, linkurl
from bench.wire.captureblock import OVERHEAD, block_of, piece_of
from bench.wire.isotp import Reassembler
from drivers.dialogue import Dialogue, status_of

LONGEST, SHORTEST = 131_072, 256
"""Bytes asked for at a time on CAN: half as many after each failure, twice as many after each success."""
ATTEMPTS = 12  # in a row that brought nothing
TIMES = 2  # that a whole buffer is fetched
SILENT_S = 0.3
LOOK_S, LONG_S, SLOW_S = 0.002, 0.05, 0.1
PORTION = 4096  # bytes: a look waits for so many where the link is slow, up to SLOW_S
ENDS = ("wrong-sequence", "wrong-length", "too-long")
Progress = Callable[[int, int], None]


class Upload:
    """Fetches buffers. `clock` is the controller's: while it sleeps, `take` gets what comes."""

    def __init__(self, rig: RigFile, link: Link, dialogue: Dialogue, clock: Clock) -> None:
        self._rig, self._link, self._dialogue, self._clock = rig, link, dialogue, clock
        pieces = linkurl.parse(rig.link.url).scheme in linkurl.PIECES_SCHEMES
        self._identifier = rig.messages["CaptureData" if pieces else "CaptureBlock"].identifier
        self._fetch = self._by_pieces if pieces else self._by_blocks
        self._form = rig.messages.code("CaptureRead", "form", "PIECES" if pieces else "BLOCK")
        self._wanted = False
        self._came: list[bytes] = []
        self.failures = 0
        """Attempts that brought nothing, since the start."""

    def take(self, batch: FrameBatch) -> None:
        """Keep what belongs to an upload; nothing while there is none."""
        if not self._wanted or not len(batch):
            return
        mine = batch[(batch["id"] == self._identifier) & (batch["flags"] & ERROR == 0)]
        lengths = mine["length"].tolist()
        whole, size = mine["data"].tobytes(), mine["data"].shape[1]
        self._came += [whole[size * k : size * k + n] for k, n in enumerate(lengths)]

    def fetch(self, number: int, size: int, crc: int, progress: Progress) -> bytes:
        """The buffer of a finished capture.

        Raises:
            LinkError: it does not arrive, or never as the controller has it.
            BenchError: the controller does not have it any more.
        """
        self._wanted = True
        try:
            for _ in range(TIMES):
                buffer = self._fetch(number, size, progress)
                if zlib.crc32(buffer) == crc:
                    return buffer
        finally:
            self._wanted, self._came = False, []
        raise LinkError(
            f"link {self._link.name}: capture {number}: {size} bytes came {TIMES} times, and their CRC-32 is "
            f"0x{zlib.crc32(buffer):08X} where the controller says 0x{crc:08X}: the link spoils what its own checks let pass"
        )

    def _by_blocks(self, number: int, size: int, progress: Progress) -> bytes:
        buffer, length, failed = bytearray(), LONGEST, 0
        while len(buffer) < size:
            asked = min(length, size - len(buffer))
            part = self._block(number, len(buffer), asked)
            if part:
                buffer += part
                length, failed = min(2 * length, LONGEST), 0
                progress(len(buffer), size)
                continue
            length, failed = max(asked // 2, SHORTEST), failed + 1
            self._failed(number, len(buffer), size, failed)
        return bytes(buffer)

    def _block(self, number: int, offset: int, length: int) -> bytes:
        """One block; nothing when it did not arrive whole."""
        token = self._ask(number, offset, length)
        receiver, silence, last = Reassembler(limit=length + OVERHEAD), Silence(self._clock), b""
        while token is not None:
            self._clock.sleep(silence.pause(length - receiver.held))
            came, self._came = self._came, []
            for payload in came:
                if payload == last:  # doubled on the way: consecutive frames differ in their number
                    continue
                event, last = receiver.feed(payload), payload
                if event.failure in ENDS:
                    return b""
                if event.send is not None and not self._go_on(event.send):
                    return b""
                if event.received is not None:
                    found = block_of(event.received)
                    right = found is not None and (found.number, found.offset, len(found.data)) == (
                        number,
                        offset,
                        length,
                    )
                    return found.data if found is not None and right else b""
            if silence.over(receiver.held) or self._refused(number, token):
                return b""
        return b""

    def _by_pieces(self, number: int, size: int, progress: Progress) -> bytes:
        buffer, missing, failed = np.zeros(size, np.uint8), np.ones(size, bool), 0
        while missing.any():
            start = int(missing.argmax())
            gap = missing[start:]
            length = int(gap.argmin()) if not gap.all() else size - start
            before = int(missing.sum())
            self._pieces(number, start, length, buffer, missing)
            left = int(missing.sum())
            progress(size - left, size)
            failed = failed + 1 if left == before else 0
            if failed:
                self._failed(number, start, size, failed)
        return buffer.tobytes()

    def _pieces(self, number: int, start: int, length: int, buffer: np.ndarray, missing: np.ndarray) -> None:
        """Ask for a stretch and put in what comes, until its end has come or nothing more does."""
        token, silence, end = self._ask(number, start, length), Silence(self._clock), start + length
        while token is not None:
            self._clock.sleep(silence.pause(int(missing[start:end].sum())))
            came, self._came = self._came, []
            for payload in came:
                found = piece_of(payload)
                if found is None or found.number != number or found.offset + len(found.data) > len(buffer):
                    continue
                place = slice(found.offset, found.offset + len(found.data))
                buffer[place] = np.frombuffer(found.data, np.uint8)
                missing[place] = False
            if (
                not missing[end - 1]
                or silence.over(length - int(missing[start:end].sum()))
                or self._refused(number, token)
            ):
                return

    def _ask(self, number: int, offset: int, length: int) -> int | None:
        """The token of a request; None where the link is being opened again."""
        self._came = []
        try:
            values = {"number": number, "form": self._form, "offset": offset, "length": length}
            return self._dialogue.begin("CaptureRead", values)
        except LinkError as error:
            self._reopening(error)
            return None

    def _go_on(self, payload: bytes) -> bool:
        """Send flow control; False where the link is being opened again."""
        try:
            self._dialogue.send("CaptureFlow", dict(zip(("flow", "block_size", "st_min"), payload, strict=True)))
        except LinkError as error:
            self._reopening(error)
            return False
        return True

    def _reopening(self, error: LinkError) -> None:
        """After a request that could not be sent: raise, unless the link is being opened again."""
        if not self._link.reopening:
            raise error
        self._clock.sleep(SILENT_S)

    def _refused(self, number: int, token: int) -> bool:
        reply = self._dialogue.heard("CaptureStatus", token)
        if reply is None:
            return False
        status = status_of(self._rig.messages["CaptureStatus"], reply)
        raise BenchError(
            f"capture {number}: the controller refuses to send it: {status}. It restarted, or another capture took its place"
        )

    def _failed(self, number: int, offset: int, size: int, failed: int) -> None:
        self.failures += 1
        if failed >= ATTEMPTS and not self._link.reopening:
            raise LinkError(
                f"link {self._link.name}: capture {number}: the block at byte {offset} of {size} did not arrive whole in "
                f"{failed} attempts; what arrived before is lost. Next: look at the link's counts, then upload again"
            )


class Silence:
    """How long to wait before looking again, and when to give up waiting; by the clock and by what has come so far."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._begin = self._moved = clock.now_ns()
        self._held = 0

    def pause(self, left: int) -> float:
        """Half the time that what is left should take at the rate so far; at first a part of what was waited already."""
        if not self._held:
            return min(max(0.2 * (self._clock.now_ns() - self._moved) * 1e-9, LOOK_S), LONG_S)
        byte_s = (self._moved - self._begin) * 1e-9 / self._held
        longest = max(LONG_S, min(PORTION * byte_s, SLOW_S)) if self._held >= PORTION else LONG_S
        return min(max(0.5 * left * byte_s, LOOK_S), longest)

    def over(self, held: int) -> bool:
        """Whether nothing has come for too long; `held` is what has come in all."""
        now = self._clock.now_ns()
        if held > self._held:
            self._held, self._moved = held, now
        return now - self._moved > SILENT_S * 1e9
