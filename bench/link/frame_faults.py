"""Faults at work on a stream of frames: what is lost, doubled, held back, destroyed, and when a link is cut."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from bench.errors import LinkError
from bench.link.fault_injection import CUTS, DEVICE_ONLY, FOREVER, SAID, SHARES, Fault, Mask
from bench.link.frames import ERROR, FrameBatch, empty_batch
from bench.link.link import LinkStats


@dataclass
class _Stage:
    """One fault at work. Its random numbers are drawn frame by frame, so that cutting into batches changes nothing."""

    fault: Fault
    random: np.random.Generator
    telemetry: Collection[int]
    held: FrameBatch = field(default_factory=empty_batch)
    due: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    last_due: int = 0
    row: int = 0  # how many frames in a row `reorder` has hit by now

    def apply(self, batch: FrameBatch, origin_ns: int, now_ns: int) -> FrameBatch:
        kind, t = self.fault.kind, batch["t_ns"]
        begin, end = self.fault.window(origin_ns)
        inside: Mask = (t >= begin) & (t < end)
        if kind in SHARES:
            inside &= self.random.random(len(batch)) < self.fault.value
        if kind in (*CUTS, "drop"):
            return batch[~inside]
        if kind == "duplicate":
            return np.repeat(batch, 1 + inside)
        if kind == "corrupt":
            return _destroyed(batch, inside)
        if kind == "reorder":
            return self._reordered(batch, inside)
        if kind == "mute":
            return batch[~inside | np.isin(batch["id"], list(self.telemetry))]
        return self._queued(batch, inside, begin, end, now_ns)

    def _reordered(self, batch: FrameBatch, chosen: Mask) -> FrameBatch:
        """Each chosen frame comes after the one behind it, which is not chosen: of neighbours every other one is. The
        last of a batch waits for its successor."""
        if not len(batch):
            return batch
        count = np.arange(1, len(batch) + 1)
        row = count - np.maximum.accumulate(np.where(chosen, -self.row, count))
        self.row = int(row[-1])
        work = np.concatenate([self.held, batch])
        late = np.concatenate([np.ones(len(self.held), bool), row % 2 == 1])
        order = np.argsort(np.arange(len(work)) + 1.5 * late, kind="stable")
        cut = len(order) - int(late[-1])
        self.held = work[order[cut:]]
        out = work[order[:cut]]
        out["t_ns"] = np.maximum.accumulate(out["t_ns"])
        return out

    def _queued(self, batch: FrameBatch, inside: Mask, begin: int, end: int, now_ns: int) -> FrameBatch:
        """First in, first out; frames get the time at which they come out."""
        due = batch["t_ns"].copy()
        if self.fault.kind == "delay":
            due[inside] += round(self.fault.value * 1e9)
        elif self.fault.kind == "burst":
            period = round(self.fault.value * 1e9)
            due[inside] = np.minimum(begin + ((due[inside] - begin) // period + 1) * period, end)
        else:
            due[inside] = end
        if len(due):
            due = np.maximum(np.maximum.accumulate(due), self.last_due)
            self.last_due = int(due[-1])
        kept = due < FOREVER  # what never comes out need not be kept
        held = np.concatenate([self.held, batch[kept]])
        times = np.concatenate([self.due, due[kept]])
        count = int(np.searchsorted(times, now_ns, side="right"))
        self.held, self.due = held[count:], times[count:]
        out: FrameBatch = held[:count]
        out["t_ns"] = times[:count]
        return out


def _destroyed(batch: FrameBatch, chosen: Mask) -> FrameBatch:
    out = batch.copy()
    out["flags"][chosen] |= ERROR
    out["id"][chosen], out["length"][chosen], out["data"][chosen] = 0, 0, 0
    return out


class FrameFaults:
    """Faults on the frames that come from a controller, in virtual or real time.

    Equal seeds and equal frames give equal faults, however the frames are cut into batches. Frames that are held back
    come out of a later `apply`, so call it also when nothing arrived.

    Args:
        faults: the kinds of DEVICE_ONLY are ignored. `corrupt` destroys a frame: what is left is an error frame.
        seed: of which frames are hit.
        telemetry: identifiers that `mute` lets pass.
        bytewise: `corrupt` is left to `corrupt_packets` (a serial endpoint).
    """

    def __init__(
        self, faults: Sequence[Fault], seed: int, *, telemetry: Collection[int] = (), bytewise: bool = False
    ) -> None:
        self._origin: int | None = None
        self._faults = tuple(faults)
        self._told: set[Fault] = set()  # cuts that the host has been told of
        self._damage = np.random.default_rng([seed, len(faults)])
        self._stages = [
            _Stage(f, np.random.default_rng([seed, k]), frozenset(telemetry))
            for k, f in enumerate(faults)
            if f.kind not in DEVICE_ONLY and not (bytewise and f.kind == "corrupt")
        ]

    def start(self, now_ns: int) -> None:
        """The host has sent a frame; only the first one counts."""
        if self._origin is None:
            self._origin = now_ns

    def apply(self, batch: FrameBatch, now_ns: int) -> FrameBatch:
        """What the host gets of what the controller sent; `t_ns` of a late frame is when it comes."""
        if self._origin is None:
            return batch
        for stage in self._stages:
            batch = stage.apply(batch, self._origin, now_ns)
        return batch

    def begun(self, kind: str, now_ns: int) -> list[Fault]:
        """Faults of a kind that have begun, also those that are over."""
        origin = self._origin
        return [] if origin is None else [f for f in self._faults if f.kind == kind and f.window(origin)[0] <= now_ns]

    def over(self, fault: Fault, now_ns: int) -> bool:
        """Whether a fault has come to its end."""
        return self._origin is not None and now_ns >= fault.window(self._origin)[1]

    def active(self, kind: str, now_ns: int) -> bool:
        """Whether a fault of a kind is at work."""
        return any(not self.over(f, now_ns) for f in self.begun(kind, now_ns))

    def cut(self, now_ns: int) -> Fault | None:
        """The cut that is at work."""
        return next((f for kind in CUTS for f in self.begun(kind, now_ns) if not self.over(f, now_ns)), None)

    def up_to_cut(
        self, batch: FrameBatch, now_ns: int, reconnect_s: float
    ) -> tuple[FrameBatch, FrameBatch, Fault | None]:
        """What the host gets now, what it gets later, and the cut that it must be told of instead.

        It is told as long as a cut lasts, and at least once; not of one that a link which reconnects for so long mends.
        """
        for fault in (f for kind in CUTS for f in self.begun(kind, now_ns)):
            mends = fault.kind == "disconnect" and (fault.duration_s or math.inf) <= reconnect_s
            if mends or (fault in self._told and self.over(fault, now_ns)):
                continue
            before = batch["t_ns"] < fault.window(self._origin or 0)[0]
            if before.any():
                return batch[before], batch[~before], None
            self._told.add(fault)
            return empty_batch(), batch, fault
        return batch, empty_batch(), None

    def counted(self, stats: LinkStats, now_ns: int) -> LinkStats:
        """A sound link's counts with the cuts so far, as a copy."""
        mended = [f for f in self.begun("disconnect", now_ns) if self.over(f, now_ns)]
        off = len(self.begun("bus-off", now_ns))
        return replace(stats, bus_off=stats.bus_off + off, reconnects=stats.reconnects + len(mended))

    def corrupt_packets(self, data: bytes, now_ns: int) -> bytes:
        """Packets (each with its delimiter 0x00) as a disturbed serial line brings them, while a `corrupt` is at work."""
        share = sum(f.value for f in self.begun("corrupt", now_ns) if not self.over(f, now_ns))
        return corrupt_bytes(data, share, self._damage) if share else data


def lost(link: str, fault: Fault) -> LinkError:
    """What a link says while a cut is at work."""
    return LinkError(f"link {link}: {SAID[fault.kind]} (injected: {fault})")


def corrupt_bytes(data: bytes, share: float, random: np.random.Generator) -> bytes:
    """Flip one to three bits in that share of the packets (each ends with 0x00, which may be hit too)."""
    out = bytearray(data)
    ends = np.flatnonzero(np.frombuffer(data, np.uint8) == 0) + 1
    bounds = [0, *ends.tolist()] if len(ends) and ends[-1] == len(data) else [0, *ends.tolist(), len(data)]
    for a, b in itertools.pairwise(bounds):
        if random.random() < share and b > a:
            bits = random.choice(8 * (b - a), size=min(int(random.integers(1, 4)), 8 * (b - a)), replace=False)
            for bit in bits.tolist():
                out[a + bit // 8] ^= 1 << bit % 8
    return bytes(out)
