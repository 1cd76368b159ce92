"""A simulated AMB stand with its controller's driver, on CAN or on a serial line, for tests of captures."""

from __future__ import annotations

from collections.abc import Sequence

from bench.link import fault_injection
from bench.link.session import Session
from bench.recording.recorder import Recorder, RunHeader
from bench.rigfile import RigFile, load_rig
from drivers.capture import ControllerCapture
from drivers.controller import Controller
from sim_backend.endpoint import SimulatedRig
from sim_backend.truth import draw

RIG = load_rig("amb5dof")
POSITIONS = ("pos_yi", "pos_zi", "pos_yo", "pos_zo")


def rig_on(kind: str, reconnect_s: float = 0.0) -> RigFile:
    """amb5dof with its controller on `can` or `serial`."""
    url = '"slcan:socket://127.0.0.1:28511"'
    line = 'url = "serial:/dev/ttyS9?baudrate=3000000"' if kind == "serial" else f"url = {url}"
    text = RIG.toml_text.replace(f"url = {url}", f"{line}\nreconnect_s = {reconnect_s}", 1)
    return RigFile.parse(text, RIG.dbc_text)


class Stand:
    """The rig and its driver, connected, nothing switched on. Injected faults count from the connection."""

    def __init__(
        self, kind: str = "can", injected: Sequence[str] = (), reconnect_s: float = 0.0, seed: int = 3
    ) -> None:
        rig = rig_on(kind, reconnect_s)
        found = [fault_injection.parse(text) for text in injected]
        self.machine = SimulatedRig(rig, draw(rig, seed), 1, found, substeps=1)
        self.controller = Controller(rig, self.machine.link, self.machine, Session(1, 1_767_225_600, "test"))
        self.controller.connect()
        assert self.controller.capture is not None
        self.capture: ControllerCapture = self.controller.capture
        self.begun_ns = self.machine.now_ns()

    def recorder(self, path: object) -> Recorder:
        header = RunHeader({"run": {}}, {"rig.toml": RIG.toml_text.encode(), "rig.dbc": RIG.dbc_text.encode()})
        recorder = Recorder(
            path, clock=self.controller.clock, streams=[self.controller.telemetry.layout], header=header
        )  # type: ignore[arg-type]
        self.controller.recorder = recorder
        return recorder

    def recorded(self, seconds: float = 0.5, channels: Sequence[str] = POSITIONS) -> bytes:
        """Have a capture recorded; its buffer as the controller has it."""
        self.capture.arm(channels, seconds=seconds)
        self.capture.wait(2 * seconds + 1)
        port = self.machine.device.captures
        assert port is not None
        return port.memory.buffer

    def uploaded(self) -> bytes:
        """What an upload brings, as a buffer."""
        data = self.capture.upload()
        layout = self.capture._present()[0]
        return layout.encoded([data.columns[name] for name in layout.channels])
