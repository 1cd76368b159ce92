"""A host that talks to the simulated controller of the rotary-linear motor directly, and beats."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count

import numpy as np
import numpy.typing as npt

from bench.link.codec import Decoder, encode
from bench.link.fault_injection import parse
from bench.link.frames import FD, FrameBatch, empty_batch, frame
from bench.rigfile import load_rig
from bench.rigfile.capture import Layout
from sim_backend.controller.controller import SimulatedController
from sim_backend.machines.rlsrm.operator import Attendant
from sim_backend.truth import draw, nominal

RIG = load_rig("rlsrm")
MESSAGES = RIG.messages
SESSION = 0x11
BEAT_S = 0.02
TICKS = 400  # of a beat
BEGIN_NS = 1_000_000_000  # nobody hears what comes at zero
Columns = Mapping[str, npt.NDArray[np.float64]]
SETTLED = {"rest_x": 0.0, "rest_angle": 0.0}


class Host:
    """The owner of a drawn machine, or of the nominal one (`seed` 0); `faults` of its controller as a command line has them."""

    def __init__(self, seed: int = 0, faults: tuple[str, ...] = (), **overrides: float) -> None:
        over = {**(nominal(RIG) if seed == 0 else {}), **overrides}
        self.device = SimulatedController(RIG, draw(RIG, seed, over), [parse(text) for text in faults])
        self.core = self.device.plant.core  # type: ignore[attr-defined]
        self.operator = Attendant(RIG, self.device.plant, self.device.truth)  # type: ignore[arg-type]
        self._tokens, self._beats, self.now = count(), count(1), BEGIN_NS
        self.telemetry: Columns = {}
        assert self.command("IDENTIFY") == "OK"  # which makes it the owner

    def run(self, seconds: float, *sent: FrameBatch, beating: bool = True) -> FrameBatch:
        out, frames = [empty_batch()], list(sent)
        for _ in range(round(seconds / BEAT_S)):
            if beating:
                counter = next(self._beats) % 65536
                frames.append(self.message("Heartbeat", session=SESSION, counter=counter))
            incoming = np.concatenate([empty_batch(), *frames])
            out.append(self.device.advance(TICKS, incoming, self.now))
            self.now, frames = self.now + round(BEAT_S * 1e9), []
        batch = np.concatenate(out)
        self.telemetry = Decoder(MESSAGES["Telemetry"]).decode(batch)[0]
        return batch

    def message(self, name: str, **values: float) -> FrameBatch:
        return frame(MESSAGES[name].identifier, encode(MESSAGES[name], values), t_ns=self.now, flags=FD)

    def command(self, name: str, session: int = SESSION) -> str:
        code = MESSAGES.code("Command", "code", name)
        sent = self.message("Command", session=session, code=code, token=next(self._tokens) % 256)
        reply, _ = Decoder(MESSAGES["CommandReply"]).decode(self.run(BEAT_S, sent))
        return MESSAGES["CommandReply"].signal("status").choices[int(reply["status"][0])]

    def set(self, **values: float) -> str:
        status = "OK"
        for name, value in values.items():
            index = RIG.parameters[name].index or 0
            sent = self.message("ParamSet", index=index, value=value, session8=SESSION & 0xFF)
            reply, _ = Decoder(MESSAGES["ParamReply"]).decode(self.run(BEAT_S, sent))
            status = MESSAGES["ParamReply"].signal("status").choices[int(reply["status"][0])]
        return status

    def hold(self) -> None:
        """Enabled, homed, held."""
        assert [self.command("ENABLE"), self.command("HOME")] == ["OK", "OK"]
        for _ in range(100):
            self.run(0.2)
            if self.device.state != "HOMING":
                break
        assert self.command("HOLD") == "OK"

    def go(self, seconds: float = 2.0, **targets: float) -> None:
        assert self.set(**{f"{axis}_target": value for axis, value in targets.items()}) == "OK"
        self.run(seconds)

    def states(self) -> list[str]:
        """Of what came last, in their order."""
        told = self.telemetry["state"].astype(int)
        first = [0, *(np.flatnonzero(np.diff(told)) + 1)]
        return [MESSAGES["Telemetry"].signal("state").choices[told[k]] for k in first]

    def arm(
        self, names: tuple[str, ...], length: int, trigger: str, source: str, level: float, before: int = 40
    ) -> Layout:
        """A capture of every tick."""
        assert RIG.capture is not None
        layout = Layout.of(RIG.capture, names)
        sent = self.message(
            "CaptureArm", session=SESSION, token=1, trigger=MESSAGES.code("CaptureArm", "trigger", trigger),
            source=RIG.capture.channels[source].index, channels0=layout.mask, channels1=0, divider=1, length=length,
            before=before, level=level,
        )  # fmt: skip
        status, _ = Decoder(MESSAGES["CaptureStatus"]).decode(self.run(BEAT_S, sent))
        assert MESSAGES["CaptureStatus"].signal("status").choices[int(status["status"][0])] == "OK"
        return layout

    def captured(self, layout: Layout) -> Columns:
        assert self.device.captures is not None
        assert self.device.captures.memory.state == "DONE"
        return layout.decoded(self.device.captures.memory.buffer)
