"""Requests to a controller and their replies: one at a time, each with a token, each recorded."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from bench.errors import NoReply
from bench.link import Link
from bench.link.codec import Decoder, encode
from bench.link.frames import ERROR, FD, SENT, FrameBatch, frame
from bench.link.segments import of_host
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.messages import Message
from drivers.waiting import patience_s

REPLIES = ("CommandReply", "ParamReply", "Identity", "Owner", "CaptureStatus")
EARLY = 1000  # frames that are kept until something records: 44 parameters asked and answered, and room for repeats
KEPT = 256  # replies that nobody waits for: another host may ask too
ATTEMPTS = 3  # times that one request is sent: a lost request or reply costs a repeat


class Dialogue:
    """What is asked of a controller and what it answers. `wait` lets the clock run until something is true."""

    def __init__(self, rig: RigFile, link: Link, now_ns: Callable[[], int]) -> None:
        self._rig, self._link, self._now_ns = rig, link, now_ns
        self._decoders = {m.identifier: Decoder(m) for n, m in rig.messages.messages.items() if n in REPLIES}
        self._segments = of_host(rig.messages) if rig.link.classic and rig.capture is not None else None
        self._answers: deque[tuple[str, dict[str, float], int]] = deque(maxlen=KEPT)
        self._held: dict[str, dict[str, float]] = {}
        self._token, self._tokens = 0, dict[str, int]()  # the last, and that of each kind of request
        self._misfit: dict[str, int] = {}  # length of replies that do not fit, since the last request
        self.wrong_length = 0  # replies that do not have the length of the DBC
        self._recorder: Recorder | None = None
        self._early: deque[FrameBatch] = deque(maxlen=EARLY)  # one frame each: what was said before anything recorded
        self.round_trip_ns: int | None = None  # the least so far
        self.repeats = 0  # requests sent again because no reply had come
        self.asked = 0  # how often the last request was sent

    @property
    def recorder(self) -> Recorder | None:
        """What records; one that begins is given what was asked and answered while none was there."""
        return self._recorder

    @recorder.setter
    def recorder(self, recorder: Recorder | None) -> None:
        self._recorder = recorder
        if recorder is not None and self._early:
            recorder.frames(self._link.name, np.concatenate(self._early))
            self._early.clear()

    def has(self, message: str) -> bool:
        """Whether the controller's DBC knows a message."""
        return message in self._rig.messages.messages

    def take(self, batch: FrameBatch) -> None:
        """Keep the replies in a batch for who waits for them. Destroyed frames are none; those of a wrong length are
        counted and left out."""
        identifiers = batch["id"].tolist()
        if self._decoders.keys().isdisjoint(identifiers):
            return
        if self._recorder is None:
            self._early.extend(batch[k : k + 1].copy() for k, i in enumerate(identifiers) if i in self._decoders)
        if self._segments is not None:
            batch, answers = self._segments.incoming(batch)
            self._go_out(answers)
        for k, identifier in enumerate(batch["id"].tolist()):
            decoder = self._decoders.get(identifier)
            if decoder is None or batch["flags"][k] & ERROR:
                continue
            name, length = decoder.message.name, int(batch["length"][k])
            if length != decoder.message.length:
                self.wrong_length += 1
                self._misfit[name] = length
                continue
            values = decoder.decode_one(batch["data"][k, :length].tobytes())
            self._answers.append((name, values, int(batch["t_ns"][k])))

    def ask(
        self, message: str, values: Mapping[str, float], reply: str, what: str, wait: Callable[..., None],
        again: Callable[[], bool] = lambda: True,
    ) -> dict[str, float]:  # fmt: skip
        """Send a request and wait for its reply: the one with its token, where the reply has one. A request whose reply
        does not come in time (`drivers.waiting.patience_s`) is sent again, byte for byte, and executed once; where what it
        was sent for may have changed, `again` looks first.

        Raises:
            NoReply: no reply to any of them.
        """
        self._next_token(message)
        self._forget()
        request, answer = self._rig.messages[message], self._rig.messages[reply]
        tokens = _has(request, "token") and _has(answer, "token")
        sent_ns = self._now_ns()
        found: list[tuple[dict[str, float], int]] = []

        def send() -> None:
            self.send(message, {**values, "token": self._token} if tokens else values)

        def arrived() -> bool:
            found.extend(
                (v, t) for n, v, t in self._answers if n == reply and (not tokens or v["token"] == self._token)
            )
            return bool(found)

        self._waited(send, wait, arrived, reply, what, again)
        values, t_ns = found[0]
        if self.asked == 1:  # else nobody knows which one is answered
            took = max(t_ns - sent_ns, 0)
            self.round_trip_ns = took if self.round_trip_ns is None else min(self.round_trip_ns, took)
        return values

    def ask_all(
        self, message: str, requests: Sequence[Mapping[str, float]], reply: str, key: str, wait: Callable[..., None]
    ) -> dict[float, dict[str, float]]:
        """Send many requests at once and wait for their replies; by the value of their signal `key`. Those without a
        reply are sent again, as `ask` does, and as long as each time some more are answered.

        Raises:
            NoReply: one is not answered.
        """
        self._forget()
        found: dict[float, dict[str, float]] = {}

        def send() -> None:
            for values in requests:
                if values[key] not in found:
                    self.send(message, values)

        def arrived() -> bool:
            found.update({v[key]: v for n, v, *_ in self._answers if n == reply})
            return all(values[key] in found for values in requests)

        self._waited(send, wait, arrived, reply, f"the replies to {message}", answered=lambda: len(found))
        return found

    def _next_token(self, message: str) -> None:
        """One up, round after 256; never that of the last request of the kind, which would be taken for a repeat."""
        step = 2 if self._tokens.get(message) == (self._token + 1) & 0xFF else 1
        self._token = self._tokens[message] = (self._token + step) & 0xFF

    def _forget(self) -> None:
        self._answers.clear()
        self._misfit.clear()

    def _waited(
        self, send: Callable[[], None], wait: Callable[..., None], arrived: Callable[[], bool], reply: str, what: str,
        again: Callable[[], bool] = lambda: True, answered: Callable[[], int] = lambda: 0,
    ) -> None:  # fmt: skip
        """Send, wait for the reply, send again: ATTEMPTS times that brought no answer. Where it came but did not fit, the
        error says so."""
        self.asked = vain = before = 0
        while True:
            self.asked += 1
            self.repeats += self.asked > 1
            send()
            try:
                return wait(arrived, patience_s(self._rig), what)
            except NoReply as error:
                vain, before = (vain + 1 if answered() == before else 0), answered()
                if vain < ATTEMPTS and not again():
                    raise NoReply(
                        f"{error}; it was not sent again, as the machine is no longer seen fit for it"
                    ) from error
                if vain == ATTEMPTS:
                    raise NoReply(f"{error}, though it was asked for {ATTEMPTS} times{self._seen(reply)}") from error

    def _seen(self, reply: str) -> str:
        """What came in place of a reply."""
        if reply in self._misfit:
            stated = self._rig.messages[reply].length
            return (
                f". A {reply} of {self._misfit[reply]} bytes came, the DBC says {stated}: does the firmware's message map "
                "match the rig file's?"
            )
        tokens = sorted({int(v["token"]) for n, v, _ in self._answers if n == reply and "token" in v})
        if tokens:
            return f". {reply} with token {', '.join(map(str, tokens[:4]))} came; expected {self._token}"
        return ""

    def begin(self, message: str, values: Mapping[str, float]) -> int:
        """Send a request that is answered by something else than a reply, or refused by one; its token."""
        self._next_token(message)
        self._forget()
        self.send(message, {**values, "token": self._token})
        return self._token

    def heard(self, reply: str, token: int) -> dict[str, float] | None:
        """The reply with a token, if one came since that request."""
        return next((v for n, v, _ in self._answers if n == reply and v["token"] == token), None)

    def send(self, message: str, values: Mapping[str, float]) -> None:
        """Send a message as it is; of one that knows no owner, without the session."""
        m = self._rig.messages[message]
        if "session" in values and not _has(m, "session"):
            values = {name: value for name, value in values.items() if name != "session"}
        batch = frame(m.identifier, encode(m, values), flags=SENT | (FD if m.fd else 0), t_ns=self._now_ns())
        self._go_out(batch if self._segments is None else self._segments.outgoing(batch))

    def _go_out(self, batch: FrameBatch) -> None:
        if not len(batch):
            return
        self._link.send(batch)
        if self._recorder is not None:
            self._recorder.frames(self._link.name, batch)
        else:
            self._early.append(batch)

    def send_held(self, message: str, values: Mapping[str, float]) -> None:
        """Send a message whose other signals keep the values that they were last given. A value that the message cannot
        carry is not kept: what comes after it, such as make-safe, must get through."""
        held = {**self._held.get(message, {}), **values}
        encode(self._rig.messages[message], held)
        self._held[message] = held
        self.send(message, held)

    def hold(self, message: str, signal: str, value: float) -> None:
        """What a signal of a held message starts from."""
        self._held.setdefault(message, {}).setdefault(signal, value)


def status_of(message: Message, reply: Mapping[str, float]) -> str:
    """The name of a reply's status."""
    return message.signal("status").choices.get(int(reply["status"]), f"status {reply['status']:g}")


def no_reply(link: str, what: str, timeout_s: float) -> NoReply:
    """Telemetry may go on: the text does not claim that the link is dead."""
    return NoReply(f"link {link}: waited {timeout_s:g} s for {what}; it did not come")


def _has(message: Message, signal: str) -> bool:
    return any(s.name == signal for s in message.signals)


def commanded(rig: RigFile, command: str) -> dict[str, dict[str, float]]:
    """Values by message that ask for a command, names replaced by their codes."""
    out: dict[str, dict[str, float]] = {}
    found: Mapping[str, int | float | str] = rig.binding.command(command)
    for path, value in found.items():
        message, _, signal = path.partition(".")
        code = rig.messages.code(message, signal, value) if isinstance(value, str) else float(value)
        out.setdefault(message, {})[signal] = code
    return out
