"""Faults inside the simulated controller: it restarts, sees a heartbeat whose counter stands still, or answers nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from bench.errors import ConfigError
from bench.link.fault_injection import DEVICE_ONLY, REBOOT_S, Fault
from bench.link.frames import FrameBatch, empty_batch
from bench.rigfile import RigFile
from sim_backend.core import PERIOD_TICKS, TICK_S
from sim_backend.machine import SimulatedPlant

TICK_NS = round(TICK_S * 1e9)
PERIOD_NS = PERIOD_TICKS * TICK_NS
STATUS_TICK = slice(24, 28)  # of CaptureStatus


class Device(Protocol):
    """The sound controller, as its faults see it."""

    @property
    def plant(self) -> SimulatedPlant: ...
    def run(self, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch: ...  # without faults
    def restart(self) -> None: ...  # as after power-on


class DeviceFaults:
    """Stands between a controller's wire and the controller. Times count from the first host frame that comes in.

    Args:
        rig: for the names and places in its messages.
        faults: of the kinds reboot, stuck-heartbeat and mute.

    Raises:
        ConfigError: another kind.
    """

    def __init__(self, rig: RigFile, faults: Sequence[Fault]) -> None:
        if wrong := [str(f) for f in faults if f.kind not in (*DEVICE_ONLY, "mute")]:
            raise ConfigError(f"--fault {', '.join(wrong)}: happens on the link, not inside the controller")
        self._faults = tuple(faults)
        beat = rig.messages[rig.binding.heartbeat]
        self._beat = beat.identifier
        self._counter = beat.signal(rig.binding.heartbeat_counter).start // 8
        self._telemetry = rig.messages[rig.binding.telemetry[0]].identifier
        status = rig.messages.messages.get("CaptureStatus")
        self._status = status.identifier if status is not None else 0
        self._last = np.zeros(2, np.uint8)  # the counter that a stuck heartbeat repeats
        self._origin: int | None = None
        self._done: set[Fault] = set()
        self._deaf_until = 0  # neither hears nor speaks while it starts
        self._first_tick = 0  # of the present boot
        self._first_sequence: int | None = 0

    def advance(self, device: Device, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch:
        """As `SimulatedController.advance`: frames are taken at their `t_ns`, what is sent carries its times."""
        if self._origin is None and len(incoming):
            self._origin = int(incoming["t_ns"][0])
        reboot = self._next_reboot(device.plant.tick, ticks, t0_ns)
        if reboot is None:
            return self._part(device, ticks, incoming, t0_ns)
        fault, here = reboot
        at = t0_ns + here * TICK_NS
        first = incoming["t_ns"] < at
        sent = [self._part(device, here, incoming[first], t0_ns)] if here else []
        self._restart(device, fault, at)
        if ticks > here:
            sent.append(self.advance(device, ticks - here, incoming[~first], at))
        return np.concatenate([empty_batch(), *sent])

    def _next_reboot(self, tick: int, ticks: int, t0_ns: int) -> tuple[Fault, int] | None:
        """The first restart within so many ticks; it comes at the end of a telemetry period."""
        if self._origin is None:
            return None
        found: list[tuple[int, Fault]] = []
        for fault in self._faults:
            if fault.kind != "reboot" or fault in self._done:
                continue
            due = max(0, -((t0_ns - fault.window(self._origin)[0]) // TICK_NS))
            due += -(tick + due) % PERIOD_TICKS
            if due <= ticks:
                found.append((due, fault))
        if not found:
            return None
        due, fault = min(found, key=lambda one: one[0])
        return fault, due

    def _restart(self, device: Device, fault: Fault, at_ns: int) -> None:
        self._done.add(fault)
        silent = fault.duration_s if fault.duration_s is not None else REBOOT_S
        periods = max(1, round(silent * 1e9 / PERIOD_NS))
        self._deaf_until = at_ns + periods * PERIOD_NS
        self._first_tick, self._first_sequence = device.plant.tick + periods * PERIOD_TICKS, None
        device.restart()

    def _part(self, device: Device, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch:
        sent = device.run(ticks, self._heard(incoming), t0_ns)
        return self._renumbered(sent[sent["t_ns"] > self._deaf_until])

    def _heard(self, incoming: FrameBatch) -> FrameBatch:
        """What the controller makes of what the host sends."""
        out = incoming[incoming["t_ns"] > self._deaf_until].copy()
        beats = out["id"] == self._beat
        counter = slice(self._counter, self._counter + 2)
        stuck = beats & self._during("stuck-heartbeat", out)
        for k in np.flatnonzero(beats):  # in order: a stuck one repeats the last that moved
            if stuck[k]:
                out["data"][k, counter] = self._last
            else:
                self._last = out["data"][k, counter].copy()
        answered: FrameBatch = out[beats | ~self._during("mute", out)]
        return answered

    def _during(self, kind: str, batch: FrameBatch) -> npt.NDArray[np.bool_]:
        hit = np.zeros(len(batch), bool)
        for fault in self._faults:
            if fault.kind == kind and self._origin is not None:
                begin, end = fault.window(self._origin)
                hit |= (batch["t_ns"] >= begin) & (batch["t_ns"] < end)
        return hit

    def _renumbered(self, sent: FrameBatch) -> FrameBatch:
        """Sequence and tick of the telemetry, and a capture's tick, count from the present boot (places as in
        controller/telemetry.py and the DBC)."""
        if not self._first_tick:
            return sent
        out = sent.copy()
        mine = out["id"] == self._telemetry
        sequence = np.ascontiguousarray(out["data"][mine, 0:2]).view("<u2")[:, 0]
        tick = np.ascontiguousarray(out["data"][mine, 2:6]).view("<u4")[:, 0]
        if len(sequence):
            if self._first_sequence is None:
                self._first_sequence = int(sequence[0])
            sequence = (sequence.astype(np.int64) - self._first_sequence).astype("<u2")
            tick = (tick.astype(np.int64) - self._first_tick).astype("<u4")
            out["data"][mine, 0:2] = sequence.view(np.uint8).reshape(-1, 2)
            out["data"][mine, 2:6] = tick.view(np.uint8).reshape(-1, 4)
        for k in np.flatnonzero(out["id"] == self._status) if self._status else ():  # of a capture of this boot
            told = int.from_bytes(out["data"][k, STATUS_TICK].tobytes(), "little") - self._first_tick
            out["data"][k, STATUS_TICK] = np.frombuffer((told & 0xFFFFFFFF).to_bytes(4, "little"), np.uint8)
        return out
