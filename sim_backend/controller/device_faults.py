"""Faults inside the simulated controller: it restarts, sees a heartbeat whose counter stands still, or answers nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from bench.errors import ConfigError
from bench.link.fault_injection import DEVICE_ONLY, REBOOT_S, Fault
from bench.link.frames import FrameBatch, empty_batch
from bench.link.payloads import put, taken
from bench.rigfile import RigFile
from bench.rigfile.messages import Signal
from sim_backend.machine import SimulatedPlant


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
        plant: whose ticks count.

    Raises:
        ConfigError: another kind.
    """

    def __init__(self, rig: RigFile, faults: Sequence[Fault], plant: SimulatedPlant) -> None:
        if wrong := [str(f) for f in faults if f.kind not in (*DEVICE_ONLY, "mute")]:
            raise ConfigError(f"--fault {', '.join(wrong)}: happens on the link, not inside the controller")
        self._faults = tuple(faults)
        beat = rig.messages[rig.binding.heartbeat]
        self._beat = beat.identifier
        self._counter = beat.signal(rig.binding.heartbeat_counter)
        first, *others = (rig.messages[name] for name in rig.binding.telemetry)
        self._first, self._others = first.identifier, [m.identifier for m in others]
        self._sequences = {first.identifier: first.signal(rig.binding.sequence)}
        self._sequences |= {m.identifier: m.signal(rig.binding.counter) for m in others}
        self._ticks = {first.identifier: first.signal(rig.binding.tick)}
        status = rig.messages.messages.get("CaptureStatus")
        if status is not None and rig.capture is not None:
            self._ticks[status.identifier] = status.signal("tick")
        self._tick_ns, self._period_ticks = round(plant.tick_s * 1e9), plant.period_ticks
        self._period_ns = self._period_ticks * self._tick_ns
        self._last = np.zeros(1, np.uint64)  # the counter that a stuck heartbeat repeats
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
        at = t0_ns + here * self._tick_ns
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
            due = max(0, -((t0_ns - fault.window(self._origin)[0]) // self._tick_ns))
            due += -(tick + due) % self._period_ticks
            if due <= ticks:
                found.append((due, fault))
        if not found:
            return None
        due, fault = min(found, key=lambda one: one[0])
        return fault, due

    def _restart(self, device: Device, fault: Fault, at_ns: int) -> None:
        self._done.add(fault)
        silent = fault.duration_s if fault.duration_s is not None else REBOOT_S
        periods = max(1, round(silent * 1e9 / self._period_ns))
        self._deaf_until = at_ns + periods * self._period_ns
        self._first_tick, self._first_sequence = device.plant.tick + periods * self._period_ticks, None
        device.restart()

    def _part(self, device: Device, ticks: int, incoming: FrameBatch, t0_ns: int) -> FrameBatch:
        sent = device.run(ticks, self._heard(incoming), t0_ns)
        return self._renumbered(sent[sent["t_ns"] > self._deaf_until])

    def _heard(self, incoming: FrameBatch) -> FrameBatch:
        """What the controller makes of what the host sends."""
        out = incoming[incoming["t_ns"] > self._deaf_until].copy()
        beats = out["id"] == self._beat
        stuck = beats & self._during("stuck-heartbeat", out)
        for k in np.flatnonzero(beats):  # in order: a stuck one repeats the last that moved
            if stuck[k]:
                put(out["data"][k : k + 1], self._counter, self._last)
            else:
                self._last = taken(out["data"][k : k + 1], self._counter)
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
        """Sequence, rolling counts and tick of the telemetry, and a capture's tick, count from the present boot. What is left
        of a sample whose first message nobody heard is not sent."""
        if not self._first_tick:
            return sent
        if self._first_sequence is None:
            firsts = np.flatnonzero(sent["id"] == self._first)
            if not len(firsts):
                return sent[~np.isin(sent["id"], self._others)]
            begun = np.arange(len(sent)) >= firsts[0]
            sent = sent[begun | ~np.isin(sent["id"], self._others)]
        out = sent.copy()
        for identifier, s in self._sequences.items():
            mine = np.flatnonzero(out["id"] == identifier)
            if len(mine) and self._first_sequence is None:
                self._first_sequence = int(taken(out["data"][mine[:1]], s)[0])
            self._count_from(out, mine, s, self._first_sequence or 0)
        for identifier, s in self._ticks.items():
            self._count_from(out, np.flatnonzero(out["id"] == identifier), s, self._first_tick)
        return out

    def _count_from(self, out: FrameBatch, mine: npt.NDArray[np.intp], s: Signal, first: int) -> None:
        data = out["data"][mine]
        put(data, s, taken(data, s).astype(np.int64) - first)
        out["data"][mine] = data
