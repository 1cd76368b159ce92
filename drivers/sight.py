"""What can be seen of a machine while it is made safe: telemetry that still changes, and the controller's replies."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from bench.link.codec import Decoder
from bench.link.frames import ERROR, FrameBatch
from bench.link.telemetry import TelemetryDecoder
from bench.rigfile import RigFile
from bench.rigfile.binding import UNKNOWN, UNSEEN
from bench.rigfile.roles import ANGLE, PULSES, SPEED, told_in, wraps_at
from bench.rigfile.turned import turned
from bench.samples import SampleBlock
from drivers.waiting import SILENCE_S

REPLY = "CommandReply"
SLOWEST_WINDOW_S = 1.0  # over which pulses are counted


class Sight:
    """Takes what the controller's link brings. `mode` is what the newest telemetry says, `now_ns` the host's time.

    A source that does not change says nothing: readings may be those of a moment that is long over. Telemetry changes
    while its tick, its sequence and some reading or state go on. A reply changes when its state is another than before.
    """

    def __init__(
        self, rig: RigFile, telemetry: TelemetryDecoder, mode: Callable[[], str], now_ns: Callable[[], int]
    ) -> None:
        self._telemetry, self._mode_told, self._now_ns = telemetry, mode, now_ns
        self._binding, self._states = rig.binding, rig.choices("state")
        self._turned = turned(rig)
        self._angle, self._speed, self._count = (told_in(rig, role) for role in (ANGLE, SPEED, PULSES))
        self._wraps = wraps_at(rig, self._count) if self._count else 0.0
        messages = rig.messages.messages
        replies = REPLY in messages and any(s.name == "state" for s in messages[REPLY].signals)
        self._reply = Decoder(messages[REPLY]) if replies else None
        self._answered = UNSEEN  # the state of the newest reply
        self._answered_ns = self._changed_ns = -1
        self._before = UNSEEN  # the state of the reply before it, or of the telemetry then
        self._block: SampleBlock | None = None
        self._pulses: list[tuple[int, float]] = []

    def frames(self, batch: FrameBatch) -> None:
        """Replies in a batch."""
        if self._reply is None or not (batch["id"] == self._reply.message.identifier).any():
            return
        m = self._reply.message
        good = (batch["id"] == m.identifier) & (batch["length"] == m.length) & (batch["flags"] & ERROR == 0)
        for one in batch[good]:
            code = int(self._reply.decode_one(one["data"][: m.length].tobytes())["state"])
            name = self._states.get(code)
            mode = self._binding.mode(name) if name is not None else None
            if mode is None:
                continue
            self._answered_ns = int(one["t_ns"])
            if mode != self._answered:
                self._before = self._answered if self._answered != UNSEEN else self._mode_told()
                self._answered = mode

    def samples(self, blocks: Sequence[SampleBlock]) -> None:
        """The newest samples, and the pulses of the last second where the rig has them."""
        for b in blocks:
            self._block = b if len(b) > 1 else self._block
            if self._count:
                self._pulses.append((int(b.t_ns[-1]), float(b.columns[self._count][-1])))
                while self._pulses[-1][0] - self._pulses[0][0] > SLOWEST_WINDOW_S * 1e9:
                    self._pulses.pop(0)

    @property
    def alive(self) -> bool:
        """Whether telemetry comes and changes."""
        still = self._telemetry.stillness
        return still.alive and self._now_ns() - still.newest_ns < SILENCE_S * 1e9

    @property
    def told(self) -> bool:
        """Whether telemetry tells the state."""
        return self.alive and self._mode_told() != UNKNOWN

    @property
    def mode(self) -> str:
        """What the controller's state amounts to, by a source that changes or by an answer of this make-safe; UNKNOWN for
        a state without a name, UNSEEN where nothing tells."""
        if self.told:
            return self._mode_told()
        if self._answered != UNSEEN:
            return self._answered
        return UNKNOWN if self.alive else UNSEEN

    @property
    def answers(self) -> bool:
        """Whether the controller's replies tell its state at all."""
        return self._reply is not None

    @property
    def answered(self) -> str:
        """The state of the newest reply of this make-safe, UNSEEN before the first."""
        return self._answered

    def forget(self) -> None:
        """Replies from before make-safe are no answers of it."""
        self._answered = self._before = UNSEEN
        self._answered_ns = -1

    @property
    def answered_ns(self) -> int:
        """When the newest reply came; -1 before the first."""
        return self._answered_ns

    def speeds_rad_s(self) -> Mapping[str, float]:
        """Speeds by source, each without its sign, of the sources that change. A shaft that nothing turns rests as long as
        the telemetry goes on: without this nobody could say that it is slow, and it would never be landed."""
        if not self.alive:
            return {}
        if not self._turned:
            return {"nothing turns it": 0.0}
        latest, out = self._telemetry.latest, dict[str, float]()
        if self._speed in latest:
            out["speed"] = abs(latest[self._speed])
        b = self._block
        if b is not None and self._angle and (took := int(b.t_ns[-1] - b.t_ns[0])) > 0:
            angle = np.unwrap(b.columns[self._angle])
            out["angle"] = abs(float(angle[-1] - angle[0])) / took * 1e9
        if len(self._pulses) > 1 and (took := self._pulses[-1][0] - self._pulses[0][0]) > 0:
            turns = (self._pulses[-1][1] - self._pulses[0][1]) % self._wraps
            out["pulses"] = 2 * math.pi * max(turns - 1, 0.0) / took * 1e9  # at least so fast
        return out

    @property
    def came_down(self) -> bool:
        """Whether replies have told a state that changed to LEVITATED: below the landing speed, as the controller sees it."""
        return self._answered == "LEVITATED" and self._before in ("SPINNING", "COASTING")
