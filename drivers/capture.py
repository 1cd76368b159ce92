"""Captures: recorded inside the controller at its full rate, uploaded, written into the recording as a stream of their own."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence

import numpy as np

from bench.clock import Clock, TickClock
from bench.errors import BenchError
from bench.link.session import Session
from bench.link.telemetry import TelemetryDecoder
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.capture import LONGEST_DIVIDER, NOW, CaptureData, CaptureSpec, Layout, Trigger
from bench.samples import ChannelInfo, SampleBlock, StreamLayout
from drivers.capture_upload import Progress, Upload
from drivers.dialogue import Dialogue, status_of

LOOK_S, LONG_S = 0.02, 0.5
WAITING = 0.2  # of what is left at least, between two looks before the trigger
_log = logging.getLogger("drivers")


class ControllerCapture:
    """The role `bench.procedure.roles.Capture` of a controller whose rig file has a table `capture`.

    `clock` is the controller's, `wait` lets it run until something is true, `telemetry` knows when its ticks are.
    """

    def __init__(
        self, rig: RigFile, spec: CaptureSpec, dialogue: Dialogue, upload: Upload, session: Session,
        telemetry: TelemetryDecoder, clock: Clock, wait: Callable[..., None],
    ) -> None:  # fmt: skip
        self._rig, self._spec, self._dialogue, self._uploads = rig, spec, dialogue, upload
        self._session, self._telemetry, self._clock, self._wait = session, telemetry, clock, wait
        self._tick_s = rig.devices["controller"].tick_s
        self._ticks = TickClock(self._tick_s)
        self._armed: tuple[Layout, Trigger, int] | None = None  # the last one, and its number
        self._recorder: Recorder | None = None
        self._recorded = 0
        self.take = upload.take

    @property
    def recorder(self) -> Recorder | None:
        """What records; a new one counts its captures from 1."""
        return self._recorder

    @recorder.setter
    def recorder(self, recorder: Recorder | None) -> None:
        self._recorder, self._recorded = recorder, 0

    @property
    def channels(self) -> tuple[str, ...]:
        """What it can record."""
        return tuple(self._spec.channels)

    @property
    def memory_bytes(self) -> int:
        """What a capture may take."""
        return self._spec.memory_bytes

    @property
    def rate_hz(self) -> float:
        """The highest rate: a sample each control tick."""
        return 1 / self._tick_s

    def arm(
        self, channels: Sequence[str], *, seconds: float, before_s: float = 0.0, rate_hz: float | None = None,
        trigger: Trigger = NOW,
    ) -> None:  # fmt: skip
        """Let the controller record `seconds` in all, `before_s` of them before the trigger. What it holds is given up.

        Args:
            rate_hz: the highest rate, or it divided by a whole number; the highest by default.

        Raises:
            BenchError: nothing was sent: an unknown channel, a rate that is none, more than the memory holds. Or the
                controller refuses, as it does while a capture is under way.
        """
        layout, divider = Layout.of(self._spec, channels), self._divider(rate_hz)
        length = round(seconds / (divider * self._tick_s))
        before = round(before_s / (divider * self._tick_s))
        self._fits(layout, length, before)
        values = {**self._watched(trigger), "channels0": layout.mask & 0xFFFFFFFF, "channels1": layout.mask >> 32,
                  "divider": divider, "length": length, "before": before}  # fmt: skip
        reply = self._ask("CaptureArm", values)
        status, state = self._said(reply)
        if status == "WRONG_STATE" and (self._armed is None or self._armed[2] != reply["number"]):
            self.cancel()  # of a bench that is gone, or the answer to its arming was lost
            reply = self._ask("CaptureArm", values)
            status, state = self._said(reply)
        if status == "WRONG_STATE":
            raise BenchError(
                f"capture: one is {state} already, and the controller records one at a time: wait, or cancel()"
            )
        if status != "OK":
            asked = f"channels {', '.join(layout.channels)}; trigger {waits_for(trigger)}; {length} samples"
            told = f"; its memory is {reply['memory']:.0f} bytes" if reply["memory"] else ""
            raise BenchError(f"capture: the controller refuses it: {status}; asked for were {asked}{told}")
        self._armed = layout, trigger, int(reply["number"])

    def wait(self, timeout_s: float) -> None:
        """Return when the armed capture is recorded.

        Raises:
            BenchError: nothing is armed; or it is not recorded in time, and stays armed.
        """
        begin, (_, trigger, _) = self._clock.now_ns(), self._present()
        while True:
            reply = self._ask("CaptureAsk", {"code": self._code("STATUS")})
            state = self._checked(reply)
            if state == "DONE":
                return
            left = timeout_s - (self._clock.now_ns() - begin) * 1e-9
            if left <= 0:
                for_what = f" for {waits_for(trigger)}" if state == "ARMED" else ""
                raise BenchError(
                    f"capture: not recorded within {timeout_s:g} s: it is {state}{for_what}, {reply['samples']:.0f} samples so "
                    "far. Next: a longer time, another trigger, or cancel()"
                )
            self._clock.sleep(min(max(self._due_s(reply, state), LOOK_S), LONG_S, left))

    def upload(self, progress: Progress | None = None, **labels: str | float) -> CaptureData:
        """Fetch what was recorded, check it whole, and write it into the recording with `labels`.

        Raises:
            BenchError: nothing is recorded, or the controller does not have it any more.
            LinkError: it does not arrive.
        """
        layout, trigger, number = self._present()
        status = self._ask("CaptureAsk", {"code": self._code("STATUS")})
        state = self._checked(status)
        if state != "DONE":
            raise BenchError(f"capture: it is {state}: nothing to upload yet; wait() returns when there is")
        size, begin = int(status["size"]), self._clock.now_ns()
        buffer = self._uploads.fetch(number, size, int(status["crc"]), progress or (lambda done, of: None))
        took = max((self._clock.now_ns() - begin) * 1e-9, 1e-9)
        _log.info("capture %d: %d bytes in %.2f s, %.0f kB/s", number, size, took, size / took / 1e3)
        period = int(status["divider"])
        tick, start_ns = self._telemetry.placed(int(status["tick"]))
        data = CaptureData(
            f"capture/{self._recorded + 1}", 1 / (period * self._tick_s), tick, start_ns, int(status["trigger"]),
            layout.decoded(buffer),
        )  # fmt: skip
        self._record(data, layout, trigger, period, labels)
        return data

    def cancel(self) -> None:
        """Give up what is armed or recorded."""
        self._ask("CaptureAsk", {"code": self._code("CANCEL")})
        self._armed = None

    def _record(
        self, data: CaptureData, layout: Layout, trigger: Trigger, period: int, labels: dict[str, str | float]
    ) -> None:
        if self._recorder is None:
            return
        self._recorded += 1
        period_ns, count = self._ticks.ns(period), len(next(iter(data.columns.values())))
        channels = tuple(ChannelInfo(name, c.unit) for name, c in layout.channels.items())
        self._recorder.stream(StreamLayout(data.stream, period_ns, channels))
        steps = period * np.arange(count)
        self._recorder.samples(SampleBlock(
            data.stream, 0, (data.first_tick + steps).astype(np.uint64), data.start_ns + self._ticks.all_ns(steps),
            self._clock.now_ns(), 0, data.columns,
        ))  # fmt: skip
        self._recorder.event(
            "capture", stream=data.stream, labels=labels, samples=count, rate_hz=data.rate_hz, first_tick=data.first_tick,
            start_ns=data.start_ns, trigger=data.trigger,
            waited_for={"kind": trigger.kind, "channel": trigger.channel, "level": trigger.level},
        )  # fmt: skip

    def _divider(self, rate_hz: float | None) -> int:
        if rate_hz is None:
            return 1
        ratio = self.rate_hz / rate_hz if rate_hz > 0 else math.inf
        divider = round(ratio) if ratio < 2 * LONGEST_DIVIDER else 0
        if not 1 <= divider <= LONGEST_DIVIDER or not math.isclose(ratio, divider, rel_tol=1e-6):
            raise BenchError(
                f"capture: found a rate of {rate_hz:g} Hz; expected {self.rate_hz:g} Hz divided by 1 to {LONGEST_DIVIDER}"
            )
        return divider

    def _fits(self, layout: Layout, length: int, before: int) -> None:
        size, room = layout.sample.itemsize, self.memory_bytes
        if not 0 <= before < length:
            raise BenchError(
                f"capture: found {length} samples, {before} of them before the trigger; expected more than those"
            )
        if length * size > room:
            raise BenchError(
                f"capture: {length} samples of {len(layout.channels)} channels take {length * size} bytes; the controller's "
                f"memory holds {room}, which is {room // size} samples. Next: fewer channels, a lower rate, or less time"
            )

    def _watched(self, trigger: Trigger) -> dict[str, float]:
        try:
            code = self._rig.messages.code("CaptureArm", "trigger", trigger.kind)
        except KeyError as error:
            raise BenchError(f"capture: {error.args[0]}: this controller does not wait for that") from error
        source = 0
        if trigger.kind in ("RISES", "FALLS"):
            source = next(iter(Layout.of(self._spec, (trigger.channel,)).channels.values())).index
        if not math.isfinite(trigger.level):
            raise BenchError(f"capture: found a trigger level of {trigger.level}; expected a number")
        return {"trigger": code, "source": source, "level": trigger.level}

    def _present(self) -> tuple[Layout, Trigger, int]:
        if self._armed is None:
            raise BenchError("capture: nothing is armed")
        return self._armed

    def _checked(self, reply: dict[str, float]) -> str:
        """The state of the capture that was armed.

        Raises:
            BenchError: the controller has another one, or none.
        """
        status, state = self._said(reply)
        if status != "OK" or int(reply["number"]) != self._present()[2] or state == "IDLE":
            raise BenchError(f"capture: the controller does not have it any more ({status}, {state}): did it restart?")
        return state

    def _due_s(self, reply: dict[str, float], state: str) -> float:
        """When to look again: once the rest is recorded; a part of that while it is not known when the rest begins."""
        length = reply["size"] / self._present()[0].sample.itemsize
        if state == "TRIGGERED":
            return (length - reply["samples"]) * reply["divider"] * self._tick_s
        return WAITING * (length - min(reply["samples"], reply["trigger"])) * reply["divider"] * self._tick_s

    def _ask(self, message: str, values: dict[str, float]) -> dict[str, float]:
        full = {**values, "session": self._session.number}
        return self._dialogue.ask(message, full, "CaptureStatus", "the state of the capture", self._wait)

    def _said(self, reply: dict[str, float]) -> tuple[str, str]:
        message = self._rig.messages["CaptureStatus"]
        return status_of(message, reply), message.signal("state").choices.get(int(reply["state"]), "unknown")

    def _code(self, name: str) -> int:
        return self._rig.messages.code("CaptureAsk", "code", name)


def waits_for(trigger: Trigger) -> str:
    """A trigger, for the reader."""
    if trigger.kind in ("NOW", "PULSE"):
        return trigger.kind
    return " ".join(word for word in (trigger.kind, trigger.channel, f"{trigger.level:g}") if word)
