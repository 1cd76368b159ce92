"""Messages of more than 8 bytes on a bus of classic CAN: in segments of ISO 15765-2, normal addressing.

A message goes under its own identifier. Who takes it answers its first frame with flow control under an identifier of its
own. One message is under way from either end: a new one takes the place of one whose flow control never came.
"""

from __future__ import annotations

from bench.link.frames import ERROR, REMOTE, SENT, FrameBatch, batch_of, packed
from bench.rigfile.messages import MessageMap
from bench.wire.isotp import Reassembler, Sender, TransferError

LONGEST = 64
"""Bytes of a message: what a frame of CAN FD would carry."""
_CONSECUTIVE, _FLOW = 2, 3


class Segments:
    """One end's half of it, without time of its own: frames go in and out by the caller.

    Args:
        messages: of the link.
        sends, takes: names of the messages that may be longer than 8 bytes, from here and from the other end.
        answers: the message under whose identifier flow control goes out.
        answered: the message under whose identifier it comes.
        flags: of the frames that come of it.
    """

    def __init__(
        self, messages: MessageMap, *, sends: tuple[str, ...], takes: tuple[str, ...], answers: str, answered: str,
        flags: int = 0,
    ) -> None:  # fmt: skip
        there = messages.messages
        self._sends = {there[n].identifier for n in sends if n in there and there[n].length > 8}
        takers = {there[n].identifier for n in takes if n in there and there[n].length > 8}
        self._takes = {i: Reassembler(limit=LONGEST) for i in takers}
        self._answers, self._answered = there[answers].identifier, there[answered].identifier
        self._flags = flags
        self._under_way: tuple[int, Sender] | None = None
        self._doubled = dict[int, bytes]()  # the last consecutive frame of each message that comes

    def outgoing(self, batch: FrameBatch) -> FrameBatch:
        """Frames to send now in place of `batch`: of each long message its first frame, the others as they are."""
        if self._sends.isdisjoint(batch["id"].tolist()):
            return batch
        return batch_of([self._begun(one) for one in batch])

    def incoming(self, batch: FrameBatch) -> tuple[FrameBatch, FrameBatch]:
        """(what came, what to send for it): whole messages stand where their last frame came; flow control that released
        something here is taken out, and what it released is to be sent."""
        minded = self._takes.keys() | {self._answered}
        if minded.isdisjoint(batch["id"].tolist()):
            return batch, batch[:0]
        whole, answers = list[bytes](), list[bytes]()
        for one in batch:
            payload, broken = one["data"][: one["length"]].tobytes(), one["flags"] & (ERROR | REMOTE)
            if broken or int(one["id"]) not in minded:
                whole.append(one.tobytes())
            elif self._released(payload, int(one["t_ns"]), answers):
                pass
            elif int(one["id"]) in self._takes:
                self._taken(one, payload, whole, answers)
            else:
                whole.append(one.tobytes())
        return batch_of(whole), batch_of(answers)

    def _begun(self, one: FrameBatch) -> bytes:
        identifier, length = int(one["id"]), int(one["length"])
        if identifier not in self._sends or length <= 8:
            return one.tobytes()
        sender = Sender(one["data"][:length].tobytes(), 8)
        self._under_way = identifier, sender
        return packed(identifier, sender.start(), t_ns=int(one["t_ns"]), flags=int(one["flags"]) & SENT)

    def _released(self, payload: bytes, t_ns: int, answers: list[bytes]) -> bool:
        """Whether it is flow control of what is under way from here."""
        if self._under_way is None or not payload or payload[0] >> 4 != _FLOW:
            return False
        identifier, sender = self._under_way
        try:
            answers += [packed(identifier, p, t_ns=t_ns, flags=self._flags) for p in sender.feed(payload)]
        except TransferError:  # who asked asks again
            self._under_way = None
        if sender.done:
            self._under_way = None
        return True

    def _taken(self, one: FrameBatch, payload: bytes, whole: list[bytes], answers: list[bytes]) -> None:
        identifier, t_ns = int(one["id"]), int(one["t_ns"])
        if payload and payload[0] >> 4 == _CONSECUTIVE:
            if self._doubled.get(identifier) == payload:  # doubled on the way: they differ in their number
                return
            self._doubled[identifier] = payload
        else:
            self._doubled.pop(identifier, None)
        event = self._takes[identifier].feed(payload)
        if event.send is not None:
            answers.append(packed(self._answers, event.send, t_ns=t_ns, flags=self._flags))
        if event.received is not None:
            whole.append(packed(identifier, event.received, t_ns=t_ns, flags=int(one["flags"])))


def of_host(messages: MessageMap) -> Segments:
    """The half of who asks for captures."""
    return Segments(messages, sends=("CaptureArm", "CaptureRead"), takes=("CaptureStatus",), answers="CaptureFlow",
                    answered="CaptureStatus", flags=SENT)  # fmt: skip


def of_controller(messages: MessageMap) -> Segments:
    """The half of who records them."""
    return Segments(messages, sends=("CaptureStatus",), takes=("CaptureArm", "CaptureRead"), answers="CaptureStatus",
                    answered="CaptureFlow")  # fmt: skip
