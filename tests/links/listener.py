"""Somebody else on the bus: hears what the controller says, and when, without a bench."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np

from bench.link.codec import Decoder
from bench.link.slcanstream import SlcanStream
from bench.rigfile.messages import load_messages

RIGS = Path(__file__).resolve().parents[2] / "rigs"


@dataclass(frozen=True)
class Heard:
    """One telemetry message: `t_ns` is CLOCK_MONOTONIC at its arrival."""

    t_ns: int
    tick: int
    state: str
    fault: str
    speed: float
    host_age: float


class Listener:
    """Listens on an SLCAN endpoint over TCP (`slcan:socket://HOST:PORT`) of a rig."""

    def __init__(self, endpoint: str, rig: str = "tsbs12") -> None:
        self._telemetry = load_messages((RIGS / f"{rig}.dbc").read_text(encoding="utf-8"))["Telemetry"]
        host, _, port = endpoint.rpartition("//")[2].rpartition(":")
        self._socket = socket.create_connection((host, int(port)))
        self._socket.sendall(b"C\rS8\rY5\rO\r")
        self.heard: list[Heard] = []
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        message = self._telemetry
        stream, decoder = SlcanStream(), Decoder(message)
        states, faults = message.signal("state").choices, message.signal("fault").choices
        while True:
            try:
                data = self._socket.recv(65536)
            except OSError:
                return
            if not data:
                return
            now = time.monotonic_ns()
            batch = stream.feed(data, now)
            batch = batch[batch["id"] == message.identifier]
            columns = decoder.decode_payloads(np.ascontiguousarray(batch["data"]))
            with self._news:
                for k in range(len(batch)):
                    v = {n: float(columns[n][k]) for n in ("tick", "state", "fault", "speed", "host_age")}
                    state, fault = states[int(v["state"])], faults[int(v["fault"])]
                    self.heard.append(Heard(now, int(v["tick"]), state, fault, v["speed"], v["host_age"]))
                self._news.notify_all()

    def wait_for(self, what: Callable[[Heard], bool], since: int = 0, timeout_s: float = 60.0) -> Heard:
        """The first message after the first `since` of which something is true."""
        with self._news:
            found = self._news.wait_for(lambda: next((h for h in self.heard[since:] if what(h)), None), timeout_s)
        assert found, f"not heard; last {self.heard[-1:]}"
        return found

    def __enter__(self) -> Listener:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._thread.join()
